//! Reassembles messages from fragments.
//!
//! A bitmap per message marks the received fragments, so that they can arrive in any order and any number of times. liblcm only counts
//! fragments: there, a duplicate completes a message that lacks another fragment.
//!
//! Memory is bounded by received data, not by the sizes that headers claim: at most [`BYTES`] and [`MESSAGES`]. Beyond these limits the
//! message with the oldest last fragment is abandoned, as is one without a new fragment for [`FRAGMENT_TIMEOUT_NS`]. Abandoned messages are reported.

use super::Fragment;
use std::collections::BTreeMap;
use std::net::SocketAddrV4;

/// Limit of buffered fragments, bytes: one message of the greatest length and some more.
const BYTES: usize = (1 << 28) + (1 << 26);
/// Limit of incomplete messages.
const MESSAGES: usize = 1000;
/// Timeout of an incomplete message since its last fragment, ns.
const FRAGMENT_TIMEOUT_NS: i64 = 2_000_000_000;
/// Memory overhead per fragment, bytes.
const OVERHEAD: usize = 64;

/// Incomplete messages of all senders.
pub struct Reassembler {
    partial: BTreeMap<Key, Partial>,
    bytes: usize,
    limit: Limit,
    abandoned: Vec<Abandoned>,
}

type Key = (SocketAddrV4, u32);

#[derive(Clone, Copy)]
struct Limit {
    bytes: usize,
    messages: usize,
}

/// Result of a fragment.
#[derive(Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Other fragments are missing.
    Incomplete {
        /// A later fragment arrived before it.
        reordered: bool,
    },
    /// The fragment was already received.
    Duplicate,
    /// The message is complete.
    Complete {
        /// Reassembled message.
        message: Reassembled,
        /// A later fragment arrived before this one.
        reordered: bool,
    },
    /// The fragments do not add up to a message: it is dropped.
    Contradictory,
}

/// A reassembled message.
#[derive(Debug, PartialEq, Eq)]
pub struct Reassembled {
    /// Channel.
    pub channel: String,
    /// The message.
    pub data: Vec<u8>,
}

/// An incomplete message that was abandoned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Abandoned {
    /// Sender.
    pub sender: SocketAddrV4,
    /// Sequence number.
    pub sequence: u32,
    /// Fragments received.
    pub received: u16,
    /// Fragments of the message.
    pub count: u16,
}

struct Partial {
    size: u32,
    count: u16,
    channel: Option<String>,
    /// Bitmap of the received fragments.
    received: Vec<u64>,
    pieces: Vec<Piece>,
    highest: u16,
    last_ns: i64,
}

struct Piece {
    number: u16,
    offset: u32,
    data: Vec<u8>,
}

impl Default for Reassembler {
    fn default() -> Self {
        Self::with_limit(BYTES, MESSAGES)
    }
}

impl Reassembler {
    /// Sets the limits of buffered bytes and incomplete messages.
    pub fn with_limit(bytes: usize, messages: usize) -> Self {
        Reassembler { partial: BTreeMap::new(), bytes: 0, limit: Limit { bytes, messages }, abandoned: Vec::new() }
    }

    /// Adds a fragment that arrived at `t_ns`.
    pub fn accept(&mut self, sender: SocketAddrV4, t_ns: i64, fragment: &Fragment) -> Outcome {
        let key = (sender, fragment.sequence);
        let other = |p: &Partial| p.size != fragment.size || p.count != fragment.count;
        if self.partial.get(&key).is_some_and(other) {
            // The sequence number is reused, as after a restart of the sender: the old message cannot be completed.
            self.abandon(key);
        }
        let partial = self.partial.entry(key).or_insert_with(|| Partial::new(fragment));
        let (word, bit) = (usize::from(fragment.number / 64), 1u64 << (fragment.number % 64));
        if partial.received[word] & bit != 0 {
            return Outcome::Duplicate;
        }
        partial.received[word] |= bit;
        let reordered = !partial.pieces.is_empty() && fragment.number < partial.highest;
        partial.highest = partial.highest.max(fragment.number);
        partial.last_ns = t_ns;
        if let Some(channel) = &fragment.channel {
            partial.channel = Some(channel.to_string());
        }
        partial.pieces.push(Piece { number: fragment.number, offset: fragment.offset, data: fragment.data.to_vec() });
        self.bytes += fragment.data.len() + OVERHEAD;
        if partial.pieces.len() < usize::from(partial.count) {
            self.stay_within_limits(key);
            return Outcome::Incomplete { reordered };
        }
        let partial = self.partial.remove(&key).expect("inserted above");
        self.bytes -= partial.bytes();
        match partial.assemble() {
            Some(message) => Outcome::Complete { message, reordered },
            None => Outcome::Contradictory,
        }
    }

    /// Abandons messages that have timed out at `now_ns`.
    pub fn expire(&mut self, now_ns: i64) {
        let old = |p: &Partial| now_ns.saturating_sub(p.last_ns) > FRAGMENT_TIMEOUT_NS;
        let keys: Vec<Key> = self.partial.iter().filter(|(_, p)| old(p)).map(|(key, _)| *key).collect();
        keys.into_iter().for_each(|key| self.abandon(key));
    }

    /// Abandons all incomplete messages.
    pub fn clear(&mut self) {
        while let Some((&key, _)) = self.partial.first_key_value() {
            self.abandon(key);
        }
    }

    /// Messages abandoned since the last call.
    pub fn abandoned(&mut self) -> Vec<Abandoned> {
        std::mem::take(&mut self.abandoned)
    }

    /// Buffered bytes, including the overhead.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    fn stay_within_limits(&mut self, newest: Key) {
        while self.bytes > self.limit.bytes || self.partial.len() > self.limit.messages {
            let others = self.partial.iter().filter(|(key, _)| **key != newest);
            let Some(key) = others.min_by_key(|(_, p)| p.last_ns).map(|(key, _)| *key) else { break };
            self.abandon(key);
        }
    }

    fn abandon(&mut self, key: Key) {
        if let Some(partial) = self.partial.remove(&key) {
            self.bytes -= partial.bytes();
            let (sender, sequence) = key;
            let received = partial.pieces.len() as u16;
            self.abandoned.push(Abandoned { sender, sequence, received, count: partial.count });
        }
    }
}

impl Partial {
    fn new(fragment: &Fragment) -> Self {
        Partial {
            size: fragment.size,
            count: fragment.count,
            channel: None,
            received: vec![0; usize::from(fragment.count).div_ceil(64)],
            pieces: Vec::new(),
            highest: 0,
            last_ns: 0,
        }
    }

    fn bytes(&self) -> usize {
        self.pieces.iter().map(|piece| piece.data.len() + OVERHEAD).sum()
    }

    /// The message, if the pieces are contiguous from its first to its last byte.
    fn assemble(mut self) -> Option<Reassembled> {
        self.pieces.sort_unstable_by_key(|piece| piece.number);
        let mut data = Vec::with_capacity(self.size as usize);
        for piece in &self.pieces {
            if piece.offset as usize != data.len() {
                return None;
            }
            data.extend_from_slice(&piece.data);
        }
        (data.len() == self.size as usize).then_some(Reassembled { channel: self.channel?, data })
    }
}
