//! Lock-free ring of encoded messages from the real-time thread to the publisher, allocated once.

use replay::record::{BytesIn, BytesOut, byte_ring};

/// Bytes before the channel's name: time, and length of the name.
const HEADER: usize = 8 + 1;

/// The end of the real-time thread.
pub struct MessageSender(BytesIn);

/// The end of the publisher.
pub struct MessageReceiver {
    ring: BytesOut,
    buffer: Vec<u8>,
}

/// A message taken from the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RingMessage<'a> {
    /// Time of the tick that sent it, ns.
    pub t_ns: i64,
    /// Its channel.
    pub channel: &'a str,
    /// Its bytes, fingerprint included.
    pub data: &'a [u8],
}

/// Allocates a ring of `capacity` bytes and returns both ends.
pub fn message_ring(capacity: usize) -> (MessageSender, MessageReceiver) {
    let (input, output) = byte_ring(capacity);
    (MessageSender(input), MessageReceiver { ring: output, buffer: Vec::new() })
}

impl MessageSender {
    /// Puts a message into the ring; false if there is no room or the channel's name is longer than 255 bytes. Allocates nothing.
    pub fn push(&mut self, t_ns: i64, channel: &str, data: &[u8]) -> bool {
        let Ok(length) = u8::try_from(channel.len()) else { return false };
        self.0.push(&[&t_ns.to_ne_bytes(), &[length], channel.as_bytes(), data])
    }
}

impl MessageReceiver {
    /// Allocates the memory for all later messages of up to 64 KiB, so that taking them allocates nothing.
    pub fn reserve(&mut self) {
        self.buffer.reserve(HEADER + usize::from(u8::MAX) + (1 << 16));
    }

    /// Takes the next message, if there is one.
    pub fn pop(&mut self) -> Option<RingMessage<'_>> {
        if !self.ring.pop(&mut self.buffer) {
            return None;
        }
        let (header, rest) = self.buffer.split_first_chunk::<HEADER>()?;
        let (t_ns, length) = header.split_first_chunk()?;
        let (channel, data) = rest.split_at_checked(usize::from(*length.first()?))?;
        Some(RingMessage { t_ns: i64::from_ne_bytes(*t_ns), channel: std::str::from_utf8(channel).ok()?, data })
    }

    /// The real-time thread has ended. Messages in the ring can still be taken.
    pub fn is_abandoned(&self) -> bool {
        self.ring.is_abandoned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_keep_time_channel_bytes_and_order() {
        let (mut input, mut output) = message_ring(1024);
        assert!(input.push(-5, "A", b"xyz") && input.push(7, "TIMING", b""));
        assert_eq!(output.pop(), Some(RingMessage { t_ns: -5, channel: "A", data: b"xyz" }));
        assert_eq!(output.pop(), Some(RingMessage { t_ns: 7, channel: "TIMING", data: b"" }));
        assert_eq!(output.pop(), None);
        assert!(!input.push(0, "A", &[0; 2000]), "larger than the ring");
        assert!(!input.push(0, &"A".repeat(256), b""));
        drop(input);
        assert!(output.is_abandoned());
    }
}
