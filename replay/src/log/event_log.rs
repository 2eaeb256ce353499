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
use super::{Cut, Damaged, EventRef, ItemRef, MAX_CHANNEL_IN_LOG, MAX_MESSAGE};
use crate::Error;
use crate::names::name_bytes;
use std::collections::BTreeSet;
use std::io::{BufWriter, Write};
use std::sync::Arc;

/// First bytes of every event.
pub(super) const SYNC: [u8; 4] = 0xEDA1_DA01_u32.to_be_bytes();

const HEADER: usize = 28;

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
        let channel = name_bytes(channel);
        debug_assert!(channel.len() <= MAX_CHANNEL_IN_LOG && data.len() <= MAX_MESSAGE);
        let mut header = [0; HEADER];
        header[0..4].copy_from_slice(&SYNC);
        header[4..12].copy_from_slice(&number.to_be_bytes());
        header[12..20].copy_from_slice(&t_ns.div_euclid(1000).to_be_bytes());
        header[20..24].copy_from_slice(&(channel.len() as u32).to_be_bytes());
        header[24..28].copy_from_slice(&(data.len() as u32).to_be_bytes());
        self.out.write_all(&header)?;
        self.out.write_all(&channel)?;
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
    /// Name of the last event whose name is not in the cache.
    name: Arc<str>,
    pending: Option<Damaged>,
    /// Header of the event at `at`, if it was already read.
    ahead: Option<Header>,
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
        EventLogReader {
            source,
            at: 0,
            names: ChannelNames::default(),
            name: Arc::from(""),
            pending: None,
            ahead: None,
            growing,
        }
    }

    /// Offset of the first event.
    pub fn first_event(source: &mut ByteSource) -> Result<Option<u64>, Error> {
        next_header(source, &ChannelNames::default(), 0)
    }

    /// Continues at the event at this offset.
    pub fn seek(&mut self, offset: u64) {
        (self.at, self.ahead, self.pending) = (offset, None, None);
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
            self.name = self.names.of_bytes(name);
        }
        let channel = self.names.cached(name).unwrap_or(&self.name);
        let Header { t_ns, number, .. } = header;
        Ok(Some(ItemRef::Event(EventRef { channel, t_ns, number, data, offset, source: None })))
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
        if let Some(header) = self.ahead.take() {
            return self.event(at, header);
        }
        match found_at(&mut self.source, &self.names, at)? {
            Found::Event(header) => self.event(at, header),
            found => self.no_event(at, &found),
        }
    }

    #[inline]
    fn event(&mut self, at: u64, header: Header) -> Result<Step, Error> {
        let end = at + header.length() as u64;
        // Read the event and the header of the next one at once.
        let ahead = self.source.bytes(at, header.length() + HEADER + MAX_CHANNEL_IN_LOG)?.len() > header.length();
        let next = if ahead { found_at(&mut self.source, &self.names, end)? } else { Found::Beginning };
        let next = match next {
            Found::Other(_) => return self.no_boundary(at, header),
            Found::Event(next) => Some(next),
            Found::Beginning => None,
        };
        let is_next = next.is_some_and(|next| next.number == header.number.wrapping_add(1));
        if !is_next && let Some(inside) = self.swallowed(at, header, next.map(|next| next.number))? {
            return Ok(self.damaged(at, inside, "another event starts inside this event"));
        }
        (self.at, self.ahead) = (end, next);
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

    /// Called if the next event number is not the successor, or at the end of the file: searches inside the event for events with successive
    /// numbers that lead to the next event, or past its start to another one.
    #[cold]
    fn swallowed(&mut self, at: u64, header: Header, next_number: Option<i64>) -> Result<Option<u64>, Error> {
        let end = at + header.length() as u64;
        let (mut from, mut is_first) = (at + 1, true);
        // A sequence that begins inside another one ends where that does, so it is not walked again.
        let mut walked = BTreeSet::new();
        while let Some(inside) = next_header(&mut self.source, &self.names, from)?.filter(|&inside| inside < end) {
            let (mut place, mut number) = (inside, header.number.wrapping_add(1));
            while place < end
                && let Found::Event(next) = found_at(&mut self.source, &self.names, place)?
                && next.number == number
                && walked.insert(place)
            {
                place += next.length() as u64;
                number = number.wrapping_add(1);
            }
            let leads_on = match next_number {
                Some(next) if place == end => number == next,
                // A log inside the message can also end there, but its first event is not the successor of this one.
                None if place == end => is_first,
                _ if place > end => match found_at(&mut self.source, &self.names, place)? {
                    Found::Event(next) => next.number == number,
                    _ => place == self.source.len(),
                },
                _ => false,
            };
            if leads_on {
                return Ok(Some(inside));
            }
            (from, is_first) = (inside + 1, false);
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

/// Bytes of an event with an unusual name in which another event is searched.
const UNUSUAL: u64 = 1 << 14;

#[inline]
fn found_at(source: &mut ByteSource, names: &ChannelNames, at: u64) -> Result<Found, Error> {
    match header_at(source, names, at)? {
        (Found::Event(header), false) => unusual(source, names, at, header),
        (found, _) => Ok(found),
    }
}

/// An event whose name is not plain text: accepted if an event or the end of the file follows, and no other event starts inside it.
#[cold]
fn unusual(source: &mut ByteSource, names: &ChannelNames, at: u64, header: Header) -> Result<Found, Error> {
    let (end, length) = (at + header.length() as u64, source.len());
    let is_followed = end == length || end < length && SYNC.starts_with(source.bytes(end, SYNC.len())?);
    if !is_followed {
        return Ok(Found::Other("channel name is not text, and no event follows"));
    }
    let mut from = at + 1;
    while let Some(inside) = source.find(&SYNC, from)?.filter(|&inside| inside < end.min(at + UNUSUAL)) {
        if matches!(header_at(source, names, inside)?, (Found::Event(_), true)) {
            return Ok(Found::Other("channel name is not text, and another event starts inside this event"));
        }
        from = inside + 1;
    }
    Ok(Found::Event(header))
}

/// The header at an offset, and whether its name is plain text.
#[inline]
fn header_at(source: &mut ByteSource, names: &ChannelNames, at: u64) -> Result<(Found, bool), Error> {
    let bytes = source.bytes(at, HEADER + MAX_CHANNEL_IN_LOG)?;
    if !SYNC.starts_with(&bytes[..bytes.len().min(SYNC.len())]) {
        return Ok((Found::Other("not the start of an event"), true));
    }
    let Some((header, rest)) = bytes.split_first_chunk::<HEADER>() else {
        return Ok((Found::Beginning, true));
    };
    let number = i64::from_be_bytes(field(header, 4));
    let time_us = i64::from_be_bytes(field(header, 12));
    let channel = i32::from_be_bytes(field(header, 20));
    let data = i32::from_be_bytes(field(header, 24));
    let (Ok(channel), Ok(data)) = (usize::try_from(channel), usize::try_from(data)) else {
        return Ok((Found::Other("negative length in an event header"), true));
    };
    if !(1..=MAX_CHANNEL_IN_LOG).contains(&channel) || data > MAX_MESSAGE {
        return Ok((Found::Other("length above the limit in an event header"), true));
    }
    let Some(t_ns) = time_us.checked_mul(1000) else {
        return Ok((Found::Other("time beyond 292 years in an event header"), true));
    };
    let name = &rest[..channel.min(rest.len())];
    let is_plain = names.cached(name).is_some() || is_text(name, channel);
    if !is_plain && name.contains(&0) {
        return Ok((Found::Other("channel name with a NUL"), true));
    }
    let end = at + (HEADER + channel + data) as u64;
    let header = Header { t_ns, number, channel, data };
    Ok((if is_plain && end > source.len() { Found::Beginning } else { Found::Event(header) }, is_plain))
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
