//! Transport of encoded messages: over liblcm ([`LcmBus`]) or within a process ([`MemoryBus`]).
//!
//! Both deliver a copy of every message to each handle that has subscribed to its channel, the sender's handle included. There are no callbacks:
//! messages wait in a queue until [`Bus::handle`] returns them.

#[allow(unsafe_code, reason = "liblcm is a C library; the wrapper in this module is safe")]
mod lcm;
mod memory;

#[allow(
    unsafe_code,
    non_camel_case_types,
    missing_docs,
    dead_code,
    reason = "declarations and names are those of lcm.h"
)]
mod ffi;

use std::time::Duration;

use regex_lite::Regex;

pub use lcm::LcmBus;
pub use memory::MemoryBus;

/// Why no LCM network can be joined, and what to do.
pub const NO_ROUTE: &str =
    "no interface has a multicast route; as root: ip route replace 224.0.0.0/4 dev lo (or the robot's interface)";
/// Capacity of a queue, in messages. The default of liblcm, 30, overflows within 3 ms with 10 channels at 1 kHz.
pub const QUEUE_CAPACITY: usize = 5000;

/// A received message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Received {
    /// Channel.
    pub channel: String,
    /// Bytes, fingerprint included.
    pub data: Vec<u8>,
    /// Time of arrival, µs since the Unix epoch; `None` on a bus without a clock.
    pub recv_utime: Option<i64>,
}

/// A handle to a bus.
pub trait Bus: Send {
    /// Sends bytes on a channel.
    ///
    /// # Errors
    /// [`BusError::ChannelName`], [`BusError::MessageSize`], [`BusError::Publish`]
    fn publish(&mut self, channel: &str, bytes: &[u8]) -> Result<(), BusError>;

    /// Subscribes to all channels whose complete name matches a regular expression; a plain name matches itself. A message that matches several
    /// subscriptions is delivered once.
    ///
    /// # Errors
    /// [`BusError::Pattern`], [`BusError::Subscribe`]
    fn subscribe(&mut self, channels: &str) -> Result<(), BusError>;

    /// Waits up to `timeout` for a message and returns all messages in the queue, at most [`QUEUE_CAPACITY`], in order of arrival. Returns an empty
    /// vector if none arrived. With a timeout of zero it does not wait.
    ///
    /// # Errors
    /// [`BusError::Receive`]
    fn handle(&mut self, timeout: Duration) -> Result<Vec<Received>, BusError>;

    /// Number of messages dropped because this handle's queue was full; 0 if the bus does not count them.
    fn dropped(&self) -> u64;
}

/// Error of a bus.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum BusError {
    #[error("cannot open LCM at {url:?}: {advice}")]
    Open { url: String, advice: &'static str },
    #[error("channel name {channel:?}: {length} bytes, expected 1 to {limit} without NUL")]
    ChannelName { channel: String, length: usize, limit: usize },
    #[error("channel {channel}: message of {length} bytes, the limit of LCM is {limit}")]
    MessageSize { channel: String, length: usize, limit: usize },
    #[error("channel pattern {pattern:?}: {problem}")]
    Pattern { pattern: String, problem: String },
    #[error("LCM rejected the subscription to {pattern:?} on {url:?}")]
    Subscribe { pattern: String, url: String },
    #[error("channel {channel}: LCM could not send a message of {length} bytes: {reason}")]
    Publish { channel: String, length: usize, reason: String },
    #[error("cannot receive from {url:?}: {reason}")]
    Receive { url: String, reason: String },
}

/// The rules of LCM for names apply to every bus, so that a name that works within a process also works between processes.
fn check_channel(channel: &str) -> Result<(), BusError> {
    let limit = ffi::LCM_MAX_CHANNEL_NAME_LENGTH as usize;
    if (1..=limit).contains(&channel.len()) && !channel.contains('\0') {
        return Ok(());
    }
    Err(BusError::ChannelName { channel: channel.to_owned(), length: channel.len(), limit })
}

/// Largest message that liblcm carries, in bytes.
const MAX_MESSAGE_SIZE: usize = 1 << 28;

fn check_size(channel: &str, bytes: &[u8]) -> Result<(), BusError> {
    if bytes.len() <= MAX_MESSAGE_SIZE {
        return Ok(());
    }
    Err(BusError::MessageSize { channel: channel.to_owned(), length: bytes.len(), limit: MAX_MESSAGE_SIZE })
}

/// A pattern that must match the complete name, as in liblcm.
fn whole_name(pattern: &str) -> Result<Regex, BusError> {
    let error = |problem: String| BusError::Pattern { pattern: pattern.to_owned(), problem };
    if pattern.contains('\0') {
        return Err(error("contains NUL".to_owned()));
    }
    Regex::new(&format!("^(?:{pattern})$")).map_err(|e| error(e.to_string()))
}
