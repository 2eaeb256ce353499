//! Reading MCAP that may be cut or damaged anywhere: a walk over its records that checks every length before it believes it, and
//! that finds the next chunk after damage.
//!
//! Source: MCAP specification, <https://mcap.dev/spec>. Chunks are [`super::chunk`]'s. In a file without chunks (which
//! [`super::LogWriter`] never writes) the walk goes on at the next message after damage, and only the CRC of all the data tells that a
//! message was altered.

mod chunk_messages;
mod resync;

use super::byte_source::ByteSource;
use super::channel_names::ChannelNames;
use super::chunk::{ChunkHead, HEAD, MAX_RECORD, MessageHead, PREFIX, Unpacker, plausible};
use super::mcap_summary::{DATA_END, FOOTER, STRETCH, ends_with_magic, has_its_length, prefix};
use super::{Cut, Damaged, EventRef, FileSchema, ItemRef};
use crate::Error;
use mcap::MAGIC;
use mcap::read::parse_record;
use mcap::records::{Record, op};
use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::sync::Arc;

/// Key of a channel's metadata: the upper half of the numbers of its messages, whose lower half is the sequence.
pub(super) const NUMBER_HIGH: &str = "lcm_event_number_high";

pub(super) struct McapReader {
    source: ByteSource,
    at: u64,
    /// End of the last record that is surely one: those behind it may be misread, if one of them has a wrong length.
    sure: u64,
    place: Place,
    /// Where the MCAP at hand begins: several may stand in one file, one behind the other.
    base: u64,
    names: ChannelNames,
    /// By their ids.
    channels: Vec<Option<Channel>>,
    schemas: BTreeMap<u16, Arc<FileSchema>>,
    unpacker: Unpacker,
    chunk: Chunk,
    /// What is no event and not yet handed out.
    told: VecDeque<ItemRef<'static>>,
    summary_read: bool,
    /// Messages may stand outside chunks: until the first chunk or the end of the data. After that, one is a damaged other record.
    loose: bool,
    /// Of the data so far; `None` once some of it was skipped.
    crc: Option<crc32fast::Hasher>,
    /// The file may still grow: what is incomplete at its end is left for later.
    growing: bool,
    pub keep_unchecked: bool,
}

struct Channel {
    topic: Arc<str>,
    number_high: i64,
    schema: Option<Arc<FileSchema>>,
}

/// The chunk at hand.
#[derive(Default)]
struct Chunk {
    records: Vec<u8>,
    at: usize,
    offset: u64,
    /// No check says that its bytes are what was written.
    unchecked: bool,
    /// Its messages that could not be handed out.
    lost: u64,
    /// What there is to tell of it behind its last message.
    then: Option<ItemRef<'static>>,
}

/// Where in the file the walk is.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    BeforeOpeningMagic,
    InRecords,
    BeforeClosingMagic,
    AfterClosingMagic,
    /// The cut has been told.
    Over,
}

/// What became of a record.
enum Step {
    /// It is done with.
    Next(u64),
    /// It is a message outside the chunks.
    Message(u64, MessageHead, Range<u64>),
    /// It is framed well, but what it holds is not what it should be.
    Bad(u64, String),
    /// No whole record stands here.
    Lost(&'static str),
    /// The file has no more, for now.
    Wait,
}

impl McapReader {
    pub fn new(source: ByteSource, growing: bool) -> Self {
        McapReader {
            source,
            at: 0,
            sure: 0,
            place: Place::BeforeOpeningMagic,
            base: 0,
            names: ChannelNames::default(),
            channels: Vec::new(),
            schemas: BTreeMap::new(),
            unpacker: Unpacker::new(),
            chunk: Chunk::default(),
            told: VecDeque::new(),
            summary_read: false,
            loose: true,
            crc: None,
            growing,
            keep_unchecked: false,
        }
    }

    /// Whether the file, its first bytes apart, is MCAP: it ends with the magic, or its first record is a header.
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

    /// The closing magic is read, and nothing follows it.
    pub fn is_complete(&self) -> bool {
        self.place == Place::AfterClosingMagic && self.at >= self.source.len()
    }

