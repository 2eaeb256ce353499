//! Compares two logs channel by channel: missing messages, and the first differing message and field.
//!
//! Messages of a channel are matched by sequence number (`seq`, `tick`) if their type has one, otherwise by content, so that a missing message
//! counts as missing and the messages after it still match. A message that both logs have at different places of the channel counts as
//! reordered, not as missing. If the channels of the logs are far apart in the files, each channel is read on its own.

use super::sequence_gaps::{sequence_field, sequence_number};
use super::{Event, EventFilter, EventRef, Health, LogReader, RunClock, Types};
use crate::Error;
use crate::engine::show;
use std::collections::{BTreeMap, VecDeque};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::sync::Arc;

/// Unmatched messages buffered per channel and side; beyond that the channel is compared on its own.
const MAX_UNMATCHED: usize = 4096;
/// Messages ahead in which an equal message is searched.
const WINDOW: usize = 64;
/// Missing messages per channel and side among which reordered ones are found.
const MAX_ABSENT: usize = 1 << 16;
/// Limit of their size, bytes.
const MAX_UNMATCHED_BYTES: usize = 64 << 20;

/// Differences between two logs.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct LogDiff {
    /// Every channel has equal messages at equal times in the same order.
    pub identical: bool,
    /// Selected messages of the first log.
    pub left_events: u64,
    /// Selected messages of the second log.
    pub right_events: u64,
    /// Damaged ranges and cuts of both logs.
    pub damaged: u64,
    /// Channels by name.
    pub channels: Vec<ChannelDiff>,
}

/// Differences in one channel.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct ChannelDiff {
    /// Channel.
    pub name: String,
    /// No difference.
    pub identical: bool,
    /// Messages in the first log.
    pub left: u64,
    /// Messages in the second log.
    pub right: u64,
    /// Matched messages whose bytes differ.
    pub different: u64,
    /// Matched messages with equal bytes and different log times.
    pub times_different: u64,
    /// Messages in the first log only.
    pub left_only: u64,
    /// Messages in the second log only.
    pub right_only: u64,
    /// Messages that both logs have, at different places of the channel.
    pub reordered: u64,
    /// The first differing or missing message.
    pub first: Option<FirstDifference>,
}

/// The first difference of a channel.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct FirstDifference {
    /// Log time of the message, ns.
    pub t_ns: i64,
    /// The same, s since the run's first tick.
    pub t_s: f64,
    /// Its sequence number (`seq`, `tick`), or its index in the channel from 0.
    pub number: i64,
    /// Field, such as `state.q[3]`; `time` if only the log times differ; `byte N` for an unknown type; empty if the message is missing in
    /// one log.
    pub field: String,
    /// Value in the first log; floats in hexadecimal and decimal.
    pub left: String,
    /// Value in the second log.
    pub right: String,
    /// Distance in units in the last place; `None` unless both values are floats and not NaN.
    pub ulp: Option<u64>,
}

/// Compares two logs. `progress` receives the fraction read, 0 to 1.
///
/// # Errors
/// As [`LogReader::open`] and [`LogReader::read`].
pub fn diff(
    left: &Path,
    right: &Path,
    filter: &EventFilter,
    types: Types,
    progress: &mut dyn FnMut(f64),
) -> Result<LogDiff, Error> {
    let mut sides = [Input::open(left, filter)?, Input::open(right, filter)?];
    let mut comparison = Comparison { types, pairs: BTreeMap::new() };
    let total: u64 = sides.iter().map(|side| side.reader.bytes()).sum();
    let mut steps = 0_u64;
    while sides.iter().any(|side| !side.over) {
        // Read from the log that is behind in time, so that few messages are buffered.
        let behind = usize::from(sides[0].over || !sides[1].over && sides[1].since < sides[0].since);
        comparison.step(&mut sides[behind], behind)?;
        steps += 1;
        if steps.is_multiple_of(4096) {
            progress(sides.iter().map(|side| side.offset).sum::<u64>() as f64 / total.max(1) as f64);
        }
    }
    let far_apart: Vec<_> =
        comparison.pairs.iter().filter(|(_, pair)| pair.is_far_apart).map(|(name, _)| Arc::clone(name)).collect();
    for name in far_apart {
        let mut inputs = [Input::open(left, filter)?, Input::open(right, filter)?];
        comparison.channel(&name, &mut inputs)?;
    }
    let damaged = sides.iter().map(|s| s.health.damaged.len() as u64 + u64::from(s.health.cut.is_some())).sum();
    Ok(comparison.finish(damaged))
}

struct Input {
    reader: LogReader,
    filter: EventFilter,
    clock: RunClock,
    health: Health,
    first: Option<i64>,
    /// Time of the last event, ns since the first.
    since: i64,
    offset: u64,
    over: bool,
}

impl Input {
    fn open(log: &Path, filter: &EventFilter) -> Result<Self, Error> {
        let reader = LogReader::open(log)?;
        let (filter, clock, health) = (filter.for_log(log)?, RunClock::read(log)?, Health::default());
        Ok(Input { reader, filter, clock, health, first: None, since: 0, offset: 0, over: false })
    }
}

