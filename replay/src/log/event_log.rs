//! The LCM event log, byte by byte: events back to back, no file header, no index, no checksum.
//!
//! ```text
//! sync 0xEDA1DA01 | number i64 | time i64, us | length of channel i32 | length of data i32 | channel | data      big-endian, 28 + ...
//! ```
//! Source: LCM 1.5.3, `docs/content/log-file-format.md` and `lcm/eventlog.c`.
//!
//! Recovery. The stock reader drops an event when the next one does not begin right behind it. Here an event is dropped only when
//! another one begins *inside* it, since then its own length is wrong; otherwise the bytes between the two are what is damaged.

use super::source::Source;
use super::writer::Output;
use super::{Cut, Damaged, Event, Item, MAX_CHANNEL, MAX_MESSAGE, Names};
use crate::Error;
use std::io::{BufWriter, Write};

/// First bytes of every event.
pub(super) const SYNC: [u8; 4] = 0xEDA1_DA01_u32.to_be_bytes();

const HEADER: usize = 28;

/// Longest channel that the stock reader accepts; the wire itself allows [`MAX_CHANNEL`].
const MAX_CHANNEL_READ: usize = 999;

/// Writes events.
pub(super) struct EventLogWriter {
    out: BufWriter<Output>,
    number: i64,
}

impl EventLogWriter {
    pub fn new(out: Output) -> Self {
        EventLogWriter { out: BufWriter::with_capacity(1 << 18, out), number: 0 }
    }

    /// `t_ns` is rounded down to whole microseconds; the caller has checked name, time and length.
    pub fn write(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> std::io::Result<()> {
        debug_assert!(channel.len() <= MAX_CHANNEL && data.len() <= MAX_MESSAGE);
        let mut header = [0; HEADER];
        header[0..4].copy_from_slice(&SYNC);
        header[4..12].copy_from_slice(&self.number.to_be_bytes());
        header[12..20].copy_from_slice(&t_ns.div_euclid(1000).to_be_bytes());
        header[20..24].copy_from_slice(&(channel.len() as u32).to_be_bytes());
        header[24..28].copy_from_slice(&(data.len() as u32).to_be_bytes());
        self.out.write_all(&header)?;
        self.out.write_all(channel.as_bytes())?;
        self.out.write_all(data)?;
        self.number += 1;
        Ok(())
    }

    pub fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}

/// Reads events, from any offset on.
pub(super) struct EventLogReader {
    source: Source,
    at: u64,
    names: Names,
    pending: Option<Damaged>,
}

/// What stands at an offset.
enum Found {
    /// A header that fits what the file still holds.
    Event { t_ns: i64, channel: usize, data: usize },
    /// The beginning of an event whose end is missing.
    Beginning,
    /// Something else.
    Other(&'static str),
}

impl EventLogReader {
    pub fn new(source: Source) -> Self {
        EventLogReader { source, at: 0, names: Names::default(), pending: None }
    }

    /// Whether an event begins anywhere in the first `limit` bytes.
    pub fn looks_like_one(source: &mut Source, limit: u64) -> Result<bool, Error> {
        let event = next_header(source, 0)?;
        Ok(event.is_some_and(|offset| offset < limit))
    }

