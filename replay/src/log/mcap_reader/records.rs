//! Records outside chunks: decides whether the bytes at an offset are a record, and processes it.

use super::super::chunk::{ChunkHeader, Decoded, HEADER, MAX_RECORD, MessageHeader, PREFIX, plausible};
use super::super::mcap_records::Parts;
use super::super::mcap_summary::{DATA_END, FOOTER, parts_end, prefix};
use super::{MAX_SIDE_RECORDS, McapReader, Section, SideRecord, Step};
use crate::Error;
use crate::log::{Damaged, ItemRef};
use mcap::MAGIC;
use mcap::records::op;

impl McapReader {
    /// Reads the record at this offset.
    pub(super) fn record(&mut self, at: u64) -> Result<Step, Error> {
        let Some((opcode, length)) = prefix(&mut self.source, at)? else {
            return Ok(if self.growing { Step::Wait } else { Step::Lost("record is incomplete") });
        };
        let (body, left) = (at + PREFIX, self.source.len() - at - PREFIX);
        if length > left {
            let wait = self.growing && plausible(opcode, length);
            return Ok(if wait { Step::Wait } else { Step::Lost("record longer than the rest of the file") });
        }
        let next = body + length;
        let head = ChunkHeader::parse(self.source.bytes(body, HEADER.min(length as usize))?);
        match (opcode, &head) {
            (op::CHUNK, Some(head)) if head.fits(length) => return self.chunk(at, head, length),
            // The records of a chunk can be followed by fields of a later version of the format.
            (op::CHUNK, Some(head)) if head.end() < length && self.decodes(at, head, head.end())? => {
                if self.follows(next)? {
                    (self.loose, self.last_certain_end) = (false, next);
                    return Ok(Step::Next(next));
                }
                self.chunk.records.clear();
                return Ok(Step::Lost("chunk header is damaged"));
            }
            (op::CHUNK, _) => return Ok(Step::Lost("chunk header is damaged")),
            (_, Some(head)) if head.fits(length) && self.decodes(at, head, length)? => {
                self.chunk.records.clear();
                return Ok(Step::Lost("chunk with the opcode of another record"));
            }
            (op::DATA_END, _) if length < DATA_END => {
                return Ok(Step::Lost("data-end record has a wrong length"));
            }
            (op::FOOTER, _) if length < FOOTER => {
                return Ok(Step::Lost("footer has a wrong length"));
            }
            (op::FOOTER, _) if length == FOOTER || self.source.bytes(next, MAGIC.len())? == MAGIC => {
                self.section = Section::BeforeClosingMagic;
                return Ok(Step::Next(next));
            }
            (0 | op::FOOTER, _) => return Ok(Step::Lost("no record follows this record")),
            _ => {}
        }
        // A record without a checksum is accepted if another record follows it; a message also must not contain a sequence of records.
        let is_followed = if opcode == op::MESSAGE && self.loose {
            match self.next_start(at + 1, next)? {
                None => true,
                Some(inside) => self.begins_with_length(next)? && self.end_of_records(inside, next)? != next,
            }
        } else if opcode == op::MESSAGE {
            self.begins_with_length(at)? && self.begins_or_ends(next)? && !self.is_message_index(body, next)?
        } else {
            self.follows(next)?
        };
        if !is_followed {
            return Ok(Step::Lost("no record follows this record"));
        }
        match parts_end(&mut self.source, opcode, body)? {
            Some(end) if end > next => return Ok(Step::Lost("record ends inside one of its parts")),
            // Bytes after the known parts are fields of a later version of the format, unless they are records.
            Some(end) if end < next && self.end_of_records(end, next)? >= next => {
                return Ok(Step::Lost("length of a record includes the records after it"));
            }
            _ => {}
        }
        self.small_record(opcode, body, next)
    }

    /// Decodes the records of a possible chunk; `true` if its CRC is correct. Such places can overlap in any number, so their lengths count as bytes
    /// that are read again.
    fn decodes(&mut self, at: u64, head: &ChunkHeader, length: u64) -> Result<bool, Error> {
        if !head.has_crc() || !self.may_read_again(length) {
            return Ok(false);
        }
        let is_complete = self.decode(at, head, length)? == Decoded::Complete;
        if !is_complete {
            self.chunk.records.clear();
        }
        Ok(is_complete)
    }

    /// Whether a record between chunks is a message index with a damaged opcode: entries of time and offset in a chunk fill it.
    fn is_message_index(&mut self, body: u64, next: u64) -> Result<bool, Error> {
        let mut parts = Parts(self.source.bytes(body, MessageHeader::LENGTH)?);
        let (_, entries, _, offset) = (parts.u16(), parts.u32(), parts.u64(), parts.u64());
        let fills = entries.is_some_and(|n| n.is_multiple_of(16) && body + 6 + u64::from(n) == next);
        Ok(fills && offset.is_some_and(|offset| offset < MAX_RECORD))
    }

    /// Processes a record that is neither a chunk nor a footer.
    fn small_record(&mut self, opcode: u8, body: u64, next: u64) -> Result<Step, Error> {
        let length = next - body;
        if opcode == op::DATA_END {
            self.in_data = false;
            return self.end_of_data(body, next);
        }
        match opcode {
            op::SCHEMA | op::CHANNEL | op::MESSAGE if self.in_data => {}
            op::MESSAGE => return Ok(Step::Bad(next, "message after the end of the data".into())),
            op::ATTACHMENT | op::METADATA | 0x10..=0xff if self.in_data => {
                if self.side_records.list.len() < MAX_SIDE_RECORDS {
                    self.side_records.list.push(SideRecord { opcode, body, end: next });
                } else {
                    self.side_records.others += 1;
                }
                return Ok(Step::Next(next));
            }
            _ => return Ok(Step::Next(next)),
        }
        if length > MAX_RECORD {
            return Ok(Step::Bad(next, format!("record of {length} bytes, limit {MAX_RECORD}")));
        }
        let bytes = self.source.bytes(body, length as usize)?;
        if opcode == op::MESSAGE {
            self.loose = true;
            return Ok(match MessageHeader::parse(bytes) {
                Some(head) => Step::Message(next, head, body + MessageHeader::LENGTH as u64..next),
                None => Step::Bad(next, "message is too short".into()),
            });
        }
        let bytes = bytes.to_vec();
        // This record has no checksum; the summary has one and takes precedence.
        self.read_summary()?;
        if !self.learn(opcode, &bytes, false) {
            return Ok(Step::Bad(next, "schema or channel is too short".into()));
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
}
