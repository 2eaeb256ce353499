//! Logs: the LCM event log (`.lcmlog`) and MCAP (`.mcap`), behind one writer and one reader.
//!
//! Both formats hold events: channel, time, number and the bytes of one LCM message. [`LogWriter`] selects the format by the extension of
//! the file name, [`LogReader`] by the first bytes of the file.
//!
//! | | LCM event log | MCAP |
//! |---|---|---|
//! | time | whole microseconds, rounded down | nanoseconds |
//! | number | event number, 64 bits | sequence, 32 bits; the upper ones, if any, in the channel's metadata |
//! | checks | none: damage inside a message is not detected | CRC of each chunk and of all the data |
//! | record: loss from one damaged place at most | one event | one chunk (256 KiB before compression) |
//! | types | only in the RUN_INFO message | `.lcm` text per channel |
//!
//! A reader distinguishes the *end* of the log, a *cut* (the file ends inside a record, as after a power failure or while it is still being
//! written) and *damage* (bytes that belong to no record; reading continues after them).
//!
//! A chunk of an MCAP is one record, compressed and checksummed as a whole. If the end of the file cuts a chunk, the events before the cut
//! are read. If a chunk cannot be decompressed completely, or has a wrong CRC, the position of the damage is unknown: its events are
//! omitted unless [`LogReader::keep_unchecked`] asks for the readable ones.
//!
//! Memory is bounded by one record (one event; one chunk, compressed and decompressed), independent of the length of the file: memory for
//! a length that a file claims is allocated only as that many bytes are present.

mod byte_source;
mod channel_names;
mod chunk;
mod chunk_index;
mod copy;
mod diff;
mod event_filter;
mod event_log;
mod excerpt;
mod mcap_reader;
mod mcap_records;
mod mcap_summary;
mod mcap_writer;
mod merge;
mod reader;
mod retype;
pub mod ros2;
mod run_clock;
pub(crate) mod run_path;
mod runs;
mod sequence_gaps;
mod summary;
mod types;
mod verify;
mod writer;

pub(crate) use chunk_index::ChunkIndex;
pub use copy::{CopyOptions, CopyReport, copy};
pub use diff::{ChannelDiff, FirstDifference, LogDiff, diff};
pub use event_filter::EventFilter;
pub use excerpt::{Excerpt, copy_excerpt};
pub use merge::merge;
pub use reader::{Events, LogReader};
pub use retype::{FieldChange, FieldDifference, RetypeReport, retype};
pub use run_clock::{EventTimes, RunClock, RunClockFinder, Zero};
pub use run_path::{path_of_run, split_run};
pub(crate) use runs::run_id;
pub use runs::{RunSummary, Runs};
pub use sequence_gaps::Gap;
pub(crate) use sequence_gaps::{SequenceTracker, sequence_field, sequence_number};
pub use summary::{ChannelSummary, LogSummary};
pub use types::Types;
pub use verify::{ChannelReport, ReplayCheck, ReportedLoss, VerifyReport, verify};
pub(crate) use writer::check_event;
pub use writer::{LogWriter, Output};

use std::collections::BTreeMap;
use std::sync::Arc;

/// Longest message that LCM allows, bytes.
pub const MAX_MESSAGE: usize = 1 << 28;

/// Longest channel name that LCM allows on a network, bytes.
pub const MAX_CHANNEL: usize = 63;

/// Longest channel name in an LCM event log, bytes: the limit of LCM's own reader.
pub const MAX_CHANNEL_IN_LOG: usize = 999;

/// A log format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// LCM event log, `.lcmlog`.
    LcmLog,
    /// MCAP with LCM payloads, `.mcap`.
    Mcap,
}

impl Format {
    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Format::LcmLog => "LCM event log",
            Format::Mcap => "MCAP",
        }
    }
}

/// One message of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Event {
    /// Channel.
    pub channel: Arc<str>,
    /// Log time, ns: receive time in a live run, simulation time in a lockstep run.
    pub t_ns: i64,
    /// Event number in the log: usually counts from 0; restarts in a file of concatenated logs.
    pub number: i64,
    /// The encoded message, fingerprint first.
    pub data: Vec<u8>,
    /// Offset of its record in the file; in MCAP, of its chunk.
    pub offset: u64,
}

impl Event {
    /// Fingerprint of the message's type: its first eight bytes. `None` if the message is shorter.
    pub fn fingerprint(&self) -> Option<u64> {
        fingerprint(&self.data)
    }
}

/// One message of a log, borrowed from its reader. Fields as in [`Event`].
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs, reason = "documented at Event")]
pub struct EventRef<'a> {
    pub channel: &'a Arc<str>,
    pub t_ns: i64,
    pub number: i64,
    pub data: &'a [u8],
    pub offset: u64,
    /// Channel and publish time in an MCAP file; `None` in an LCM event log.
    pub source: Option<McapSource<'a>>,
}

