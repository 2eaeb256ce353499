//! Command multiplexer: selects one of several operators of a robot.
//!
//! Each [`Source`] is a channel of `operator_command_t` with a priority and a time-out, as in ROS `twist_mux`: the source with the highest priority
//! that has not timed out is active. Two rules differ from `twist_mux`:
//!
//! - An emergency stop (`MODE_DAMPING`) of any source overrides all priorities. It stays in force, without being repeated, until the same source
//!   sends another mode: only the source that triggered the stop can clear it.
//! - When all sources have timed out, the last command is kept with its arrival time. The controller checks its age and stops walking.
//!
//! Pure: the caller gives the time; nothing is allocated after construction.

use crate::teleop;
use lcmtypes::{OperatorCommand, channels};
use serde::Deserialize;

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
}

impl Transition {
    /// Whether a person should check the robot.
    pub fn is_warning(self) -> bool {
        matches!(self, Transition::TimedOut(_) | Transition::StopTriggered(_))
    }
}

/// Selects among sources.
#[derive(Clone, Debug)]
pub struct CommandMux {
    sources: Vec<Source>,
    /// Last command of each source.
    last: Vec<Option<LastCommand>>,
    active: Option<Active>,
    /// Source, seq, sending time and arrival of the last [`CommandMux::new_selection`].
    newest: Option<(usize, i64, i64, i64)>,
    /// State that [`CommandMux::transition`] has reported.
    reported: Option<Active>,
}

#[derive(Clone, Debug)]
struct LastCommand {
    command: OperatorCommand,
    arrival_ns: i64,
    /// It is an emergency stop.
    stops: bool,
    /// The value of `stops` that [`CommandMux::transition`] has reported.
    reported_stops: bool,
}

