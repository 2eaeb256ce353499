//! Summary of a log: channels, types, counts, rates, damage.

use super::sequence_gaps::{SequenceTracker, sequence_field, sequence_number};
use super::{EventRef, Format, Health, LogReader, RunClock, RunClockFinder, RunSummary, Runs, Types, Zero, split_run};
use crate::Error;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Summary of a log.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct LogSummary {
    /// Format of the file.
    pub format: Format,
    /// Number of events.
    pub events: u64,
    /// Length of the file, bytes.
    pub bytes: u64,
    /// Time of the earliest event, ns.
    pub first_t_ns: Option<i64>,
    /// Time from the earliest to the latest event, s.
    pub duration_s: f64,
    /// Event that defines time zero of the tools for this log.
    pub zero: Zero,
    /// Time zero in the clock of the log's events, ns.
    pub zero_t_ns: i64,
    /// Damaged ranges.
    pub damaged: u64,
    /// The file ends inside a record.
    pub cut: bool,
    /// Bytes in damaged ranges and the incomplete last record.
    pub bytes_skipped: u64,
    /// Lost messages over all channels, from the gaps in their sequence numbers (`seq`, `tick`).
    pub lost: u64,
    /// The runs of the log, in the order in which they begin.
    pub runs: Vec<RunSummary>,
    /// Channels by name.
    pub channels: Vec<ChannelSummary>,
}

/// Summary of one channel and type.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ChannelSummary {
    /// Channel.
    pub name: String,
    /// Type with package, or `one of A, B`; `None` if unknown.
    #[serde(rename = "type")]
    pub type_name: Option<String>,
    /// Fingerprint in hexadecimal; `None` if the messages are shorter than one, or of several unknown types.
    pub fingerprint: Option<String>,
    /// Messages.
    pub count: u64,
    /// Mean rate from the first to the last message, Hz; 0 for a single message.
    pub rate_hz: f64,
    /// Size of the messages, bytes.
    pub bytes: u64,
    /// Lost messages, from gaps in the sequence number. `None` without a sequence number, or if the channel does not carry every number.
    pub lost: Option<u64>,
}

/// Rows of a summary; further channels share one row.
const MAX_ROWS: usize = 10_000;

/// Name of the row of the channels beyond [`MAX_ROWS`].
const OTHERS: &str = "(further channels)";

/// Statistics of a channel while the log is read.
struct ChannelStats {
    has_counter: bool,
    /// Fingerprint of its messages; `None` if a message has none or they differ.
    fingerprint: Option<u64>,
    type_name: Option<String>,
    count: u64,
    bytes: u64,
    first: i64,
    last: i64,
    sequence: SequenceTracker,
}

impl LogSummary {
    /// Reads a log from start to end.
    ///
    /// # Errors
    /// As [`LogReader::open`] and [`LogReader::read`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::read_with(path, Types::default())
    }

    /// [`LogSummary::read`] with further types.
    ///
    /// # Errors
    /// As [`LogSummary::read`].
    pub fn read_with(path: impl AsRef<Path>, mut types: Types) -> Result<Self, Error> {
        let mut reader = LogReader::open(&path)?;
        let (format, bytes) = (reader.format(), reader.bytes());
        let (mut stats, mut runs): (BTreeMap<_, ChannelStats>, _) = (BTreeMap::new(), Runs::default());
        let others: Arc<str> = Arc::from(OTHERS);
        let (mut health, mut clock) = (Health::default(), RunClockFinder::default());
        while let Some(item) = reader.read()? {
            let Some(event) = health.note(item) else { continue };
            clock.see(&event);
            runs.see(&event);
            types.learn(&event);
            // Messages of unknown type share a row: bytes that are no LCM messages seem to have a new type each time.
            let fingerprint = event.fingerprint().filter(|&f| types.of(event.channel, f).is_some());
            let mut key = (Arc::clone(event.channel), fingerprint);
            if stats.len() >= MAX_ROWS && !stats.contains_key(&key) {
                key = (Arc::clone(&others), None);
            }
            stats.entry(key).or_insert_with(|| ChannelStats::new(&event, &types)).add(&event);
        }
        let mut runs = runs.summaries().to_vec();
        if let (_, Some(selected)) = split_run(path.as_ref()) {
            runs.iter_mut().for_each(|run| run.number = selected);
        }
        Ok(LogSummary { runs, ..summarize(format, bytes, &stats, &health, &clock.clock()) })
    }
}

fn summarize(
    format: Format,
    bytes: u64,
    stats: &BTreeMap<(Arc<str>, Option<u64>), ChannelStats>,
    health: &Health,
    clock: &RunClock,
) -> LogSummary {
    let first_t_ns = stats.values().map(|t| t.first).min();
    let last = stats.values().map(|t| t.last).max();
    let channels: Vec<_> = stats.iter().map(|((name, _), channel)| channel.summary(name)).collect();
    LogSummary {
        format,
        events: stats.values().map(|t| t.count).sum(),
        bytes,
        first_t_ns,
        zero: clock.zero(),
        zero_t_ns: clock.origin_ns(),
        duration_s: first_t_ns.zip(last).map_or(0.0, |(first, last)| seconds(first, last)),
        damaged: health.damaged.len() as u64,
        cut: health.cut.is_some(),
        bytes_skipped: health.bytes_skipped(),
        lost: channels.iter().filter_map(|c| c.lost).sum(),
        runs: Vec::new(),
        channels,
    }
}

impl ChannelStats {
    fn new(event: &EventRef, types: &Types) -> Self {
        let ty = types.of_message(event.channel, event.data);
        // For a schema in another language at least the type name is known.
        let named = event.schema().filter(|schema| schema.encoding != "lcm").map(|schema| schema.name.clone());
        ChannelStats {
            has_counter: ty.and_then(sequence_field).is_some(),
            type_name: types.name_of(event.channel, event.data).or(named),
            fingerprint: event.fingerprint(),
            count: 0,
            bytes: 0,
            first: event.t_ns,
            last: event.t_ns,
            sequence: SequenceTracker::default(),
        }
    }

    fn add(&mut self, event: &EventRef) {
        self.count += 1;
        self.fingerprint = self.fingerprint.filter(|_| self.fingerprint == event.fingerprint());
        self.bytes += event.data.len() as u64;
        self.first = self.first.min(event.t_ns);
        self.last = self.last.max(event.t_ns);
        if self.has_counter
            && let Some(number) = sequence_number(event.data)
        {
            self.sequence.add(number, event.t_ns);
        }
    }

    fn summary(&self, name: &str) -> ChannelSummary {
        let span = seconds(self.first, self.last);
        ChannelSummary {
            name: name.to_owned(),
            type_name: self.type_name.clone(),
            fingerprint: self.fingerprint.map(|f| format!("{f:016x}")),
            count: self.count,
            rate_hz: if span > 0.0 { (self.count - 1) as f64 / span } else { 0.0 },
            bytes: self.bytes,
            lost: self.sequence.lost().filter(|_| self.has_counter),
        }
    }
}

pub(super) fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}