/// A buffered message without a match so far.
struct Unmatched {
    event: Event,
    number: i64,
    /// Time since the run's first tick, s.
    t_s: f64,
}

#[derive(Default)]
struct ChannelPair {
    has_counter: bool,
    counts: [u64; 2],
    unmatched: [VecDeque<Unmatched>; 2],
    bytes: [usize; 2],
    diff: ChannelDiff,
    /// Missing messages by content.
    absent: [BTreeMap<u64, Vec<FirstDifference>>; 2],
    absent_count: [usize; 2],
    /// Too many messages were unmatched: the channel has to be read on its own.
    is_far_apart: bool,
}

struct Comparison {
    types: Types,
    pairs: BTreeMap<Arc<str>, ChannelPair>,
}

impl Comparison {
    fn step(&mut self, side: &mut Input, which: usize) -> Result<(), Error> {
        let Some(item) = side.reader.read()? else {
            side.over = true;
            return Ok(());
        };
        let Some(event) = side.health.note(item) else { return Ok(()) };
        side.since = event.t_ns.saturating_sub(*side.first.get_or_insert(event.t_ns));
        side.offset = event.offset;
        self.types.learn(&event);
        if side.filter.accepts(&event) {
            let t_s = side.clock.of_event(&event) as f64 * 1e-9;
            self.add(&event, t_s, which);
        }
        Ok(())
    }

    fn add(&mut self, event: &EventRef<'_>, t_s: f64, which: usize) {
        let types = &self.types;
        if !self.pairs.contains_key(event.channel) {
            let ty = types.of_message(event.channel, event.data);
            let has_counter = ty.and_then(sequence_field).is_some();
            self.pairs.insert(Arc::clone(event.channel), ChannelPair { has_counter, ..ChannelPair::default() });
        }
        let Some(pair) = self.pairs.get_mut(event.channel).filter(|pair| !pair.is_far_apart) else { return };
        pair.push(event, t_s, which);
        pair.match_messages(types, false);
        if pair.unmatched[which].len() > MAX_UNMATCHED || pair.bytes[which] > MAX_UNMATCHED_BYTES {
            *pair = ChannelPair { has_counter: pair.has_counter, is_far_apart: true, ..ChannelPair::default() };
        }
    }

    /// Compares one channel, message by message, each log at its own pace.
    fn channel(&mut self, name: &Arc<str>, sides: &mut [Input; 2]) -> Result<(), Error> {
        let Comparison { types, pairs } = self;
        let Some(pair) = pairs.get_mut(name) else { return Ok(()) };
        while sides.iter().any(|side| !side.over) {
            let over = [sides[0].over, sides[1].over];
            for (which, side) in sides.iter_mut().enumerate() {
                // The log with fewer unmatched messages goes on to its next message.
                let is_behind = pair.unmatched[which].len() <= pair.unmatched[1 - which].len();
                while !side.over && (is_behind || over[1 - which]) {
                    let Some(item) = side.reader.read()? else {
                        side.over = true;
                        break;
                    };
                    let Some(event) = side.health.note(item) else { continue };
                    if **event.channel == **name && side.filter.accepts(&event) {
                        let t_s = side.clock.of_event(&event) as f64 * 1e-9;
                        pair.push(&event, t_s, which);
                        break;
                    }
                }
            }
            pair.match_messages(types, false);
            let is_over = sides.iter().any(|side| side.over);
            for which in [0, 1] {
                while is_over && pair.unmatched[which].len() > MAX_UNMATCHED {
                    pair.count_missing(which);
                }
            }
        }
        Ok(())
    }

    fn finish(mut self, damaged: u64) -> LogDiff {
        let mut all = LogDiff { damaged, ..LogDiff::default() };
        for (name, pair) in &mut self.pairs {
            pair.match_messages(&self.types, true);
            for which in [0, 1] {
                while !pair.unmatched[which].is_empty() {
                    pair.count_missing(which);
                }
            }
            let ChannelDiff { different, times_different, left_only, right_only, reordered, first, .. } =
                std::mem::take(&mut pair.diff);
            let absent = std::mem::take(&mut pair.absent).into_iter().flatten().flat_map(|(_, absent)| absent);
            let first = first.into_iter().chain(absent).min_by(|a, b| a.t_s.total_cmp(&b.t_s));
            let identical = different + times_different + left_only + right_only + reordered == 0;
            let ([left, right], name) = (pair.counts, name.to_string());
            all.left_events += left;
            all.right_events += right;
            all.channels.push(ChannelDiff {
                name,
                identical,
                left,
                right,
                different,
                times_different,
                left_only,
                right_only,
                reordered,
                first,
            });
        }
        all.identical = damaged == 0 && all.channels.iter().all(|channel| channel.identical);
        all
    }
}

impl ChannelPair {
    fn push(&mut self, event: &EventRef<'_>, t_s: f64, which: usize) {
        let place = self.counts[which] as i64;
        let number = sequence_number(event.data).filter(|_| self.has_counter).unwrap_or(place);
        self.counts[which] += 1;
        self.bytes[which] += event.data.len();
        self.unmatched[which].push_back(Unmatched { event: event.to_event(), number, t_s });
    }

