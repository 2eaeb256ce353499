//! Command multiplexer: selects one of several operators of a robot.
//!
//! Each [`Source`] is a channel of `operator_command_t` with a priority and a time-out, as in ROS `twist_mux`: the source with the highest priority
//! that has not timed out is active. Several processes may send on one channel; their `sender_id` distinguishes them, and the one that is active stays
//! active until it times out. These rules differ from `twist_mux`:
//!
//! - An emergency stop (`MODE_DAMPING`) of any sender overrides all priorities. It stays in force, without being repeated, until the same sender
//!   sends another mode: only the sender that triggered the stop can clear it. If that sender has timed out, its process may have ended: then another
//!   sender of the same channel can clear the stop by a new request for IDLE.
//! - A mode request takes effect only if it is new: made after the start of the run, and after the operator before was last in control. So neither
//!   an operator that sent before the start nor one that was overridden moves the robot without a new request.
//! - When all senders have timed out, the last command is kept with its arrival time. The controller checks its age and stops walking.
//!
//! Pure: the caller gives the time. Memory is bounded: [`MAX_SENDERS`] per source.

mod sender;
#[cfg(test)]
mod tests;

use crate::teleop;
use lcmtypes::{OperatorCommand, channels, enum_names};
use sender::Sender;
use serde::Deserialize;
use std::collections::VecDeque;

/// An `[[operator]]` entry of a run file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Channel of its commands.
    pub channel: String,
    /// The source with the larger priority is active; with equal priorities, the one listed first.
    pub priority: i32,
    /// Time after its last command at which the source times out, s.
    #[serde(default = "default_timeout")]
    pub timeout_s: f64,
}

impl Source {
    #[expect(clippy::cast_possible_truncation, reason = "a time-out is at most a minute")]
    fn timeout_ns(&self) -> i64 {
        (self.timeout_s * 1e9).round() as i64
    }
}

/// Twelve periods of the 20 ms heartbeat.
fn default_timeout() -> f64 {
    0.25
}

/// Sources of a run file without `[[operator]]`: teleoperation has priority over scenarios and planners.
pub fn default_sources() -> Vec<Source> {
    let source = |channel: &str, priority| {
        let (channel, timeout_s) = (channel.to_owned(), default_timeout());
        Source { channel, priority, timeout_s }
    };
    vec![source(teleop::CHANNEL, 100), source(channels::OPERATOR_COMMAND, 10)]
}

/// Senders that are remembered for each source.
pub const MAX_SENDERS: usize = 8;
/// Changes that wait to be reported.
const MAX_TRANSITIONS: usize = 64;

/// Period at which an emergency stop in force is repeated to the controller, ns: that of an operator's heartbeat.
pub const RENEW_NS: i64 = teleop::HEARTBEAT_NS;

/// Invalid list of sources.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum SourcesError {
    #[error("no [[operator]]: the robot could not be stopped; add at least one")]
    None,
    #[error("[[operator]] {channel:?}: invalid channel name, expected 1 to 63 letters, digits, _ and -")]
    Channel { channel: String },
    #[error("[[operator]] {channel}: listed twice")]
    Twice { channel: String },
    #[error("[[operator]] {channel}: timeout_s is {found}, expected 0.02 to 60")]
    Timeout { channel: String, found: f64 },
}

/// The selected command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection<'a> {
    /// Index of the source in the list.
    pub source: usize,
    /// Its command.
    pub command: &'a OperatorCommand,
    /// Time of arrival, ns; for an emergency stop in force, the present time.
    pub arrival_ns: i64,
}

/// Why a command is not followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ignored {
    /// Another sender is active; its source.
    OtherActive(usize),
    /// The mode was requested before the start of the run.
    BeforeRun,
    /// The mode was requested while another operator, this source, was in control.
    Overridden(usize),
}

/// A change of the selection, to be reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transition {
    /// This source became the active one.
    Activated(usize),
    /// The active source timed out, and no other source is active.
    TimedOut(usize),
    /// This source triggered the emergency stop.
    StopTriggered(usize),
    /// This source cleared its emergency stop.
    StopCleared(usize),
    /// A mode request of a sender of this source is ignored; `operator_command_t` MODE_*.
    Ignored(usize, i8, Ignored),
}

impl Transition {
    /// Whether a person should check the robot.
    pub fn is_warning(self) -> bool {
        match self {
            Transition::TimedOut(_) | Transition::StopTriggered(_) => true,
            // An operator of lower priority that sends beside the active one is common.
            Transition::Ignored(source, _, why) => !matches!(why, Ignored::OtherActive(active) if active != source),
            Transition::Activated(_) | Transition::StopCleared(_) => false,
        }
    }
}

