//! Interning of channel names: each distinct name is allocated once and shared by all events of the channel.

use crate::names::name_text;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Slots of the cache of recent names. A log has a few dozen channels.
const CACHE_SLOTS: usize = 256;

/// Names stored at most. A damaged file can appear to have a new channel every few bytes.
const MAX_NAMES: usize = 1 << 14;

/// Interned channel names.
pub(super) struct ChannelNames {
    interned: BTreeSet<Arc<str>>,
    /// Direct-mapped cache in front of `interned`.
    cache: Vec<Option<Arc<str>>>,
}

impl Default for ChannelNames {
    fn default() -> Self {
        ChannelNames { interned: BTreeSet::new(), cache: vec![None; CACHE_SLOTS] }
    }
}

impl ChannelNames {
    /// The interned name equal to these bytes, if it is in the cache. A hit needs no UTF-8 check: cached names are valid text.
    #[inline]
    pub fn cached(&self, bytes: &[u8]) -> Option<&Arc<str>> {
        self.cache[slot(bytes)].as_ref().filter(|name| name.as_bytes() == bytes)
    }

    /// The interned name of these bytes.
    #[inline]
    pub fn of_bytes(&mut self, bytes: &[u8]) -> Arc<str> {
        match self.cached(bytes) {
            Some(name) => Arc::clone(name),
            None => self.intern(&name_text(bytes)),
        }
    }

    /// The interned name equal to this text; puts it into the cache.
    pub fn intern(&mut self, name: &str) -> Arc<str> {
        let slot = slot(name.as_bytes());
        if let Some(cached) = self.cache[slot].as_ref().filter(|cached| ***cached == *name) {
            return Arc::clone(cached);
        }
        let interned = match self.interned.get(name) {
            Some(known) => Arc::clone(known),
            None => {
                if self.interned.len() == MAX_NAMES {
                    self.interned.clear();
                }
                let name: Arc<str> = name.into();
                self.interned.insert(Arc::clone(&name));
                name
            }
        };
        self.cache[slot] = Some(Arc::clone(&interned));
        interned
    }
}

/// Cache slot of a name: a multiplicative hash of its first and last eight bytes and its length.
#[inline]
fn slot(name: &[u8]) -> usize {
    let word = |bytes: &[u8]| bytes.iter().fold(0_u64, |word, &byte| word << 8 | u64::from(byte));
    let (first, last) = match (name.first_chunk::<8>(), name.last_chunk::<8>()) {
        (Some(first), Some(last)) => (u64::from_le_bytes(*first), u64::from_le_bytes(*last)),
        _ => (word(name), 0),
    };
    let mixed = (first ^ last.rotate_left(23) ^ name.len() as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (mixed >> 56) as usize % CACHE_SLOTS
}
