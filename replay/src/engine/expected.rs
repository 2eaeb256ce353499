//! Which outputs a log should contain, computed from those it contains.

use super::outputs::OutputCounts;
use lcmtypes::channels::CONTROLLER_SNAPSHOT;
use std::sync::Arc;

/// Groups of ticks that are kept apart; a hostile log may have any number.
const MAX_GROUPS: usize = 64;

/// Outputs of the ticks that can be computed, grouped by the controllers that run: the same controllers have the same outputs in every tick, and their
/// state in every `snapshot_ticks`-th.
pub(super) struct ExpectedOutputs {
    groups: Vec<Group>,
    snapshot_ticks: i64,
}

struct Group {
    /// Bits of the controllers that run, and whether it is the group of the snapshots.
    key: (i64, bool),
    first_tick: i64,
    ticks: u64,
    outputs: Vec<Output>,
}

struct Output {
    channel: Arc<str>,
    recorded: u64,
    first_missing: Option<i64>,
}

impl ExpectedOutputs {
    /// - `snapshot_ticks`: as of [`controller::time::snapshot_ticks`].
    pub fn new(snapshot_ticks: i64) -> Self {
        ExpectedOutputs { groups: Vec::new(), snapshot_ticks }
    }

    /// Takes a tick with the channels of its recorded outputs. `running`: as in its input.
    pub fn take<'c>(&mut self, tick: i64, running: i64, recorded: impl Iterator<Item = &'c Arc<str>> + Clone) {
        let is_snapshot = |channel: &&Arc<str>| ***channel == *CONTROLLER_SNAPSHOT;
        self.take_group((running, false), tick, recorded.clone().filter(|channel| !is_snapshot(channel)));
        if tick % self.snapshot_ticks == 0 {
            self.take_group((running, true), tick, recorded.filter(is_snapshot));
        }
    }

    fn take_group<'c>(&mut self, key: (i64, bool), tick: i64, recorded: impl Iterator<Item = &'c Arc<str>> + Clone) {
        let at = self.groups.iter().position(|group| group.key == key).unwrap_or(self.groups.len());
        if at == self.groups.len() {
            if at == MAX_GROUPS {
                return;
            }
            self.groups.push(Group { key, first_tick: tick, ticks: 0, outputs: Vec::new() });
        }
        let group = &mut self.groups[at];
        for output in &mut group.outputs {
            if recorded.clone().any(|channel| *channel == output.channel) {
                output.recorded += 1;
            } else {
                output.first_missing.get_or_insert(tick);
            }
        }
        for channel in recorded {
            if group.outputs.iter().all(|output| output.channel != *channel) {
                let first_missing = (group.ticks > 0).then_some(group.first_tick);
                group.outputs.push(Output { channel: Arc::clone(channel), recorded: 1, first_missing });
            }
        }
        group.ticks += 1;
    }

    /// Counts by channel.
    pub fn counts(&self) -> OutputCounts {
        let mut counts = OutputCounts::default();
        for Group { ticks, outputs, .. } in &self.groups {
            for Output { channel, recorded, first_missing } in outputs {
                counts.count_all(channel, *recorded, ticks - recorded, *first_missing);
            }
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::MissingOutputs;

    /// Ticks with their running controllers and outputs.
    fn missing(ticks: impl Iterator<Item = (i64, i64, Vec<&'static str>)>) -> Vec<(String, u64, i64)> {
        let mut expected = ExpectedOutputs::new(1000);
        for (tick, running, channels) in ticks {
            let channels: Vec<Arc<str>> = channels.into_iter().map(Arc::from).collect();
            expected.take(tick, running, channels.iter());
        }
        let of = |MissingOutputs { channel, count, first_tick }: MissingOutputs| (channel, count, first_tick);
        expected.counts().missing().into_iter().map(of).collect()
    }

    #[test]
    fn an_output_is_expected_in_every_tick_with_the_same_controllers() {
        let complete = |tick: i64| match tick {
            0..10 => (tick, 1, vec!["A", "B"]),
            _ => (tick, 0, vec!["A"]),
        };
        assert_eq!(missing((0..20).map(complete)), []);
        let without = |dropped: i64, channel: &'static str| {
            (0..20).map(complete).map(move |(tick, running, mut channels)| {
                channels.retain(|c| tick != dropped || *c != channel);
                (tick, running, channels)
            })
        };
        assert_eq!(missing(without(0, "B")), [("B".to_owned(), 1, 0)]);
        assert_eq!(missing(without(9, "B")), [("B".to_owned(), 1, 9)]);
        assert_eq!(missing(without(15, "A")), [("A".to_owned(), 1, 15)]);
    }

    #[test]
    fn snapshots_are_expected_at_their_period() {
        let complete = |tick: i64| {
            let channels = if tick % 1000 == 0 { vec!["A", CONTROLLER_SNAPSHOT] } else { vec!["A"] };
            (tick, 1, channels)
        };
        assert_eq!(missing((1..5001).map(complete)), []);
        let dropped = (1..5001).map(complete).map(|(tick, running, mut channels)| {
            channels.truncate(if tick == 2000 { 1 } else { 2 });
            (tick, running, channels)
        });
        assert_eq!(missing(dropped), [(CONTROLLER_SNAPSHOT.to_owned(), 1, 2000)]);
    }
}
