//! Several operators, one robot: which command counts.
//!
//! Each [`Source`] is a channel of OPERATOR_COMMANDs with a priority and a time-out, as in ROS' `twist_mux`: the highest priority among those heard
//! lately is followed. What departs from it:
//!
//! - An emergency stop (`MODE_DAMPING`) of any source wins over every priority. It holds, without being said again, until the same source says
//!   something else: who pulled it may be gone, and nobody else knows why.
//! - When all are silent, the last command stays with the time at which it came: how old a command may be is for the controller to judge, and
//!   it stops walking.
//!
//! Pure: times are given, no clock is read, nothing is allocated after the start.

use crate::teleop;
use lcmtypes::{OperatorCommand, channels};
use serde::Deserialize;

/// An `[[operator]]` entry of a run file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Channel on which it speaks.
    pub channel: String,
    /// The larger one counts; of equal ones, the one that stands first.
    pub priority: i32,
    /// Silence after which it counts no more, s.
    #[serde(default = "default_timeout")]
    pub timeout_s: f64,
}

/// A heartbeat has 20 ms: this outlasts a dozen lost ones.
fn default_timeout() -> f64 {
    0.25
}

/// Who may command unless a run file says otherwise: a person before whatever plans or plays.
pub fn default_sources() -> Vec<Source> {
    let source = |channel: &str, priority| {
        let (channel, timeout_s) = (channel.to_owned(), default_timeout());
        Source { channel, priority, timeout_s }
    };
    vec![source(teleop::CHANNEL, 100), source(channels::OPERATOR_COMMAND, 10)]
}

/// How often an emergency stop in force counts as said again, ns: as often as an operator says what it wants.
pub const RENEW_NS: i64 = teleop::HEARTBEAT_NS;

/// Why a list of sources is unusable.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum SourcesError {
    #[error("there is no [[operator]]: nobody could stop the robot")]
    None,
    #[error("[[operator]] {channel:?}: a channel is 1 to 63 letters, digits, _ and -")]
    Channel { channel: String },
    #[error("[[operator]] {channel}: stands twice")]
    Twice { channel: String },
    #[error("[[operator]] {channel}: timeout_s is {found}, expected 0.02 to 60")]
    Timeout { channel: String, found: f64 },
}

/// What the choice fell on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice<'a> {
    /// Number of the source, as listed.
    pub source: usize,
    /// Its command.
    pub command: &'a OperatorCommand,
    /// When it came, ns; of an emergency stop in force, now.
    pub arrival_ns: i64,
}

/// Something that a person should know of a choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switch {
    /// This source is followed from now on.
    TakesOver(usize),
    /// This source was followed and is silent, and so are all others.
    Silent(usize),
    /// This source pulled the emergency stop.
    Stops(usize),
    /// This source took its emergency stop back.
    Releases(usize),
}

impl Switch {
    /// Somebody should look at the robot.
    pub fn is_alarming(self) -> bool {
        matches!(self, Switch::Silent(_) | Switch::Stops(_))
    }
}

/// Chooses among sources.
#[derive(Clone, Debug)]
pub struct CommandMux {
    sources: Vec<Source>,
    heard: Vec<Option<Heard>>,
    followed: Option<Followed>,
    /// Source, number, sending and arrival of the last [`CommandMux::news`].
    newest: Option<(usize, i64, i64, i64)>,
    /// What [`CommandMux::switch`] has told of it.
    told: Option<Followed>,
}

#[derive(Clone, Debug)]
struct Heard {
    command: OperatorCommand,
    arrival_ns: i64,
    /// Its emergency stop is in force.
    stops: bool,
    /// Whether [`CommandMux::switch`] has told of that.
    told_stops: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Followed {
    source: usize,
    silent: bool,
}

impl CommandMux {
    /// Checks sources; none has been heard yet.
    ///
    /// # Errors
    /// No source at all, a channel that is none or stands twice, a time-out out of range.
    pub fn new(sources: Vec<Source>) -> Result<Self, SourcesError> {
        if sources.is_empty() {
            return Err(SourcesError::None);
        }
        for (k, Source { channel, timeout_s, .. }) in sources.iter().enumerate() {
            let channel = channel.clone();
            let fits = |c: char| c.is_ascii_alphanumeric() || "_-".contains(c);
            if !(1..=63).contains(&channel.len()) || !channel.chars().all(fits) {
                return Err(SourcesError::Channel { channel });
            }
            if sources[..k].iter().any(|other| other.channel == channel) {
                return Err(SourcesError::Twice { channel });
            }
            if !(0.02..=60.0).contains(timeout_s) {
                return Err(SourcesError::Timeout { channel, found: *timeout_s });
            }
        }
        Ok(CommandMux { heard: vec![None; sources.len()], sources, followed: None, newest: None, told: None })
    }

