//! A lock-free ring of byte strings between two threads, allocated once.

use rtrb::{Consumer, Producer, RingBuffer};

/// Length before each string, bytes.
const PREFIX: usize = 4;

/// The end that puts in.
pub struct BytesIn(Producer<u8>);

/// The end that takes out.
pub struct BytesOut(Consumer<u8>);

/// A ring that holds `capacity` bytes.
pub fn byte_ring(capacity: usize) -> (BytesIn, BytesOut) {
    let (input, output) = RingBuffer::new(capacity);
    (BytesIn(input), BytesOut(output))
}

impl BytesIn {
    /// Puts in one string, given in parts; `false` if there is no room for it now.
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

    /// Longest string that an empty ring takes.
    pub fn longest(&self) -> usize {
        (self.0.buffer().capacity() - PREFIX).min(u32::MAX as usize)
    }

    /// Bytes that wait in the ring.
    pub fn waiting(&self) -> usize {
        self.0.buffer().capacity() - self.0.slots()
    }

    /// All bytes that the ring holds.
    pub fn capacity(&self) -> usize {
        self.0.buffer().capacity()
    }

    /// Nobody takes out any more.
    pub fn is_abandoned(&self) -> bool {
        self.0.is_abandoned()
    }
}

impl BytesOut {
    /// Takes the next string into `out`, whatever was there before; `false` if there is none.
    pub fn pop(&mut self, out: &mut Vec<u8>) -> bool {
        let mut prefix = [0; PREFIX];
        if self.0.pop_entire_slice(&mut prefix).is_err() {
            return false;
        }
        // A string is put in at once, so all of it is there.
        let chunk = self.0.read_chunk(u32::from_ne_bytes(prefix) as usize).expect("put in with its length");
        let (first, second) = chunk.as_slices();
        out.clear();
        out.extend_from_slice(first);
        out.extend_from_slice(second);
        chunk.commit_all();
        true
    }

    /// Nobody puts in any more; what is in the ring can still be taken.
    pub fn is_abandoned(&self) -> bool {
        self.0.is_abandoned()
    }
}
