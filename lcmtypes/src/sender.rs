//! Identity of senders and of their events.

use crate::Event;
use std::collections::BTreeMap;
use std::hash::{BuildHasher, Hasher, RandomState};

/// A random number that identifies a process as a sender of messages. Never 0.
pub fn new_sender_id() -> i64 {
    // The keys of a RandomState are random, so the hash of nothing is too.
    RandomState::new().build_hasher().finish().max(1).cast_signed()
}

/// Gives each event of a sender its [`Event::sender_id`] and [`Event::seq`]; each source has its own numbers, from 0.
#[derive(Clone, Debug, Default)]
pub struct EventNumbers {
    sender_id: i64,
    next: BTreeMap<String, i64>,
}

impl EventNumbers {
    /// Numbers for the events of a sender.
    pub fn new(sender_id: i64) -> Self {
        EventNumbers { sender_id, next: BTreeMap::new() }
    }

    /// Identifies the sender.
    pub fn sender_id(&self) -> i64 {
        self.sender_id
    }

    /// Sets sender and number of an event.
    pub fn number(&mut self, event: &mut Event) {
        event.sender_id = self.sender_id;
        let next = self.next.entry(event.source.clone()).or_default();
        event.seq = *next;
        *next += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_numbered_for_each_source() {
        let mut numbers = EventNumbers::new(7);
        let mut number = |source: &str| {
            let mut event = Event { source: source.to_owned(), ..Event::default() };
            numbers.number(&mut event);
            (event.sender_id, event.seq)
        };
        assert_eq!(["a", "b", "a"].map(&mut number), [(7, 0), (7, 0), (7, 1)]);
    }
}
