//! Fragments to messages.
//!
//! A bitmap a message says which of its fragments have come, so that they may come in any order and any number of times. The stock
//! library only counts them: a fragment that comes twice completes a message with a part of it missing.
//!
//! Memory is bounded by what has really arrived, not by what a header claims: at most [`BYTES`] and [`MESSAGES`]. Beyond, the message that
//! has waited longest for a fragment is given up; so is one that waited for more than [`PATIENCE_NS`]. Whatever is given up is told.

use super::Fragment;
use std::collections::BTreeMap;
use std::net::SocketAddrV4;

/// Bytes of fragments held at most: one message of the greatest length and some.
const BYTES: usize = (1 << 28) + (1 << 26);
/// Incomplete messages held at most.
const MESSAGES: usize = 1000;
/// How long a message waits for its next fragment, ns.
const PATIENCE_NS: i64 = 2_000_000_000;
/// What a fragment costs beside its bytes.
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

/// What became of a fragment.
#[derive(Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Others are still missing.
    Incomplete {
        /// A later one had come before it.
        reordered: bool,
    },
    /// It had come before.
    Duplicate,
    /// The message is whole.
    Complete {
        /// The message.
        message: Whole,
        /// A later fragment had come before this one.
        reordered: bool,
    },
    /// The fragments do not fit together: the message is given up.
    Contradictory,
}

/// A message put together.
#[derive(Debug, PartialEq, Eq)]
pub struct Whole {
    /// Channel.
    pub channel: String,
    /// The message.
    pub data: Vec<u8>,
}

/// A message that was given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Abandoned {
    /// Its sender.
    pub sender: SocketAddrV4,
    /// Its number.
    pub sequence: u32,
    /// Fragments that came.
    pub came: u16,
    /// Fragments there are.
    pub count: u16,
}

struct Partial {
    size: u32,
    count: u16,
    channel: Option<String>,
    /// Which fragments are among the pieces.
    came: Vec<u64>,
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
    /// One that holds no more than so many bytes and messages.
    pub fn with_limit(bytes: usize, messages: usize) -> Self {
        Reassembler { partial: BTreeMap::new(), bytes: 0, limit: Limit { bytes, messages }, abandoned: Vec::new() }
    }

    /// Takes a fragment that arrived at `t_ns`.
    pub fn accept(&mut self, sender: SocketAddrV4, t_ns: i64, fragment: &Fragment) -> Outcome {
        let key = (sender, fragment.sequence);
        let other = |p: &Partial| p.size != fragment.size || p.count != fragment.count;
        if self.partial.get(&key).is_some_and(other) {
            // The number is in use again, as after a restart of the sender: the old message will never be whole.
            self.give_up(key);
        }
        let partial = self.partial.entry(key).or_insert_with(|| Partial::new(fragment));
        let (word, bit) = (usize::from(fragment.number / 64), 1u64 << (fragment.number % 64));
        if partial.came[word] & bit != 0 {
            return Outcome::Duplicate;
        }
        partial.came[word] |= bit;
        let reordered = !partial.pieces.is_empty() && fragment.number < partial.highest;
        partial.highest = partial.highest.max(fragment.number);
        partial.last_ns = t_ns;
        if let Some(channel) = fragment.channel {
            partial.channel = Some(channel.to_owned());
        }
        partial.pieces.push(Piece { number: fragment.number, offset: fragment.offset, data: fragment.data.to_vec() });
        self.bytes += fragment.data.len() + OVERHEAD;
        if partial.pieces.len() < usize::from(partial.count) {
            self.stay_within_limits(key);
            return Outcome::Incomplete { reordered };
        }
        let partial = self.partial.remove(&key).expect("it was entered above");
        self.bytes -= partial.bytes();
        match partial.whole() {
            Some(message) => Outcome::Complete { message, reordered },
            None => Outcome::Contradictory,
        }
    }

    /// Gives up what has waited too long at `now_ns`.
    pub fn expire(&mut self, now_ns: i64) {
        let old = |p: &Partial| now_ns.saturating_sub(p.last_ns) > PATIENCE_NS;
        let keys: Vec<Key> = self.partial.iter().filter(|(_, p)| old(p)).map(|(key, _)| *key).collect();
        keys.into_iter().for_each(|key| self.give_up(key));
    }

    /// Gives up everything that is incomplete.
    pub fn clear(&mut self) {
        while let Some((&key, _)) = self.partial.first_key_value() {
            self.give_up(key);
        }
    }

    /// What was given up since this was last asked.
    pub fn abandoned(&mut self) -> Vec<Abandoned> {
        std::mem::take(&mut self.abandoned)
    }

    /// Bytes held, with what holding them costs.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    fn stay_within_limits(&mut self, newest: Key) {
        while self.bytes > self.limit.bytes || self.partial.len() > self.limit.messages {
            let others = self.partial.iter().filter(|(key, _)| **key != newest);
            let Some(key) = others.min_by_key(|(_, p)| p.last_ns).map(|(key, _)| *key) else { break };
            self.give_up(key);
        }
    }

    fn give_up(&mut self, key: Key) {
        if let Some(partial) = self.partial.remove(&key) {
            self.bytes -= partial.bytes();
            let (sender, sequence) = key;
            let came = partial.pieces.len() as u16;
            self.abandoned.push(Abandoned { sender, sequence, came, count: partial.count });
        }
    }
}

impl Partial {
    fn new(fragment: &Fragment) -> Self {
        Partial {
            size: fragment.size,
            count: fragment.count,
            channel: None,
            came: vec![0; usize::from(fragment.count).div_ceil(64)],
            pieces: Vec::new(),
            highest: 0,
            last_ns: 0,
        }
    }

    fn bytes(&self) -> usize {
        self.pieces.iter().map(|piece| piece.data.len() + OVERHEAD).sum()
    }

    /// The message, if the pieces lie end to end from its first to its last byte.
    fn whole(mut self) -> Option<Whole> {
        self.pieces.sort_unstable_by_key(|piece| piece.number);
        let mut data = Vec::with_capacity(self.size as usize);
        for piece in &self.pieces {
            if piece.offset as usize != data.len() {
                return None;
            }
            data.extend_from_slice(&piece.data);
        }
        (data.len() == self.size as usize).then_some(Whole { channel: self.channel?, data })
    }
}
