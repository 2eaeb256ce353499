//! Statistics of one channel.

use super::intervals::{Intervals, Pace, SAMPLE, Window};
use crate::log::{SequenceTracker, Types, fingerprint, sequence_field, sequence_number};
use std::net::SocketAddrV4;

/// Largest number of senders per channel; messages of further senders count for the channel only.
const MAX_LANES: usize = 32;
/// Longest message that is stored, bytes.
pub(super) const KEPT: usize = 1 << 20;

/// One channel.
#[derive(Debug, Clone)]
pub(super) struct Channel {
    pub count: u64,
    pub bytes: u64,
    pub late: u64,
    pub first_ns: i64,
    pub last_ns: i64,
    pub fingerprint: Option<u64>,
    pub type_name: Option<String>,
    pub lanes: Vec<Lane>,
    /// The last message; empty if it was too long.
    pub message: Vec<u8>,
    /// Length of the last message, bytes.
    pub length: usize,
    window: Window,
    whole: Intervals,
    has_counter: bool,
    /// Version of the types at which type and counter were looked up.
    types_version: Option<u64>,
}

/// The messages of one sender. In a log the sender is unknown.
#[derive(Debug, Clone)]
pub(super) struct Lane {
    pub sender: Option<SocketAddrV4>,
    numbers: SequenceTracker,
}

/// A received message.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrival<'a> {
    pub sender: Option<SocketAddrV4>,
    pub t_ns: i64,
    pub name: &'a str,
    pub data: &'a [u8],
    pub is_late: bool,
}

impl Channel {
    pub fn new(t_ns: i64) -> Self {
        Channel {
            count: 0,
            bytes: 0,
            late: 0,
            first_ns: t_ns,
            last_ns: t_ns,
            fingerprint: None,
            type_name: None,
            lanes: Vec::new(),
            message: Vec::new(),
            length: 0,
            window: Window::default(),
            whole: Intervals::new(SAMPLE),
            has_counter: false,
            types_version: None,
        }
    }

    /// Takes a message. `types_version` changes when `types` does; `keep`: whether to store a copy of the message.
    pub fn take(&mut self, arrival: &Arrival, types: &Types, types_version: u64, keep: bool) {
        let Arrival { sender, t_ns, name, data, is_late } = *arrival;
        let found = fingerprint(data);
        if self.types_version != Some(types_version) || self.fingerprint != found {
            let ty = found.and_then(|found| types.of(name, found));
            self.type_name = ty.map(|ty| ty.name().to_owned());
            self.has_counter = ty.and_then(sequence_field).is_some();
            (self.fingerprint, self.types_version) = (found, Some(types_version));
        }
        self.count += 1;
        self.bytes += data.len() as u64;
        self.late += u64::from(is_late);
        // Skip negative intervals: the clock was set back, or logs were concatenated.
        if let Some(interval) = t_ns.checked_sub(self.last_ns).filter(|ns| *ns >= 0 && self.count > 1) {
            self.window.add(t_ns, interval, data.len());
            self.whole.add(interval, data.len());
        }
        self.last_ns = t_ns;
        self.length = data.len();
        self.message.clear();
        if keep && data.len() <= KEPT {
            self.message.extend_from_slice(data);
        }
        let number = sequence_number(data).filter(|_| self.has_counter);
        if let (Some(lane), Some(number)) = (self.lane(sender), number) {
            lane.numbers.add(number, t_ns);
        }
    }

    /// Rates at `now_ns`.
    pub fn pace(&self, now_ns: i64) -> Pace {
        self.window.pace(now_ns, self.age_ns(now_ns))
    }

    /// Rates from the first to the last message.
    pub fn whole(&self) -> Pace {
        let span_s = self.last_ns.saturating_sub(self.first_ns) as f64 * 1e-9;
        let per_s = |n: f64| if span_s > 0.0 { n / span_s } else { 0.0 };
        let bytes = self.bytes as f64 - self.bytes as f64 / self.count.max(1) as f64;
        Pace { rate_hz: per_s(self.count as f64 - 1.0), bytes_per_s: per_s(bytes), spread: self.whole.spread() }
    }

    /// Time since the last message, ns.
    pub fn age_ns(&self, now_ns: i64) -> i64 {
        now_ns.saturating_sub(self.last_ns).max(0)
    }

    /// Missing messages by the counters in them (`seq`, `tick`), summed over the senders. `None` without a counter, or with one that does
    /// not count every message.
    pub fn skipped(&self) -> Option<u64> {
        if !self.has_counter || self.lanes.is_empty() {
            return None;
        }
        self.lanes.iter().map(|lane| lane.numbers.lost()).sum()
    }

    fn lane(&mut self, sender: Option<SocketAddrV4>) -> Option<&mut Lane> {
        let known = self.lanes.iter().position(|lane| lane.sender == sender);
        if known.is_none() && self.lanes.len() < MAX_LANES {
            self.lanes.push(Lane { sender, numbers: SequenceTracker::default() });
            return self.lanes.last_mut();
        }
        self.lanes.get_mut(known?)
    }
}