    pub fn next(&mut self) -> Result<Option<ItemRef<'_>>, Error> {
        loop {
            if let Some((head, t_ns, data)) = self.message_of_chunk()? {
                let (offset, data) = (self.chunk.offset, &self.chunk.records[data]);
                let Some(Some(channel)) = self.channels.get(usize::from(head.channel)) else { return Ok(None) };
                return Ok(Some(ItemRef::Event(channel.event(&head, t_ns, data, offset))));
            }
            if let Some(told) = self.told.pop_front() {
                return Ok(Some(told));
            }
            if self.at >= self.source.len() {
                if self.growing {
                    self.source.refresh_len()?;
                }
                if self.at >= self.source.len() {
                    let complete = matches!(self.place, Place::AfterClosingMagic | Place::Over) || self.growing;
                    if !complete {
                        self.place = Place::Over;
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
                    self.sure = to;
                    let (known, t_ns) = (self.is_known(head.channel)?, i64::try_from(head.log_time));
                    let (true, Ok(t_ns)) = (known, t_ns) else {
                        self.tell_lost(from, 1);
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
        if self.place == Place::InRecords {
            return self.record(at);
        }
        let bytes = self.source.bytes(at, MAGIC.len())?;
        let (is_magic, is_cut) = (bytes == MAGIC, bytes.len() < MAGIC.len() && MAGIC.starts_with(bytes));
        let end = at + bytes.len() as u64;
        if is_cut {
            return Ok(if self.growing { Step::Wait } else { Step::Lost("the closing magic is not whole") });
        }
        let closing = self.place == Place::BeforeClosingMagic;
        self.place = if closing { Place::AfterClosingMagic } else { Place::InRecords };
        if closing {
            return Ok(if is_magic { Step::Next(end) } else { Step::Bad(end, "the closing magic is damaged".into()) });
        }
        if !is_magic && let Some(magic) = self.opening_magic(at + 1)? {
            self.place = Place::BeforeOpeningMagic;
            return Ok(Step::Bad(magic, "bytes in front of the log".into()));
        }
        self.base = at;
        self.sure = end;
        self.channels.clear();
        self.schemas.clear();
        self.summary_read = false;
        self.loose = true;
        self.crc = is_magic.then(crc32fast::Hasher::new);
        let header_follows = prefix(&mut self.source, end)?.is_some_and(|(opcode, _)| opcode == op::HEADER);
        Ok(match (is_magic, at) {
            (true, _) => Step::Next(end),
            (false, 0) if header_follows => Step::Bad(end, "the opening magic is damaged".into()),
            (false, 0) => Step::Lost("the opening magic is damaged"),
            (false, _) => Step::Lost("bytes behind the end of the log"),
        })
    }

    /// Where an MCAP begins at or behind `from`.
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
            return Ok(if self.growing { Step::Wait } else { Step::Lost("a record is not whole") });
        };
        let (body, left) = (at + PREFIX, self.source.len() - at - PREFIX);
        if length > left {
            let wait = self.growing && plausible(opcode, length);
            return Ok(if wait { Step::Wait } else { Step::Lost("a record is longer than what follows it") });
        }
        let next = body + length;
        let is_chunk = ChunkHead::parse(self.source.bytes(body, HEAD.min(length as usize))?).filter(|h| h.fits(length));
        match (opcode, is_chunk) {
            (op::CHUNK, Some(head)) => return self.chunk(at, &head, length),
            (op::CHUNK, None) => return Ok(Step::Lost("the head of a chunk is damaged")),
            (_, Some(_)) => return Ok(Step::Lost("a chunk has the opcode of another record")),
            (op::DATA_END, None) if length != DATA_END => {
                return Ok(Step::Lost("the end of the data has a wrong length"));
            }
            (op::FOOTER, None) if length != FOOTER => {
                return Ok(Step::Lost("the footer has a wrong length"));
            }
            (op::FOOTER, None) => {
                self.place = Place::BeforeClosingMagic;
                return Ok(Step::Next(next));
            }
            _ => {}
        }
        // A record without a check of its own is believed when another one begins behind it; a message, unless others stand inside.
        let is_followed = if opcode == op::MESSAGE && self.loose {
            match self.next_start(at + 1)?.filter(|&inside| inside < next) {
                None => true,
                Some(inside) => self.begins_with_length(next)? && !self.leads_to(inside, next)?,
            }
        } else {
            prefix(&mut self.source, next)?.is_none_or(|(opcode, length)| plausible(opcode, length))
        };
        if !is_followed {
            return Ok(Step::Lost("no record begins behind this one"));
        }
        if !has_its_length(&mut self.source, opcode, body, next)? {
            return Ok(Step::Lost("a record has another length than its parts"));
        }
        self.small_record(opcode, body, next)
    }

    /// A record that is no chunk and no footer.
    fn small_record(&mut self, opcode: u8, body: u64, next: u64) -> Result<Step, Error> {
        let length = next - body;
        if opcode == op::DATA_END {
            self.loose = false;
            return self.end_of_data(body, next);
        }
        match opcode {
            op::SCHEMA | op::CHANNEL | op::MESSAGE if self.loose => {}
            op::MESSAGE => return Ok(Step::Bad(next, "a message outside the chunks".into())),
            _ => return Ok(Step::Next(next)),
        }
        if length > MAX_RECORD {
            return Ok(Step::Bad(next, format!("a record of {length} bytes, at most {MAX_RECORD} are read")));
        }
        let bytes = self.source.bytes(body, length as usize)?;
        if opcode == op::MESSAGE {
            return Ok(match MessageHead::parse(bytes) {
                Some(head) => Step::Message(next, head, body + MessageHead::LENGTH as u64..next),
                None => Step::Bad(next, "a message is too short".into()),
            });
        }
        match parse_record(opcode, bytes).map(Record::into_owned) {
            Ok(record) => {
                // Nothing checks this record; the summary has a CRC.
                self.read_summary()?;
                self.learn(record, false);
            }
            Err(why) => return Ok(Step::Bad(next, why.to_string())),
        }
        Ok(Step::Next(next))
    }

    /// All the data is read: its CRC may tell what no other check did.
    fn end_of_data(&mut self, body: u64, next: u64) -> Result<Step, Error> {
        let expected = self.source.bytes(body, DATA_END as usize)?.first_chunk().map_or(0, |b| u32::from_le_bytes(*b));
        let found = self.crc.take().map(crc32fast::Hasher::finalize);
        let (base, end) = (self.base, body - PREFIX);
        if expected != 0 && found.is_some_and(|found| found != expected) {
            let why =
                format!("somewhere up to byte {end}: the CRC of all the data does not hold, those of the chunks do");
            self.told.push_back(ItemRef::Damaged(Damaged { offset: base, bytes: 0, why }));
        }
        Ok(Step::Next(next))
    }

    /// Goes on to `to`, all of it sound.
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
        (self.at, self.sure) = (to, to);
        self.crc = None;
        self.told.push_back(ItemRef::Damaged(Damaged { offset: from, bytes: to - from, why }));
    }
}

impl Channel {
    fn event<'a>(&'a self, head: &MessageHead, t_ns: i64, data: &'a [u8], offset: u64) -> EventRef<'a> {
        let number = self.number_high | i64::from(head.sequence);
        EventRef { channel: &self.topic, t_ns, number, data, offset, schema: self.schema.as_ref() }
    }
}
