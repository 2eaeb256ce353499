//! Groups the messages of a log by tick.

use crate::Error;
use crate::log::{Event, Events, Health, LogReader};
use lcm_idl::ast::{Field, FieldType, Primitive};
use lcmtypes::channels::{self, Class};
use lcmtypes::{ControllerInput, Message, ParameterChange};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A tick is returned once this many later ticks have their inputs: over a bus, messages of different ticks arrive interleaved.
const WINDOW: usize = 256;
/// Largest number of ticks that wait, with and without input. A live controller publishes its commands directly and all other messages through a
/// ring that a busy machine may read seconds later, so inputs can arrive this much later than commands.
const MAX_WAITING: usize = 1 << 14;

/// The messages of one tick.
#[derive(Default)]
pub(crate) struct Tick {
    pub tick: i64,
    /// Log time of the input, ns.
    pub t_log_ns: i64,
    pub input: Option<ControllerInput>,
    /// Recorded outputs, in log order.
    pub recorded: Vec<(Arc<str>, Vec<u8>)>,
    /// Parameter changes that hold from this tick on, or from an earlier tick that is not in the log, in order.
    pub changes: Vec<ParameterChange>,
    /// Time since the run's first tick, ns.
    pub since_ns: Option<i64>,
    /// All other events between the previous input and this one; only with [`Beside::InPlace`].
    pub others: Vec<Event>,
    /// TIMING and EVENT of this tick; only with [`Beside::ByTick`].
    pub beside: Vec<Event>,
}

impl Tick {
    /// The recorded state after the tick, if any.
    pub fn snapshot(&self) -> Option<&[u8]> {
        self.recorded.iter().find(|(channel, _)| **channel == *channels::CONTROLLER_SNAPSHOT).map(|(_, bytes)| &**bytes)
    }
}

/// Which events to return in addition to inputs and outputs.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Beside {
    /// None.
    Nothing,
    /// All, in log order: [`Tick::others`].
    InPlace,
    /// TIMING and EVENT by tick: [`Tick::beside`].
    ByTick,
}

/// The ticks of a log in order. Memory is bounded by the number of waiting ticks.
pub(crate) struct Ticks {
    path: PathBuf,
    events: Events,
    waiting: BTreeMap<i64, Tick>,
    /// Number of waiting ticks that have their input.
    with_input: usize,
    /// Parameter changes of ticks that are not returned yet, by their first tick.
    changes: BTreeMap<i64, Vec<ParameterChange>>,
    /// All parameter changes read so far: a live run repeats them.
    known: Vec<ParameterChange>,
    returned: Option<i64>,
    kinds: Vec<(Arc<str>, Option<u64>, Kind)>,
    run_info: Option<Vec<u8>>,
    /// Events since the last input; `None` if not requested.
    others: Option<Vec<Event>>,
    /// TIMING and EVENT of waiting ticks; `None` if not requested.
    beside: Option<BTreeMap<i64, Vec<Event>>>,
    /// Messages of ticks that were already returned: late or duplicate.
    pub late: u64,
    /// Offset of the last event read.
    pub offset: u64,
}

/// Role of a message in a replay.
#[derive(Clone, Copy)]
enum Kind {
    RunInfo,
    Input,
    /// A parameter change.
    Change,
    /// An output of the controller: it contains its tick.
    Output,
    /// Contains a tick but is not an output of the controller.
    Beside,
    Other,
}

impl Ticks {
    pub fn open(path: &Path, beside: Beside) -> Result<Self, Error> {
        let known = changes_before(path)?;
        let mut changes = BTreeMap::<_, Vec<_>>::new();
        known.iter().for_each(|change| changes.entry(change.tick).or_default().push(change.clone()));
        Ok(Ticks {
            path: path.into(),
            events: LogReader::open(path)?.events(),
            waiting: BTreeMap::new(),
            with_input: 0,
            changes,
            known,
            returned: None,
            kinds: Vec::new(),
            run_info: None,
            others: (beside == Beside::InPlace).then(Vec::new),
            beside: (beside == Beside::ByTick).then(BTreeMap::new),
            late: 0,
            offset: 0,
        })
    }

