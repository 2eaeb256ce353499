//! Traffic statistics of a network or a log, for `hoof spy`: channels, rates, jitter, losses and senders.
//!
//! - [`Traffic`]: takes datagrams, or the events of a log, and keeps statistics per channel and per sender in bounded memory.
//! - [`Live`]: receives a network with its own socket; never sends.
//! - [`Row`]: one channel; [`Summary`]: all channels. JSON keys include those of `hoof log info`.
//! - [`Intervals`], [`Window`]: rate and jitter, from 0.1 Hz to 50 kHz.
//! - [`Alarm`], [`Alarms`]: conditions on rows, such as `ROBOT_STATE rate<900`.
//! - [`Trace`]: a field of a channel's messages over time.
//!
//! The number of messages lost per sender is exact: LCM's sequence numbers count all messages of a sender over all channels. The number
//! lost per channel is known if its messages have a counter (`seq`, `tick`); otherwise its upper bound is the number that its senders lost. A
//! row contains both.
//!
//! It must never send, report an estimate as a count, or use memory without bound.

mod alarm;
mod channel;
mod intervals;
mod live;
mod row;
mod trace;

pub use alarm::{Alarm, Alarms, Raised};
pub use intervals::{Intervals, Pace, Spread, Window};
pub use live::Live;
pub use row::{Row, Summary};
pub use trace::Trace;

use crate::log::{EventRef, Types};
use crate::record::{MessageDecoder, SenderCounts};
use crate::udpm::Datagram;
use channel::{Arrival, Channel};
use std::collections::{BTreeMap, VecDeque};

/// Largest number of channels; messages of further channels are counted together.
const MAX_CHANNELS: usize = 1000;
/// Largest size of the stored last messages of all channels, bytes.
const MAX_KEPT: usize = 1 << 26;
/// Time between two checks for lost messages, ns.
const SETTLE_NS: i64 = 500_000_000;
/// Largest number of stored network events.
const MAX_NETWORK_EVENTS: usize = 100;

/// Statistics of received messages.
#[derive(Default)]
pub struct Traffic {
    decoder: MessageDecoder,
    channels: BTreeMap<String, Channel>,
    types: Types,
    /// Incremented when types are added.
    types_version: u64,
    traces: Vec<Trace>,
    kept: usize,
    /// Messages of channels beyond [`MAX_CHANNELS`].
    ignored: u64,
    first_ns: Option<i64>,
    last_ns: i64,
    settled_ns: i64,
    network_events: VecDeque<(i64, String)>,
}

impl Traffic {
    /// Empty statistics. `types`: types that are known besides those of this build.
    pub fn new(types: Types) -> Self {
        Traffic { types, ..Traffic::default() }
    }

    /// Takes a datagram.
    pub fn datagram(&mut self, datagram: &Datagram) {
        let Datagram { sender, t_ns, .. } = *datagram;
        if let Some(message) = self.decoder.datagram(datagram) {
            let (name, data, is_late) = (&*message.channel, &*message.data, message.is_late);
            self.take(&Arrival { sender: Some(sender), t_ns, name, data, is_late });
        }
    }

    /// Takes an event of a log.
    pub fn event(&mut self, event: &EventRef) {
        if let Some(schema) = event.schema() {
            self.types_version += u64::from(self.types.learn_schema(schema));
        }
        let EventRef { channel, t_ns, data, .. } = *event;
        self.take(&Arrival { sender: None, t_ns, name: channel, data, is_late: false });
        // A message in another language has no fingerprint; its type is that of the schema.
        if let Some(schema) = event.schema().filter(|schema| schema.encoding != "lcm")
            && let Some(channel) = self.channels.get_mut(&**channel)
        {
            (channel.type_name, channel.fingerprint) = (Some(schema.name.clone()), None);
        }
    }

    fn take(&mut self, arrival: &Arrival) {
        let Arrival { t_ns, name, data, .. } = *arrival;
        self.first_ns.get_or_insert(t_ns);
        self.last_ns = t_ns;
        self.types_version += u64::from(self.types.learn_run_info(name, data));
        if self.channels.len() >= MAX_CHANNELS && !self.channels.contains_key(name) {
            self.ignored += 1;
            return;
        }
        if !self.channels.contains_key(name) {
            self.channels.insert(name.to_owned(), Channel::new(t_ns));
        }
        let Some(channel) = self.channels.get_mut(name) else { return };
        self.kept -= channel.message.len();
        let keep = self.kept + data.len() <= MAX_KEPT;
        channel.take(arrival, &self.types, self.types_version, keep);
        self.kept += channel.message.len();
        let is_due = |trace: &Trace| trace.channel == name && trace.is_due(t_ns);
        if self.traces.iter().any(is_due)
            && let Some(ty) = self.types.of_message(name, data)
        {
            trace::trace(&mut self.traces, name, ty, data, t_ns);
        }
    }

    /// Counts overdue messages as lost. Call it a few times per second. `now_ns`: time now in the clock of the receive times.
    pub fn settle(&mut self, now_ns: i64) {
        if (0..SETTLE_NS).contains(&now_ns.saturating_sub(self.settled_ns)) {
            return;
        }
        self.settled_ns = now_ns;
        self.decoder.settle(now_ns);
        self.read_network_events(now_ns);
    }

