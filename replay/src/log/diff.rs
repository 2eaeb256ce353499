//! Two logs, channel by channel: what is in one only, and the first message and field in which they differ.
//!
//! Messages of a channel are matched by their counter (`seq`, `tick`) where their type has one, so that a missing message is told as
//! missing and not as a difference of all that follow; else one by one, in order.

use super::sequence_gaps::{sequence_field, sequence_number};
use super::{Event, EventFilter, EventRef, Health, LogReader, RunClock, Types};
use crate::Error;
use crate::engine::show;
use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::Arc;

/// Messages of a channel that wait for their match on the other side; beyond that they count as missing there.
const WAITING: usize = 4096;
/// Bytes of them.
const WAITING_BYTES: usize = 64 << 20;

/// How two logs differ.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct LogDiff {
    /// Every channel has equal messages at equal times, in the same order.
    pub identical: bool,
    /// Messages of the first log.
    pub left_events: u64,
    /// Messages of the second log.
    pub right_events: u64,
    /// Stretches of either log that are damaged, cuts included.
    pub damaged: u64,
    /// Channels by name.
    pub channels: Vec<ChannelDiff>,
}

/// How two logs differ in one channel.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct ChannelDiff {
    /// Channel.
    pub name: String,
    /// Nothing differs.
    pub identical: bool,
    /// Messages in the first log.
    pub left: u64,
    /// Messages in the second log.
    pub right: u64,
    /// Pairs whose bytes differ.
    pub different: u64,
    /// Pairs whose bytes are equal and whose times in the log differ.
    pub times_different: u64,
    /// Messages in the first log only.
    pub left_only: u64,
    /// Messages in the second log only.
    pub right_only: u64,
    /// The first pair that differs, or the first message that is on one side only.
    pub first: Option<FirstDifference>,
}

/// Where a channel first differs.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct FirstDifference {
    /// Time of the message in the log, ns.
    pub t_ns: i64,
    /// The same, s since the run's first tick.
    pub t_s: f64,
    /// Its counter (`seq`, `tick`), else its place in the channel from 0.
    pub number: i64,
    /// Field, such as `state.q[3]`; `time` if only the times in the log differ; empty if the message is on one side only or of no
    /// known type.
    pub field: String,
    /// Value in the first log; floats as hexadecimal float and decimal.
    pub left: String,
    /// Value in the second log.
    pub right: String,
    /// Floats that lie between the two, plus one; `None` unless both are floats and numbers.
    pub ulp: Option<u64>,
}

/// Compares two logs. `progress` is told which part has been read, 0 to 1.
///
/// # Errors
/// As [`LogReader::open`], or [`Error::Io`] on the way.
pub fn diff(
    left: &Path,
    right: &Path,
    filter: &EventFilter,
    types: Types,
    progress: &mut dyn FnMut(f64),
) -> Result<LogDiff, Error> {
    let mut sides = [Side::open(left, filter)?, Side::open(right, filter)?];
    let mut comparison = Comparison { types, lanes: BTreeMap::new() };
    let total: u64 = sides.iter().map(|side| side.reader.bytes()).sum();
    let mut steps = 0_u64;
    while sides.iter().any(|side| !side.over) {
        // The side that is behind in time reads on, so that few messages wait.
        let behind = usize::from(sides[0].over || !sides[1].over && sides[1].since < sides[0].since);
        comparison.step(&mut sides[behind], behind)?;
        steps += 1;
        if steps.is_multiple_of(4096) {
            progress(sides.iter().map(|side| side.offset).sum::<u64>() as f64 / total.max(1) as f64);
        }
    }
    let damaged = sides.iter().map(|s| s.health.damaged.len() as u64 + u64::from(s.health.cut.is_some())).sum();
    Ok(comparison.finish(damaged))
}