/// Selects among sources.
#[derive(Clone, Debug)]
pub struct CommandMux {
    sources: Vec<Source>,
    /// At most [`MAX_SENDERS`] per source, in the order of their first command.
    senders: Vec<Sender>,
    /// Start of the run, ns.
    start_ns: i64,
    active: Option<Active>,
    /// Source, sender, seq, sending time and arrival of the last [`CommandMux::new_selection`].
    newest: Option<(usize, i64, i64, i64, i64)>,
    transitions: VecDeque<Transition>,
    /// Time of the last [`Transition::Ignored`] of each source, ns.
    ignored_ns: Vec<Option<i64>>,
    /// State that a transition has reported.
    reported: Option<Active>,
}

/// The sender whose command is selected.
#[derive(Clone, Copy, Debug)]
struct Active {
    source: usize,
    id: i64,
    timed_out: bool,
    /// Time since which it is in control, ns: since it became active, or since the last emergency stop began or ended.
    since_ns: i64,
}

impl CommandMux {
    /// A multiplexer for sources that have not sent anything yet.
    ///
    /// # Errors
    /// If there is no source, a channel name is invalid or listed twice, or a time-out is out of range.
    pub fn new(sources: Vec<Source>) -> Result<Self, SourcesError> {
        if sources.is_empty() {
            return Err(SourcesError::None);
        }
        for (k, Source { channel, timeout_s, .. }) in sources.iter().enumerate() {
            let channel = channel.clone();
            if !teleop::is_channel_name(&channel) {
                return Err(SourcesError::Channel { channel });
            }
            if sources[..k].iter().any(|other| other.channel == channel) {
                return Err(SourcesError::Twice { channel });
            }
            if !(0.02..=60.0).contains(timeout_s) {
                return Err(SourcesError::Timeout { channel, found: *timeout_s });
            }
        }
        let (active, newest, reported) = (None, None, None);
        let (senders, transitions) = (Vec::new(), VecDeque::new());
        let ignored_ns = vec![None; sources.len()];
        Ok(CommandMux { sources, senders, start_ns: i64::MIN, active, newest, transitions, ignored_ns, reported })
    }

    /// Sets the start of the run, ns: mode requests that were made before are ignored.
    pub fn start(&mut self, t_ns: i64) {
        self.start_ns = t_ns;
    }

    /// The sources, as listed.
    pub fn sources(&self) -> &[Source] {
        &self.sources
    }

    /// Index of the source with a channel.
    pub fn source_of(&self, channel: &str) -> Option<usize> {
        self.sources.iter().position(|source| source.channel == channel)
    }

    /// Takes a command of a source that arrived at `t_ns`.
    ///
    /// A command that is older than the sender's last one, by seq and by its own clock, is ignored: it could clear an emergency stop that was sent
    /// after it. An emergency stop is never ignored. A sender that has timed out may have been restarted, with other numbers and another clock: its
    /// command is always taken.
    pub fn receive(&mut self, source: usize, t_ns: i64, command: &OperatorCommand) {
        let Some(timeout_ns) = self.sources.get(source).map(Source::timeout_ns) else { return };
        let known = self.senders.iter().position(|sender| (sender.source, sender.id()) == (source, command.sender_id));
        let Some(place) = known.or_else(|| self.make_room(source, t_ns, command)) else { return };
        if known.is_some() {
            if !self.senders[place].take(t_ns, timeout_ns, command) {
                return;
            }
        } else {
            let is_starting = t_ns.saturating_sub(self.start_ns) < timeout_ns;
            self.senders.push(Sender::new(source, t_ns, is_starting, command));
        }
        self.update_stops(place, t_ns);
    }

    /// Place of a new sender. An emergency stop always has one; other commands only if fewer than [`MAX_SENDERS`] of its source are in use.
    fn make_room(&mut self, source: usize, t_ns: i64, command: &OperatorCommand) -> Option<usize> {
        let of_source = |sender: &Sender| sender.source == source;
        if self.senders.iter().filter(|sender| of_source(sender)).count() >= MAX_SENDERS {
            let is_active = |sender: &Sender| self.active.is_some_and(|active| active.is(sender));
            let timed_out = |sender: &Sender| !sender.is_alive(t_ns, self.sources[source].timeout_ns());
            let stops = command.mode == OperatorCommand::MODE_DAMPING;
            let free = self.senders.iter().position(|sender| {
                of_source(sender) && !is_active(sender) && sender.stop_ns.is_none() && (stops || timed_out(sender))
            });
            self.senders.remove(free?);
        }
        Some(self.senders.len())
    }

