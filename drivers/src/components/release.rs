//! The release rule: what a component computes from the inputs of base tick k is delivered at k + latency.

use super::slot::Slot;

/// Results for which memory is allocated in advance.
const RESULTS: usize = 256;
/// Bytes for which memory is allocated in each of them.
const CAPACITY: usize = 4096;

/// A result in transit.
struct Waiting {
    due_tick: i64,
    channel: &'static str,
    data: Vec<u8>,
}

/// Results in transit from the components that computed them to those that listen.
pub struct Releases {
    /// In the order in which they were computed.
    waiting: Vec<Waiting>,
    spare: Vec<Waiting>,
}

impl Default for Releases {
    fn default() -> Self {
        let empty = || Waiting { due_tick: 0, channel: "", data: Vec::with_capacity(CAPACITY) };
        Releases { waiting: Vec::with_capacity(RESULTS), spare: (0..RESULTS).map(|_| empty()).collect() }
    }
}

impl Releases {
    /// Takes a result that is due at a base tick. Allocates only with more than 256 results in transit, or for a large one.
    pub fn put(&mut self, due_tick: i64, channel: &'static str, data: &[u8]) {
        let mut result = self.spare.pop().unwrap_or(Waiting { due_tick, channel, data: Vec::new() });
        (result.due_tick, result.channel) = (due_tick, channel);
        result.data.clear();
        result.data.extend_from_slice(data);
        self.waiting.push(result);
    }

    /// Delivers the results that are due to those that listen to them.
    ///
    /// - `t_ns`: time of the base tick.
    pub fn release(&mut self, base_tick: i64, t_ns: i64, slots: &mut [Slot]) {
        let mut at = 0;
        while let Some(result) = self.waiting.get(at) {
            if result.due_tick > base_tick {
                at += 1;
                continue;
            }
            for slot in slots.iter_mut().filter(|slot| slot.listens_to(result.channel)) {
                slot.inbox.put_newest(result.channel, t_ns, &result.data);
            }
            let result = self.waiting.remove(at);
            self.spare.push(result);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::ComponentInfo;

    /// A result is delivered in the tick in which it is due, once, and a newer one replaces an older one that waits for the same tick of a component.
    #[test]
    fn results_are_delivered_when_they_are_due() {
        let slot = |name: &str, receives: &[&str]| {
            let receives = receives.iter().map(ToString::to_string).collect();
            Slot::new(&ComponentInfo::new(name, ""), 1, receives)
        };
        let mut slots = [slot("first", &["a/PLAN"]), slot("b", &["a/PLAN", "a/OTHER"])];
        let mut releases = Releases::default();
        releases.put(5, "a/PLAN", &[1]);
        releases.put(7, "a/PLAN", &[2]);
        releases.put(6, "a/OTHER", &[3]);
        let delivered = |slot: &Slot| -> Vec<(String, u8)> {
            let input = slot.inbox.input();
            input.messages.iter().map(|message| (message.channel.clone(), message.data[0])).collect()
        };
        let of = |list: &[(&str, u8)]| list.iter().map(|(name, byte)| ((*name).to_owned(), *byte)).collect::<Vec<_>>();
        for (tick, first, b) in [
            (4, of(&[]), of(&[])),
            (5, of(&[("a/PLAN", 1)]), of(&[("a/PLAN", 1)])),
            (6, of(&[]), of(&[("a/PLAN", 1), ("a/OTHER", 3)])),
            (7, of(&[("a/PLAN", 2)]), of(&[("a/OTHER", 3), ("a/PLAN", 2)])),
            (8, of(&[]), of(&[("a/OTHER", 3), ("a/PLAN", 2)])),
        ] {
            releases.release(tick, 0, &mut slots);
            assert_eq!((delivered(&slots[0]), delivered(&slots[1])), (first, b), "tick {tick}");
            // The first one runs in every tick.
            slots[0].inbox.clear();
        }
    }
}