    pub fn health(&self) -> &Health {
        self.events.health()
    }

    /// Events after the last input.
    pub fn rest(&mut self) -> Vec<Event> {
        self.others.take().unwrap_or_default()
    }

    /// The next tick, or `None` at the end of the log.
    ///
    /// # Errors
    /// A second run in the log, another type version, an undecodable input, an I/O error.
    pub fn next(&mut self) -> Result<Option<Tick>, Error> {
        while self.with_input <= WINDOW && self.waiting.len() <= MAX_WAITING {
            let Some(event) = self.events.next().transpose()? else { break };
            self.offset = event.offset;
            self.take(event)?;
        }
        let mut tick = self.waiting.pop_first().map(|(_, tick)| tick);
        self.returned = tick.as_ref().map(|tick| tick.tick).or(self.returned);
        if let Some(tick) = &mut tick {
            self.with_input -= usize::from(tick.input.is_some());
            let later = self.changes.split_off(&tick.tick.saturating_add(1));
            tick.changes = std::mem::replace(&mut self.changes, later).into_values().flatten().collect();
        }
        if let (Some(waiting), Some(tick)) = (&mut self.beside, &mut tick) {
            let later = waiting.split_off(&tick.tick.saturating_add(1));
            tick.beside = waiting.remove(&tick.tick).unwrap_or_default();
            *waiting = later;
        }
        Ok(tick)
    }

    fn take(&mut self, event: Event) -> Result<(), Error> {
        match self.kind(&event)? {
            Kind::RunInfo => {
                // A live run repeats RUN_INFO; different contents are another run.
                let first = self.run_info.get_or_insert_with(|| event.data.clone());
                if *first != event.data {
                    return Err(Error::SeveralRuns { path: self.path.clone(), offset: event.offset });
                }
                self.other(event);
            }
            Kind::Input => {
                let input = ControllerInput::decode(&event.data).map_err(|source| Error::Decode {
                    path: self.path.clone(),
                    channel: event.channel.to_string(),
                    offset: event.offset,
                    source: source.into(),
                })?;
                let others = self.others.as_mut().map(std::mem::take).unwrap_or_default();
                if let Some(tick) = self.slot(input.tick) {
                    tick.t_log_ns = event.t_ns;
                    tick.others.extend(others);
                    let is_new = tick.input.is_none();
                    tick.input.get_or_insert(input);
                    self.with_input += usize::from(is_new);
                }
            }
            Kind::Change => {
                let change = change_of(&self.path, &event)?;
                if !self.known.contains(&change) {
                    if self.returned.is_some_and(|last| change.tick <= last) {
                        self.late += 1;
                    } else {
                        self.changes.entry(change.tick).or_default().push(change.clone());
                    }
                    self.known.push(change);
                }
                self.other(event);
            }
            Kind::Output => {
                let number = integer_at(&event.data, 16);
                if let Some(tick) = number.and_then(|number| self.slot(number)) {
                    tick.recorded.push((event.channel, event.data));
                }
            }
            Kind::Beside => {
                if let (Some(waiting), Some(number)) = (&mut self.beside, integer_at(&event.data, 16)) {
                    // Do not store a message whose tick is far ahead of the log.
                    if self.waiting.last_key_value().is_none_or(|(last, _)| number <= last + WINDOW as i64) {
                        waiting.entry(number).or_default().push(event);
                    }
                } else {
                    self.other(event);
                }
            }
            Kind::Other => self.other(event),
        }
        Ok(())
    }

    fn other(&mut self, event: Event) {
        if let Some(others) = &mut self.others {
            others.push(event);
        }
    }

    fn slot(&mut self, number: i64) -> Option<&mut Tick> {
        if self.returned.is_some_and(|last| number <= last) {
            self.late += 1;
            return None;
        }
        Some(self.waiting.entry(number).or_insert_with(|| Tick { tick: number, ..Tick::default() }))
    }

