//! The messages of a log, put together tick by tick.

use crate::Error;
use crate::log::{Event, Events, Health, LogReader};
use lcm_idl::ast::{Field, FieldType, Primitive};
use lcmtypes::channels::{self, Class};
use lcmtypes::{ControllerInput, Message, ParameterChange};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How many later ticks may have their inputs before a tick is handed out: over a bus, messages of one tick do not all arrive before those of the next.
const WINDOW: usize = 256;
/// Ticks that wait at most, with and without input. A live controller sends its commands by itself, and all else through a ring, from which a busy
/// machine may take it seconds later: inputs are worth waiting for as long as such a ring lasts.
const MOST: usize = 1 << 14;

/// All that a log holds of one tick.
#[derive(Default)]
pub(crate) struct Tick {
    pub tick: i64,
    /// Time that the log gives the input, ns.
    pub t_log_ns: i64,
    pub input: Option<ControllerInput>,
    /// What the controller put out then, in the order of the log.
    pub recorded: Vec<(Arc<str>, Vec<u8>)>,
    /// Changes of parameters that hold from this tick on, or from one before it that is not in the log, in order.
    pub changes: Vec<ParameterChange>,
    /// Time since the run's first tick, ns.
    pub since_ns: Option<i64>,
    /// Everything else that stands in the log between the last input and this one, if it was asked for.
    pub others: Vec<Event>,
    /// What others said of this tick (TIMING, EVENT), if it was asked for.
    pub beside: Vec<Event>,
}

impl Tick {
    /// The state after the tick, if it was recorded.
    pub fn snapshot(&self) -> Option<&[u8]> {
        self.recorded.iter().find(|(channel, _)| **channel == *channels::CONTROLLER_SNAPSHOT).map(|(_, bytes)| &**bytes)
    }
}

/// What is kept besides the inputs and outputs of a controller.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Beside {
    /// Nothing.
    Nothing,
    /// Everything, where it stands in the log: [`Tick::others`].
    InPlace,
    /// Timing and events, by tick: [`Tick::beside`].
    ByTick,
}

/// The ticks of a log in the order of their numbers. Memory is bounded by a number of ticks.
pub(crate) struct Ticks {
    path: PathBuf,
    events: Events,
    waiting: BTreeMap<i64, Tick>,
    /// Ticks among those waiting that have their input.
    with_input: usize,
    /// Changes of parameters whose ticks have not been handed out, by the first tick that they hold in.
    changes: BTreeMap<i64, Vec<ParameterChange>>,
    /// All of them so far: a live run says them again for those who come late.
    known: Vec<ParameterChange>,
    handed_out: Option<i64>,
    kinds: Vec<(Arc<str>, Option<u64>, Kind)>,
    run_info: Option<Vec<u8>>,
    /// Events that wait for the next input; `None` if nobody wants them.
    others: Option<Vec<Event>>,
    /// Timing and events that wait for their ticks; `None` if nobody wants them.
    beside: Option<BTreeMap<i64, Vec<Event>>>,
    /// Messages of ticks that were already handed out: too late, or a second time.
    pub late: u64,
    /// Offset of the last event read.
    pub offset: u64,
}

/// What a message is to a replay.
#[derive(Clone, Copy)]
enum Kind {
    RunInfo,
    Input,
    /// Says which parameter is otherwise from a tick on.
    Change,
    /// Says its tick, so the controller may have put it out.
    Output,
    /// Says of which tick it speaks, but does not come from the controller.
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
            handed_out: None,
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

    /// Channels and fingerprints of the messages read so far that a replay decodes or compares.
    pub fn consumed(&self) -> Vec<(Arc<str>, Option<u64>)> {
        let consumed = self.kinds.iter().filter(|(.., kind)| !matches!(kind, Kind::Beside | Kind::Other));
        consumed.map(|(channel, fingerprint, _)| (Arc::clone(channel), *fingerprint)).collect()
    }

    /// What stands in the log behind the last input.
    pub fn rest(&mut self) -> Vec<Event> {
        self.others.take().unwrap_or_default()
    }

    /// The next tick, or `None` at the end of the log.
    ///
    /// # Errors
    /// A second run in the log, a type of another version, an input that cannot be decoded, a file that cannot be read.
    pub fn next(&mut self) -> Result<Option<Tick>, Error> {
        while self.with_input <= WINDOW && self.waiting.len() <= MOST {
            let Some(event) = self.events.next().transpose()? else { break };
            self.offset = event.offset;
            self.take(event)?;
        }
        let mut tick = self.waiting.pop_first().map(|(_, tick)| tick);
        self.handed_out = tick.as_ref().map(|tick| tick.tick).or(self.handed_out);
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
                // It may be repeated for those who come late; another one is another run.
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
                    if self.handed_out.is_some_and(|last| change.tick <= last) {
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
                    // A number that no tick of this part of the log has is not waited for.
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
        if self.handed_out.is_some_and(|last| number <= last) {
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
            // Its type is that of the controller at hand, which checks it.
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
            None if fingerprint.is_some_and(says_its_tick) => Kind::Output,
            None => Kind::Other,
        };
        self.kinds.push((Arc::clone(&event.channel), fingerprint, kind));
        Ok(kind)
    }
}

/// Changes of parameters before the first tick of a log, which stand in it where they were said again: a log that was begun in the middle of a
/// run is read for them.
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

/// Whether the type of a message is still the one of its channel.
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

/// Whether a type begins with `int64_t t_ns; int64_t tick;`.
fn says_its_tick(fingerprint: u64) -> bool {
    let Some(ty) = lcmtypes::types().by_fingerprint(fingerprint) else { return false };
    let is = |field: &Field, name: &str| {
        *field.name == *name && field.dims.is_empty() && matches!(field.ty, FieldType::Primitive(Primitive::Int64))
    };
    matches!(&ty.def().fields[..], [time, tick, ..] if is(time, "t_ns") && is(tick, "tick"))
}

/// The big-endian `int64_t` at an offset of a message: `t_ns` stands at 8, `tick` or `seq` at 16.
pub(crate) fn integer_at(message: &[u8], offset: usize) -> Option<i64> {
    message.get(offset..)?.first_chunk().map(|bytes| i64::from_be_bytes(*bytes))
}
