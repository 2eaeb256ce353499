//! Messages of components that are kept until those that listen have consumed them, in bounded memory.

use std::collections::BTreeMap;

/// What a component published, by the time of its tick, ns.
pub(super) struct Published {
    ticks: BTreeMap<i64, PublishedTick>,
    bytes: usize,
    /// All its messages from this time on are known, ns.
    pub known_from_ns: i64,
}

/// Messages of one tick.
pub(super) struct PublishedTick {
    /// Base tick in which they are due.
    pub due_tick: i64,
    /// With the channels as in the log.
    pub messages: Vec<(String, Vec<u8>)>,
}

impl PublishedTick {
    fn bytes(&self) -> usize {
        self.messages.iter().map(|(_, data)| data.len()).sum()
    }
}

impl Default for Published {
    fn default() -> Self {
        Published { ticks: BTreeMap::new(), bytes: 0, known_from_ns: i64::MAX }
    }
}

impl Published {
    /// The messages of the tick at a time.
    pub fn at(&self, t_ns: i64) -> Option<&PublishedTick> {
        self.ticks.get(&t_ns)
    }

    /// Keeps the messages of a tick.
    pub fn put(&mut self, t_ns: i64, tick: PublishedTick) {
        self.known_from_ns = self.known_from_ns.min(t_ns);
        self.bytes += tick.bytes();
        if let Some(before) = self.ticks.insert(t_ns, tick) {
            self.bytes -= before.bytes();
        }
    }

    /// Forgets the oldest tick; false if there is none.
    fn forget_oldest(&mut self) -> bool {
        let Some((t_ns, tick)) = self.ticks.pop_first() else { return false };
        self.bytes -= tick.bytes();
        self.known_from_ns = self.known_from_ns.max(t_ns.saturating_add(1));
        true
    }
}

/// Forgets the oldest messages of the components with the most bytes, until all components together keep at most `max_bytes`. So the messages of a slow
/// component outlast those of a fast one.
pub(super) fn limit(all: &mut [&mut Published], max_bytes: usize) {
    while all.iter().map(|one| one.bytes).sum::<usize>() > max_bytes {
        let largest = all.iter_mut().max_by_key(|one| one.bytes);
        if !largest.is_some_and(|one| one.forget_oldest()) {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick(bytes: usize) -> PublishedTick {
        PublishedTick { due_tick: 0, messages: vec![("a/X".to_owned(), vec![0; bytes])] }
    }

    #[test]
    fn the_bound_is_for_all_components_together() {
        let (mut fast, mut slow) = (Published::default(), Published::default());
        for t_ns in 0..100 {
            fast.put(t_ns, tick(10));
            if t_ns % 50 == 0 {
                slow.put(t_ns, tick(100));
            }
            limit(&mut [&mut fast, &mut slow], 500);
            assert!(fast.bytes + slow.bytes <= 500);
        }
        assert_eq!((fast.bytes, slow.bytes), (300, 200));
        assert_eq!((fast.known_from_ns, slow.known_from_ns), (70, 0));
        assert!(fast.at(69).is_none() && fast.at(70).is_some() && slow.at(0).is_some());
        // A tick that is larger than the bound is forgotten at once.
        fast.put(100, tick(1000));
        limit(&mut [&mut fast, &mut slow], 500);
        assert_eq!((fast.bytes, fast.known_from_ns, slow.bytes), (0, 101, 200));
    }

    /// The same time twice, from a damaged log.
    #[test]
    fn a_tick_in_place_of_another_one_is_counted_once() {
        let mut one = Published::default();
        one.put(5, tick(10));
        one.put(5, tick(30));
        assert_eq!(one.bytes, 30);
        limit(&mut [&mut one], 0);
        assert_eq!(one.bytes, 0);
    }
}