    /// Begins or clears emergency stops after a command of the sender at `place`.
    fn update_stops(&mut self, place: usize, t_ns: i64) {
        let Sender { source, request_ns, .. } = self.senders[place];
        let mode = self.senders[place].command.mode;
        let stops = mode == OperatorCommand::MODE_DAMPING;
        let change = match (stops, self.senders[place].stop_ns) {
            (true, None) => Some(Transition::StopTriggered(source)),
            (false, Some(_)) => Some(Transition::StopCleared(source)),
            _ => None,
        };
        if let Some(change) = change {
            self.senders[place].stop_ns = stops.then_some(t_ns);
            self.stop_changed(change, t_ns);
        }
        if mode != OperatorCommand::MODE_IDLE {
            return;
        }
        // The stop of a sender that has timed out.
        let timeout_ns = self.sources[source].timeout_ns();
        for k in 0..self.senders.len() {
            let other = &mut self.senders[k];
            if other.source == source && !other.is_alive(t_ns, timeout_ns) && request_ns > other.arrival_ns {
                let had_stop = other.stop_ns.take().is_some();
                if had_stop {
                    // The request that clears the stop is new, requests before it are not.
                    self.stop_changed(Transition::StopCleared(source), request_ns.saturating_sub(1));
                }
            }
        }
    }

    /// From now on the active operator is in control again: requests made before are ignored.
    fn stop_changed(&mut self, change: Transition, t_ns: i64) {
        if let Some(active) = &mut self.active {
            active.since_ns = t_ns;
        }
        self.report(change);
    }

    /// Why a sender's commands are not followed; `None` if they are. Call it after [`CommandMux::select`].
    pub fn ignored(&self, source: usize, sender_id: i64) -> Option<Ignored> {
        if self.active.is_some_and(|active| (active.source, active.id) == (source, sender_id)) {
            return None;
        }
        let sender = self.senders.iter().find(|sender| (sender.source, sender.id()) == (source, sender_id));
        if sender.is_some_and(|sender| sender.request_ns < self.start_ns) {
            return Some(Ignored::BeforeRun);
        }
        let active = self.active?;
        Some(if active.timed_out { Ignored::Overridden(active.source) } else { Ignored::OtherActive(active.source) })
    }

