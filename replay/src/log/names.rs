//! Channel names, each stored once.

use std::collections::BTreeSet;
use std::sync::Arc;

/// Places of the names that came last. A log has a few dozen channels.
const RECENT: usize = 256;

/// Names kept at most: a damaged file may look as if it had a new channel every few bytes.
const KEPT: usize = 1 << 14;

/// Channel names, each stored once.
pub(super) struct Names {
    known: BTreeSet<Arc<str>>,
    recent: Vec<Option<Arc<str>>>,
}

impl Default for Names {
    fn default() -> Self {
        Names { known: BTreeSet::new(), recent: vec![None; RECENT] }
    }
}

impl Names {
    /// The stored name of these bytes, if it is at hand. What is stored is text, so bytes found here need no further check.
    #[inline]
    pub fn at_hand(&self, bytes: &[u8]) -> Option<&Arc<str>> {
        self.recent[place(bytes)].as_ref().filter(|name| name.as_bytes() == bytes)
    }

    /// The stored name of this text.
    pub fn intern(&mut self, name: &str) -> Arc<str> {
        let slot = place(name.as_bytes());
        if let Some(recent) = self.recent[slot].as_ref().filter(|recent| ***recent == *name) {
            return Arc::clone(recent);
        }
        let stored = match self.known.get(name) {
            Some(known) => Arc::clone(known),
            None => {
                if self.known.len() == KEPT {
                    self.known.clear();
                }
                let name: Arc<str> = name.into();
                self.known.insert(Arc::clone(&name));
                name
            }
        };
        self.recent[slot] = Some(Arc::clone(&stored));
        stored
    }
}

/// Place of a name among the recent ones: a multiplicative hash of its first and last eight bytes and its length.
#[inline]
fn place(name: &[u8]) -> usize {
    let word = |bytes: &[u8]| bytes.iter().fold(0_u64, |word, &byte| word << 8 | u64::from(byte));
    let (first, last) = match (name.first_chunk::<8>(), name.last_chunk::<8>()) {
        (Some(first), Some(last)) => (u64::from_le_bytes(*first), u64::from_le_bytes(*last)),
        _ => (word(name), 0),
    };
    let mixed = (first ^ last.rotate_left(23) ^ name.len() as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (mixed >> 56) as usize % RECENT
}