struct Side {
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

impl Side {
    fn open(log: &Path, filter: &EventFilter) -> Result<Self, Error> {
        let reader = LogReader::open(log)?;
        let (filter, clock, health) = (filter.for_log(log)?, RunClock::read(log)?, Health::default());
        Ok(Side { reader, filter, clock, health, first: None, since: 0, offset: 0, over: false })
    }
}

/// A message that waits for its match.
struct Waiting {
    event: Event,
    number: i64,
    /// Time since the run's first tick, s.
    t_s: f64,
}

#[derive(Default)]
struct Lane {
    has_counter: bool,
    counts: [u64; 2],
    waiting: [VecDeque<Waiting>; 2],
    bytes: [usize; 2],
    diff: ChannelDiff,
}

struct Comparison {
    types: Types,
    lanes: BTreeMap<Arc<str>, Lane>,
}

impl Comparison {
    fn step(&mut self, side: &mut Side, which: usize) -> Result<(), Error> {
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
            self.take(&event, t_s, which);
        }
        Ok(())
    }

    fn take(&mut self, event: &EventRef<'_>, t_s: f64, which: usize) {
        let types = &self.types;
        if !self.lanes.contains_key(event.channel) {
            let has_counter = types.of_message(event.channel, event.data).and_then(sequence_field).is_some();
            self.lanes.insert(Arc::clone(event.channel), Lane { has_counter, ..Lane::default() });
        }
        let Some(lane) = self.lanes.get_mut(event.channel) else { return };
        let place = lane.counts[which] as i64;
        let number = sequence_number(event.data).filter(|_| lane.has_counter).unwrap_or(place);
        lane.counts[which] += 1;
        lane.bytes[which] += event.data.len();
        lane.waiting[which].push_back(Waiting { event: event.to_event(), number, t_s });
        lane.pair(types);
        if lane.waiting[which].len() > WAITING || lane.bytes[which] > WAITING_BYTES {
            lane.alone(which);
        }
    }

    fn finish(mut self, damaged: u64) -> LogDiff {
        let mut all = LogDiff { damaged, ..LogDiff::default() };
        for (name, lane) in &mut self.lanes {
            for which in [0, 1] {
                while !lane.waiting[which].is_empty() {
                    lane.alone(which);
                }
            }
            let ChannelDiff { different, times_different, left_only, right_only, first, .. } =
                std::mem::take(&mut lane.diff);
            let identical = different + times_different + left_only + right_only == 0;
            let ([left, right], name) = (lane.counts, name.to_string());
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
                first,
            });
        }
        all.identical = damaged == 0 && all.channels.iter().all(|channel| channel.identical);
        all
    }
}

impl Lane {
    /// Compares what has its match.
    fn pair(&mut self, types: &Types) {
        while let (Some(left), Some(right)) = (self.waiting[0].front(), self.waiting[1].front()) {
            match left.number.cmp(&right.number) {
                std::cmp::Ordering::Less => self.alone(0),
                std::cmp::Ordering::Greater => self.alone(1),
                std::cmp::Ordering::Equal => self.compare(types),
            }
        }
    }

    fn pop(&mut self, which: usize) -> Option<Waiting> {
        let popped = self.waiting[which].pop_front()?;
        self.bytes[which] -= popped.event.data.len();
        Some(popped)
    }

    /// The first message that waits on a side has no match.
    fn alone(&mut self, which: usize) {
        let Some(Waiting { event, number, t_s }) = self.pop(which) else { return };
        let here = format!("{} bytes", event.data.len());
        let mut sides = [here, "absent".to_owned()];
        sides.rotate_right(which);
        let [left, right] = sides;
        *(if which == 0 { &mut self.diff.left_only } else { &mut self.diff.right_only }) += 1;
        let first = FirstDifference { t_ns: event.t_ns, t_s, number, field: String::new(), left, right, ulp: None };
        self.diff.first.get_or_insert(first);
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
fn first_difference(types: &Types, left: &Waiting, right: &Event) -> FirstDifference {
    let Waiting { event: left, number, t_s } = left;
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
    // Of a type that nobody knows: the first byte.
    let place = a.iter().zip(b).position(|(a, b)| a != b).unwrap_or(a.len().min(b.len()));
    let byte = |data: &[u8]| data.get(place).map_or("no more".to_owned(), |byte| format!("{byte:#04x}"));
    FirstDifference { t_ns, t_s, number, field: format!("byte {place}"), left: byte(a), right: byte(b), ulp: None }
}
