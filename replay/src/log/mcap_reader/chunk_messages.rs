//! Messages of the current chunk, and the channels and schemas that they refer to.

use super::super::chunk::{ChunkHeader, Decoded, MessageHeader, PREFIX, record_at};
use super::super::mcap_summary::summary_records;
use super::super::mcap_writer::{NAMED, NUMBER_HIGH};
use super::{Channel, McapReader, Step};
use crate::Error;
use crate::log::{Damaged, ItemRef, mcap_records};
use mcap::records::op;
use std::ops::Range;
use std::sync::Arc;

impl McapReader {
    /// Decodes a chunk; its messages are returned afterwards.
    pub(super) fn chunk(&mut self, at: u64, head: &ChunkHeader, length: u64) -> Result<Step, Error> {
        let next = at + PREFIX + length;
        self.loose = false;
        let why = match self.decode(at, head, length)? {
            Decoded::Complete => {
                self.last_certain_end = next;
                return Ok(Step::Next(next));
            }
            Decoded::WrongCrc => "wrong CRC",
            Decoded::Truncated(why) => why,
        };
        let next = self.end_of_damaged_chunk(at, next)?;
        self.last_certain_end = next;
        if !self.keep_unchecked {
            self.chunk.records.clear();
            return Ok(Step::Bad(next, format!("chunk omitted: {why}")));
        }
        self.crc = None;
        let why = format!("chunk: {why}; its events are returned unchecked");
        self.chunk.damage = Some(ItemRef::Damaged(Damaged { offset: at, bytes: next - at, why }));
        Ok(Step::Next(next))
    }

    pub(super) fn decode(&mut self, at: u64, head: &ChunkHeader, length: u64) -> Result<Decoded, Error> {
        let body = self.source.bytes(at + PREFIX, length as usize)?;
        let records = body.get(head.records..).unwrap_or_default();
        (self.chunk.at, self.chunk.offset, self.chunk.lost) = (0, at, 0);
        let decoded = self.decoder.decode(head, records, &mut self.chunk.records);
        self.chunk.unchecked = decoded != Decoded::Complete;
        Ok(decoded)
    }

    /// The next message of the current chunk: header, time, and range of its data in the records.
    pub(super) fn message_of_chunk(&mut self) -> Result<Option<(MessageHeader, i64, Range<usize>)>, Error> {
        while self.chunk.at < self.chunk.records.len() {
            let Some(record) = record_at(&self.chunk.records, self.chunk.at) else {
                // A truncated chunk ends here; in a complete one the record is malformed.
                self.chunk.lost += u64::from(self.chunk.damage.is_none());
                break;
            };
            self.chunk.at = record.body.end;
            let body = &self.chunk.records[record.body.clone()];
            match record.opcode {
                op::MESSAGE => {
                    let head = MessageHeader::parse(body);
                    let t_ns = head.and_then(|head| i64::try_from(head.log_time).ok());
                    if let Some((head, t_ns)) = head.zip(t_ns)
                        && self.is_known(head.channel)?
                    {
                        let data = record.body.start + MessageHeader::LENGTH..record.body.end;
                        return Ok(Some((head, t_ns, data)));
                    }
                    self.chunk.lost += 1;
                }
                op::SCHEMA | op::CHANNEL => {
                    let body = body.to_vec();
                    if self.chunk.unchecked {
                        self.read_summary()?;
                    }
                    if !self.learn(record.opcode, &body, !self.chunk.unchecked) {
                        self.chunk.lost += 1;
                    }
                }
                _ => self.side_records.others += 1,
            }
        }
        self.chunk.records.clear();
        self.chunk.at = 0;
        let lost = std::mem::take(&mut self.chunk.lost);
        if lost > 0 {
            self.report_lost(self.chunk.offset, lost);
        }
        self.pending.extend(self.chunk.damage.take());
        Ok(None)
    }

    pub(super) fn report_lost(&mut self, offset: u64, lost: u64) {
        let why = format!("{lost} messages omitted: malformed, without a channel, or with a time beyond 292 years");
        self.pending.push_back(ItemRef::Damaged(Damaged { offset, bytes: 0, why }));
    }

    /// Adds a schema or channel; `replace`: also if its id is already known. `false` if the record is too short.
    pub(super) fn learn(&mut self, opcode: u8, body: &[u8], replace: bool) -> bool {
        if opcode == op::SCHEMA {
            let Some((id, schema)) = mcap_records::schema(body) else { return false };
            let is_known = self.schemas.get(&id).is_some_and(|known| !replace || **known == schema);
            if !is_known {
                self.schemas.insert(id, schema.into());
            }
            return true;
        }
        let Some((id, schema_id, mut file)) = mcap_records::channel(body) else { return false };
        let id = usize::from(id);
        if self.channels.len() <= id {
            self.channels.resize_with(id + 1, || None);
        }
        file.schema = self.schemas.get(&schema_id).map(Arc::clone);
        file.topic = self.names.intern(&file.topic);
        // A summary can repeat a channel without its schema, which then comes from the data.
        let is_known = self.channels[id].as_ref().is_some_and(|known| {
            let adds_schema = known.file.schema.is_none() && file.schema.is_some();
            !replace && !adds_schema || *known.file == file
        });
        if !is_known {
            let high = file.metadata.get(NUMBER_HIGH).and_then(|high| high.parse::<i32>().ok());
            let is_named = file.message_encoding == "lcm" && file.metadata.contains_key(NAMED);
            let number_high = i64::from(high.unwrap_or(0)) << 32;
            self.channels[id] = Some(Channel { file: file.into(), number_high, is_named });
        }
        true
    }

    /// Whether a channel is known; reads the summary if its record was in a damaged chunk.
    #[inline]
    pub(super) fn is_known(&mut self, id: u16) -> Result<bool, Error> {
        let known = |channels: &[Option<Channel>]| channels.get(usize::from(id)).is_some_and(Option::is_some);
        if !known(&self.channels) {
            self.read_summary()?;
        }
        Ok(known(&self.channels))
    }

    pub(super) fn read_summary(&mut self) -> Result<(), Error> {
        if !std::mem::replace(&mut self.summary_read, true) {
            for (opcode, body) in summary_records(&mut self.source, self.base)? {
                self.learn(opcode, &body, false);
            }
        }
        Ok(())
    }
}
