//! What is in a log, at a glance.

use super::schema::type_of;
use super::{Event, Format, Health, LogReader};
use crate::Error;
use lcm_idl::Type;
use lcm_idl::ast::{FieldType, Primitive};
use std::collections::BTreeMap;
use std::path::Path;

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
    counter: Option<&'static str>,
    type_name: Option<&'static str>,
    count: u64,
    bytes: u64,
    first: i64,
    last: i64,
    numbers: Option<Numbers>,
}

/// The values of a counter: what lies between the lowest and the highest and never came is lost.
struct Numbers {
    lowest: i64,
    highest: i64,
}

impl LogSummary {
    /// Reads a log from end to end.
    ///
    /// # Errors
    /// As [`LogReader::open`], or [`Error::Io`] on the way.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let reader = LogReader::open(path)?;
        let (format, bytes) = (reader.format(), reader.bytes());
        let mut tallies = BTreeMap::new();
        let mut events = reader.events();
        for event in events.by_ref() {
            let event = event?;
            let fingerprint = event.fingerprint();
            let key = (event.channel.to_string(), fingerprint);
            tallies.entry(key).or_insert_with(|| Tally::new(&event)).add(&event);
        }
        Ok(summarise(format, bytes, &tallies, events.health()))
    }
}

fn summarise(
    format: Format,
    bytes: u64,
    tallies: &BTreeMap<(String, Option<u64>), Tally>,
    health: &Health,
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
        duration_s: first_t_ns.zip(last).map_or(0.0, |(first, last)| seconds(first, last)),
        damaged: health.damaged.len() as u64,
        cut: health.cut.is_some(),
        bytes_skipped: health.bytes_skipped(),
        lost: channels.iter().filter_map(|c| c.lost).sum(),
        channels,
    }
}

impl Tally {
    fn new(event: &Event) -> Self {
        let ty = event.fingerprint().and_then(|fingerprint| type_of(&event.channel, fingerprint));
        Tally {
            counter: ty.and_then(counter),
            type_name: ty.map(|ty| ty.name()),
            count: 0,
            bytes: 0,
            first: event.t_ns,
            last: event.t_ns,
            numbers: None,
        }
    }

    fn add(&mut self, event: &Event) {
        self.count += 1;
        self.bytes += event.data.len() as u64;
        self.first = self.first.min(event.t_ns);
        self.last = self.last.max(event.t_ns);
        if self.counter.is_some()
            && let Some(number) = second_integer(&event.data)
        {
            let numbers = self.numbers.get_or_insert(Numbers { lowest: number, highest: number });
            numbers.lowest = numbers.lowest.min(number);
            numbers.highest = numbers.highest.max(number);
        }
    }

    fn summary(&self, name: &str, fingerprint: Option<u64>) -> ChannelSummary {
        let span = seconds(self.first, self.last);
        ChannelSummary {
            name: name.to_owned(),
            type_name: self.type_name.map(str::to_owned),
            fingerprint: fingerprint.map(|f| format!("{f:016x}")),
            count: self.count,
            rate_hz: if span > 0.0 { (self.count - 1) as f64 / span } else { 0.0 },
            bytes: self.bytes,
            lost: self.lost(),
        }
    }

    fn lost(&self) -> Option<u64> {
        let Numbers { lowest, highest } = self.numbers.as_ref()?;
        let span = highest.checked_sub(*lowest)?.checked_add(1)?;
        let lost = u64::try_from(span).ok()?.saturating_sub(self.count);
        // A channel that comes in every tenth tick has lost nothing: only most of a sequence is a sequence.
        (lost < self.count).then_some(lost)
    }
}

/// Name of the counter that stands behind the time in a type: `seq` or `tick`.
fn counter(ty: Type<'static>) -> Option<&'static str> {
    let [time, second, ..] = &ty.def().fields[..] else { return None };
    let integer = |field: &lcm_idl::ast::Field| {
        field.dims.is_empty() && matches!(field.ty, FieldType::Primitive(Primitive::Int64))
    };
    let named = ["seq", "tick"].into_iter().find(|name| **name == *second.name);
    named.filter(|_| integer(time) && integer(second) && *time.name == *"t_ns")
}

/// The second `int64_t` of a message, behind fingerprint and time.
fn second_integer(message: &[u8]) -> Option<i64> {
    message.get(16..24)?.first_chunk().map(|bytes| i64::from_be_bytes(*bytes))
}

fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}