    fn kind(&mut self, event: &Event) -> Result<Kind, Error> {
        let fingerprint = event.fingerprint();
        let same = |(c, f, _): &&(Arc<str>, _, _)| Arc::ptr_eq(c, &event.channel) && *f == fingerprint;
        if let Some((.., kind)) = self.kinds.iter().find(same) {
            return Ok(*kind);
        }
        let kind = match channels::find(&event.channel) {
            // The type depends on the controller, which checks it.
            Some(known) if known.name == channels::CONTROLLER_SNAPSHOT => Kind::Output,
            Some(known) => {
                let kind = match (known.name, known.class, known.stage) {
                    (channels::RUN_INFO, ..) => Kind::RunInfo,
                    (channels::PARAMETER_CHANGE, ..) => Kind::Change,
                    (_, Class::ReplayInput, _) => Kind::Input,
                    (_, Class::Output | Class::Debug, Some(_)) => Kind::Output,
                    (channels::TIMING | channels::EVENT, ..) if fingerprint == Some(known.fingerprint) => Kind::Beside,
                    _ => Kind::Other,
                };
                if !matches!(kind, Kind::Other | Kind::Beside) {
                    same_version(&self.path, event, known)?;
                }
                kind
            }
            None if fingerprint.is_some_and(has_tick) => Kind::Output,
            None => Kind::Other,
        };
        self.kinds.push((Arc::clone(&event.channel), fingerprint, kind));
        Ok(kind)
    }
}

/// Parameter changes before the first tick of a log that starts in the middle of a run. The run repeats them, so the whole log is searched.
fn changes_before(path: &Path) -> Result<Vec<ParameterChange>, Error> {
    let (mut first, mut found) = (None, Vec::<ParameterChange>::new());
    for event in LogReader::open(path)?.events() {
        let event = event?;
        match (&*event.channel, first) {
            (channels::CONTROLLER_INPUT, None) => first = integer_at(&event.data, 16),
            (channels::PARAMETER_CHANGE, _) => {
                let change = change_of(path, &event)?;
                if !found.contains(&change) {
                    found.push(change);
                }
            }
            _ => {}
        }
        if first == Some(0) {
            return Ok(Vec::new());
        }
    }
    found.retain(|change| first.is_some_and(|first| change.tick < first));
    Ok(found)
}

fn change_of(path: &Path, event: &Event) -> Result<ParameterChange, Error> {
    ParameterChange::decode(&event.data).map_err(|source| Error::Decode {
        path: path.into(),
        channel: event.channel.to_string(),
        offset: event.offset,
        source: source.into(),
    })
}

/// Checks that a message has the type of its channel in this build.
pub(crate) fn same_version(path: &Path, event: &Event, known: &channels::Channel) -> Result<(), Error> {
    if event.fingerprint() == Some(known.fingerprint) {
        return Ok(());
    }
    Err(Error::OtherTypeVersion {
        path: path.into(),
        channel: known.name.into(),
        type_name: known.type_name.into(),
        found: event.fingerprint().unwrap_or(0),
        expected: known.fingerprint,
    })
}

/// Whether a type starts with `int64_t t_ns; int64_t tick;`.
fn has_tick(fingerprint: u64) -> bool {
    let Some(ty) = lcmtypes::types().by_fingerprint(fingerprint) else { return false };
    let is = |field: &Field, name: &str| {
        *field.name == *name && field.dims.is_empty() && matches!(field.ty, FieldType::Primitive(Primitive::Int64))
    };
    matches!(&ty.def().fields[..], [time, tick, ..] if is(time, "t_ns") && is(tick, "tick"))
}

/// The big-endian `int64_t` at an offset of a message: `t_ns` is at 8, `tick` or `seq` at 16.
pub(crate) fn integer_at(message: &[u8], offset: usize) -> Option<i64> {
    message.get(offset..)?.first_chunk().map(|bytes| i64::from_be_bytes(*bytes))
}
