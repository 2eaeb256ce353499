//! Counts of computed outputs by channel, and which of them are missing in the log.

use crate::printable;

/// Outputs of one channel that are missing in the log.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct MissingOutputs {
    /// Channel.
    pub channel: String,
    /// Number of messages.
    pub count: u64,
    /// First tick without one.
    pub first_tick: i64,
}

impl MissingOutputs {
    /// One line for people.
    pub fn text(&self) -> String {
        let MissingOutputs { channel, count, first_tick } = self;
        format!("{count} messages of {} are missing, first at tick {first_tick}", printable(channel))
    }
}

/// Counts by channel, in the order of the first output. Counts of different parts of a log can be added in any order.
#[derive(Default)]
pub(super) struct OutputCounts(Vec<Outputs>);

struct Outputs {
    channel: String,
    recorded: u64,
    missing: u64,
    first_missing: Option<i64>,
}

impl OutputCounts {
    /// Counts an output of a computed tick.
    pub fn count(&mut self, channel: &str, tick: i64, is_recorded: bool) {
        self.count_all(channel, u64::from(is_recorded), u64::from(!is_recorded), (!is_recorded).then_some(tick));
    }

    /// Counts outputs of several computed ticks.
    pub fn count_all(&mut self, channel: &str, recorded: u64, missing: u64, first_missing: Option<i64>) {
        let ours = self.of(channel);
        ours.recorded += recorded;
        ours.missing += missing;
        ours.first_missing = ours.first_missing.into_iter().chain(first_missing).min();
    }

    pub fn add(&mut self, other: OutputCounts) {
        for Outputs { channel, recorded, missing, first_missing } in other.0 {
            self.count_all(&channel, recorded, missing, first_missing);
        }
    }

    /// Outputs that are not in the log, whether or not they should be.
    pub fn not_recorded(&self) -> u64 {
        self.0.iter().map(|outputs| outputs.missing).sum()
    }

    /// Outputs that are missing on channels that the log has for most ticks. A log may hold samples or a part of a channel.
    pub fn missing(&self) -> Vec<MissingOutputs> {
        let missing = |outputs: &Outputs| {
            let first_tick = outputs.first_missing.filter(|_| outputs.missing < outputs.recorded)?;
            Some(MissingOutputs { channel: outputs.channel.clone(), count: outputs.missing, first_tick })
        };
        let mut found: Vec<_> = self.0.iter().filter_map(missing).collect();
        found.sort_by(|a, b| (a.first_tick, &a.channel).cmp(&(b.first_tick, &b.channel)));
        found
    }

    fn of(&mut self, channel: &str) -> &mut Outputs {
        let at = self.0.iter().position(|outputs| outputs.channel == channel).unwrap_or_else(|| {
            self.0.push(Outputs { channel: channel.to_owned(), recorded: 0, missing: 0, first_missing: None });
            self.0.len() - 1
        });
        &mut self.0[at]
    }
}