/// Information about a message that only an MCAP file contains.
#[derive(Debug, Clone, Copy)]
pub struct McapSource<'a> {
    /// Its channel.
    pub channel: &'a Arc<FileChannel>,
    /// Time at which it was published, ns.
    pub publish_t: u64,
}

impl<'a> EventRef<'a> {
    /// Schema of the channel in the file. Always `None` in an LCM event log.
    pub fn schema(&self) -> Option<&'a Arc<FileSchema>> {
        self.source.and_then(|source| source.channel.schema.as_ref())
    }

    /// As [`Event::fingerprint`].
    pub fn fingerprint(&self) -> Option<u64> {
        fingerprint(self.data)
    }

    /// An owned copy.
    pub fn to_event(&self) -> Event {
        let EventRef { channel, t_ns, number, data, offset, source: _ } = *self;
        Event { channel: Arc::clone(channel), t_ns, number, data: data.to_vec(), offset }
    }
}

/// A schema of an MCAP file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileSchema {
    /// Name of the type.
    pub name: String,
    /// Schema language: `lcm`, `ros2msg`, ...
    pub encoding: String,
    /// Schema text.
    pub data: Vec<u8>,
}

impl FileSchema {
    /// The text, if its language is LCM.
    pub fn lcm_text(&self) -> Option<&str> {
        std::str::from_utf8(&self.data).ok().filter(|_| self.encoding == "lcm")
    }
}

/// A channel of an MCAP file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileChannel {
    /// Name.
    pub topic: Arc<str>,
    /// Encoding of its messages: `lcm`, `cdr`, `json`, ...
    pub message_encoding: String,
    /// Further properties.
    pub metadata: BTreeMap<String, String>,
    /// Entries of the metadata that a later entry of the same key replaces.
    pub repeated_keys: u64,
    /// Schema.
    pub schema: Option<Arc<FileSchema>>,
}

/// Fingerprint of an encoded LCM message: its first eight bytes, big-endian. `None` if it is shorter.
pub fn fingerprint(message: &[u8]) -> Option<u64> {
    message.first_chunk().map(|bytes| u64::from_be_bytes(*bytes))
}

/// One item of a log, in file order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Item {
    /// A message.
    Event(Event),
    /// Bytes that belong to no complete record. Reading continues after them.
    Damaged(Damaged),
    /// The file ends inside a record: always the last item.
    Cut(Cut),
}

/// One item of a log, borrowed from its reader.
#[derive(Debug, Clone)]
pub enum ItemRef<'a> {
    /// A message.
    Event(EventRef<'a>),
    /// Bytes that belong to no complete record. Reading continues after them.
    Damaged(Damaged),
    /// The file ends inside a record: always the last item.
    Cut(Cut),
}

impl ItemRef<'_> {
    /// An owned copy.
    pub fn to_item(&self) -> Item {
        match self {
            ItemRef::Event(event) => Item::Event(event.to_event()),
            ItemRef::Damaged(damaged) => Item::Damaged(damaged.clone()),
            ItemRef::Cut(cut) => Item::Cut(cut.clone()),
        }
    }
}

/// A byte range of a file that could not be read.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Damaged {
    /// Offset of the first byte.
    pub offset: u64,
    /// Bytes skipped.
    pub bytes: u64,
    /// What is wrong.
    pub why: String,
}

/// The incomplete record at the end of a file.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Cut {
    /// Offset of the incomplete record.
    pub offset: u64,
    /// Bytes of it that are present.
    pub bytes: u64,
}

/// Damage found in a log, as far as it has been read.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct Health {
    /// Damaged ranges.
    pub damaged: Vec<Damaged>,
    /// The incomplete last record, if the file is cut.
    pub cut: Option<Cut>,
}

impl Health {
    /// Nothing is damaged and nothing is cut.
    pub fn is_good(&self) -> bool {
        self.damaged.is_empty() && self.cut.is_none()
    }

    /// Returns an event; collects any other item.
    pub fn note<'a>(&mut self, item: ItemRef<'a>) -> Option<EventRef<'a>> {
        match item {
            ItemRef::Event(event) => return Some(event),
            ItemRef::Damaged(damaged) => self.damaged.push(damaged),
            ItemRef::Cut(cut) => self.cut = Some(cut),
        }
        None
    }

    /// Bytes of the file that belong to no event.
    pub fn bytes_skipped(&self) -> u64 {
        self.damaged.iter().map(|d| d.bytes).sum::<u64>() + self.cut.as_ref().map_or(0, |c| c.bytes)
    }
}