    /// The sources, as listed.
    pub fn sources(&self) -> &[Source] {
        &self.sources
    }

    /// Number of the source that speaks on a channel.
    pub fn source_of(&self, channel: &str) -> Option<usize> {
        self.sources.iter().position(|source| source.channel == channel)
    }

    /// Takes a command of a source that came at `t_ns`.
    ///
    /// One that was overtaken on its way (by number and by its own clock) is left out, or it could take back an emergency stop that was
    /// sent after it; an emergency stop itself never is. Where a source was silent for longer than its time-out, it may have begun
    /// anew, with other numbers and another clock.
    pub fn hear(&mut self, source: usize, t_ns: i64, command: &OperatorCommand) {
        let stops = command.mode == OperatorCommand::MODE_DAMPING;
        let lasting = self.is_heard(source, t_ns);
        let Some(heard) = self.heard.get_mut(source) else { return };
        if let Some(last) = heard.as_ref()
            && lasting
            && !stops
            && command.seq <= last.command.seq
            && command.t_ns < last.command.t_ns
        {
            return;
        }
        let told_stops = heard.as_ref().is_some_and(|last| last.told_stops);
        *heard = Some(Heard { command: command.clone(), arrival_ns: t_ns, stops, told_stops });
    }

    /// The command that counts at `t_ns`; `None` before the first one of all.
    pub fn choose(&mut self, t_ns: i64) -> Option<Choice<'_>> {
        self.followed = self.follow(t_ns);
        let source = self.followed?.source;
        let heard = self.heard[source].as_ref()?;
        let arrival_ns = if heard.stops { t_ns } else { heard.arrival_ns };
        Some(Choice { source, command: &heard.command, arrival_ns })
    }

