//! Resynchronization after damage: finds the next chunk, message or footer, and salvages what is readable before it.

use super::super::chunk::{ChunkHeader, Decoded, HEADER, MAX_RECORD, MessageHeader, PREFIX, plausible};
use super::super::mcap_summary::{STRETCH, ends_with_magic, footer, parts_end, prefix};
use super::{McapReader, Section};
use crate::Error;
use crate::log::{Cut, Damaged, ItemRef};
use mcap::MAGIC;
use mcap::records::op;

/// Limit of the bytes that are read again in search of chunks, in lengths of the file: a hostile file can nest chunks without end.
const MAX_READ_AGAIN: u64 = 4;

impl McapReader {
    /// Continues at the next chunk (in a file without chunks: message), else at the footer, else at the end.
    #[cold]
    pub(super) fn resynchronise(&mut self, why: &str) -> Result<(), Error> {
        self.section = Section::InRecords;
        let next = match self.next_start(self.last_certain_end.min(self.at), u64::MAX)? {
            Some(at) if at == self.at => self.next_start(at + 1, u64::MAX)?,
            next => next,
        };
        let from = next.map_or(self.at, |next| if next < self.at { self.last_certain_end } else { self.at });
        if let Some(at) = next {
            self.salvage(from, at, ItemRef::Damaged(Damaged { offset: from, bytes: at - from, why: why.into() }))?;
            return Ok(());
        }
        let end = self.source.len();
        if !ends_with_magic(&mut self.source)? {
            self.section = Section::AfterCut;
            return self.salvage(from, end, ItemRef::Cut(Cut { offset: from, bytes: end - from }));
        }
        let magic = (end - MAGIC.len() as u64).max(from);
        let to = match footer(&mut self.source)? {
            Some((at, _)) if at > from => at,
            _ => {
                self.section = Section::BeforeClosingMagic;
                magic
            }
        };
        self.salvage(from, to, ItemRef::Damaged(Damaged { offset: from, bytes: to - from, why: why.into() }))
    }

    /// Skips from `from` to `to` and queues the damage. If a chunk starts there, it is decompressed: it can be complete except for its
    /// lengths, or cut; the events before a cut are returned.
    fn salvage(&mut self, from: u64, to: u64, why: ItemRef<'static>) -> Result<(), Error> {
        (self.at, self.last_certain_end) = (to, to);
        self.crc = None;
        let length = (to - from).saturating_sub(PREFIX).min(MAX_RECORD);
        let Some(head) = ChunkHeader::parse(self.source.bytes(from + PREFIX, HEADER.min(length as usize))?) else {
            self.pending.push_back(why);
            return Ok(());
        };
        let decoded = self.decode(from, &head, length)?;
        let is_cut = matches!((&why, &decoded), (ItemRef::Cut(_), Decoded::Truncated(_)));
        if decoded != Decoded::Complete && !is_cut && !self.keep_unchecked {
            self.chunk.records.clear();
        }
        self.chunk.damage = Some(why);
        Ok(())
    }

    /// End of a damaged chunk: its stated end if a record follows there. Otherwise bytes are missing, and a chunk can start inside the stated
    /// length: one from which records lead past the stated end.
    pub(super) fn end_of_damaged_chunk(&mut self, at: u64, stated: u64) -> Result<u64, Error> {
        if self.begins_or_ends(stated)? {
            return Ok(stated);
        }
        let mut from = at + 1;
        while let Some(inside) = self.next_of(from, stated, false)? {
            let end = self.end_of_records(inside, stated)?;
            if !self.may_read_again(end - inside) {
                break;
            }
            if end >= stated {
                return Ok(inside);
            }
            from = inside + 1;
        }
        Ok(stated)
    }

    /// Counts bytes that are read again; `false` if they are too many.
    pub(super) fn may_read_again(&mut self, bytes: u64) -> bool {
        let read_again = self.read_again.saturating_add(bytes);
        let limit = MAX_READ_AGAIN.saturating_mul(self.source.len()).max(MAX_RECORD);
        let is_allowed = read_again <= limit;
        if is_allowed {
            self.read_again = read_again;
        }
        is_allowed
    }

    /// Offset of the next chunk.
    pub(super) fn next_chunk(&mut self, from: u64) -> Result<Option<u64>, Error> {
        self.next_of(from, u64::MAX, false)
    }

