//! Logs: the LCM event log (`.lcmlog`) and MCAP (`.mcap`), behind one writer and one reader.
//!
//! Both hold the same thing: events, each a channel, a time and the bytes of one LCM message. [`LogWriter`] takes the format from the
//! file's name; [`LogReader`] from the file's first bytes, whatever its name.
//!
//! | | LCM event log | MCAP |
//! |---|---|---|
//! | time | whole microseconds, rounded down | nanoseconds |
//! | checks | none: a damaged payload cannot be seen | CRC of each chunk: a damaged chunk is dropped and reported |
//! | smallest loss | one event | one chunk (256 KiB before compression) |
//! | types | not in the file, but in its RUN_INFO message | `.lcm` text of each channel |
//!
//! A reader tells three ends apart: the end, a *cut* (the file stops inside a record, as after a power failure or while it is still being
//! written) and *damage* (bytes that belong to no record, from which it recovers). Memory is bounded by one record, at most
//! [`MAX_MESSAGE`] bytes, however long the file and whatever its lengths claim.

mod event_log;
mod mcap_reader;
mod mcap_writer;
mod reader;
mod schema;
mod source;
mod summary;
mod writer;

pub use reader::{Events, LogReader};
pub use summary::{ChannelSummary, LogSummary};
pub(crate) use writer::check_event;
pub use writer::{LogWriter, Output};

use std::sync::Arc;

/// Longest message that LCM carries, bytes.
pub const MAX_MESSAGE: usize = 1 << 28;

/// Longest channel name that LCM carries, bytes.
pub const MAX_CHANNEL: usize = 63;

/// A log format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// LCM event log, `.lcmlog`.
    LcmLog,
    /// MCAP with LCM payloads, `.mcap`.
    Mcap,
}

/// One message of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Event {
    /// Channel on which it went out.
    pub channel: Arc<str>,
    /// Time that the log gives it, ns: receive time in a live run, simulation time in a lockstep run.
    pub t_ns: i64,
    /// The encoded message, fingerprint first.
    pub data: Vec<u8>,
    /// Where its record begins in the file; in MCAP, the chunk that holds it.
    pub offset: u64,
}

impl Event {
    /// The first eight bytes of an LCM message: the fingerprint of its type. `None` if it is shorter.
    pub fn fingerprint(&self) -> Option<u64> {
        fingerprint(&self.data)
    }
}

/// Fingerprint of an encoded LCM message: its first eight bytes, big-endian. `None` if it is shorter.
pub fn fingerprint(message: &[u8]) -> Option<u64> {
    message.first_chunk().map(|bytes| u64::from_be_bytes(*bytes))
}

/// What a reader comes across.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Item {
    /// A message.
    Event(Event),
    /// Bytes that belong to no whole record. Reading goes on after them.
    Damaged(Damaged),
    /// The file stops before its end: always the last item.
    Cut(Cut),
}

/// A stretch of a file that could not be read.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Damaged {
    /// Where it begins.
    pub offset: u64,
    /// How many bytes were skipped.
    pub bytes: u64,
    /// What is wrong there.
    pub why: String,
}

/// The end of a file that stops too early.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Cut {
    /// Where the incomplete part begins.
    pub offset: u64,
    /// How many bytes of it there are.
    pub bytes: u64,
}

/// What is known to be wrong with a log, as far as it has been read.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct Health {
    /// Damaged stretches.
    pub damaged: Vec<Damaged>,
    /// Where the file is cut, if it is.
    pub cut: Option<Cut>,
}

impl Health {
    /// Nothing is damaged and nothing is cut.
    pub fn is_good(&self) -> bool {
        self.damaged.is_empty() && self.cut.is_none()
    }

    /// Bytes of the file that are in no event.
    pub fn bytes_skipped(&self) -> u64 {
        self.damaged.iter().map(|d| d.bytes).sum::<u64>() + self.cut.as_ref().map_or(0, |c| c.bytes)
    }
}

/// Channel names, each stored once.
#[derive(Default)]
struct Names(std::collections::BTreeSet<Arc<str>>);

impl Names {
    fn intern(&mut self, name: &str) -> Arc<str> {
        if let Some(known) = self.0.get(name) {
            return Arc::clone(known);
        }
        let name: Arc<str> = name.into();
        self.0.insert(Arc::clone(&name));
        name
    }
}
