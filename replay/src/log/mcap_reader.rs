//! Reads MCAP files that may be cut or damaged anywhere: walks over the records, checks every length before it uses it, and continues at the
//! next chunk after damage.
//!
//! Source: MCAP specification, <https://mcap.dev/spec>. Chunks are decoded by [`super::chunk`]. In a file without chunks (which
//! [`super::LogWriter`] never writes) reading continues at the next message after damage, and an altered message is detected only by the
//! CRC of all the data.

mod chunk_messages;
mod resync;

use super::byte_source::ByteSource;
use super::channel_names::ChannelNames;
use super::chunk::{ChunkDecoder, ChunkHeader, HEADER, MAX_RECORD, MessageHeader, PREFIX, plausible};
use super::mcap_summary::{DATA_END, FOOTER, STRETCH, ends_with_magic, has_its_length, prefix};
use super::{Cut, Damaged, EventRef, FileSchema, ItemRef};
use crate::Error;
use mcap::MAGIC;
use mcap::read::parse_record;
use mcap::records::{Record, op};
use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::sync::Arc;

/// Metadata key of an MCAP channel: the upper 32 bits of its event numbers. The lower 32 bits are the `sequence` of a message.
pub(super) const NUMBER_HIGH: &str = "lcm_event_number_high";

pub(super) struct McapReader {
    source: ByteSource,
    at: u64,
    /// End of the last record that is certainly one. Later records may be misread if one of them has a wrong length.
    last_certain_end: u64,
    section: Section,
    /// Start of the current MCAP: a file can contain several, one after the other.
    base: u64,
    names: ChannelNames,
    /// By channel id.
    channels: Vec<Option<Channel>>,
    schemas: BTreeMap<u16, Arc<FileSchema>>,
    decoder: ChunkDecoder,
    chunk: Chunk,
    /// Damage and cut that are not yet returned.
    pending: VecDeque<ItemRef<'static>>,
    summary_read: bool,
    /// Messages outside chunks are allowed: until the first chunk or the end of the data. Later, one is a damaged record of another type.
    messages_outside_chunks: bool,
    /// CRC of the data so far; `None` after damage.
    crc: Option<crc32fast::Hasher>,
    /// The file is still being written: an incomplete record at its end is read later.
    growing: bool,
    pub keep_unchecked: bool,
}