    pub fn next(&mut self) -> Result<Option<Item>, Error> {
        if let Some(damaged) = self.pending.take() {
            return Ok(Some(Item::Damaged(damaged)));
        }
        let at = self.at;
        if at >= self.source.len() {
            return Ok(None);
        }
        let item = match found_at(&mut self.source, at)? {
            Found::Event { t_ns, channel, data } => {
                let length = HEADER + channel + data;
                // One window for the event and what tells where it ends.
                self.source.bytes(at, length + SYNC.len())?;
                let end = at + length as u64;
                let mut next = end;
                if !boundary(&mut self.source, end)? {
                    next = next_header(&mut self.source, at + 1)?.unwrap_or(self.source.len());
                    if next < end {
                        return Ok(Some(self.damaged(at, next, "another event begins inside this one")));
                    }
                    self.pending = Some(Damaged { offset: end, bytes: next - end, why: "no event begins here".into() });
                }
                self.at = next;
                Item::Event(self.event(at, t_ns, channel, data)?)
            }
            found => match (next_header(&mut self.source, at + 1)?, found) {
                (None, Found::Beginning) => {
                    self.at = self.source.len();
                    Item::Cut(Cut { offset: at, bytes: self.at - at })
                }
                (next, found) => {
                    let why =
                        if let Found::Other(why) = found { why } else { "the event is longer than what follows it" };
                    let end = next.unwrap_or(self.source.len());
                    self.damaged(at, end, why)
                }
            },
        };
        Ok(Some(item))
    }

    fn damaged(&mut self, from: u64, to: u64, why: &str) -> Item {
        self.at = to;
        Item::Damaged(Damaged { offset: from, bytes: to - from, why: why.into() })
    }

    fn event(&mut self, offset: u64, t_ns: i64, channel: usize, data: usize) -> Result<Event, Error> {
        let bytes = &self.source.bytes(offset, HEADER + channel + data)?[HEADER..];
        let (name, data) = bytes.split_at(channel.min(bytes.len()));
        // `found_at` has seen that the name is text.
        let channel = self.names.intern(&String::from_utf8_lossy(name));
        Ok(Event { channel, t_ns, data: data.to_vec(), offset })
    }
}

/// Whether an event may end at `offset`: the file ends, or the next sync (or what there is of it) follows.
fn boundary(source: &mut Source, offset: u64) -> Result<bool, Error> {
    let bytes = source.bytes(offset, SYNC.len())?;
    Ok(SYNC.starts_with(bytes))
}

/// The next offset at or after `from` with a whole, plausible event.
fn next_header(source: &mut Source, mut from: u64) -> Result<Option<u64>, Error> {
    while let Some(at) = source.find(&SYNC, from)? {
        if matches!(found_at(source, at)?, Found::Event { .. }) {
            return Ok(Some(at));
        }
        from = at + 1;
    }
    Ok(None)
}

fn found_at(source: &mut Source, at: u64) -> Result<Found, Error> {
    let left = source.len() - at;
    let header = source.bytes(at, HEADER)?;
    let sync = &header[..header.len().min(SYNC.len())];
    if !SYNC.starts_with(sync) {
        return Ok(Found::Other("no event begins here"));
    }
    let Some(header) = header.first_chunk::<HEADER>() else {
        return Ok(Found::Beginning);
    };
    let time_us = i64::from_be_bytes(field(header, 12));
    let channel = i32::from_be_bytes(field(header, 20));
    let data = i32::from_be_bytes(field(header, 24));
    let (Ok(channel), Ok(data)) = (usize::try_from(channel), usize::try_from(data)) else {
        return Ok(Found::Other("an event has a negative length"));
    };
    if !(1..=MAX_CHANNEL_READ).contains(&channel) || data > MAX_MESSAGE {
        return Ok(Found::Other("an event has an impossible length"));
    }
    let Some(t_ns) = time_us.checked_mul(1000) else {
        return Ok(Found::Other("an event has a time beyond 292 years"));
    };
    let name = source.bytes(at + HEADER as u64, channel)?;
    let is_text = match std::str::from_utf8(name) {
        Ok(name) => !name.chars().any(char::is_control),
        // The file may end within a character.
        Err(error) => name.len() < channel && error.error_len().is_none(),
    };
    if !is_text {
        return Ok(Found::Other("a channel's name is not text"));
    }
    if (HEADER + channel + data) as u64 > left {
        return Ok(Found::Beginning);
    }
    Ok(Found::Event { t_ns, channel, data })
}

fn field<const N: usize>(header: &[u8; HEADER], at: usize) -> [u8; N] {
    std::array::from_fn(|i| header[at + i])
}
