//! Drop policy under overload: debug channels are dropped first, replay inputs never.

use super::Pattern;
use lcmtypes::channels::{self, Class};
use std::collections::BTreeMap;

/// Which channels are recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordLevel {
    /// Every channel.
    #[default]
    All,
    /// Channels that a replay needs or compares; debug channels and channels unknown to this stack are dropped.
    Replay,
    /// Only channels that a replay needs.
    Inputs,
}

impl RecordLevel {
    /// Text for EVENT messages and screens.
    pub fn text(self) -> &'static str {
        match self {
            RecordLevel::All => "all channels are recorded",
            RecordLevel::Replay => "debug channels are not recorded",
            RecordLevel::Inputs => "only channels that a replay needs are recorded",
        }
    }

    fn takes(self, class: Option<Class>) -> bool {
        match class {
            Some(Class::Meta | Class::ReplayInput) => true,
            Some(Class::Output) => self <= RecordLevel::Replay,
            Some(Class::Debug | Class::Truth | Class::Timing) | None => self == RecordLevel::All,
        }
    }
}

/// Decides for each message whether it is recorded, and counts the dropped ones.
#[derive(Default)]
pub(super) struct DropPolicy {
    /// Channels that are never dropped, in addition to the replay inputs.
    vital: Option<Pattern>,
    /// Level permitted by the free disk space.
    pub disk: RecordLevel,
    /// Level permitted by the free space in the ring.
    ring: RecordLevel,
    /// Messages dropped since the last report.
    unreported: BTreeMap<String, u64>,
    /// Dropped messages by channel.
    pub total: BTreeMap<String, u64>,
}

impl DropPolicy {
    /// A policy that never drops channels that match `vital`.
    pub fn new(vital: Option<Pattern>) -> Self {
        DropPolicy { vital, ..Self::default() }
    }

    /// Level in use.
    pub fn level(&self) -> RecordLevel {
        self.disk.max(self.ring)
    }

    /// Sets the level from the fill of the ring. The thresholds have a hysteresis of a quarter of the ring, so that the level does not
    /// change with every message.
    pub fn update(&mut self, waiting: usize, capacity: usize) {
        let quarters = |n: usize| capacity / 4 * n;
        self.ring = match self.ring {
            _ if waiting > quarters(3) => RecordLevel::Inputs,
            RecordLevel::Inputs if waiting > quarters(2) => RecordLevel::Inputs,
            _ if waiting > quarters(2) => RecordLevel::Replay,
            RecordLevel::Replay | RecordLevel::Inputs if waiting > quarters(1) => RecordLevel::Replay,
            _ => RecordLevel::All,
        };
    }

    /// Whether a message of this channel is recorded.
    pub fn takes(&self, channel: &str) -> bool {
        let level = self.level();
        level == RecordLevel::All
            || level.takes(channels::find(channel).map(|c| c.class))
            || self.vital.as_ref().is_some_and(|vital| vital.matches(channel))
    }

    /// Counts a dropped message.
    pub fn count_dropped(&mut self, channel: &str) {
        for counts in [&mut self.unreported, &mut self.total] {
            match counts.get_mut(channel) {
                Some(count) => *count += 1,
                None => drop(counts.insert(channel.to_owned(), 1)),
            }
        }
    }

    /// Whether messages were dropped since the last report.
    pub fn has_unreported(&self) -> bool {
        !self.unreported.is_empty()
    }

    /// Messages dropped since the last call: `ROBOT_STATE 120, LEG_STATE 7`.
    pub fn take_report(&mut self) -> String {
        let report: Vec<_> =
            std::mem::take(&mut self.unreported).iter().map(|(name, n)| format!("{name} {n}")).collect();
        report.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(policy: &DropPolicy) -> Vec<&'static str> {
        channels::CHANNELS.iter().map(|c| c.name).chain(["OTHER"]).filter(|name| policy.takes(name)).collect()
    }

    #[test]
    fn debug_channels_are_dropped_first_and_replay_inputs_never() {
        let mut policy = DropPolicy::default();
        assert_eq!(kept(&policy).len(), channels::CHANNELS.len() + 1);
        policy.update(51, 100);
        assert_eq!(
            kept(&policy),
            [
                "RUN_INFO",
                "ROBOT_INFO",
                "EXPECTED_ROBOT",
                "PARAMETER_CHANGE",
                "CONTROLLER_INPUT",
                "CONTROLLER_TICK",
                "ROBOT_COMMAND",
                "CONTROLLER_SNAPSHOT",
                "EVENT"
            ]
        );
        let vital = ["RUN_INFO", "ROBOT_INFO", "EXPECTED_ROBOT", "PARAMETER_CHANGE", "CONTROLLER_INPUT", "EVENT"];
        policy.update(76, 100);
        assert_eq!(kept(&policy), vital);
        policy.update(100, 100);
        assert_eq!(kept(&policy), vital);
    }

    #[test]
    fn channels_are_recorded_again_below_the_hysteresis() {
        let mut policy = DropPolicy::default();
        let mut after = |waiting| {
            policy.update(waiting, 100);
            policy.level()
        };
        assert_eq!(
            [50, 51, 26, 25].map(&mut after),
            [RecordLevel::All, RecordLevel::Replay, RecordLevel::Replay, RecordLevel::All]
        );
        assert_eq!(
            [76, 51, 50, 26, 25].map(after),
            [RecordLevel::Inputs, RecordLevel::Inputs, RecordLevel::Replay, RecordLevel::Replay, RecordLevel::All]
        );
    }

    #[test]
    fn low_disk_space_drops_channels_except_vital_ones() {
        let mut policy = DropPolicy::new(Pattern::new("OTHER|LEG.*").ok());
        policy.disk = RecordLevel::Inputs;
        let (vital, named) = (["RUN_INFO", "ROBOT_INFO", "EXPECTED_ROBOT"], ["LEG_STATE", "EVENT", "OTHER"]);
        let kept_inputs = ["PARAMETER_CHANGE", "CONTROLLER_INPUT"];
        assert_eq!(kept(&policy), [&vital[..], &kept_inputs, &named].concat());
    }

    #[test]
    fn each_drop_is_reported_once() {
        let mut policy = DropPolicy::default();
        for channel in ["B", "A", "B"] {
            policy.count_dropped(channel);
        }
        assert_eq!(policy.take_report(), "A 1, B 2");
        policy.count_dropped("B");
        assert_eq!((policy.take_report(), policy.has_unreported()), ("B 1".to_owned(), false));
        assert_eq!(policy.total["B"], 3);
    }
}
