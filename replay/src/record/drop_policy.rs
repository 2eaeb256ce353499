//! What a log goes without when not everything fits: debug channels first, replay inputs never.

use super::Pattern;
use lcmtypes::channels::{self, Class};
use std::collections::BTreeMap;

/// What is recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Keep {
    /// Every channel.
    #[default]
    All,
    /// What a replay needs and compares: not the channels for people, nor those that this stack does not know.
    Replay,
    /// Only what a replay needs.
    Inputs,
}

impl Keep {
    /// In words, for the log and for people.
    pub fn text(self) -> &'static str {
        match self {
            Keep::All => "every channel is recorded",
            Keep::Replay => "debug channels are not recorded",
            Keep::Inputs => "only what a replay needs is recorded",
        }
    }

    fn takes(self, class: Option<Class>) -> bool {
        match class {
            Some(Class::Meta | Class::ReplayInput) => true,
            Some(Class::Output) => self <= Keep::Replay,
            Some(Class::Debug | Class::Truth | Class::Timing) | None => self == Keep::All,
        }
    }
}

/// Decides message by message, and counts what was left out.
#[derive(Default)]
pub(super) struct Shedder {
    /// Channels never left out, beside those of the table.
    vital: Option<Pattern>,
    /// What the free space on the disk allows.
    pub disk: Keep,
    /// What the room in the ring allows.
    room: Keep,
    /// Messages left out since this was last said.
    unsaid: BTreeMap<String, u64>,
    /// Messages left out, by channel.
    pub total: BTreeMap<String, u64>,
}

impl Shedder {
    /// One that never leaves out what `vital` matches.
    pub fn new(vital: Option<Pattern>) -> Self {
        Shedder { vital, ..Self::default() }
    }

    /// What is recorded now.
    pub fn keep(&self) -> Keep {
        self.disk.max(self.room)
    }

    /// Takes notice of how much waits. Between falling behind and having caught up lies a quarter of the ring, so that the answer does
    /// not change with every message.
    pub fn see(&mut self, waiting: usize, capacity: usize) {
        let quarters = |n: usize| capacity / 4 * n;
        self.room = match self.room {
            _ if waiting > quarters(3) => Keep::Inputs,
            Keep::Inputs if waiting > quarters(2) => Keep::Inputs,
            _ if waiting > quarters(2) => Keep::Replay,
            Keep::Replay | Keep::Inputs if waiting > quarters(1) => Keep::Replay,
            _ => Keep::All,
        };
    }

    /// Whether a message of this channel is recorded.
    pub fn takes(&self, channel: &str) -> bool {
        let keep = self.keep();
        keep == Keep::All
            || keep.takes(channels::find(channel).map(|c| c.class))
            || self.vital.as_ref().is_some_and(|vital| vital.matches(channel))
    }

    /// Counts a message that was left out.
    pub fn left_out(&mut self, channel: &str) {
        for counts in [&mut self.unsaid, &mut self.total] {
            match counts.get_mut(channel) {
                Some(count) => *count += 1,
                None => drop(counts.insert(channel.to_owned(), 1)),
            }
        }
    }

    /// Something was left out that nobody has been told of.
    pub fn has_unsaid(&self) -> bool {
        !self.unsaid.is_empty()
    }

    /// What was left out since this was last asked: `ROBOT_STATE 120, LEG_STATE 7`.
    pub fn say(&mut self) -> String {
        let said: Vec<_> = std::mem::take(&mut self.unsaid).iter().map(|(name, n)| format!("{name} {n}")).collect();
        said.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(shedder: &Shedder) -> Vec<&'static str> {
        channels::CHANNELS.iter().map(|c| c.name).chain(["OTHER"]).filter(|name| shedder.takes(name)).collect()
    }

    #[test]
    fn debug_goes_first_and_replay_inputs_never() {
        let mut shedder = Shedder::default();
        assert_eq!(kept(&shedder).len(), channels::CHANNELS.len() + 1);
        shedder.see(51, 100);
        assert_eq!(
            kept(&shedder),
            [
                "RUN_INFO",
                "PARAMETER_CHANGE",
                "CONTROLLER_INPUT",
                "CONTROLLER_TICK",
                "ROBOT_COMMAND",
                "CONTROLLER_SNAPSHOT",
                "EVENT"
            ]
        );
        shedder.see(76, 100);
        assert_eq!(kept(&shedder), ["RUN_INFO", "PARAMETER_CHANGE", "CONTROLLER_INPUT", "EVENT"]);
        shedder.see(100, 100);
        assert_eq!(kept(&shedder), ["RUN_INFO", "PARAMETER_CHANGE", "CONTROLLER_INPUT", "EVENT"]);
    }

    #[test]
    fn what_was_left_out_comes_back_a_quarter_later() {
        let mut shedder = Shedder::default();
        let mut after = |waiting| {
            shedder.see(waiting, 100);
            shedder.keep()
        };
        assert_eq!([50, 51, 26, 25].map(&mut after), [Keep::All, Keep::Replay, Keep::Replay, Keep::All]);
        assert_eq!(
            [76, 51, 50, 26, 25].map(after),
            [Keep::Inputs, Keep::Inputs, Keep::Replay, Keep::Replay, Keep::All]
        );
    }

    #[test]
    fn the_disk_counts_too_and_a_vital_channel_stays() {
        let mut shedder = Shedder::new(Pattern::new("OTHER|LEG.*").ok());
        shedder.disk = Keep::Inputs;
        assert_eq!(kept(&shedder), ["RUN_INFO", "PARAMETER_CHANGE", "CONTROLLER_INPUT", "LEG_STATE", "EVENT", "OTHER"]);
    }

    #[test]
    fn each_loss_is_said_once() {
        let mut shedder = Shedder::default();
        for channel in ["B", "A", "B"] {
            shedder.left_out(channel);
        }
        assert_eq!(shedder.say(), "A 1, B 2");
        shedder.left_out("B");
        assert_eq!((shedder.say(), shedder.has_unsaid()), ("B 1".to_owned(), false));
        assert_eq!(shedder.total["B"], 3);
    }
}
