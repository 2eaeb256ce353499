//! Carries encoded messages between parts: over liblcm ([`LcmBus`]) or within a process ([`MemoryBus`]).
//!
//! Both deliver a copy of every message to each handle that subscribed to its channel, the sender's own handle included. Nothing of
//! a user runs while a message arrives: messages wait in a queue until [`Bus::handle`] hands them over.

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

/// Messages that may wait in a queue. liblcm's own 30 overflow within 3 ms at 10 channels of 1 kHz.
pub const QUEUE_CAPACITY: usize = 5000;

/// A message as it arrived.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Received {
    /// Its channel.
    pub channel: String,
    /// Its bytes, fingerprint included.
    pub data: Vec<u8>,
    /// When it arrived, µs since the Unix epoch; `None` on a bus without a clock.
    pub recv_utime: Option<i64>,
}

/// A handle to a bus.
pub trait Bus: Send {
    /// Sends bytes on a channel.
    ///
    /// # Errors
    /// [`BusError::ChannelName`], [`BusError::MessageSize`], [`BusError::Publish`]
    fn publish(&mut self, channel: &str, bytes: &[u8]) -> Result<(), BusError>;

    /// Asks for the messages of every channel whose whole name matches a regular expression; a plain name matches itself.
    /// A channel that matches several subscriptions is delivered once.
    ///
    /// # Errors
    /// [`BusError::Pattern`], [`BusError::Subscribe`]
    fn subscribe(&mut self, channels: &str) -> Result<(), BusError>;

    /// Waits up to `timeout` for a message, then returns it and all that wait behind it, at most [`QUEUE_CAPACITY`], in order of
    /// arrival. Empty if none came; with a timeout of zero it does not wait.
    ///
    /// # Errors
    /// [`BusError::Receive`]
    fn handle(&mut self, timeout: Duration) -> Result<Vec<Received>, BusError>;

    /// Messages lost because this handle's queue was full; 0 where the bus cannot know.
    fn dropped(&self) -> u64;
}

/// What can go wrong on a bus.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum BusError {
    #[error("LCM cannot be opened with {url:?}: {advice}")]
    Open { url: String, advice: &'static str },
    #[error("channel {channel:?}: found {length} bytes, expected 1 to {limit} without NUL")]
    ChannelName { channel: String, length: usize, limit: usize },
    #[error("channel {channel}: message of {length} bytes, LCM carries at most {limit}")]
    MessageSize { channel: String, length: usize, limit: usize },
    #[error("channel pattern {pattern:?}: {problem}")]
    Pattern { pattern: String, problem: String },
    #[error("LCM refused the subscription to {pattern:?} on {url:?}")]
    Subscribe { pattern: String, url: String },
    #[error("channel {channel}: LCM could not send {length} bytes: {reason}")]
    Publish { channel: String, length: usize, reason: String },
    #[error("nothing more comes from {url:?}: {reason}")]
    Receive { url: String, reason: String },
}

/// The rules for names are LCM's on every bus, so that what works in a process works between processes.
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

/// A pattern that has to match the whole name, as liblcm matches.
fn whole_name(pattern: &str) -> Result<Regex, BusError> {
    let error = |problem: String| BusError::Pattern { pattern: pattern.to_owned(), problem };
    if pattern.contains('\0') {
        return Err(error("contains NUL".to_owned()));
    }
    Regex::new(&format!("^(?:{pattern})$")).map_err(|e| error(e.to_string()))
}