/// The source whose command is selected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Active {
    source: usize,
    timed_out: bool,
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
        Ok(CommandMux { last: vec![None; sources.len()], sources, active: None, newest: None, reported: None })
    }

    /// The sources, as listed.
    pub fn sources(&self) -> &[Source] {
        &self.sources
    }

    /// Index of the source with a channel.
    pub fn source_of(&self, channel: &str) -> Option<usize> {
        self.sources.iter().position(|source| source.channel == channel)
    }

    /// Index of the source that was selected last; `None` before the first command.
    pub fn active(&self) -> Option<usize> {
        self.active.map(|active| active.source)
    }

    /// Takes a command of a source that arrived at `t_ns`.
    ///
    /// A command that is older than the last one, by seq and by its own clock, is ignored: it could clear an emergency stop that was sent after it.
    /// An emergency stop is never ignored. A source that has timed out may have been restarted, with other numbers and another clock: its command
    /// is always taken.
    pub fn receive(&mut self, source: usize, t_ns: i64, command: &OperatorCommand) {
        let stops = command.mode == OperatorCommand::MODE_DAMPING;
        let is_alive = self.is_alive(source, t_ns);
        let Some(slot) = self.last.get_mut(source) else { return };
        if let Some(last) = slot.as_ref()
            && is_alive
            && !stops
            && command.seq <= last.command.seq
            && command.t_ns < last.command.t_ns
        {
            return;
        }
        let reported_stops = slot.as_ref().is_some_and(|last| last.reported_stops);
        *slot = Some(LastCommand { command: command.clone(), arrival_ns: t_ns, stops, reported_stops });
    }

    /// The command that is followed at `t_ns`; `None` before the first command of any source.
    pub fn select(&mut self, t_ns: i64) -> Option<Selection<'_>> {
        self.active = self.find_active(t_ns);
        let source = self.active?.source;
        let last = self.last[source].as_ref()?;
        let arrival_ns = if last.stops { t_ns } else { last.arrival_ns };
        Some(Selection { source, command: &last.command, arrival_ns })
    }

    /// [`CommandMux::select`], if it is another command than last time. An emergency stop in force is repeated every [`RENEW_NS`].
    pub fn new_selection(&mut self, t_ns: i64) -> Option<Selection<'_>> {
        let before = self.newest;
        let Selection { source, command, arrival_ns } = self.select(t_ns)?;
        let now = (source, command.seq, command.t_ns, arrival_ns);
        let is_same = |before: (usize, i64, i64, i64)| {
            (before.0, before.1, before.2) == (now.0, now.1, now.2) && arrival_ns - before.3 < RENEW_NS
        };
        if before.is_some_and(is_same) {
            return None;
        }
        self.newest = Some(now);
        let command = &self.last[source].as_ref()?.command;
        Some(Selection { source, command, arrival_ns })
    }

    /// Next transition that has not been reported yet.
    pub fn transition(&mut self) -> Option<Transition> {
        for (source, last) in self.last.iter_mut().enumerate() {
            let Some(last) = last else { continue };
            if last.stops != last.reported_stops {
                last.reported_stops = last.stops;
                let transition = if last.stops { Transition::StopTriggered } else { Transition::StopCleared };
                return Some(transition(source));
            }
        }
        if self.reported == self.active {
            return None;
        }
        self.reported = self.active;
        let Active { source, timed_out } = self.active?;
        Some(if timed_out { Transition::TimedOut(source) } else { Transition::Activated(source) })
    }

    /// A transition as a sentence.
    pub fn text(&self, transition: Transition) -> String {
        let channel = |source: usize| self.sources.get(source).map_or("?", |source| &*source.channel);
        match transition {
            Transition::Activated(source) => format!("{} is active", channel(source)),
            Transition::TimedOut(source) => format!("{} timed out; no operator is active", channel(source)),
            Transition::StopTriggered(source) => format!("emergency stop by {}", channel(source)),
            Transition::StopCleared(source) => format!("emergency stop cleared by {}", channel(source)),
        }
    }

    /// A source with an emergency stop in force, else the one with the highest priority that has not timed out, else the last active one.
    fn find_active(&self, t_ns: i64) -> Option<Active> {
        let best = |is_candidate: &dyn Fn(usize) -> bool| {
            let candidates = (0..self.sources.len()).filter(|&source| is_candidate(source));
            // max_by_key returns the last of equal elements: reversed, the one listed first.
            candidates.rev().max_by_key(|&source| self.sources[source].priority)
        };
        let stops = |source: usize| self.last[source].as_ref().is_some_and(|last| last.stops);
        if let Some(source) = best(&stops).or_else(|| best(&|source| self.is_alive(source, t_ns))) {
            return Some(Active { source, timed_out: false });
        }
        self.active.map(|last| Active { timed_out: true, ..last })
    }

    /// Whether a source has sent a command that has not timed out.
    fn is_alive(&self, source: usize, t_ns: i64) -> bool {
        let (Some(Some(last)), Some(Source { timeout_s, .. })) = (self.last.get(source), self.sources.get(source))
        else {
            return false;
        };
        #[expect(clippy::cast_precision_loss, reason = "ages are far below 2^53 ns")]
        let age_s = t_ns.saturating_sub(last.arrival_ns) as f64 * 1e-9;
        age_s <= *timeout_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const PAD: usize = 0;
    const KEYS: usize = 1;
    const PLANNER: usize = 2;

    /// Three sources with decreasing priority.
    fn mux() -> CommandMux {
        let source = |channel: &str, priority, timeout_s| Source { channel: channel.to_owned(), priority, timeout_s };
        CommandMux::new(vec![source("PAD", 30, 0.1), source("KEYS", 20, 0.25), source("PLANNER", 10, 1.0)]).unwrap()
    }

    fn command(mode: i8, seq: i64) -> OperatorCommand {
        OperatorCommand { mode, seq, t_ns: seq * 20 * MS, ..OperatorCommand::default() }
    }

    fn walk(seq: i64) -> OperatorCommand {
        command(OperatorCommand::MODE_WALK, seq)
    }

    fn stop(seq: i64) -> OperatorCommand {
        command(OperatorCommand::MODE_DAMPING, seq)
    }

    fn stand(seq: i64) -> OperatorCommand {
        command(OperatorCommand::MODE_STAND, seq)
    }

    /// Source, seq and arrival in ms of the selected command.
    fn selected(mux: &mut CommandMux, ms: i64) -> Option<(usize, i64, i64)> {
        mux.select(ms * MS).map(|found| (found.source, found.command.seq, found.arrival_ns / MS))
    }

    fn transitions(mux: &mut CommandMux) -> Vec<Transition> {
        std::iter::from_fn(|| mux.transition()).collect()
    }

    #[test]
    fn the_highest_priority_is_active_until_it_times_out() {
        let mut a = mux();
        assert_eq!(selected(&mut a, 0), None);
        a.receive(PLANNER, 10 * MS, &walk(7));
        assert_eq!(selected(&mut a, 12), Some((PLANNER, 7, 10)));
        assert_eq!(transitions(&mut a), [Transition::Activated(PLANNER)]);
        a.receive(PAD, 20 * MS, &walk(1));
        a.receive(PLANNER, 30 * MS, &walk(8));
        assert_eq!(selected(&mut a, 120), Some((PAD, 1, 20)), "100 ms after its command, its time-out");
        assert_eq!(transitions(&mut a), [Transition::Activated(PAD)]);
        assert_eq!(selected(&mut a, 121), Some((PLANNER, 8, 30)));
        assert_eq!(transitions(&mut a), [Transition::Activated(PLANNER)]);
        assert_eq!(transitions(&mut a), [], "once");
    }

    #[test]
    fn the_last_command_is_kept_when_all_have_timed_out() {
        let mut a = mux();
        a.receive(KEYS, 10 * MS, &walk(3));
        a.receive(PLANNER, 9 * MS, &walk(1));
        assert_eq!(selected(&mut a, 200), Some((KEYS, 3, 10)));
        assert_eq!(selected(&mut a, 1009), Some((PLANNER, 1, 9)));
        assert_eq!(selected(&mut a, 5000), Some((PLANNER, 1, 9)));
        assert_eq!(transitions(&mut a), [Transition::TimedOut(PLANNER)]);
        a.receive(PLANNER, 5020 * MS, &walk(2));
        assert_eq!(selected(&mut a, 5020), Some((PLANNER, 2, 5020)));
        assert_eq!(transitions(&mut a), [Transition::Activated(PLANNER)]);
    }

    #[test]
    fn an_emergency_stop_overrides_priorities_and_only_its_source_clears_it() {
        let mut a = mux();
        a.receive(PAD, 0, &walk(1));
        a.receive(PLANNER, 5 * MS, &stop(2));
        assert_eq!(selected(&mut a, 6), Some((PLANNER, 2, 6)));
        assert_eq!(transitions(&mut a), [Transition::StopTriggered(PLANNER), Transition::Activated(PLANNER)]);
        for ms in 1..500 {
            a.receive(PAD, ms * 20 * MS, &stand(ms + 1));
            assert_eq!(selected(&mut a, ms * 20 + 1), Some((PLANNER, 2, ms * 20 + 1)), "timed out, but in force");
        }
        a.receive(PLANNER, 10_000 * MS, &command(OperatorCommand::MODE_IDLE, 3));
        assert_eq!(selected(&mut a, 10_001), Some((PAD, 500, 9980)));
        assert_eq!(transitions(&mut a), [Transition::StopCleared(PLANNER), Transition::Activated(PAD)]);
    }

    #[test]
    fn a_new_selection_is_another_command_than_before() {
        let mut a = mux();
        let new = |a: &mut CommandMux, ms: i64| {
            a.new_selection(ms * MS).map(|c| (c.source, c.command.seq, c.arrival_ns / MS))
        };
        assert_eq!(new(&mut a, 0), None);
        a.receive(KEYS, MS, &walk(1));
        assert_eq!(new(&mut a, 2), Some((KEYS, 1, 1)));
        assert_eq!(new(&mut a, 2000), None, "a time-out is no new command");
        a.receive(KEYS, 2001 * MS, &walk(1));
        assert_eq!(new(&mut a, 2001), Some((KEYS, 1, 2001)), "the same command, received again");
        a.receive(PLANNER, 2002 * MS, &stop(1));
        assert_eq!(new(&mut a, 2002), Some((PLANNER, 1, 2002)));
        assert_eq!(new(&mut a, 2021), None);
        assert_eq!(new(&mut a, 2022), Some((PLANNER, 1, 2022)), "in force");
        a.receive(PLANNER, 2023 * MS, &stand(2));
        assert_eq!(new(&mut a, 2023), Some((KEYS, 1, 2001)), "active again, with its old arrival time");
    }

    #[test]
    fn each_emergency_stop_is_cleared_by_its_own_source() {
        let mut a = mux();
        a.receive(PAD, 0, &stop(1));
        a.receive(KEYS, 0, &stop(1));
        assert_eq!(selected(&mut a, 1), Some((PAD, 1, 1)));
        a.receive(PAD, 2 * MS, &stand(2));
        assert_eq!(selected(&mut a, 3), Some((KEYS, 1, 3)));
        assert_eq!(transitions(&mut a), [Transition::StopTriggered(KEYS), Transition::Activated(KEYS)]);
    }

    #[test]
    fn an_older_command_does_not_clear_an_emergency_stop() {
        let mut a = mux();
        a.receive(KEYS, 0, &stop(9));
        a.receive(KEYS, MS, &walk(8));
        assert_eq!(selected(&mut a, 2), Some((KEYS, 9, 2)));
        a.receive(KEYS, 2 * MS, &walk(10));
        assert_eq!(selected(&mut a, 3), Some((KEYS, 10, 2)));
        a.receive(KEYS, 4 * MS, &stop(9));
        assert_eq!(selected(&mut a, 5), Some((KEYS, 9, 5)), "an older command, but an emergency stop");
    }

    #[test]
    fn a_source_may_be_restarted() {
        let mut a = mux();
        a.receive(KEYS, 1000 * MS, &walk(50));
        // Before its time-out with a clock that continues, and after it with a clock that was reset.
        a.receive(KEYS, 1020 * MS, &OperatorCommand { t_ns: 1020 * MS, ..walk(0) });
        assert_eq!(selected(&mut a, 1020), Some((KEYS, 0, 1020)));
        a.receive(KEYS, 1300 * MS, &OperatorCommand { t_ns: 1, ..walk(0) });
        assert_eq!(selected(&mut a, 1300), Some((KEYS, 0, 1300)));
    }

    #[test]
    fn of_equal_priorities_the_first_listed_is_active() {
        let source = |channel: &str| Source { channel: channel.to_owned(), priority: 1, timeout_s: 0.1 };
        let mut a = CommandMux::new(vec![source("A"), source("B")]).unwrap();
        a.receive(1, 0, &walk(1));
        a.receive(0, 0, &walk(1));
        assert_eq!(selected(&mut a, 1), Some((0, 1, 0)));
        assert_eq!((a.source_of("B"), a.source_of("C")), (Some(1), None));
    }

    #[test]
    fn transitions_are_reported_with_the_channel() {
        let a = mux();
        let transitions =
            [Transition::Activated, Transition::TimedOut, Transition::StopTriggered, Transition::StopCleared];
        for transition in transitions {
            assert!(a.text(transition(PLANNER)).contains("PLANNER"));
        }
    }

    #[test]
    fn invalid_sources_are_refused_by_name() {
        let read = |text: &str| -> Result<CommandMux, String> {
            #[derive(Deserialize)]
            struct File {
                #[serde(default)]
                operator: Vec<Source>,
            }
            let file: File = toml::from_str(text).map_err(|error| error.message().to_owned())?;
            CommandMux::new(file.operator).map_err(|error| error.to_string())
        };
        let pad = "[[operator]]\nchannel = \"PAD\"\npriority = 3\n";
        assert_eq!(read(pad).unwrap().sources()[0].timeout_s, 0.25);
        for (text, names) in [
            (String::new(), vec!["[[operator]]"]),
            (format!("{pad}{pad}"), vec!["[[operator]] PAD"]),
            (format!("{pad}timeout_s = 0.0\n"), vec!["[[operator]] PAD", "timeout_s is 0", "0.02 to 60"]),
            (format!("{pad}timeout_s = nan\n"), vec!["[[operator]] PAD", "timeout_s is NaN", "0.02 to 60"]),
            (pad.replace("PAD", ""), vec!["[[operator]] \"\""]),
            (pad.replace("PAD", "P.*"), vec!["[[operator]] \"P.*\""]),
            (format!("{pad}timeout = 1\n"), vec!["`timeout`", "`channel`, `priority`, `timeout_s`"]),
        ] {
            let error = read(&text).unwrap_err();
            assert!(names.iter().all(|name| error.contains(name)), "{names:?}: {error}");
        }
    }
}
