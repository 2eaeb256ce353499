//! Statistics of one channel, and of all channels.

use super::channel::Channel;
use super::{Pace, Traffic};
use crate::record::{MessageDecoder, ReceiveCounts, SenderCounts};
use std::net::SocketAddrV4;

/// One channel.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct Row {
    /// Channel.
    pub name: String,
    /// Type of the last message with package; `None` if unknown.
    #[serde(rename = "type")]
    pub type_name: Option<String>,
    /// Fingerprint in hexadecimal; `None` if the message is too short to have one.
    pub fingerprint: Option<String>,
    /// Messages.
    pub count: u64,
    /// Messages per second.
    pub rate_hz: f64,
    /// Bytes of the messages.
    pub bytes: u64,
    /// Bytes of messages per second.
    pub bytes_per_s: f64,
    /// Lost messages. `None` if unknown: see `lost_at_most`.
    pub lost: Option<u64>,
    /// Messages that the channel's senders lost on all their channels. `None` for a log, whose senders are unknown.
    pub lost_at_most: Option<u64>,
    /// Numbers skipped by the counters in the messages.
    pub skipped: Option<u64>,
    /// Messages received after a later one of their sender.
    pub late: u64,
    /// Half the range of the middle 68.27 % of the intervals, us.
    pub jitter_us: Option<f64>,
    /// Standard deviation of the intervals, us.
    pub jitter_rms_us: Option<f64>,
    /// Largest interval, us.
    pub gap_us: Option<f64>,
    /// Time since the last message, s.
    pub age_s: f64,
    /// Senders: address and port.
    pub senders: Vec<String>,
}

impl Row {
    pub(super) fn new(name: &str, channel: &Channel, pace: Pace, now_ns: i64, decoder: &MessageDecoder) -> Self {
        let senders: Vec<SocketAddrV4> = channel.lanes.iter().filter_map(|lane| lane.sender).collect();
        let account = |sender: &SocketAddrV4| decoder.sender_counts(*sender);
        let lost_by = |sender| account(sender).map(|counts| counts.lost);
        let lost_at_most = if senders.is_empty() { None } else { senders.iter().map(lost_by).sum() };
        let skipped = channel.skipped();
        let us = |ns: f64| ns * 1e-3;
        Row {
            name: name.to_owned(),
            type_name: channel.type_name.clone(),
            fingerprint: channel.fingerprint.map(|f| format!("{f:016x}")),
            count: channel.count,
            rate_hz: pace.rate_hz,
            bytes: channel.bytes,
            bytes_per_s: pace.bytes_per_s,
            lost: lost(skipped, lost_at_most),
            lost_at_most,
            skipped,
            late: channel.late,
            jitter_us: pace.spread.map(|spread| us(spread.jitter_ns)),
            jitter_rms_us: pace.spread.map(|spread| us(spread.rms_ns)),
            gap_us: pace.spread.map(|spread| us(spread.max_ns as f64)),
            age_s: channel.age_ns(now_ns) as f64 * 1e-9,
            senders: senders.iter().map(ToString::to_string).collect(),
        }
    }
}

/// Lost messages of a channel, from the numbers skipped by its counters and the loss of its senders on all channels. A skipped number that
/// the sender did not lose was never sent.
fn lost(skipped: Option<u64>, lost_at_most: Option<u64>) -> Option<u64> {
    match (skipped, lost_at_most) {
        (_, Some(0)) => Some(0),
        (Some(skipped), Some(at_most)) => Some(skipped.min(at_most)),
        (skipped, None) => skipped,
        (None, Some(_)) => None,
    }
}

/// Statistics of all channels.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Summary {
    /// Messages.
    pub events: u64,
    /// From the first to the last message, s.
    pub duration_s: f64,
    /// Lost messages: on a network of all senders, in a log by the counters in the messages.
    pub lost: u64,
    /// Duplicate datagrams.
    pub duplicates: u64,
    /// Datagrams received after a later one of their sender.
    pub reordered: u64,
    /// Messages of channels above the largest number of channels.
    #[serde(rename = "untold")]
    pub ignored: u64,
    /// Received messages and datagrams.
    #[serde(flatten)]
    pub counts: ReceiveCounts,
    /// Channels by name.
    pub channels: Vec<Row>,
    /// Senders by address.
    pub senders: Vec<SenderCounts>,
}

impl Summary {
    pub(super) fn new(traffic: &Traffic, channels: Vec<Row>) -> Self {
        let [lost, duplicates, reordered] = traffic.lost_duplicate_late();
        let senders = traffic.senders();
        let skipped = channels.iter().filter_map(|row| row.skipped).sum();
        let span_ns = traffic.first_ns.map_or(0, |first| traffic.last_ns.saturating_sub(first));
        Summary {
            events: channels.iter().map(|row| row.count).sum::<u64>() + traffic.ignored,
            duration_s: span_ns as f64 * 1e-9,
            lost: if senders.is_empty() { skipped } else { lost },
            duplicates,
            reordered,
            ignored: traffic.ignored,
            counts: traffic.decoder.counts(),
            channels,
            senders,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::lost;

    #[test]
    fn lost_messages_follow_from_counters_and_senders() {
        // A counter, and the sequence numbers of the senders as upper bound.
        assert_eq!(lost(Some(3), Some(10)), Some(3));
        // Numbers that the sender skipped are not lost.
        assert_eq!(lost(Some(3), Some(0)), Some(0));
        assert_eq!(lost(Some(3), Some(1)), Some(1));
        // Without a counter the number is unknown unless nothing was lost.
        assert_eq!(lost(None, Some(10)), None);
        assert_eq!(lost(None, Some(0)), Some(0));
        // In a log the senders are unknown.
        assert_eq!((lost(Some(3), None), lost(None, None)), (Some(3), None));
    }
}
