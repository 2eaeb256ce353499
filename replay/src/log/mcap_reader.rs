//! Reads MCAP files that may be cut or damaged anywhere: walks over the records, checks every length before it uses it, and continues at the
//! next chunk after damage.
//!
//! Source: MCAP specification, <https://mcap.dev/spec>. Chunks are decoded by [`super::chunk`]. Records may be longer than their known
//! parts, records of unknown kinds are skipped, and schemas, channels and messages may also stand outside chunks. In a file with messages
//! outside chunks (which [`super::LogWriter`] never writes) reading continues at the next message after damage, and an altered message is
//! detected only by the CRC of all the data.

mod chunk_messages;
mod records;
mod resync;

use super::byte_source::ByteSource;
use super::channel_names::ChannelNames;
use super::chunk::{ChunkDecoder, ChunkHeader, Decoded, HEADER, MAX_RECORD, MessageHeader, PREFIX};
use super::mcap_records;
use super::mcap_summary::{STRETCH, ends_with_magic, prefix};
use super::mcap_writer::split_named;
use super::{Cut, Damaged, EventRef, FileChannel, FileSchema, ItemRef, McapSource};
use crate::Error;
use mcap::MAGIC;
use mcap::records::op;
use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::sync::Arc;

/// Attachments, metadata and private records that are remembered for a copy.
const MAX_SIDE_RECORDS: usize = 1 << 20;

/// A record of the data section that is no message: an attachment, metadata, or a record of an unknown kind.
#[derive(Debug, Clone, Copy)]
pub(super) struct SideRecord {
    pub opcode: u8,
    /// Offset of its body in the file.
    pub body: u64,
    /// End of its body.
    pub end: u64,
}

/// Side records of the part of the file that was read.
#[derive(Debug, Default)]
pub(super) struct SideRecords {
    pub list: Vec<SideRecord>,
    /// Records that are not in `list`: those in chunks, and those beyond the limit of the list.
    pub others: u64,
}

pub(super) struct McapReader {
    source: ByteSource,
    at: u64,
    /// End of the last record that is certainly one. Later records may be misread if one of them has a wrong length.
    last_certain_end: u64,
    section: Section,
    /// Start of the current MCAP: a file can contain several, one after the other.
    base: u64,
    /// Number of MCAPs so far.
    parts: usize,
    names: ChannelNames,
    /// By channel id.
    channels: Vec<Option<Channel>>,
    schemas: BTreeMap<u16, Arc<FileSchema>>,
    decoder: ChunkDecoder,
    chunk: Chunk,
    /// Damage and cut that are not yet returned.
    pending: VecDeque<ItemRef<'static>>,
    summary_read: bool,
    /// In the data section, where schemas, channels and messages count.
    in_data: bool,
    /// After damage, also search for messages outside chunks: until the first chunk, and after each message outside chunks.
    loose: bool,
    pub side_records: SideRecords,
    /// Bytes that were read again in search of chunks.
    read_again: u64,
    /// Channel of the last message in a channel for further names.
    named: Arc<str>,
    /// CRC of the data so far; `None` after damage.
    crc: Option<crc32fast::Hasher>,
    /// The file is still being written: an incomplete record at its end is read later.
    growing: bool,
    pub keep_unchecked: bool,
}

struct Channel {
    file: Arc<FileChannel>,
    number_high: i64,
    /// Each message starts with the name of its channel and a NUL.
    is_named: bool,
}

/// The current chunk.
#[derive(Default)]
struct Chunk {
    records: Vec<u8>,
    at: usize,
    offset: u64,
    /// Its CRC is wrong, or it could not be decompressed completely.
    unchecked: bool,
    /// Messages in it that could not be returned.
    lost: u64,
    /// Damage to report after its last message.
    damage: Option<ItemRef<'static>>,
}

/// Position in the structure of the file.
#[derive(Clone, Copy, PartialEq)]
enum Section {
    BeforeOpeningMagic,
    InRecords,
    BeforeClosingMagic,
    AfterClosingMagic,
    /// After a reported cut.
    AfterCut,
}

/// Result of reading one record.
enum Step {
    /// Processed; the next record is at this offset.
    Next(u64),
    /// A message outside chunks: end, header, range of the data in the file.
    Message(u64, MessageHeader, Range<u64>),
    /// Its length is plausible, but its content is invalid: end, reason.
    Bad(u64, String),
    /// Not a complete record.
    Lost(&'static str),
    /// Incomplete at the end of a file that is still being written.
    Wait,
}

impl McapReader {
    pub fn new(source: ByteSource, growing: bool) -> Self {
        McapReader {
            source,
            at: 0,
            last_certain_end: 0,
            section: Section::BeforeOpeningMagic,
            base: 0,
            parts: 0,
            names: ChannelNames::default(),
            channels: Vec::new(),
            schemas: BTreeMap::new(),
            decoder: ChunkDecoder::new(),
            chunk: Chunk::default(),
            pending: VecDeque::new(),
            summary_read: false,
            in_data: true,
            loose: true,
            side_records: SideRecords::default(),
            read_again: 0,
            named: Arc::from(""),
            crc: None,
            growing,
            keep_unchecked: false,
        }
    }

