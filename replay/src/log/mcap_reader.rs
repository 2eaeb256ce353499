//! Reading MCAP that may be cut or damaged anywhere: a walk over its records that takes a chunk whole or not at all.
//!
//! Source: MCAP specification, <https://mcap.dev/spec>. Parsing and decompression are those of the `mcap` crate; what is ours is the
//! framing, which checks every length before it believes it, and which finds the next chunk after damage. A damaged file without
//! chunks (which [`super::LogWriter`] never writes) is read up to the damage.

use super::source::Source;
use super::{Cut, Damaged, Event, Item, Names};
use crate::Error;
use mcap::MAGIC;
use mcap::read::parse_record;
use mcap::records::{Footer, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Opcode and length.
const PREFIX: u64 = 9;
/// Length of the body of a footer: two offsets and a CRC.
const FOOTER: u64 = 20;
/// Length of the body of a data end: a CRC.
const DATA_END: u64 = 4;
/// Largest record that is read into memory, compressed or not.
const MAX_RECORD: u64 = 1 << 29;
/// Bytes of a chunk before the name of its compression: two times, size, CRC, length of the name.
const CHUNK_HEAD: usize = 8 + 8 + 8 + 4 + 4;

type Channels = BTreeMap<u16, Arc<str>>;

pub(super) struct McapReader {
    source: Source,
    at: u64,
    place: Place,
    /// Where the MCAP at hand begins: several may stand in one file, one behind the other.
    base: u64,
    names: Names,
    channels: Channels,
    /// What is known and not yet handed out.
    ready: VecDeque<Item>,
    summary_read: bool,
    /// Messages may stand outside chunks: until the first chunk or the end of the data. After that, one is a damaged other record.
    loose: bool,
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
    /// It is framed well, but what it holds is not what it should be.
    Bad(u64, String),
    /// No whole record stands here.
    Lost(&'static str),
}

impl McapReader {
    pub fn new(source: Source) -> Self {
        McapReader {
            source,
            at: 0,
            place: Place::BeforeOpeningMagic,
            base: 0,
            names: Names::default(),
            channels: Channels::new(),
            ready: VecDeque::new(),
            summary_read: false,
            loose: true,
        }
    }

    /// Whether the file, its first bytes apart, is MCAP: it ends with the magic, or its first record is a header.
    pub fn looks_like_one(source: &mut Source) -> Result<bool, Error> {
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

    pub fn next(&mut self) -> Result<Option<Item>, Error> {
        loop {
            if let Some(item) = self.ready.pop_front() {
                return Ok(Some(item));
            }
            if self.at >= self.source.len() {
                let complete = matches!(self.place, Place::AfterClosingMagic | Place::Over);
                self.place = Place::Over;
                return Ok((!complete).then(|| Item::Cut(Cut { offset: self.source.len(), bytes: 0 })));
            }
            let from = self.at;
            match self.step()? {
                Step::Next(to) => self.at = to,
                Step::Bad(to, why) => self.damaged(from, to, why),
                Step::Lost(why) => self.resynchronise(why)?,
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
            return Ok(Step::Lost("the closing magic is not whole"));
        }
        let closing = self.place == Place::BeforeClosingMagic;
        self.place = if closing { Place::AfterClosingMagic } else { Place::InRecords };
        if closing {
            return Ok(if is_magic { Step::Next(end) } else { Step::Bad(end, "the closing magic is damaged".into()) });
        }
        self.base = at;
        self.channels.clear();
        self.summary_read = false;
        self.loose = true;
        Ok(match (is_magic, at) {
            (true, _) => Step::Next(end),
            (false, 0) => Step::Bad(end, "the opening magic is damaged".into()),
            (false, _) => Step::Lost("bytes behind the end of the log"),
        })
    }

    fn record(&mut self, at: u64) -> Result<Step, Error> {
        let Some((opcode, length)) = prefix(&mut self.source, at)? else {
            return Ok(Step::Lost("a record is not whole"));
        };
        let (body, left) = (at + PREFIX, self.source.len() - at - PREFIX);
        if length > left {
            return Ok(Step::Lost("a record is longer than what follows it"));
        }
        let next = body + length;
        let is_chunk = looks_like_chunk(&mut self.source, body, length)?;
        match opcode {
            op::CHUNK if is_chunk => return self.chunk(at, length),
            op::CHUNK => return Ok(Step::Lost("the head of a chunk is damaged")),
            _ if is_chunk => {
                return Ok(Step::Bad(next, format!("a chunk has the opcode {opcode:#04x}")));
            }
            op::DATA_END if length != DATA_END => {
                return Ok(Step::Lost("the end of the data has a wrong length"));
            }
            op::FOOTER if length != FOOTER => {
                return Ok(Step::Lost("the footer has a wrong length"));
            }
            op::FOOTER => {
                self.place = Place::BeforeClosingMagic;
                return Ok(Step::Next(next));
            }
            _ => {}
        }
        self.loose &= opcode != op::DATA_END;
        // A record without a check of its own is believed when another one begins behind it.
        if !plausible(&mut self.source, next)? {
            return Ok(Step::Lost("no record begins behind this one"));
        }
        match opcode {
            op::CHANNEL | op::MESSAGE if self.loose => {}
            op::MESSAGE => return Ok(Step::Bad(next, "a message outside the chunks".into())),
            _ => return Ok(Step::Next(next)),
        }
        if length > MAX_RECORD {
            return Ok(Step::Bad(next, format!("a record of {length} bytes, at most {MAX_RECORD} are read")));
        }
        match parse_record(opcode, self.source.bytes(body, length as usize)?).map(Record::into_owned) {
            Ok(record) => self.messages(at, [record])?,
            Err(why) => return Ok(Step::Bad(next, why.to_string())),
        }
        Ok(Step::Next(next))
    }

    /// Takes a chunk, if its CRC holds.
    fn chunk(&mut self, at: u64, length: u64) -> Result<Step, Error> {
        let next = at + PREFIX + length;
        self.loose = false;
        let record = self.source.bytes(at, (PREFIX + length) as usize)?;
        match records_of(record) {
            Ok(records) => self.messages(at, records)?,
            Err(why) => return Ok(Step::Bad(next, format!("a chunk: {why}"))),
        }
        Ok(Step::Next(next))
    }

    /// Takes channels and messages from sound records.
    fn messages(&mut self, at: u64, records: impl IntoIterator<Item = Record<'static>>) -> Result<(), Error> {
        let mut lost = 0_u64;
        for record in records {
            match record {
                Record::Channel(channel) => {
                    let topic = self.names.intern(&channel.topic);
                    self.channels.insert(channel.id, topic);
                }
                Record::Message { header, data } => {
                    let channel = self.channel(header.channel_id)?;
                    match (channel, i64::try_from(header.log_time)) {
                        (Some(channel), Ok(t_ns)) => {
                            self.ready.push_back(Item::Event(Event {
                                channel,
                                t_ns,
                                data: data.into_owned(),
                                offset: at,
                            }));
                        }
                        _ => lost += 1,
                    }
                }
                _ => {}
            }
        }
        if lost > 0 {
            let why = format!("{lost} messages have no channel, or a time beyond 292 years");
            self.ready.push_back(Item::Damaged(Damaged { offset: at, bytes: 0, why }));
        }
        Ok(())
    }

    /// Name of a channel. Where its record was in a damaged chunk, it stands in the summary again.
    fn channel(&mut self, id: u16) -> Result<Option<Arc<str>>, Error> {
        if let Some(channel) = self.channels.get(&id) {
            return Ok(Some(Arc::clone(channel)));
        }
        if !self.summary_read {
            self.summary_read = true;
            for (id, topic) in summary_channels(&mut self.source, self.base)? {
                let topic = self.names.intern(&topic);
                self.channels.entry(id).or_insert(topic);
            }
        }
        Ok(self.channels.get(&id).map(Arc::clone))
    }

    fn damaged(&mut self, from: u64, to: u64, why: String) {
        self.at = to;
        self.ready.push_back(Item::Damaged(Damaged { offset: from, bytes: to - from, why }));
    }

    /// Goes on at the next chunk, else at the footer, else at the end.
    fn resynchronise(&mut self, why: &str) -> Result<(), Error> {
        let from = self.at;
        self.place = Place::InRecords;
        let mut search = from + 1;
        while let Some(at) = self.source.find(&[op::CHUNK], search)? {
            if let Some((_, length)) = prefix(&mut self.source, at)?
                && length <= self.source.len() - at - PREFIX
                && looks_like_chunk(&mut self.source, at + PREFIX, length)?
            {
                self.damaged(from, at, why.into());
                return Ok(());
            }
            search = at + 1;
        }
        let end = self.source.len();
        if !ends_with_magic(&mut self.source)? {
            self.at = end;
            self.place = Place::Over;
            self.ready.push_back(Item::Cut(Cut { offset: from, bytes: end - from }));
            return Ok(());
        }
        let magic = end - MAGIC.len() as u64;
        match footer(&mut self.source)? {
            Some((at, _)) if at > from => self.damaged(from, at, why.into()),
            _ => {
                self.place = Place::BeforeClosingMagic;
                self.damaged(from, magic.max(from), why.into());
            }
        }
        Ok(())
    }
}

/// The channels and messages of a chunk record, prefix included; all of them or, when its CRC does not hold, none.
fn records_of(mut chunk: &[u8]) -> mcap::McapResult<Vec<Record<'static>>> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(MAX_RECORD as usize);
    let mut reader = LinearReader::new_with_options(options);
    let mut records = Vec::new();
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(wanted) => {
                let (bytes, rest) = chunk.split_at(wanted.min(chunk.len()));
                reader.insert(bytes.len()).copy_from_slice(bytes);
                reader.notify_read(bytes.len());
                chunk = rest;
            }
            // Only these are parsed: the parser of an attachment panics on a short one.
            LinearReadEvent::Record { opcode: opcode @ (op::CHANNEL | op::MESSAGE), data } => {
                records.push(parse_record(opcode, data)?.into_owned());
            }
            LinearReadEvent::Record { .. } => {}
        }
    }
    Ok(records)
}

/// Opcode and length of the record at `at`, if the file holds that much.
fn prefix(source: &mut Source, at: u64) -> Result<Option<(u8, u64)>, Error> {
    let bytes = source.bytes(at, PREFIX as usize)?;
    let Some((&opcode, length)) = bytes.split_first() else {
        return Ok(None);
    };
    Ok(length.first_chunk().map(|length| (opcode, u64::from_le_bytes(*length))))
}

/// Whether a record may begin at `at`: one of the specification or a private one, of a length that can be.
fn plausible(source: &mut Source, at: u64) -> Result<bool, Error> {
    Ok(prefix(source, at)?.is_none_or(|(opcode, length)| {
        length <= MAX_RECORD && (matches!(opcode, op::HEADER..=op::DATA_END) || opcode >= 0x80)
    }))
}

/// Whether a record's body is a chunk: its compression is a known one and its inner length fits its outer one.
fn looks_like_chunk(source: &mut Source, body: u64, length: u64) -> Result<bool, Error> {
    if length > MAX_RECORD {
        return Ok(false);
    }
    let bytes = source.bytes(body, (CHUNK_HEAD + 12).min(length as usize))?;
    let Some((head, rest)) = bytes.split_first_chunk::<CHUNK_HEAD>() else {
        return Ok(false);
    };
    let size = head[16..24].iter().rev().fold(0, |n, &byte| n << 8 | u64::from(byte));
    let name = head[28..32].iter().rev().fold(0, |n, &byte| n << 8 | usize::from(byte));
    let Some((name, rest)) = rest.split_at_checked(name) else {
        return Ok(false);
    };
    let Some(inner) = rest.first_chunk() else {
        return Ok(false);
    };
    let before = (CHUNK_HEAD + name.len() + 8) as u64;
    Ok(size <= MAX_RECORD
        && [&b""[..], b"lz4", b"zstd"].contains(&name)
        && u64::from_le_bytes(*inner) == length - before)
}

fn ends_with_magic(source: &mut Source) -> Result<bool, Error> {
    let at = source.len().saturating_sub(MAGIC.len() as u64);
    Ok(source.bytes(at, MAGIC.len())? == MAGIC)
}

/// The footer in front of the closing magic, and where it stands.
fn footer(source: &mut Source) -> Result<Option<(u64, Footer)>, Error> {
    let Some(at) = source.len().checked_sub(PREFIX + FOOTER + MAGIC.len() as u64) else {
        return Ok(None);
    };
    if prefix(source, at)? != Some((op::FOOTER, FOOTER)) {
        return Ok(None);
    }
    let body = source.bytes(at + PREFIX, FOOTER as usize)?;
    Ok(match parse_record(op::FOOTER, body) {
        Ok(Record::Footer(footer)) => Some((at, footer)),
        _ => None,
    })
}

/// The channels that the summary of the last MCAP of the file repeats. Empty if there is no sound summary.
fn summary_channels(source: &mut Source, base: u64) -> Result<Vec<(u16, String)>, Error> {
    let mut channels = Vec::new();
    let Some((end, footer)) = footer(source)? else {
        return Ok(channels);
    };
    let Some(mut at) = base.checked_add(footer.summary_start) else {
        return Ok(channels);
    };
    // The summary follows the end of the data; an offset into another MCAP would not point there.
    let data_end = at.checked_sub(PREFIX + DATA_END).map(|before| prefix(source, before)).transpose()?;
    if data_end != Some(Some((op::DATA_END, DATA_END))) {
        return Ok(channels);
    }
    while at < end
        && let Some((opcode, length)) = prefix(source, at)?
        && length <= MAX_RECORD.min(end - at)
    {
        if opcode == op::CHANNEL
            && let Ok(Record::Channel(channel)) = parse_record(opcode, source.bytes(at + PREFIX, length as usize)?)
        {
            channels.push((channel.id, channel.topic));
        }
        at += PREFIX + length;
    }
    Ok(channels)
}
