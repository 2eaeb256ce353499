//! The LCM event log: events back to back, without file header, index or checksum.
//!
//! ```text
//! sync 0xEDA1DA01 | number i64 | time i64, us | channel length i32 | data length i32 | channel | data      big-endian, 28 + ...
//! ```
//! Source: LCM 1.5.3, `docs/content/log-file-format.md` and `lcm/eventlog.c`.
//!
//! Recovery: LCM's own reader drops an event if no other event starts directly after it. This reader drops an event only if another event
//! starts *inside* it, which shows that its length is wrong; otherwise only the bytes between the two events are damaged. A wrong length
//! can also end an event exactly at the start of a later one, with the events between them inside; the event numbers show this case.

use super::byte_source::ByteSource;
use super::channel_names::ChannelNames;
use super::writer::Output;
use super::{Cut, Damaged, EventRef, ItemRef, MAX_CHANNEL, MAX_MESSAGE};
use crate::Error;
use std::io::{BufWriter, Write};

/// First bytes of every event.
pub(super) const SYNC: [u8; 4] = 0xEDA1_DA01_u32.to_be_bytes();

const HEADER: usize = 28;

/// Longest channel name that LCM's own reader accepts; the protocol allows [`MAX_CHANNEL`].
const MAX_CHANNEL_READ: usize = 999;

/// Writes events.
pub(super) struct EventLogWriter {
    out: BufWriter<Output>,
}

impl EventLogWriter {
    pub fn new(out: Output) -> Self {
        EventLogWriter { out: BufWriter::with_capacity(1 << 18, out) }
    }

    /// `t_ns` is rounded down to whole microseconds. The caller has checked channel, time and length.
    pub fn write(&mut self, channel: &str, t_ns: i64, number: i64, data: &[u8]) -> std::io::Result<()> {
        debug_assert!(channel.len() <= MAX_CHANNEL && data.len() <= MAX_MESSAGE);
        let mut header = [0; HEADER];
        header[0..4].copy_from_slice(&SYNC);
        header[4..12].copy_from_slice(&number.to_be_bytes());
        header[12..20].copy_from_slice(&t_ns.div_euclid(1000).to_be_bytes());
        header[20..24].copy_from_slice(&(channel.len() as u32).to_be_bytes());
        header[24..28].copy_from_slice(&(data.len() as u32).to_be_bytes());
        self.out.write_all(&header)?;
        self.out.write_all(channel.as_bytes())?;
        self.out.write_all(data)
    }

    pub fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}

/// Reads events and skips damage.
pub(super) struct EventLogReader {
    source: ByteSource,
    at: u64,
    names: ChannelNames,
    pending: Option<Damaged>,
    /// The file is still being written: an incomplete event at its end is read later.
    growing: bool,
}

/// Header of an event.
#[derive(Clone, Copy)]
struct Header {
    t_ns: i64,
    number: i64,
    channel: usize,
    data: usize,
}

impl Header {
    fn length(&self) -> usize {
        HEADER + self.channel + self.data
    }
}

/// Content at an offset.
enum Found {
    /// An event that is completely in the file.
    Event(Header),
    /// The start of an event that the end of the file cuts.
    Beginning,
    /// No event, with the reason.
    Other(&'static str),
}

/// Result of one step of the reader.
enum Step {
    Event(u64, Header),
    Damaged(Damaged),
    Cut(Cut),
    End,
}

impl EventLogReader {
    pub fn new(source: ByteSource, growing: bool) -> Self {
        EventLogReader { source, at: 0, names: ChannelNames::default(), pending: None, growing }
    }

    /// Continues at the offset of an event.
    pub fn start_at(&mut self, offset: u64) {
        (self.at, self.pending) = (offset, None);
    }

    /// Whether an event starts in the first `limit` bytes.
    pub fn looks_like_one(source: &mut ByteSource, limit: u64) -> Result<bool, Error> {
        let event = next_header(source, &ChannelNames::default(), 0)?;
        Ok(event.is_some_and(|offset| offset < limit))
    }

    pub fn next(&mut self) -> Result<Option<ItemRef<'_>>, Error> {
        let (offset, header) = match self.step()? {
            Step::Event(offset, header) => (offset, header),
            Step::Damaged(damaged) => return Ok(Some(ItemRef::Damaged(damaged))),
            Step::Cut(cut) => return Ok(Some(ItemRef::Cut(cut))),
            Step::End => return Ok(None),
        };
        let bytes = self.source.bytes(offset, header.length())?;
        let (name, data) = bytes.get(HEADER..).unwrap_or_default().split_at_checked(header.channel).unwrap_or_default();
        if self.names.cached(name).is_none() {
            // `found_at` has checked that the name is valid text.
            self.names.intern(&String::from_utf8_lossy(name));
        }
        let Some(channel) = self.names.cached(name) else { return Ok(None) };
        let Header { t_ns, number, .. } = header;
        Ok(Some(ItemRef::Event(EventRef { channel, t_ns, number, data, offset, schema: None })))
    }

    /// Reads one event, damaged range or end.
    fn step(&mut self) -> Result<Step, Error> {
        if let Some(damaged) = self.pending.take() {
            return Ok(Step::Damaged(damaged));
        }
        let at = self.at;
        if at >= self.source.len() {
            if self.growing {
                self.source.refresh_len()?;
            }
            if at >= self.source.len() {
                return Ok(Step::End);
            }
        }
        match found_at(&mut self.source, &self.names, at)? {
            Found::Event(header) => self.event(at, header),
            found => self.no_event(at, &found),
        }
    }