    /// Offset before `to` of the next chunk or, in a file with messages outside chunks, of the next message.
    pub(super) fn next_start(&mut self, from: u64, to: u64) -> Result<Option<u64>, Error> {
        if self.loose {
            self.read_summary()?;
        }
        let loose = self.loose && !self.channels.is_empty();
        self.next_of(from, to, loose)
    }

    fn next_of(&mut self, mut from: u64, to: u64, loose: bool) -> Result<Option<u64>, Error> {
        while let Some(at) = self.next_opcode(from, to, loose)? {
            if let Some((opcode, length)) = prefix(&mut self.source, at)?
                && length <= (self.source.len() - at - PREFIX).min(MAX_RECORD)
            {
                let body = at + PREFIX;
                let fits = match opcode {
                    op::CHUNK => {
                        let head = self.source.bytes(body, HEADER.min(length as usize))?;
                        ChunkHeader::parse(head).is_some_and(|head| head.fits(length))
                    }
                    _ => self.is_message(body, length)? && self.begins_with_length(body + length)?,
                };
                if fits {
                    return Ok(Some(at));
                }
            }
            from = at + 1;
        }
        Ok(None)
    }

    /// Offset before `to` of the next byte that can be the opcode of a chunk or, if `loose`, of a message.
    fn next_opcode(&mut self, mut from: u64, to: u64, loose: bool) -> Result<Option<u64>, Error> {
        while from < to {
            let bytes = self.source.bytes(from, STRETCH.min(to - from) as usize)?;
            if bytes.is_empty() {
                break;
            }
            if let Some(at) = bytes.iter().position(|&byte| byte == op::CHUNK || loose && byte == op::MESSAGE) {
                return Ok(Some(from + at as u64));
            }
            from += bytes.len() as u64;
        }
        Ok(None)
    }

    /// Whether a complete record of the specification, with consistent lengths, is at `at`.
    pub(super) fn begins_with_length(&mut self, at: u64) -> Result<bool, Error> {
        let Some((opcode, length)) = prefix(&mut self.source, at)? else { return Ok(false) };
        let body = at + PREFIX;
        if !(op::HEADER..=op::DATA_END).contains(&opcode) || length > (self.source.len() - body).min(MAX_RECORD) {
            return Ok(false);
        }
        match opcode {
            op::MESSAGE => self.is_message(body, length),
            op::CHUNK => {
                let head = self.source.bytes(body, HEADER.min(length as usize))?;
                Ok(ChunkHeader::parse(head).is_some_and(|head| head.fits(length)))
            }
            _ => Ok(parts_end(&mut self.source, opcode, body)?.is_some_and(|end| end <= body + length)),
        }
    }

    /// Whether a record or the end of the file is at `at`.
    pub(super) fn begins_or_ends(&mut self, at: u64) -> Result<bool, Error> {
        Ok(at >= self.source.len() || self.begins_with_length(at)?)
    }

    /// Whether a record follows at `at`, as far as opcodes and lengths show; records of unknown kinds are skipped.
    pub(super) fn follows(&mut self, mut at: u64) -> Result<bool, Error> {
        for _ in 0..3 {
            match prefix(&mut self.source, at)? {
                None => return Ok(true),
                Some((opcode @ op::HEADER..=op::DATA_END, length)) => return Ok(plausible(opcode, length)),
                Some((opcode, length)) => {
                    if opcode == 0 || length > (self.source.len() - at - PREFIX).min(MAX_RECORD) {
                        return Ok(false);
                    }
                    at += PREFIX + length;
                }
            }
        }
        Ok(true)
    }

    /// End of the consecutive records from `at`: the first end at or after `end`, or an end before it that no record follows.
    pub(super) fn end_of_records(&mut self, mut at: u64, end: u64) -> Result<u64, Error> {
        while at < end && self.begins_with_length(at)? {
            at += PREFIX + prefix(&mut self.source, at)?.map_or(0, |(_, length)| length);
        }
        Ok(at)
    }

    /// Whether a record's body is a message of a known channel.
    fn is_message(&mut self, body: u64, length: u64) -> Result<bool, Error> {
        let head = MessageHeader::parse(self.source.bytes(body, MessageHeader::LENGTH.min(length as usize))?);
        Ok(head.is_some_and(|head| self.channels.get(usize::from(head.channel)).is_some_and(Option::is_some)))
    }
}
