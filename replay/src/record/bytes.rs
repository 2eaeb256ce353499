//! A preallocated lock-free ring of byte strings between two threads.

use rtrb::{Consumer, Producer, RingBuffer};

/// Size of the length prefix of each string, bytes.
const PREFIX: usize = 4;

/// The writing end of the ring.
pub struct BytesIn(Producer<u8>);

/// The reading end of the ring.
pub struct BytesOut(Consumer<u8>);

/// Creates a ring of `capacity` bytes.
pub fn byte_ring(capacity: usize) -> (BytesIn, BytesOut) {
    let (input, output) = RingBuffer::new(capacity);
    (BytesIn(input), BytesOut(output))
}

impl BytesIn {
    /// Appends one string, given in parts; `false` if it does not fit now.
    pub fn push(&mut self, parts: &[&[u8]]) -> bool {
        let length: usize = parts.iter().map(|part| part.len()).sum();
        let Ok(prefix) = u32::try_from(length) else { return false };
        let Ok(mut chunk) = self.0.write_chunk(PREFIX + length) else { return false };
        let (mut first, mut second) = chunk.as_mut_slices();
        let prefix = prefix.to_ne_bytes();
        for mut part in std::iter::once(&prefix[..]).chain(parts.iter().copied()) {
            let here = part.len().min(first.len());
            first.split_off_mut(..here).expect("not longer").copy_from_slice(&part[..here]);
            part = &part[here..];
            second.split_off_mut(..part.len()).expect("the chunk is as long as its parts").copy_from_slice(part);
        }
        chunk.commit_all();
        true
    }

    /// Longest string that fits into the empty ring, bytes.
    pub fn longest(&self) -> usize {
        (self.0.buffer().capacity() - PREFIX).min(u32::MAX as usize)
    }

    /// Used bytes of the ring.
    pub fn waiting(&self) -> usize {
        self.0.buffer().capacity() - self.0.slots()
    }

    /// Size of the ring, bytes.
    pub fn capacity(&self) -> usize {
        self.0.buffer().capacity()
    }

    /// Whether the reading end was dropped.
    pub fn is_abandoned(&self) -> bool {
        self.0.is_abandoned()
    }
}

impl BytesOut {
    /// Moves the next string into `out`, replacing its contents; `false` if the ring is empty.
    pub fn pop(&mut self, out: &mut Vec<u8>) -> bool {
        let mut prefix = [0; PREFIX];
        if self.0.pop_entire_slice(&mut prefix).is_err() {
            return false;
        }
        // A string is written in one step, so it is complete.
        let chunk =
            self.0.read_chunk(u32::from_ne_bytes(prefix) as usize).expect("the prefix is the length of the string");
        let (first, second) = chunk.as_slices();
        out.clear();
        out.extend_from_slice(first);
        out.extend_from_slice(second);
        chunk.commit_all();
        true
    }

    /// Whether the writing end was dropped; the strings in the ring can still be read.
    pub fn is_abandoned(&self) -> bool {
        self.0.is_abandoned()
    }
}