    /// The command that is followed at `t_ns`; `None` before the first command of any source.
    pub fn select(&mut self, t_ns: i64) -> Option<Selection<'_>> {
        self.active = self.find_active(t_ns);
        self.report_ignored(t_ns);
        let active = self.active?;
        let sender = self.senders.iter().find(|sender| active.is(sender))?;
        let arrival_ns = if sender.stop_ns.is_some() { t_ns } else { sender.arrival_ns };
        Some(Selection { source: sender.source, command: &sender.command, arrival_ns })
    }

    /// [`CommandMux::select`], if it is another command than last time. An emergency stop in force is repeated every [`RENEW_NS`].
    pub fn new_selection(&mut self, t_ns: i64) -> Option<Selection<'_>> {
        let before = self.newest;
        let Selection { source, command, arrival_ns } = self.select(t_ns)?;
        let now = (source, command.sender_id, command.seq, command.t_ns, arrival_ns);
        let is_same = |before: (usize, i64, i64, i64, i64)| {
            (before.0, before.1, before.2, before.3) == (now.0, now.1, now.2, now.3) && arrival_ns - before.4 < RENEW_NS
        };
        if before.is_some_and(is_same) {
            return None;
        }
        self.newest = Some(now);
        let sender = self.senders.iter().find(|sender| (sender.source, sender.id()) == (now.0, now.1))?;
        Some(Selection { source, command: &sender.command, arrival_ns })
    }

    /// Next transition that has not been reported yet.
    pub fn transition(&mut self) -> Option<Transition> {
        if let Some(transition) = self.transitions.pop_front() {
            return Some(transition);
        }
        let key = |active: Active| (active.source, active.id, active.timed_out);
        if self.reported.map(key) == self.active.map(key) {
            return None;
        }
        self.reported = self.active;
        let Active { source, timed_out, .. } = self.active?;
        Some(if timed_out { Transition::TimedOut(source) } else { Transition::Activated(source) })
    }

    /// A transition as a sentence.
    pub fn text(&self, transition: Transition) -> String {
        match transition {
            Transition::Activated(source) => format!("{} is active", self.channel(source)),
            Transition::TimedOut(source) => format!("{} timed out; no operator is active", self.channel(source)),
            Transition::StopTriggered(source) => format!("emergency stop by {}", self.channel(source)),
            Transition::StopCleared(source) => format!("emergency stop cleared by {}", self.channel(source)),
            Transition::Ignored(source, mode, why) => {
                let (channel, mode) = (self.channel(source), enum_names::operator_mode(mode));
                format!("{mode} of {channel} ignored: {}", self.reason(source, why))
            }
        }
    }

    /// Why commands of a source are ignored, as a sentence.
    pub fn reason(&self, source: usize, why: Ignored) -> String {
        match why {
            Ignored::OtherActive(active) if active == source => {
                format!("another sender on {} is active", self.channel(source))
            }
            Ignored::OtherActive(active) => format!("operator {} is active", self.channel(active)),
            Ignored::BeforeRun => "requested before the start of the run; request it again".to_owned(),
            Ignored::Overridden(before) => {
                format!("requested before the last command of operator {}; request it again", self.channel(before))
            }
        }
    }

    fn channel(&self, source: usize) -> &str {
        self.sources.get(source).map_or("?", |source| &*source.channel)
    }

    fn report(&mut self, transition: Transition) {
        if self.transitions.len() < MAX_TRANSITIONS {
            self.transitions.push_back(transition);
        }
    }

    /// Reports mode requests that are ignored, each once, and at most one of a source in a second.
    fn report_ignored(&mut self, t_ns: i64) {
        for k in 0..self.senders.len() {
            let sender = &self.senders[k];
            let (source, mode) = (sender.source, sender.command.mode);
            if !sender.is_alive(t_ns, self.sources[source].timeout_ns()) {
                continue;
            }
            let why = self.ignored(source, sender.id());
            let is_due = self.ignored_ns[source].is_none_or(|last| t_ns.saturating_sub(last) >= 1_000_000_000);
            if let Some(why) = why
                && sender.reported != Some((mode, why))
                && is_due
            {
                self.senders[k].reported = Some((mode, why));
                self.ignored_ns[source] = Some(t_ns);
                self.report(Transition::Ignored(source, mode, why));
            }
        }
    }

    /// A sender with an emergency stop in force, else the active sender or one with a new request that has precedence, else the last active one.
    fn find_active(&self, t_ns: i64) -> Option<Active> {
        // min_by_key returns the first of equal elements: the source listed first, the sender that was received from first.
        let best = |is_candidate: &dyn Fn(&Sender) -> bool| {
            let candidates = self.senders.iter().filter(|sender| is_candidate(sender));
            candidates.min_by_key(|sender| self.rank(sender))
        };
        let found = best(&|sender| sender.stop_ns.is_some()).or_else(|| best(&|sender| self.may_command(sender, t_ns)));
        match (found, self.active) {
            (Some(found), Some(active)) if active.is(found) => Some(Active { timed_out: false, ..active }),
            (Some(found), _) => Some(Active { source: found.source, id: found.id(), timed_out: false, since_ns: t_ns }),
            (None, active) => active.map(|last| Active { timed_out: true, ..last }),
        }
    }

    /// Order of precedence, the smallest first: priority, place in the list, and within a source the active sender.
    fn rank(&self, sender: &Sender) -> (i64, usize, bool) {
        let is_active = self.active.is_some_and(|active| active.is(sender));
        (-i64::from(self.sources[sender.source].priority), sender.source, !is_active)
    }

    /// Whether a sender has not timed out, and is the active one or has a new request.
    fn may_command(&self, sender: &Sender, t_ns: i64) -> bool {
        if !sender.is_alive(t_ns, self.sources[sender.source].timeout_ns()) || sender.request_ns < self.start_ns {
            return false;
        }
        let Some(active) = self.active else { return true };
        if active.is(sender) {
            return true;
        }
        let last = self.senders.iter().find(|other| active.is(other));
        let in_control = last.filter(|last| last.is_alive(t_ns, self.sources[last.source].timeout_ns()));
        let until_ns = match (in_control, last) {
            (None, Some(last)) => last.arrival_ns.max(active.since_ns),
            _ => active.since_ns,
        };
        sender.request_ns > until_ns
    }
}

impl Active {
    fn is(self, sender: &Sender) -> bool {
        (self.source, self.id) == (sender.source, sender.id())
    }
}