    /// Whether a file without opening magic is MCAP: it ends with the magic, or its first record is a header.
    pub fn looks_like_one(source: &mut ByteSource) -> Result<bool, Error> {
        if ends_with_magic(source)? {
            return Ok(true);
        }
        let head = source.bytes(MAGIC.len() as u64, 4096)?;
        let Some((&op::HEADER, rest)) = head.split_first() else {
            return Ok(false);
        };
        let Some((length, body)) = rest.split_first_chunk() else {
            return Ok(false);
        };
        let whole = usize::try_from(u64::from_le_bytes(*length)).ok().and_then(|n| body.get(..n));
        Ok(whole.is_some_and(|body| mcap_records::header(body).is_some()))
    }

    /// Offset of the first undamaged chunk. The chunks that are tried on the way may have twice the length of the file in all.
    pub fn first_chunk(source: &mut ByteSource) -> Result<Option<u64>, Error> {
        let (mut from, mut decoder, mut records) = (0, ChunkDecoder::new(), Vec::new());
        let mut tries = 2 * source.len();
        while let Some(at) = source.find(&[op::CHUNK], from)? {
            let left = source.len() - at;
            if let Some((_, length)) = prefix(source, at)?
                && left >= PREFIX
                && length <= (left - PREFIX).min(MAX_RECORD)
                && let Some(head) = ChunkHeader::parse(source.bytes(at + PREFIX, HEADER.min(length as usize))?)
                && head.fits(length)
                && head.has_crc()
            {
                let Some(rest) = tries.checked_sub(length) else { return Ok(None) };
                tries = rest;
                let body = source.bytes(at + PREFIX + head.records as u64, head.inner as usize)?;
                if decoder.decode(&head, body, &mut records) == Decoded::Complete {
                    return Ok(Some(at));
                }
            }
            from = at + 1;
        }
        Ok(None)
    }

    /// Several MCAPs were read, one after the other. Each has its own channel ids, so [`McapReader::seek`] is not possible.
    pub fn is_joined(&self) -> bool {
        self.parts > 1
    }

    /// Continues at the chunk or message at this offset, that of an event of the same file.
    pub fn seek(&mut self, offset: u64) -> Result<(), Error> {
        self.read_summary()?;
        self.go_to(offset, Section::InRecords);
        self.in_data = true;
        Ok(())
    }

    /// Continues at the start of the file.
    pub fn rewind(&mut self) {
        self.go_to(0, Section::BeforeOpeningMagic);
        self.parts = 0;
        self.side_records = SideRecords::default();
    }

    fn go_to(&mut self, offset: u64, section: Section) {
        (self.at, self.last_certain_end, self.section) = (offset, offset, section);
        // Damage of the current chunk is still returned.
        self.chunk.records.clear();
        self.chunk.at = 0;
        self.pending.clear();
        (self.read_again, self.crc) = (0, None);
    }

    /// Reads the profile in the header; empty if the first record is no header.
    pub fn read_profile(&mut self) -> Result<String, Error> {
        let at = MAGIC.len() as u64;
        let length = match prefix(&mut self.source, at)? {
            Some((op::HEADER, length)) if length <= 1 << 16 => length,
            _ => return Ok(String::new()),
        };
        let body = self.source.bytes(at + PREFIX, length as usize)?;
        Ok(mcap_records::header(body).map(|(profile, _)| profile).unwrap_or_default())
    }

    /// Bytes of the file, for side records.
    pub fn bytes(&mut self, offset: u64, n: usize) -> Result<&[u8], Error> {
        self.source.bytes(offset, n)
    }

    /// The closing magic was read, and nothing follows it.
    pub fn is_complete(&self) -> bool {
        self.section == Section::AfterClosingMagic && self.at >= self.source.len()
    }

