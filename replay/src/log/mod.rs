//! Logs: the LCM event log (`.lcmlog`) and MCAP (`.mcap`), behind one writer and one reader.
//!
//! Both hold the same thing: events, each a channel, a time, a number and the bytes of one LCM message. [`LogWriter`] takes the format
//! from the file's name; [`LogReader`] from the file's first bytes, whatever its name.
//!
//! | | LCM event log | MCAP |
//! |---|---|---|
//! | time | whole microseconds, rounded down | nanoseconds |
//! | number | event number, 64 bits | sequence, 32 bits; the upper ones, if any, in the channel's metadata |
//! | checks | none: a damaged payload cannot be seen | CRC of each chunk and of all the data |
//! | record: the most that one damaged place costs | one event | one chunk (256 KiB before compression) |
//! | types | not in the file, but in its RUN_INFO message | `.lcm` text of each channel |
//!
//! A reader tells three ends apart: the end, a *cut* (the file stops inside a record, as after a power failure or while it is still being
//! written) and *damage* (bytes that belong to no record, from which it recovers).
//!
//! A chunk of an MCAP is one record, compressed as one and checked as one. Of a chunk that the end of the file cuts, the events in
//! front of the cut are read. One that cannot be decompressed to its end, or to something of another CRC, is damaged nobody knows
//! where: its events are left out unless [`LogReader::keep_unchecked`] asks for those that can be had.
//!
//! Memory is bounded by one record (one event; one chunk, compressed and not), however long the file, and by what the file really holds:
//! no length that it claims is believed before as many bytes are there.

mod byte_source;
mod channel_names;
mod chunk;
mod copy;
mod diff;
mod event_filter;
mod event_log;
mod excerpt;
mod mcap_reader;
mod mcap_summary;
mod mcap_writer;
mod merge;
mod reader;
pub mod ros2;
mod run_clock;
mod sequence_gaps;
mod summary;
mod types;
mod verify;
mod writer;

pub use copy::{CopyOptions, CopyReport, copy};
pub use diff::{ChannelDiff, FirstDifference, LogDiff, diff};
pub use event_filter::EventFilter;
pub use excerpt::{ExcerptWindow, copy_excerpt};
pub use merge::merge;
pub use reader::{Events, LogReader};
pub use run_clock::{RunClock, RunClockFinder, Zero};
pub use sequence_gaps::Gap;
pub(crate) use sequence_gaps::{SequenceTracker, sequence_field, sequence_number};
pub use summary::{ChannelSummary, LogSummary};
pub use types::Types;
pub use verify::{ChannelReport, ReplayCheck, VerifyReport, verify};
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
    /// Number that the log gives it: usually they count up from 0; in logs one behind the other they begin anew.
    pub number: i64,
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

/// One message of a log, in the memory of its reader. Fields as in [`Event`].
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs, reason = "said at Event")]
pub struct EventRef<'a> {
    pub channel: &'a Arc<str>,
    pub t_ns: i64,
    pub number: i64,
    pub data: &'a [u8],
    pub offset: u64,
    /// What the file says of the channel's type. Always `None` in an LCM event log.
    pub schema: Option<&'a Arc<FileSchema>>,
}

impl EventRef<'_> {
    /// As [`Event::fingerprint`].
    pub fn fingerprint(&self) -> Option<u64> {
        fingerprint(self.data)
    }

    /// A copy of its own.
    pub fn to_event(&self) -> Event {
        let EventRef { channel, t_ns, number, data, offset, schema: _ } = *self;
        Event { channel: Arc::clone(channel), t_ns, number, data: data.to_vec(), offset }
    }
}

/// A schema that stands in an MCAP file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileSchema {
    /// Name of the type.
    pub name: String,
    /// Language of the text: `lcm`, `ros2msg`, ...
    pub encoding: String,
    /// The text.
    pub data: Vec<u8>,
}

impl FileSchema {
    /// The text, if it is in the LCM type language.
    pub fn lcm_text(&self) -> Option<&str> {
        std::str::from_utf8(&self.data).ok().filter(|_| self.encoding == "lcm")
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

/// What a reader comes across, in its memory.
#[derive(Debug, Clone)]
pub enum ItemRef<'a> {
    /// A message.
    Event(EventRef<'a>),
    /// Bytes that belong to no whole record. Reading goes on after them.
    Damaged(Damaged),
    /// The file stops before its end: always the last item.
    Cut(Cut),
}

impl ItemRef<'_> {
    /// A copy of its own.
    pub fn to_item(&self) -> Item {
        match self {
            ItemRef::Event(event) => Item::Event(event.to_event()),
            ItemRef::Damaged(damaged) => Item::Damaged(damaged.clone()),
            ItemRef::Cut(cut) => Item::Cut(cut.clone()),
        }
    }
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

    /// Takes note of what is no event.
    pub fn note<'a>(&mut self, item: ItemRef<'a>) -> Option<EventRef<'a>> {
        match item {
            ItemRef::Event(event) => return Some(event),
            ItemRef::Damaged(damaged) => self.damaged.push(damaged),
            ItemRef::Cut(cut) => self.cut = Some(cut),
        }
        None
    }

    /// Bytes of the file that are in no event.
    pub fn bytes_skipped(&self) -> u64 {
        self.damaged.iter().map(|d| d.bytes).sum::<u64>() + self.cut.as_ref().map_or(0, |c| c.bytes)
    }
}
