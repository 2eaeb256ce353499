//! Groups the messages of a log by tick.

use super::account::{Account, Unused};
use super::parameter_changes::Changes;
use super::run_messages::{Role, RunMessages};
use super::state_types::state_types;
use crate::Error;
use crate::log::{Event, Events, Health, LogReader};
use lcmtypes::channels::{self, Class};
use lcmtypes::{ControllerInput, ControllerTick, Message, ParameterChange, RunInfo};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A tick is returned once this many later ticks have their inputs: over a bus, messages of different ticks arrive interleaved.
const WINDOW: usize = 256;
/// Largest number of ticks that wait, with and without input. A live controller publishes its commands directly and all other messages through a
/// ring that a busy machine may read seconds later, so inputs can arrive this much later than commands.
const MAX_WAITING: usize = 1 << 14;
/// Largest step between the ticks of a run, hours at any tick rate; a message with a larger step is not used.
const MAX_STEP: i64 = 1 << 24;
/// Messages of one tick that are stored beside its outputs, and outputs with a channel that the tick has already; a hostile log may have any number.
const MAX_OF_TICK: usize = 1000;
/// Channels and types whose role is remembered; a hostile log may have any number.
const MAX_KINDS: usize = 1000;

/// The messages of one tick.
#[derive(Default)]
pub(crate) struct Tick {
    pub tick: i64,
    /// Offset of its first message in the file.
    pub offset: u64,
    /// Log time of the input, ns.
    pub t_log_ns: i64,
    pub input: Option<ControllerInput>,
    /// Recorded outputs, in log order.
    pub recorded: Vec<(Arc<str>, Vec<u8>)>,
    /// Messages on channels outside the table: outputs only if the controller has outputs on these channels.
    pub candidates: Vec<(Arc<str>, Vec<u8>)>,
    /// Parameter changes that hold from this tick on, or from an earlier tick that is not in the log, in order.
    pub changes: Vec<ParameterChange>,
    /// Time since the run's first tick, ns.
    pub since_ns: Option<i64>,
    /// Recorded digest of the parameters of the next tick, if no change holds from that tick on.
    pub next_parameters: Option<i64>,
    /// All other events between the previous input and this one; only with [`Beside::InPlace`].
    pub others: Vec<Event>,
    /// TIMING and EVENT of this tick; only with [`Beside::ByTick`].
    pub beside: Vec<Event>,
}

impl Tick {
    /// The recorded state after the tick, if any.
    pub fn snapshot(&self) -> Option<&[u8]> {
        self.recorded(channels::CONTROLLER_SNAPSHOT)
    }

    /// Whether the recorded parameters of the tick have this digest; true if the log does not say, or if those of the next tick have it and nothing
    /// changed between: then CONTROLLER_TICK was altered, and the comparison finds it.
    pub fn has_parameters(&self, digest: i64) -> bool {
        let says = |recorded: i64| [0, digest].contains(&recorded);
        self.parameters().is_none_or(says) || self.next_parameters == Some(digest)
    }

    /// Recorded digest of the parameters.
    fn parameters(&self) -> Option<i64> {
        let message = ControllerTick::decode(self.recorded(channels::CONTROLLER_TICK)?);
        message.ok().map(|tick| tick.digest_parameters)
    }