    #[inline]
    fn event(&mut self, at: u64, header: Header) -> Result<Step, Error> {
        let length = header.length();
        // Read the event and the start of the next one at once.
        let bytes = self.source.bytes(at, length + SYNC.len() + 8)?;
        let end = at + length as u64;
        let behind = &bytes[length.min(bytes.len())..];
        if !SYNC.starts_with(&behind[..behind.len().min(SYNC.len())]) {
            return self.no_boundary(at, header);
        }
        let next_number = behind.get(SYNC.len()..).and_then(<[u8]>::first_chunk).map(|b| i64::from_be_bytes(*b));
        if let Some(next) = next_number.filter(|&next| next != header.number.wrapping_add(1))
            && let Some(inside) = self.swallowed(at, header, next)?
        {
            return Ok(self.damaged(at, inside, "another event starts inside this event"));
        }
        self.at = end;
        Ok(Step::Event(at, header))
    }

    /// An event that is not followed directly by another.
    #[cold]
    fn no_boundary(&mut self, at: u64, header: Header) -> Result<Step, Error> {
        let end = at + header.length() as u64;
        let next = next_header(&mut self.source, &self.names, at + 1)?;
        if next.is_none() && self.growing && self.source.len() - end < HEADER as u64 {
            // The following bytes are too few for an event header.
            return Ok(Step::End);
        }
        let next = next.unwrap_or(self.source.len());
        if next < end {
            return Ok(self.damaged(at, next, "another event starts inside this event"));
        }
        self.pending = Some(Damaged { offset: end, bytes: next - end, why: "not the start of an event".into() });
        self.at = next;
        Ok(Step::Event(at, header))
    }

    #[cold]
    fn no_event(&mut self, at: u64, found: &Found) -> Result<Step, Error> {
        let next = next_header(&mut self.source, &self.names, at + 1)?;
        Ok(match (next, found) {
            (None, Found::Beginning) if self.growing => {
                let length = self.source.len();
                self.source.refresh_len()?;
                if self.source.len() > length { self.step()? } else { Step::End }
            }
            (None, Found::Beginning) => {
                self.at = self.source.len();
                Step::Cut(Cut { offset: at, bytes: self.at - at })
            }
            (next, found) => {
                let why = if let Found::Other(why) = found { why } else { "event longer than the rest of the file" };
                let end = next.unwrap_or(self.source.len());
                self.damaged(at, end, why)
            }
        })
    }

    /// Called if the next event number is not the successor: searches inside the event for events whose numbers lead to the next one.
    #[cold]
    fn swallowed(&mut self, at: u64, header: Header, next_number: i64) -> Result<Option<u64>, Error> {
        let end = at + header.length() as u64;
        let mut from = at + 1;
        while let Some(inside) = next_header(&mut self.source, &self.names, from)?.filter(|&inside| inside < end) {
            let (mut place, mut number) = (inside, header.number.wrapping_add(1));
            while place < end
                && let Found::Event(next) = found_at(&mut self.source, &self.names, place)?
                && next.number == number
            {
                place += next.length() as u64;
                number = number.wrapping_add(1);
            }
            if place == end && number == next_number {
                return Ok(Some(inside));
            }
            from = inside + 1;
        }
        Ok(None)
    }

    fn damaged(&mut self, from: u64, to: u64, why: &str) -> Step {
        self.at = to;
        Step::Damaged(Damaged { offset: from, bytes: to - from, why: why.into() })
    }
}

/// The next offset at or after `from` with a complete, plausible event.
fn next_header(source: &mut ByteSource, names: &ChannelNames, mut from: u64) -> Result<Option<u64>, Error> {
    while let Some(at) = source.find(&SYNC, from)? {
        if matches!(found_at(source, names, at)?, Found::Event(_)) {
            return Ok(Some(at));
        }
        from = at + 1;
    }
    Ok(None)
}

#[inline]
fn found_at(source: &mut ByteSource, names: &ChannelNames, at: u64) -> Result<Found, Error> {
    let left = source.len() - at;
    let bytes = source.bytes(at, HEADER + MAX_CHANNEL_READ)?;
    if !SYNC.starts_with(&bytes[..bytes.len().min(SYNC.len())]) {
        return Ok(Found::Other("not the start of an event"));
    }
    let Some((header, rest)) = bytes.split_first_chunk::<HEADER>() else {
        return Ok(Found::Beginning);
    };
    let number = i64::from_be_bytes(field(header, 4));
    let time_us = i64::from_be_bytes(field(header, 12));
    let channel = i32::from_be_bytes(field(header, 20));
    let data = i32::from_be_bytes(field(header, 24));
    let (Ok(channel), Ok(data)) = (usize::try_from(channel), usize::try_from(data)) else {
        return Ok(Found::Other("negative length in an event header"));
    };
    if !(1..=MAX_CHANNEL_READ).contains(&channel) || data > MAX_MESSAGE {
        return Ok(Found::Other("length above the limit in an event header"));
    }
    let Some(t_ns) = time_us.checked_mul(1000) else {
        return Ok(Found::Other("time beyond 292 years in an event header"));
    };
    let name = &rest[..channel.min(rest.len())];
    if names.cached(name).is_none() && !is_text(name, channel) {
        return Ok(Found::Other("channel name is not text"));
    }
    if (HEADER + channel + data) as u64 > left {
        return Ok(Found::Beginning);
    }
    Ok(Found::Event(Header { t_ns, number, channel, data }))
}

/// Whether a name of `length` bytes is valid text, as far as it is in the file.
fn is_text(name: &[u8], length: usize) -> bool {
    match std::str::from_utf8(name) {
        Ok(name) => !name.chars().any(char::is_control),
        // The file can end inside a UTF-8 character.
        Err(error) => name.len() < length && error.error_len().is_none(),
    }
}

fn field<const N: usize>(header: &[u8; HEADER], at: usize) -> [u8; N] {
    std::array::from_fn(|i| header[at + i])
}