struct Channel {
    topic: Arc<str>,
    number_high: i64,
    schema: Option<Arc<FileSchema>>,
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
            names: ChannelNames::default(),
            channels: Vec::new(),
            schemas: BTreeMap::new(),
            decoder: ChunkDecoder::new(),
            chunk: Chunk::default(),
            pending: VecDeque::new(),
            summary_read: false,
            messages_outside_chunks: true,
            crc: None,
            growing,
            keep_unchecked: false,
        }
    }

    /// Continues at a chunk of the first MCAP of the file, with the channels of its summary.
    pub fn start_at(&mut self, offset: u64) -> Result<(), Error> {
        self.read_summary()?;
        (self.at, self.last_certain_end, self.section) = (offset, offset, Section::InRecords);
        (self.messages_outside_chunks, self.crc, self.chunk) = (false, None, Chunk::default());
        self.pending.clear();
        Ok(())
    }

    /// Whether the file, apart from its first bytes, is MCAP: it ends with the magic, or its first record is a header.
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
        Ok(whole.is_some_and(|body| parse_record(op::HEADER, body).is_ok()))
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
                return Ok(Some(ItemRef::Event(channel.event(&head, t_ns, data, offset))));
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
                    return Ok(Some(ItemRef::Event(channel.event(&head, t_ns, bytes, from))));
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
        if !is_magic && let Some(magic) = self.opening_magic(at + 1)? {
            self.section = Section::BeforeOpeningMagic;
            return Ok(Step::Bad(magic, "bytes before the start of the log".into()));
        }
        self.base = at;
        self.last_certain_end = end;
        self.channels.clear();
        self.schemas.clear();
        self.summary_read = false;
        self.messages_outside_chunks = true;
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

    fn record(&mut self, at: u64) -> Result<Step, Error> {
        let Some((opcode, length)) = prefix(&mut self.source, at)? else {
            return Ok(if self.growing { Step::Wait } else { Step::Lost("record is incomplete") });
        };
        let (body, left) = (at + PREFIX, self.source.len() - at - PREFIX);
        if length > left {
            let wait = self.growing && plausible(opcode, length);
            return Ok(if wait { Step::Wait } else { Step::Lost("record longer than the rest of the file") });
        }
        let next = body + length;
        let is_chunk =
            ChunkHeader::parse(self.source.bytes(body, HEADER.min(length as usize))?).filter(|h| h.fits(length));
        match (opcode, is_chunk) {
            (op::CHUNK, Some(head)) => return self.chunk(at, &head, length),
            (op::CHUNK, None) => return Ok(Step::Lost("chunk header is damaged")),
            (_, Some(_)) => return Ok(Step::Lost("chunk with the opcode of another record")),
            (op::DATA_END, None) if length != DATA_END => {
                return Ok(Step::Lost("data-end record has a wrong length"));
            }
            (op::FOOTER, None) if length != FOOTER => {
                return Ok(Step::Lost("footer has a wrong length"));
            }
            (op::FOOTER, None) => {
                self.section = Section::BeforeClosingMagic;
                return Ok(Step::Next(next));
            }
            _ => {}
        }
        // A record without a checksum is accepted if another record follows it; a message also must not contain a sequence of records.
        let is_followed = if opcode == op::MESSAGE && self.messages_outside_chunks {
            match self.next_start(at + 1)?.filter(|&inside| inside < next) {
                None => true,
                Some(inside) => self.begins_with_length(next)? && !self.leads_to(inside, next)?,
            }
        } else {
            prefix(&mut self.source, next)?.is_none_or(|(opcode, length)| plausible(opcode, length))
        };
        if !is_followed {
            return Ok(Step::Lost("no record follows this record"));
        }
        if !has_its_length(&mut self.source, opcode, body, next)? {
            return Ok(Step::Lost("length of a record differs from the length of its parts"));
        }
        self.small_record(opcode, body, next)
    }

    /// Processes a record that is neither a chunk nor a footer.
    fn small_record(&mut self, opcode: u8, body: u64, next: u64) -> Result<Step, Error> {
        let length = next - body;
        if opcode == op::DATA_END {
            self.messages_outside_chunks = false;
            return self.end_of_data(body, next);
        }
        match opcode {
            op::SCHEMA | op::CHANNEL | op::MESSAGE if self.messages_outside_chunks => {}
            op::MESSAGE => return Ok(Step::Bad(next, "message outside the chunks".into())),
            _ => return Ok(Step::Next(next)),
        }
        if length > MAX_RECORD {
            return Ok(Step::Bad(next, format!("record of {length} bytes, limit {MAX_RECORD}")));
        }
        let bytes = self.source.bytes(body, length as usize)?;
        if opcode == op::MESSAGE {
            return Ok(match MessageHeader::parse(bytes) {
                Some(head) => Step::Message(next, head, body + MessageHeader::LENGTH as u64..next),
                None => Step::Bad(next, "message is too short".into()),
            });
        }
        match parse_record(opcode, bytes).map(Record::into_owned) {
            Ok(record) => {
                // This record has no checksum; the summary has one and takes precedence.
                self.read_summary()?;
                self.learn(record, false);
            }
            Err(why) => return Ok(Step::Bad(next, why.to_string())),
        }
        Ok(Step::Next(next))
    }

    /// At the end of the data, checks its CRC, which may show damage that no other check found.
    fn end_of_data(&mut self, body: u64, next: u64) -> Result<Step, Error> {
        let expected = self.source.bytes(body, DATA_END as usize)?.first_chunk().map_or(0, |b| u32::from_le_bytes(*b));
        let found = self.crc.take().map(crc32fast::Hasher::finalize);
        let (base, end) = (self.base, body - PREFIX);
        if expected != 0 && found.is_some_and(|found| found != expected) {
            let why =
                format!("between here and byte {end}: CRC of all the data is wrong, CRCs of the chunks are correct");
            self.pending.push_back(ItemRef::Damaged(Damaged { offset: base, bytes: 0, why }));
        }
        Ok(Step::Next(next))
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
    fn event<'a>(&'a self, head: &MessageHeader, t_ns: i64, data: &'a [u8], offset: u64) -> EventRef<'a> {
        let number = self.number_high | i64::from(head.sequence);
        EventRef { channel: &self.topic, t_ns, number, data, offset, schema: self.schema.as_ref() }
    }
}
