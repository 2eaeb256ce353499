//! Where a tick leaves its messages: one buffer, kept from tick to tick, so that publishing does not allocate.

use lcmtypes::{EncodeError, Message};
use std::ops::Range;

/// Encoded messages of one tick, in the order in which they were put in.
#[derive(Default)]
pub struct Outbox {
    bytes: Vec<u8>,
    index: Vec<(&'static str, Range<usize>)>,
}

impl Outbox {
    /// An empty outbox that holds a tick of a 45-joint robot without growing.
    pub fn new() -> Self {
        Outbox { bytes: Vec::with_capacity(64 << 10), index: Vec::with_capacity(32) }
    }

    /// Forgets the messages, keeps the memory.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.index.clear();
    }

    /// Adds a message.
    ///
    /// # Errors
    /// If an array of the message does not have the length that its length field says; nothing is added then.
    pub fn put<M: Message>(&mut self, channel: &'static str, message: &M) -> Result<(), EncodeError> {
        let start = self.bytes.len();
        if let Err(error) = message.encode(&mut self.bytes) {
            self.bytes.truncate(start);
            return Err(error);
        }
        self.index.push((channel, start..self.bytes.len()));
        Ok(())
    }

    /// Adds a message that is encoded already.
    pub fn put_bytes(&mut self, channel: &'static str, bytes: &[u8]) {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.index.push((channel, start..self.bytes.len()));
    }

    /// The messages: channel and encoded bytes.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (&'static str, &[u8])> {
        self.index.iter().map(|(channel, range)| (*channel, &self.bytes[range.clone()]))
    }

    /// The bytes on a channel, if the tick put any there.
    pub fn get(&self, channel: &str) -> Option<&[u8]> {
        self.iter().find(|(c, _)| *c == channel).map(|(_, bytes)| bytes)
    }
}