    fn recorded(&self, wanted: &str) -> Option<&[u8]> {
        self.recorded.iter().find(|(channel, _)| **channel == *wanted).map(|(_, bytes)| &**bytes)
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

/// What is known of the messages of a channel and type.
struct Kind {
    channel: Arc<str>,
    fingerprint: Option<u64>,
    /// They may contain a state of another type, each of them.
    is_snapshot: bool,
    of_all: Use,
}

/// What a message is used for.
#[derive(Clone)]
struct Use {
    /// The channel as the component names it: [`RunMessages::plain`].
    plain: Arc<str>,
    is_hidden: bool,
    role: Role,
}

/// The ticks of a log in order. Memory is bounded by the number of waiting ticks.
pub(crate) struct Ticks {
    path: PathBuf,
    messages: RunMessages,
    events: Events,
    waiting: BTreeMap<i64, Tick>,
    /// Waiting ticks with an input by its time; only for a component that is not the first one.
    times: BTreeMap<i64, i64>,
    /// Messages of [`Role::AtTime`] whose input was not read yet: time, plain channel, event.
    early: Vec<(i64, Arc<str>, Event)>,
    /// Number of waiting ticks that have their input.
    with_input: usize,
    /// Parameter changes of ticks that are not returned yet, by their first tick.
    changes: BTreeMap<i64, Vec<ParameterChange>>,
    returned: Option<i64>,
    /// Largest tick of an input so far.
    newest: Option<i64>,
    kinds: Vec<Kind>,
    /// Channels of the table with a message of this build's type.
    read: BTreeSet<Arc<str>>,
    /// Events since the last input; `None` if not requested.
    others: Option<Vec<Event>>,
    /// TIMING and EVENT of waiting ticks; `None` if not requested.
    beside: Option<BTreeMap<i64, Vec<Event>>>,
    account: Account,
    /// Offset of the last event read.
    pub offset: u64,
}

impl Ticks {
    pub fn open(path: &Path, messages: &RunMessages, beside: Beside) -> Result<Self, Error> {
        Self::open_at(path, messages, beside, None)
    }

    /// [`Ticks::open`] at a place of the log: [`super::seek`].
    pub fn open_at(path: &Path, messages: &RunMessages, beside: Beside, place: Option<u64>) -> Result<Self, Error> {
        let mut reader = LogReader::open(path)?;
        place.map_or(Ok(()), |place| reader.seek(place))?;
        let Changes { valid: changes, rejected, first_rejected } = Changes::read(path, messages)?;
        let account =
            Account { rejected_changes: rejected, first_rejected_change: first_rejected, ..Account::default() };
        Ok(Ticks {
            path: path.into(),
            messages: messages.clone(),
            events: reader.events(),
            waiting: BTreeMap::new(),
            times: BTreeMap::new(),
            early: Vec::new(),
            with_input: 0,
            changes,
            returned: None,
            newest: None,
            kinds: Vec::new(),
            read: BTreeSet::new(),
            others: (beside == Beside::InPlace).then(Vec::new),
            beside: (beside == Beside::ByTick).then(BTreeMap::new),
            account,
            offset: 0,
        })
    }

    pub fn health(&self) -> &Health {
        self.events.health()
    }

    /// As [`LogReader::is_joined`].
    pub fn is_joined(&self) -> bool {
        self.events.is_joined()
    }

    /// Events after the last input.
    pub fn rest(&mut self) -> Vec<Event> {
        let early = self.early.drain(..).map(|(.., event)| event);
        self.others.take().map(|others| others.into_iter().chain(early).collect()).unwrap_or_default()
    }

    /// The account of the part that was read.
    ///
    /// # Errors
    /// [`Error::OtherTypeVersion`] if all messages of a channel that a replay needs have another type. Debug channels are not needed.
    pub fn account(&self) -> Result<Account, Error> {
        let mut account = self.account.clone();
        for other in &mut account.other_types {
            other.is_every_message = !self.read.contains(&*other.channel);
            // A parameter change of another type shows in the digest of the parameters.
            let is_needed = |known: &&channels::Channel| match known.class {
                Class::ReplayInput => known.name == channels::CONTROLLER_INPUT,
                class => class == Class::Output,
            };
            let needed = channels::find(&other.channel).filter(is_needed);
            if let Some(known) = needed.filter(|_| other.is_every_message) {
                return Err(Error::OtherTypeVersion {
                    path: self.path.clone(),
                    channel: known.name.into(),
                    type_name: other.type_name.clone(),
                    found: other.found,
                    expected: other.expected,
                });
            }
        }
        Ok(account)
    }

    /// The next tick, or `None` at the end of the log.
    ///
    /// # Errors
    /// A second run in the log, an I/O error.
    pub fn next(&mut self) -> Result<Option<Tick>, Error> {
        loop {
            let mut is_end = false;
            while self.with_input <= WINDOW && self.waiting.len() <= MAX_WAITING {
                let Some(event) = self.events.next().transpose()? else {
                    is_end = true;
                    break;
                };
                self.offset = event.offset;
                self.take(event)?;
            }
            let Some((number, mut tick)) = self.waiting.pop_first() else { return Ok(None) };
            // After the last input no tick can be computed: these outputs have no input.
            if is_end && self.with_input == 0 {
                tick.recorded.iter().for_each(|(channel, _)| {
                    let channel = self.messages.in_log(channel);
                    self.account.unused(&channel, Some(number), tick.offset, Unused::NoInput);
                });
                continue;
            }
            self.returned = Some(number);
            self.with_input -= usize::from(tick.input.is_some());
            if let Some(input) = &tick.input {
                self.times.remove(&input.t_ns);
            }
            let later = self.changes.split_off(&number.saturating_add(1));
            tick.changes = std::mem::replace(&mut self.changes, later).into_values().flatten().collect();
            let next = self.waiting.first_key_value().filter(|(next, _)| number.checked_add(1) == Some(**next));
            let is_unchanged =
                self.changes.first_key_value().is_none_or(|(from, _)| number.checked_add(1) != Some(*from));
            tick.next_parameters = next.filter(|_| is_unchanged).and_then(|(_, next)| next.parameters());
            if let Some(waiting) = &mut self.beside {
                let later = waiting.split_off(&number.saturating_add(1));
                tick.beside = waiting.remove(&number).unwrap_or_default();
                *waiting = later;
            }
            return Ok(Some(tick));
        }
    }

    fn take(&mut self, mut event: Event) -> Result<(), Error> {
        let Use { plain, is_hidden, role } = self.use_of(&event);
        let is_foreign = !is_hidden && self.messages.is_foreign(&event);
        match role {
            // A live run repeats RUN_INFO.
            Role::RunInfo => {
                if RunInfo::decode(&event.data).is_err() {
                    self.account.unused(&event.channel, None, event.offset, Unused::Undecodable);
                } else if is_foreign {
                    return Err(Error::SeveralRuns { path: self.path.clone(), offset: event.offset });
                }
                self.other(event);
            }
            _ if is_foreign => {
                self.account.foreign_messages += 1;
                self.other(event);
            }
            Role::Input => match ControllerInput::decode(&event.data) {
                Ok(input) => {
                    // The fingerprint of CONTROLLER_INPUT does not cover the types of the messages in it.
                    for message in &input.messages {
                        let known = channels::find(&message.channel);
                        let found = crate::log::fingerprint(&message.data);
                        if let Some(known) = known.filter(|known| found != Some(known.fingerprint)) {
                            self.account.other_type(&message.channel, known, found, known.fingerprint);
                        }
                    }
                    self.input(input, &event);
                }
                Err(_) => {
                    let tick = integer_at(&event.data, 16);
                    self.account.unused(&event.channel, tick, event.offset, Unused::Undecodable);
                    self.other(event);
                }
            },
            Role::Change => {
                // The changes were read when the log was opened.
                if ParameterChange::decode(&event.data).is_err() {
                    let tick = integer_at(&event.data, 16);
                    self.account.unused(&event.channel, tick, event.offset, Unused::Undecodable);
                }
                self.other(event);
            }
            Role::Output => self.output(event, plain),
            Role::Candidate => {
                let number = integer_at(&event.data, 16);
                // The outputs of a tick come after its input, apart from the command.
                match number.and_then(|number| self.waiting.get_mut(&number)) {
                    Some(tick) if tick.candidates.len() < MAX_OF_TICK => {
                        tick.candidates.push((plain, event.data));
                    }
                    _ => self.other(event),
                }
            }
            Role::AtTime => {
                let t_ns = integer_at(&event.data, 8);
                let number = t_ns.and_then(|t_ns| self.times.get(&t_ns));
                match (number.and_then(|number| self.waiting.get_mut(number)), t_ns) {
                    (Some(tick), _) if tick.candidates.len() < MAX_OF_TICK => {
                        tick.candidates.push((plain, event.data));
                    }
                    // Its input may come later; a component has few such messages.
                    (None, Some(t_ns)) => {
                        if self.early.len() == MAX_OF_TICK {
                            let (.., oldest) = self.early.remove(0);
                            self.other(oldest);
                        }
                        self.early.push((t_ns, plain, event));
                    }
                    _ => self.other(event),
                }
            }
            Role::Beside => {
                if let (Some(waiting), Some(number)) = (&mut self.beside, integer_at(&event.data, 16)) {
                    // Do not store a message whose tick is far ahead of the log.
                    let is_far = |last: i64| number > last.saturating_add(WINDOW as i64);
                    if self.waiting.last_key_value().is_none_or(|(last, _)| !is_far(*last)) {
                        let of_tick = waiting.entry(number).or_default();
                        if of_tick.len() < MAX_OF_TICK {
                            event.channel = plain;
                            of_tick.push(event);
                        }
                    }
                } else {
                    self.other(event);
                }
            }
            Role::OtherType { known, found, expected } => {
                self.account.other_type(&plain, known, found, expected);
                self.other(event);
            }
            Role::Other => self.other(event),
        }
        Ok(())
    }

    fn input(&mut self, input: ControllerInput, event: &Event) {
        let number = input.tick;
        let unused = match self.slot(number, event.offset) {
            Ok(Tick { input: Some(first), .. }) if *first == input => Unused::Doubled,
            Ok(Tick { input: Some(_), .. }) => Unused::DoubledOtherBytes,
            Ok(tick) => {
                let t_ns = input.t_ns;
                (tick.t_log_ns, tick.input) = (event.t_ns, Some(input));
                self.at_time(number, t_ns);
                self.with_input += 1;
                self.newest = self.newest.max(Some(number));
                if let (Some(others), Some(tick)) = (&mut self.others, self.waiting.get_mut(&number)) {
                    tick.others.append(others);
                }
                return;
            }
            Err(why) => why,
        };
        self.account.unused(&event.channel, Some(number), event.offset, unused);
    }

    /// - `plain`: name of its channel.
    fn output(&mut self, event: Event, plain: Arc<str>) {
        let is_snapshot = event.channel.ends_with(channels::CONTROLLER_SNAPSHOT);
        let Some(number) = integer_at(&event.data, 16).filter(|_| !is_snapshot || state_types(&event.data).is_some())
        else {
            let tick = integer_at(&event.data, 16);
            return self.account.unused(&event.channel, tick, event.offset, Unused::Undecodable);
        };
        let unused = match self.slot(number, event.offset) {
            Ok(tick) => match tick.recorded.iter_mut().find(|(channel, _)| *channel == plain) {
                None => {
                    tick.recorded.push((plain, event.data));
                    return;
                }
                Some((_, first)) if *first == event.data => Unused::Doubled,
                // Of another program, or damaged.
                Some(_) if !decodes(&event.data) => Unused::Undecodable,
                Some((_, first)) if !decodes(first) => {
                    *first = event.data;
                    Unused::Undecodable
                }
                Some(_) => {
                    // Both are compared, so one of them differs.
                    if tick.recorded.len() < MAX_OF_TICK {
                        tick.recorded.push((plain, event.data));
                    }
                    Unused::DoubledOtherBytes
                }
            },
            Err(why) => why,
        };
        self.account.unused(&event.channel, Some(number), event.offset, unused);
    }

    fn other(&mut self, event: Event) {
        if let Some(others) = &mut self.others {
            others.push(event);
        }
    }

    /// The waiting tick of a message at an offset in the file.
    fn slot(&mut self, number: i64, offset: u64) -> Result<&mut Tick, Unused> {
        if number < 0 || self.newest.is_some_and(|newest| number > newest.saturating_add(MAX_STEP)) {
            return Err(Unused::NoInput);
        }
        if self.returned.is_some_and(|last| number <= last) {
            return Err(Unused::Late);
        }
        Ok(self.waiting.entry(number).or_insert_with(|| Tick { tick: number, offset, ..Tick::default() }))
    }

    /// Notes the time of a tick, and gives it the messages of this time.
    fn at_time(&mut self, number: i64, t_ns: i64) {
        if self.messages.is_of_first() {
            return;
        }
        self.times.insert(t_ns, number);
        let Some(tick) = self.waiting.get_mut(&number) else { return };
        for (_, channel, event) in self.early.extract_if(.., |(time, ..)| *time == t_ns) {
            tick.candidates.push((channel, event.data));
        }
    }

    fn use_of(&mut self, event: &Event) -> Use {
        let fingerprint = event.fingerprint();
        let same = |kind: &Kind| Arc::ptr_eq(&kind.channel, &event.channel) && kind.fingerprint == fingerprint;
        if let Some(at) = self.kinds.iter().position(same) {
            let Kind { is_snapshot, of_all, .. } = &self.kinds[at];
            let (is_snapshot, known) = (*is_snapshot, of_all.clone());
            return if is_snapshot { self.use_of_snapshot(event, known) } else { known };
        }
        let plain = self.messages.plain(&event.channel);
        let role = plain.map_or(Role::Other, |plain| self.messages.role(plain, fingerprint));
        let of_all = Use {
            plain: plain
                .filter(|plain| **plain != *event.channel)
                .map_or_else(|| Arc::clone(&event.channel), Arc::from),
            is_hidden: plain.is_none(),
            role,
        };
        let is_snapshot = plain == Some(channels::CONTROLLER_SNAPSHOT) && matches!(role, Role::Output);
        if self.kinds.len() < MAX_KINDS {
            let channel = Arc::clone(&event.channel);
            self.kinds.push(Kind { channel, fingerprint, is_snapshot, of_all: of_all.clone() });
        }
        if is_snapshot {
            return self.use_of_snapshot(event, of_all);
        }
        if matches!(role, Role::RunInfo | Role::Input | Role::Change | Role::Output | Role::Beside) {
            self.read.insert(Arc::clone(&of_all.plain));
        }
        of_all
    }

    /// A snapshot that contains a state of another type than the controller's is of no use.
    fn use_of_snapshot(&mut self, event: &Event, of_all: Use) -> Use {
        if let Some(role) = self.messages.other_state(&of_all.plain, &event.data) {
            return Use { role, ..of_all };
        }
        self.read.insert(Arc::clone(&of_all.plain));
        of_all
    }
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

/// Whether a message decodes as its type.
fn decodes(message: &[u8]) -> bool {
    lcmtypes::types().of_message(message).is_some_and(|ty| ty.walk(message, |_, _| ()).is_ok())
}

/// The big-endian `int64_t` at an offset of a message: `t_ns` is at 8, `tick` or `seq` at 16.
pub(crate) fn integer_at(message: &[u8], offset: usize) -> Option<i64> {
    message.get(offset..)?.first_chunk().map(|bytes| i64::from_be_bytes(*bytes))
}
