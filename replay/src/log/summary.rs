//! What is in a log, at a glance.

use super::sequence_gaps::{SequenceTracker, sequence_field, sequence_number};
use super::{EventRef, Format, Health, LogReader, RunClock, RunClockFinder, Types, Zero};
use crate::Error;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// What is in a log.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct LogSummary {
    /// Format of the file.
    pub format: Format,
    /// Messages.
    pub events: u64,
    /// Length of the file.
    pub bytes: u64,
    /// Time of the earliest event, ns.
    pub first_t_ns: Option<i64>,
    /// From the earliest to the latest event, s.
    pub duration_s: f64,
    /// What time zero of the tools is for this log.
    pub zero: Zero,
    /// Time zero in the clock of the log's events, ns.
    pub zero_t_ns: i64,
    /// Stretches that could not be read.
    pub damaged: u64,
    /// The file stops inside a record.
    pub cut: bool,
    /// Bytes that are in no event for these two reasons.
    pub bytes_skipped: u64,
    /// Messages that their counters (`seq`, `tick`) say are missing, over all channels.
    pub lost: u64,
    /// Channels by name.
    pub channels: Vec<ChannelSummary>,
}

/// What a log holds of one channel and type.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ChannelSummary {
    /// Channel.
    pub name: String,
    /// Type with package, if it is known here.
    #[serde(rename = "type")]
    pub type_name: Option<String>,
    /// Fingerprint in hexadecimal, if the messages are long enough to have one.
    pub fingerprint: Option<String>,
    /// Messages.
    pub count: u64,
    /// Messages per second, first to last; 0 for a single one.
    pub rate_hz: f64,
    /// Bytes of the messages.
    pub bytes: u64,
    /// Messages that the counter skips. `None` if the type has no counter, or not one that counts every message.
    pub lost: Option<u64>,
}

/// What is counted of a channel.
struct Tally {
    has_counter: bool,
    type_name: Option<String>,
    count: u64,
    bytes: u64,
    first: i64,
    last: i64,
    numbers: SequenceTracker,
}

impl LogSummary {
    /// Reads a log from end to end.
    ///
    /// # Errors
    /// As [`LogReader::open`], or [`Error::Io`] on the way.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::read_with(path, Types::default())
    }

    /// [`LogSummary::read`] of a log whose types others describe.
    ///
    /// # Errors
    /// As [`LogSummary::read`].
    pub fn read_with(path: impl AsRef<Path>, mut types: Types) -> Result<Self, Error> {
        let mut reader = LogReader::open(path)?;
        let (format, bytes) = (reader.format(), reader.bytes());
        let mut tallies = BTreeMap::new();
        let (mut health, mut clock) = (Health::default(), RunClockFinder::default());
        while let Some(item) = reader.read()? {
            let Some(event) = health.note(item) else { continue };
            clock.see(&event);
            types.learn(&event);
            let key = (Arc::clone(event.channel), event.fingerprint());
            tallies.entry(key).or_insert_with(|| Tally::new(&event, &types)).add(&event);
        }
        Ok(summarise(format, bytes, &tallies, &health, &clock.clock()))
    }
}

fn summarise(
    format: Format,
    bytes: u64,
    tallies: &BTreeMap<(Arc<str>, Option<u64>), Tally>,
    health: &Health,
    clock: &RunClock,
) -> LogSummary {
    let first_t_ns = tallies.values().map(|t| t.first).min();
    let last = tallies.values().map(|t| t.last).max();
    let channels: Vec<_> =
        tallies.iter().map(|((name, fingerprint), tally)| tally.summary(name, *fingerprint)).collect();
    LogSummary {
        format,
        events: tallies.values().map(|t| t.count).sum(),
        bytes,
        first_t_ns,
        zero: clock.zero(),
        zero_t_ns: clock.origin_ns(),
        duration_s: first_t_ns.zip(last).map_or(0.0, |(first, last)| seconds(first, last)),
        damaged: health.damaged.len() as u64,
        cut: health.cut.is_some(),
        bytes_skipped: health.bytes_skipped(),
        lost: channels.iter().filter_map(|c| c.lost).sum(),
        channels,
    }
}

impl Tally {
    fn new(event: &EventRef, types: &Types) -> Self {
        let ty = types.of_message(event.channel, event.data);
        // A type of another encoding has a name, at least.
        let named = event.schema.filter(|schema| schema.encoding != "lcm").map(|schema| schema.name.clone());
        Tally {
            has_counter: ty.and_then(sequence_field).is_some(),
            type_name: ty.map(|ty| ty.name().to_owned()).or(named),
            count: 0,
            bytes: 0,
            first: event.t_ns,
            last: event.t_ns,
            numbers: SequenceTracker::default(),
        }
    }

    fn add(&mut self, event: &EventRef) {
        self.count += 1;
        self.bytes += event.data.len() as u64;
        self.first = self.first.min(event.t_ns);
        self.last = self.last.max(event.t_ns);
        if self.has_counter
            && let Some(number) = sequence_number(event.data)
        {
            self.numbers.add(number, event.t_ns);
        }
    }

    fn summary(&self, name: &str, fingerprint: Option<u64>) -> ChannelSummary {
        let span = seconds(self.first, self.last);
        ChannelSummary {
            name: name.to_owned(),
            type_name: self.type_name.clone(),
            fingerprint: fingerprint.map(|f| format!("{f:016x}")),
            count: self.count,
            rate_hz: if span > 0.0 { (self.count - 1) as f64 / span } else { 0.0 },
            bytes: self.bytes,
            lost: self.numbers.lost().filter(|_| self.has_counter),
        }
    }
}

pub(super) fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}