    /// Counts all missing messages as lost, at the end of reception.
    pub fn settle_all(&mut self) {
        self.decoder.settle_all();
        self.read_network_events(self.last_ns);
    }

    fn read_network_events(&mut self, now_ns: i64) {
        for (_, text) in self.decoder.take_events() {
            if self.network_events.len() == MAX_NETWORK_EVENTS {
                self.network_events.pop_front();
            }
            self.network_events.push_back((now_ns, text));
        }
    }

    /// Resets all counts; types and traced fields stay.
    pub fn clear(&mut self) {
        let (types, mut traces) = (std::mem::take(&mut self.types), std::mem::take(&mut self.traces));
        traces.iter_mut().for_each(Trace::clear);
        *self = Traffic { types, types_version: self.types_version, traces, ..Traffic::default() };
    }

    /// Starts to trace a field. Returns false for an invalid path.
    pub fn follow(&mut self, channel: &str, path: &str) -> bool {
        let trace = Trace::new(channel, path);
        let is_some = trace.is_some();
        self.traces.extend(trace);
        is_some
    }

    /// Stops tracing a field.
    pub fn unfollow(&mut self, channel: &str, path: &str) {
        self.traces.retain(|trace| trace.channel != channel || trace.path != path);
    }

    /// The traced fields.
    pub fn traces(&self) -> &[Trace] {
        &self.traces
    }

    /// The known types.
    pub fn types(&self) -> &Types {
        &self.types
    }

    /// The last message of a channel: its bytes (empty if it was too long to be stored) and its length.
    pub fn message(&self, channel: &str) -> Option<(&[u8], usize)> {
        self.channels.get(channel).map(|channel| (&channel.message[..], channel.length))
    }

    /// Every channel at `now_ns`.
    pub fn rows(&self, now_ns: i64) -> Vec<Row> {
        self.all(|channel| channel.pace(now_ns), now_ns)
    }

    fn all(&self, pace: impl Fn(&Channel) -> Pace, now_ns: i64) -> Vec<Row> {
        let row = |(name, channel): (&String, &Channel)| Row::new(name, channel, pace(channel), now_ns, &self.decoder);
        self.channels.iter().map(row).collect()
    }

    /// Every channel, from its first to its last message.
    pub fn summary(&self, now_ns: i64) -> Summary {
        Summary::new(self, self.all(Channel::whole, now_ns))
    }

    /// Counts of the senders, by address.
    pub fn senders(&self) -> Vec<SenderCounts> {
        self.decoder.all_counts()
    }

    /// Lost messages, duplicate datagrams and late datagrams of all senders.
    pub fn lost_duplicate_late(&self) -> [u64; 3] {
        self.decoder.totals()
    }

    /// Datagrams that the kernel dropped because the receive buffer was full.
    pub fn kernel_dropped(&self) -> u64 {
        self.decoder.counts().kernel_dropped
    }

    /// Whether no datagram was received.
    pub fn is_empty(&self) -> bool {
        self.first_ns.is_none() && self.decoder.counts() == crate::record::ReceiveCounts::default()
    }

    /// Network events with their times, ns; oldest first.
    pub fn network_events(&self) -> impl DoubleEndedIterator<Item = &(i64, String)> {
        self.network_events.iter()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use std::sync::Arc;

    fn receive(traffic: &mut Traffic, channel: &str, t_ns: i64, data: &[u8]) {
        let channel: &Arc<str> = &channel.into();
        traffic.event(&EventRef { channel, t_ns, number: 0, data, offset: 0, source: None });
    }

    #[test]
    fn memory_is_bounded_for_any_number_of_channels_and_messages() {
        let mut traffic = Traffic::default();
        for n in 0..1500 {
            receive(&mut traffic, &format!("C{n}"), n, &[0; 100_000]);
        }
        let summary = traffic.summary(1500);
        assert_eq!((summary.channels.len(), summary.ignored, summary.events), (MAX_CHANNELS, 500, 1500));
        // 671 messages fit into 64 MiB; of the others the length is known.
        let kept = |name: &str| traffic.message(name).map(|(bytes, length)| (bytes.len(), length));
        assert_eq!((kept("C670"), kept("C671")), (Some((100_000, 100_000)), Some((0, 100_000))));
        assert_eq!(traffic.kept, 671 * 100_000);
        // Known channels are still counted; space that one frees is available to others.
        receive(&mut traffic, "C0", 1500, b"short");
        receive(&mut traffic, "C671", 1500, &[0; 100_000]);
        assert_eq!(traffic.message("C671").unwrap().0.len(), 100_000);
        // Too long to be stored.
        receive(&mut traffic, "C0", 1501, &vec![0; channel::KEPT + 1]);
        assert_eq!(traffic.message("C0").unwrap().0.len(), 0);
    }

    #[test]
    fn a_reset_keeps_traced_fields() {
        let mut traffic = Traffic::default();
        assert!(traffic.follow("A", "x") && !traffic.follow("A", "x[one]"));
        receive(&mut traffic, "A", 5, b"12345678");
        traffic.clear();
        assert_eq!((traffic.rows(10).len(), traffic.traces().len(), traffic.is_empty()), (0, 1, true));
        traffic.unfollow("A", "x");
        assert_eq!(traffic.traces().len(), 0);
    }
}
