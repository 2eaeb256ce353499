//! A channel in numbers.

use super::channel::Channel;
use super::{Pace, Traffic};
use crate::record::{Account, Hearing, Tally};
use std::net::SocketAddrV4;

/// One channel.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct Row {
    /// Channel.
    pub name: String,
    /// Type with package of its last message, if it is known here.
    #[serde(rename = "type")]
    pub type_name: Option<String>,
    /// Fingerprint in hexadecimal, if the messages are long enough to have one.
    pub fingerprint: Option<String>,
    /// Messages.
    pub count: u64,
    /// Messages per second.
    pub rate_hz: f64,
    /// Bytes of the messages.
    pub bytes: u64,
    /// Bytes of messages per second.
    pub bytes_per_s: f64,
    /// Messages that were sent and did not come. `None` where nobody can know: see `lost_at_most`.
    pub lost: Option<u64>,
    /// What the channel's senders lost on all their channels. `None` of a log, which does not say who sent.
    pub lost_at_most: Option<u64>,
    /// Numbers that the counters in the messages skip, for whatever reason.
    pub skipped: Option<u64>,
    /// Messages that came after a later one of their sender.
    pub late: u64,
    /// Half the range of the middle 68.27 % of all intervals, us.
    pub jitter_us: Option<f64>,
    /// Standard deviation of the intervals, us.
    pub jitter_rms_us: Option<f64>,
    /// Largest interval, us.
    pub gap_us: Option<f64>,
    /// Time since the last message, s.
    pub age_s: f64,
    /// Who sent: addresses and ports.
    pub senders: Vec<String>,
}

impl Row {
    pub(super) fn new(name: &str, channel: &Channel, pace: Pace, now_ns: i64, hearing: &Hearing) -> Self {
        let senders: Vec<SocketAddrV4> = channel.lanes.iter().filter_map(|lane| lane.sender).collect();
        let account = |sender: &SocketAddrV4| hearing.account(*sender);
        let lost_by = |sender| account(sender).map(|account| account.lost);
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

/// What a channel lost, from what its counters skip and what its senders lost on all channels. A number that was skipped and not lost on
/// the way was never sent.
fn lost(skipped: Option<u64>, lost_at_most: Option<u64>) -> Option<u64> {
    match (skipped, lost_at_most) {
        (_, Some(0)) => Some(0),
        (Some(skipped), Some(at_most)) => Some(skipped.min(at_most)),
        (skipped, None) => skipped,
        (None, Some(_)) => None,
    }
}

/// All that was heard.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Summary {
    /// Messages.
    pub events: u64,
    /// From the first to the last message, s.
    pub duration_s: f64,
    /// Messages lost: on a network those of all senders, in a log those that the counters in the messages miss.
    pub lost: u64,
    /// Datagrams that came again.
    pub duplicates: u64,
    /// Datagrams that came after a later one of their sender.
    pub reordered: u64,
    /// Messages of channels of which there are too many to be told apart.
    pub untold: u64,
    /// What came off the network.
    #[serde(flatten)]
    pub tally: Tally,
    /// Channels by name.
    pub channels: Vec<Row>,
    /// Senders by address.
    pub senders: Vec<Account>,
}

impl Summary {
    pub(super) fn new(traffic: &Traffic, channels: Vec<Row>) -> Self {
        let [lost, duplicates, reordered] = traffic.lost_twice_late();
        let senders = traffic.senders();
        let skipped = channels.iter().filter_map(|row| row.skipped).sum();
        let span_ns = traffic.first_ns.map_or(0, |first| traffic.last_ns.saturating_sub(first));
        Summary {
            events: channels.iter().map(|row| row.count).sum::<u64>() + traffic.untold,
            duration_s: span_ns as f64 * 1e-9,
            lost: if senders.is_empty() { skipped } else { lost },
            duplicates,
            reordered,
            untold: traffic.untold,
            tally: traffic.hearing.tally(),
            channels,
            senders,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::lost;

    #[test]
    fn a_loss_is_told_as_far_as_it_is_known() {
        // A counter, and the senders' sequence numbers, which say at most how many.
        assert_eq!(lost(Some(3), Some(10)), Some(3));
        // Numbers that the sender left out by itself are not lost.
        assert_eq!(lost(Some(3), Some(0)), Some(0));
        assert_eq!(lost(Some(3), Some(1)), Some(1));
        // Without a counter, nothing is known but where nothing was lost at all.
        assert_eq!(lost(None, Some(10)), None);
        assert_eq!(lost(None, Some(0)), Some(0));
        // A log knows no senders.
        assert_eq!((lost(Some(3), None), lost(None, None)), (Some(3), None));
    }
}