    /// Compares buffered messages that match. `at_end`: no further messages follow.
    fn match_messages(&mut self, types: &Types, at_end: bool) {
        while let (Some(left), Some(right)) = (self.unmatched[0].front(), self.unmatched[1].front()) {
            if self.has_counter {
                match left.number.cmp(&right.number) {
                    std::cmp::Ordering::Less => self.count_missing(0),
                    std::cmp::Ordering::Greater => self.count_missing(1),
                    std::cmp::Ordering::Equal => self.compare(types),
                }
                continue;
            }
            if left.event.data == right.event.data {
                self.compare(types);
                continue;
            }
            if !at_end && self.unmatched.iter().any(|side| side.len() < WINDOW) {
                return;
            }
            // The nearest equal message shows how many are missing on the other side.
            let ahead = |of: usize, head: &Unmatched| {
                let mut candidates = self.unmatched[of].iter().take(WINDOW);
                candidates.position(|other| other.event.data == head.event.data)
            };
            match (ahead(1, left), ahead(0, right)) {
                (Some(n), other) if other.is_none_or(|other| n <= other) => (0..n).for_each(|_| self.count_missing(1)),
                (_, Some(n)) => (0..n).for_each(|_| self.count_missing(0)),
                _ => self.compare(types),
            }
        }
    }

    fn pop(&mut self, which: usize) -> Option<Unmatched> {
        let popped = self.unmatched[which].pop_front()?;
        self.bytes[which] -= popped.event.data.len();
        Some(popped)
    }

    /// Counts the oldest buffered message of a side as missing on the other side.
    fn count_missing(&mut self, which: usize) {
        let Some(Unmatched { event, number, t_s }) = self.pop(which) else { return };
        let mut hasher = DefaultHasher::new();
        event.data.hash(&mut hasher);
        let hash = hasher.finish();
        let other = 1 - which;
        if self.absent[other].get_mut(&hash).is_some_and(|absent| absent.pop().is_some()) {
            self.absent_count[other] -= 1;
            *(if other == 0 { &mut self.diff.left_only } else { &mut self.diff.right_only }) -= 1;
            self.diff.reordered += 1;
            return;
        }
        let here = format!("{} bytes", event.data.len());
        let mut sides = [here, "absent".to_owned()];
        sides.rotate_right(which);
        let [left, right] = sides;
        *(if which == 0 { &mut self.diff.left_only } else { &mut self.diff.right_only }) += 1;
        let first = FirstDifference { t_ns: event.t_ns, t_s, number, field: String::new(), left, right, ulp: None };
        if self.absent_count[which] < MAX_ABSENT {
            self.absent_count[which] += 1;
            self.absent[which].entry(hash).or_default().push(first);
        } else {
            self.diff.first.get_or_insert(first);
        }
    }

    fn compare(&mut self, types: &Types) {
        let (Some(left), Some(right)) = (self.pop(0), self.pop(1)) else { return };
        let (t_ns, t_s, number) = (left.event.t_ns, left.t_s, left.number);
        if left.event.data == right.event.data {
            if t_ns == right.event.t_ns {
                return;
            }
            self.diff.times_different += 1;
            self.diff.first.get_or_insert_with(|| FirstDifference {
                t_ns,
                t_s,
                number,
                field: "time".into(),
                left: format!("{t_ns} ns"),
                right: format!("{} ns", right.event.t_ns),
                ulp: None,
            });
            return;
        }
        self.diff.different += 1;
        self.diff.first.get_or_insert_with(|| first_difference(types, &left, &right.event));
    }
}

/// The first field in which two messages differ, by reflection.
fn first_difference(types: &Types, left: &Unmatched, right: &Event) -> FirstDifference {
    let Unmatched { event: left, number, t_s } = left;
    let (number, t_s) = (*number, *t_s);
    let (t_ns, [a, b]) = (left.t_ns, [left, right].map(|event| &event.data));
    let fingerprints = [left, right].map(Event::fingerprint);
    if fingerprints[0] != fingerprints[1] {
        let [left, right] = fingerprints.map(|f| f.map_or("none".to_owned(), |f| format!("{f:016x}")));
        return FirstDifference { t_ns, t_s, number, field: "fingerprint".into(), left, right, ulp: None };
    }
    let ty = types.of_message(&left.channel, a);
    if let Some(Ok(Some(found))) = ty.map(|ty| ty.first_difference(a, b)) {
        let (ulp, left, right) = (found.ulps(), show(&found.left), show(&found.right));
        return FirstDifference { t_ns, t_s, number, field: found.path, left, right, ulp };
    }
    // Unknown type: the first differing byte.
    let place = a.iter().zip(b).position(|(a, b)| a != b).unwrap_or(a.len().min(b.len()));
    let byte = |data: &[u8]| data.get(place).map_or("end of message".to_owned(), |byte| format!("{byte:#04x}"));
    FirstDifference { t_ns, t_s, number, field: format!("byte {place}"), left: byte(a), right: byte(b), ulp: None }
}