    /// [`CommandMux::choose`], where it is another command than last time; an emergency stop in force is one again every [`RENEW_NS`].
    pub fn news(&mut self, t_ns: i64) -> Option<Choice<'_>> {
        let before = self.newest;
        let Choice { source, command, arrival_ns } = self.choose(t_ns)?;
        let now = (source, command.seq, command.t_ns, arrival_ns);
        let is_same = |before: (usize, i64, i64, i64)| {
            (before.0, before.1, before.2) == (now.0, now.1, now.2) && arrival_ns - before.3 < RENEW_NS
        };
        if before.is_some_and(is_same) {
            return None;
        }
        self.newest = Some(now);
        let command = &self.heard[source].as_ref()?.command;
        Some(Choice { source, command, arrival_ns })
    }

    /// What the choices so far changed and was not told yet, one by one.
    pub fn switch(&mut self) -> Option<Switch> {
        for (source, heard) in self.heard.iter_mut().enumerate() {
            let Some(heard) = heard else { continue };
            if heard.stops != heard.told_stops {
                heard.told_stops = heard.stops;
                return Some(if heard.stops { Switch::Stops(source) } else { Switch::Releases(source) });
            }
        }
        if self.told == self.followed {
            return None;
        }
        self.told = self.followed;
        let Followed { source, silent } = self.followed?;
        Some(if silent { Switch::Silent(source) } else { Switch::TakesOver(source) })
    }

    /// A switch as a sentence.
    pub fn text(&self, switch: Switch) -> String {
        let channel = |source: usize| self.sources.get(source).map_or("?", |source| &*source.channel);
        match switch {
            Switch::TakesOver(source) => format!("{} takes over", channel(source)),
            Switch::Silent(source) => format!("{} is silent, and so are all others", channel(source)),
            Switch::Stops(source) => format!("emergency stop by {}", channel(source)),
            Switch::Releases(source) => format!("{} takes its emergency stop back", channel(source)),
        }
    }

    /// Whom to follow: an emergency stop, else the highest priority that is heard, else the last one.
    fn follow(&self, t_ns: i64) -> Option<Followed> {
        let best = |wanted: &dyn Fn(usize) -> bool| {
            let candidates = (0..self.sources.len()).filter(|&source| wanted(source));
            // Of equal ones the last is the largest, so the first listed comes last.
            candidates.rev().max_by_key(|&source| self.sources[source].priority)
        };
        let stops = |source: usize| self.heard[source].as_ref().is_some_and(|heard| heard.stops);
        if let Some(source) = best(&stops).or_else(|| best(&|source| self.is_heard(source, t_ns))) {
            return Some(Followed { source, silent: false });
        }
        self.followed.map(|last| Followed { silent: true, ..last })
    }

    fn is_heard(&self, source: usize, t_ns: i64) -> bool {
        let (Some(Some(heard)), Some(Source { timeout_s, .. })) = (self.heard.get(source), self.sources.get(source))
        else {
            return false;
        };
        #[expect(clippy::cast_precision_loss, reason = "ages are far below 2^53 ns")]
        let age_s = t_ns.saturating_sub(heard.arrival_ns) as f64 * 1e-9;
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

    /// A pad above a keyboard above a planner, listed so that order and priority differ.
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

    /// Source, number and arrival in ms of the command that counts.
    fn chosen(mux: &mut CommandMux, ms: i64) -> Option<(usize, i64, i64)> {
        mux.choose(ms * MS).map(|choice| (choice.source, choice.command.seq, choice.arrival_ns / MS))
    }

    fn told(mux: &mut CommandMux) -> Vec<Switch> {
        std::iter::from_fn(|| mux.switch()).collect()
    }

    #[test]
    fn the_highest_priority_that_speaks_is_followed_until_its_time_out() {
        let mut a = mux();
        assert_eq!(chosen(&mut a, 0), None);
        a.hear(PLANNER, 10 * MS, &walk(7));
        assert_eq!(chosen(&mut a, 12), Some((PLANNER, 7, 10)));
        assert_eq!(told(&mut a), [Switch::TakesOver(PLANNER)]);
        a.hear(PAD, 20 * MS, &walk(1));
        a.hear(PLANNER, 30 * MS, &walk(8));
        assert_eq!(chosen(&mut a, 120), Some((PAD, 1, 20)), "heard 100 ms ago, its time-out");
        assert_eq!(told(&mut a), [Switch::TakesOver(PAD)]);
        assert_eq!(chosen(&mut a, 121), Some((PLANNER, 8, 30)));
        assert_eq!(told(&mut a), [Switch::TakesOver(PLANNER)]);
        assert_eq!(told(&mut a), [], "once");
    }

    #[test]
    fn in_silence_the_last_command_grows_old() {
        let mut a = mux();
        a.hear(KEYS, 10 * MS, &walk(3));
        a.hear(PLANNER, 9 * MS, &walk(1));
        assert_eq!(chosen(&mut a, 200), Some((KEYS, 3, 10)));
        assert_eq!(chosen(&mut a, 1009), Some((PLANNER, 1, 9)));
        assert_eq!(chosen(&mut a, 5000), Some((PLANNER, 1, 9)));
        assert_eq!(told(&mut a), [Switch::Silent(PLANNER)]);
        a.hear(PLANNER, 5020 * MS, &walk(2));
        assert_eq!(chosen(&mut a, 5020), Some((PLANNER, 2, 5020)));
        assert_eq!(told(&mut a), [Switch::TakesOver(PLANNER)]);
    }

    #[test]
    fn an_emergency_stop_of_the_least_wins_and_is_taken_back_by_itself_alone() {
        let mut a = mux();
        a.hear(PAD, 0, &walk(1));
        a.hear(PLANNER, 5 * MS, &stop(2));
        assert_eq!(chosen(&mut a, 6), Some((PLANNER, 2, 6)));
        assert_eq!(told(&mut a), [Switch::Stops(PLANNER), Switch::TakesOver(PLANNER)]);
        for ms in 1..500 {
            a.hear(PAD, ms * 20 * MS, &stand(ms + 1));
            assert_eq!(chosen(&mut a, ms * 20 + 1), Some((PLANNER, 2, ms * 20 + 1)), "silent for long, and in force");
        }
        a.hear(PLANNER, 10_000 * MS, &command(OperatorCommand::MODE_IDLE, 3));
        assert_eq!(chosen(&mut a, 10_001), Some((PAD, 500, 9980)));
        assert_eq!(told(&mut a), [Switch::Releases(PLANNER), Switch::TakesOver(PAD)]);
    }

    #[test]
    fn news_are_commands_that_were_not_there_before() {
        let mut a = mux();
        let news = |a: &mut CommandMux, ms: i64| a.news(ms * MS).map(|c| (c.source, c.command.seq, c.arrival_ns / MS));
        assert_eq!(news(&mut a, 0), None);
        a.hear(KEYS, MS, &walk(1));
        assert_eq!(news(&mut a, 2), Some((KEYS, 1, 1)));
        assert_eq!(news(&mut a, 2000), None, "silence is no news");
        a.hear(KEYS, 2001 * MS, &walk(1));
        assert_eq!(news(&mut a, 2001), Some((KEYS, 1, 2001)), "the same again, much later");
        a.hear(PLANNER, 2002 * MS, &stop(1));
        assert_eq!(news(&mut a, 2002), Some((PLANNER, 1, 2002)));
        assert_eq!(news(&mut a, 2021), None);
        assert_eq!(news(&mut a, 2022), Some((PLANNER, 1, 2022)), "in force");
        a.hear(PLANNER, 2023 * MS, &stand(2));
        assert_eq!(news(&mut a, 2023), Some((KEYS, 1, 2001)), "followed again, with the age that it has");
    }

    #[test]
    fn two_emergency_stops_are_two() {
        let mut a = mux();
        a.hear(PAD, 0, &stop(1));
        a.hear(KEYS, 0, &stop(1));
        assert_eq!(chosen(&mut a, 1), Some((PAD, 1, 1)));
        a.hear(PAD, 2 * MS, &stand(2));
        assert_eq!(chosen(&mut a, 3), Some((KEYS, 1, 3)));
        assert_eq!(told(&mut a), [Switch::Stops(KEYS), Switch::TakesOver(KEYS)]);
    }

    #[test]
    fn what_was_overtaken_takes_no_emergency_stop_back() {
        let mut a = mux();
        a.hear(KEYS, 0, &stop(9));
        a.hear(KEYS, MS, &walk(8));
        assert_eq!(chosen(&mut a, 2), Some((KEYS, 9, 2)));
        a.hear(KEYS, 2 * MS, &walk(10));
        assert_eq!(chosen(&mut a, 3), Some((KEYS, 10, 2)));
        a.hear(KEYS, 4 * MS, &stop(9));
        assert_eq!(chosen(&mut a, 5), Some((KEYS, 9, 5)), "late, and an emergency stop");
    }

    #[test]
    fn a_source_may_begin_anew() {
        let mut a = mux();
        a.hear(KEYS, 1000 * MS, &walk(50));
        // At once, with its clock running on; and after its time-out, with another one.
        a.hear(KEYS, 1020 * MS, &OperatorCommand { t_ns: 1020 * MS, ..walk(0) });
        assert_eq!(chosen(&mut a, 1020), Some((KEYS, 0, 1020)));
        a.hear(KEYS, 1300 * MS, &OperatorCommand { t_ns: 1, ..walk(0) });
        assert_eq!(chosen(&mut a, 1300), Some((KEYS, 0, 1300)));
    }

    #[test]
    fn of_equal_priorities_the_first_counts() {
        let source = |channel: &str| Source { channel: channel.to_owned(), priority: 1, timeout_s: 0.1 };
        let mut a = CommandMux::new(vec![source("A"), source("B")]).unwrap();
        a.hear(1, 0, &walk(1));
        a.hear(0, 0, &walk(1));
        assert_eq!(chosen(&mut a, 1), Some((0, 1, 0)));
        assert_eq!((a.source_of("B"), a.source_of("C")), (Some(1), None));
    }

    #[test]
    fn what_happens_is_said_with_the_channel() {
        let a = mux();
        assert_eq!(a.text(Switch::TakesOver(KEYS)), "KEYS takes over");
        assert_eq!(a.text(Switch::Silent(PAD)), "PAD is silent, and so are all others");
        assert_eq!(a.text(Switch::Stops(PLANNER)), "emergency stop by PLANNER");
        assert_eq!(a.text(Switch::Releases(PLANNER)), "PLANNER takes its emergency stop back");
    }

    #[test]
    fn sources_that_cannot_be_are_refused_by_name() {
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
        for (text, wanted) in [
            (String::new(), "there is no [[operator]]: nobody could stop the robot"),
            (format!("{pad}{pad}"), "[[operator]] PAD: stands twice"),
            (format!("{pad}timeout_s = 0.0\n"), "[[operator]] PAD: timeout_s is 0, expected 0.02 to 60"),
            (format!("{pad}timeout_s = nan\n"), "[[operator]] PAD: timeout_s is NaN, expected 0.02 to 60"),
            (pad.replace("PAD", ""), "[[operator]] \"\": a channel is 1 to 63 letters, digits, _ and -"),
            (pad.replace("PAD", "P.*"), "[[operator]] \"P.*\": a channel is 1 to 63 letters, digits, _ and -"),
            (
                format!("{pad}timeout = 1\n"),
                "unknown field `timeout`, expected one of `channel`, `priority`, `timeout_s`",
            ),
        ] {
            assert_eq!(read(&text).unwrap_err(), wanted);
        }
    }
}
