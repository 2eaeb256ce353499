//! PARAMETER_CHANGE messages that are published again, so that a log that lost one, or that begins later, can be replayed.

use super::outgoing::Outgoing;
use lcmtypes::{ParameterChange, channels};
use std::collections::VecDeque;

/// Times after a change at which it is published again, ns: within the ticks for which a replay waits for a message.
const REPEAT_NS: [i64; 3] = [20_000_000, 60_000_000, 140_000_000];

/// The parameter changes of a run.
#[derive(Debug, Default)]
pub struct ChangeRepeater {
    /// Last change of each key, in order.
    latest: Vec<ParameterChange>,
    /// Time, ns, and change, in the order of time.
    due: VecDeque<(i64, ParameterChange)>,
}

impl ChangeRepeater {
    /// Takes a change that has just been published, and publishes the earlier ones again.
    pub fn changed(&mut self, change: &ParameterChange, now_ns: i64, out: &mut Outgoing) {
        self.publish_all(out);
        self.latest.retain(|before| before.key != change.key);
        self.latest.push(change.clone());
        self.due.extend(REPEAT_NS.map(|later| (now_ns + later, change.clone())));
        self.due.make_contiguous().sort_by_key(|(due, _)| *due);
    }

    /// Publishes what is due.
    pub fn publish_due(&mut self, now_ns: i64, out: &mut Outgoing) {
        while let Some((_, change)) = self.due.pop_front_if(|(due, _)| *due <= now_ns) {
            out.put(channels::PARAMETER_CHANGE, &change);
        }
    }

    /// Publishes the last change of each key.
    pub fn publish_all(&self, out: &mut Outgoing) {
        self.latest.iter().for_each(|change| out.put(channels::PARAMETER_CHANGE, change));
    }
}