    pub fn next(&mut self) -> Result<Option<ItemRef<'_>>, Error> {
        loop {
            if let Some((head, t_ns, data)) = self.message_of_chunk()? {
                let (offset, data) = (self.chunk.offset, &self.chunk.records[data]);
                let Some(Some(channel)) = self.channels.get(usize::from(head.channel)) else { return Ok(None) };
                let event = channel.event(&head, t_ns, data, offset, (&mut self.names, &mut self.named));
                return Ok(Some(ItemRef::Event(event)));
            }
            if let Some(pending) = self.pending.pop_front() {
                return Ok(Some(pending));
            }
            if self.at >= self.source.len() {
                if self.growing {
                    self.source.refresh_len()?;
                }
                if self.at >= self.source.len() {
                    let complete =
                        matches!(self.section, Section::AfterClosingMagic | Section::AfterCut) || self.growing;
                    if !complete {
                        self.section = Section::AfterCut;
                        return Ok(Some(ItemRef::Cut(Cut { offset: self.source.len(), bytes: 0 })));
                    }
                    return Ok(None);
                }
            }
            let from = self.at;
            match self.step()? {
                Step::Next(to) => self.advance(to)?,
                Step::Message(to, head, data) => {
                    self.advance(to)?;
                    self.last_certain_end = to;
                    let (known, t_ns) = (self.is_known(head.channel)?, i64::try_from(head.log_time));
                    let (true, Ok(t_ns)) = (known, t_ns) else {
                        self.report_lost(from, 1);
                        continue;
                    };
                    let bytes = self.source.bytes(data.start, (data.end - data.start) as usize)?;
                    let Some(Some(channel)) = self.channels.get(usize::from(head.channel)) else { return Ok(None) };
                    let event = channel.event(&head, t_ns, bytes, from, (&mut self.names, &mut self.named));
                    return Ok(Some(ItemRef::Event(event)));
                }
                Step::Bad(to, why) => self.damaged(from, to, why),
                Step::Lost(why) => self.resynchronise(why)?,
                Step::Wait => {
                    let length = self.source.len();
                    self.source.refresh_len()?;
                    if self.source.len() == length {
                        return Ok(None);
                    }
                }
            }
        }
    }

    fn step(&mut self) -> Result<Step, Error> {
        let at = self.at;
        if self.section == Section::InRecords {
            return self.record(at);
        }
        let bytes = self.source.bytes(at, MAGIC.len())?;
        let (is_magic, is_cut) = (bytes == MAGIC, bytes.len() < MAGIC.len() && MAGIC.starts_with(bytes));
        let end = at + bytes.len() as u64;
        if is_cut {
            return Ok(if self.growing { Step::Wait } else { Step::Lost("closing magic is incomplete") });
        }
        let closing = self.section == Section::BeforeClosingMagic;
        self.section = if closing { Section::AfterClosingMagic } else { Section::InRecords };
        if closing {
            return Ok(if is_magic { Step::Next(end) } else { Step::Bad(end, "closing magic is damaged".into()) });
        }
        if !is_magic
            && let Some(magic) = self.opening_magic(at + 1)?
            && self.next_chunk(at)?.is_none_or(|chunk| magic < chunk)
        {
            self.section = Section::BeforeOpeningMagic;
            return Ok(Step::Bad(magic, "bytes before the start of the log".into()));
        }
        (self.base, self.parts) = (at, self.parts + 1);
        self.last_certain_end = end;
        self.channels.clear();
        self.schemas.clear();
        self.summary_read = false;
        (self.in_data, self.loose) = (true, true);
        self.crc = is_magic.then(crc32fast::Hasher::new);
        let header_follows = prefix(&mut self.source, end)?.is_some_and(|(opcode, _)| opcode == op::HEADER);
        Ok(match (is_magic, at) {
            (true, _) => Step::Next(end),
            (false, 0) if header_follows => Step::Bad(end, "opening magic is damaged".into()),
            (false, 0) => Step::Lost("opening magic is damaged"),
            (false, _) => Step::Lost("bytes after the end of the log"),
        })
    }

    /// Offset of the next MCAP at or after `from`.
    fn opening_magic(&mut self, mut from: u64) -> Result<Option<u64>, Error> {
        while let Some(at) = self.source.find(MAGIC, from)? {
            if prefix(&mut self.source, at + MAGIC.len() as u64)?.is_some_and(|(opcode, _)| opcode == op::HEADER) {
                return Ok(Some(at));
            }
            from = at + 1;
        }
        Ok(None)
    }

    /// Moves to `to` over undamaged bytes.
    fn advance(&mut self, to: u64) -> Result<(), Error> {
        if let Some(crc) = &mut self.crc {
            let mut at = self.at;
            while at < to {
                let bytes = self.source.bytes(at, STRETCH.min(to - at) as usize)?;
                if bytes.is_empty() {
                    break;
                }
                crc.update(bytes);
                at += bytes.len() as u64;
            }
        }
        self.at = to;
        Ok(())
    }

    fn damaged(&mut self, from: u64, to: u64, why: String) {
        (self.at, self.last_certain_end) = (to, to);
        self.crc = None;
        self.pending.push_back(ItemRef::Damaged(Damaged { offset: from, bytes: to - from, why }));
    }
}

impl Channel {
    #[inline]
    fn event<'a>(
        &'a self,
        head: &MessageHeader,
        t_ns: i64,
        data: &'a [u8],
        offset: u64,
        (names, named): (&mut ChannelNames, &'a mut Arc<str>),
    ) -> EventRef<'a> {
        let number = self.number_high | i64::from(head.sequence);
        let source = Some(McapSource { channel: &self.file, publish_t: head.publish_time });
        if self.is_named
            && let Some((name, data)) = split_named(data)
        {
            *named = names.of_bytes(name);
            return EventRef { channel: named, t_ns, number, data, offset, source };
        }
        EventRef { channel: &self.file.topic, t_ns, number, data, offset, source }
    }
}
