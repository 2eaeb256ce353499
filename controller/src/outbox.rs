//! Output messages of a tick, in one buffer that is reused from tick to tick: publishing does not allocate.

use lcmtypes::{EncodeError, Message};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::PoisonError;

/// Encoded messages of one tick, in the order in which they were added.
#[derive(Default)]
pub struct Outbox {
    bytes: Vec<u8>,
    index: Vec<(&'static str, Range<usize>)>,
}

impl Outbox {
    /// An empty outbox with enough memory for a tick of a 45-joint robot.
    pub fn new() -> Self {
        Outbox { bytes: Vec::with_capacity(64 << 10), index: Vec::with_capacity(32) }
    }

    /// Removes the messages and keeps the memory.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.index.clear();
    }

    /// Adds a message.
    ///
    /// # Errors
    /// If the length of an array differs from its length field; nothing is added.
    pub fn put<M: Message>(&mut self, channel: &'static str, message: &M) -> Result<(), EncodeError> {
        let start = self.bytes.len();
        if let Err(error) = message.encode(&mut self.bytes) {
            self.bytes.truncate(start);
            return Err(error);
        }
        self.index.push((channel, start..self.bytes.len()));
        Ok(())
    }

    /// Adds an encoded message.
    pub fn put_bytes(&mut self, channel: &'static str, bytes: &[u8]) {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.index.push((channel, start..self.bytes.len()));
    }

    /// The messages: channel and encoded bytes.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (&'static str, &[u8])> {
        self.index.iter().map(|(channel, range)| (*channel, &self.bytes[range.clone()]))
    }

    /// The first message on a channel, if there is one.
    pub fn get(&self, channel: &str) -> Option<&[u8]> {
        self.iter().find(|(c, _)| *c == channel).map(|(_, bytes)| bytes)
    }
}

/// Returns `name` with static lifetime; each name is stored once per process. Messages of a run then refer to their channel without a copy of its
/// name.
#[expect(
    clippy::disallowed_types,
    reason = "the names are the same in every run, and the order of the calls changes no result"
)]
pub fn interned(name: String) -> &'static str {
    static NAMES: std::sync::Mutex<BTreeSet<&'static str>> = std::sync::Mutex::new(BTreeSet::new());
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = names.get(&*name) {
        return known;
    }
    let name: &'static str = name.leak();
    names.insert(name);
    name
}
