//! Messages of the current chunk, and the channels and schemas that they refer to.

use super::super::chunk::{ChunkHeader, Decoded, MessageHeader, PREFIX, record_at};
use super::super::mcap_summary::summary_records;
use super::{Channel, McapReader, NUMBER_HIGH, Step};
use crate::Error;
use crate::log::{Damaged, FileSchema, ItemRef};
use mcap::read::parse_record;
use mcap::records::{Record, op};
use std::ops::Range;
use std::sync::Arc;

impl McapReader {
    /// Decodes a chunk; its messages are returned afterwards.
    pub(super) fn chunk(&mut self, at: u64, head: &ChunkHeader, length: u64) -> Result<Step, Error> {
        let next = at + PREFIX + length;
        self.messages_outside_chunks = false;
        self.last_certain_end = next;
        let why = match self.decode(at, head, length)? {
            Decoded::Complete => return Ok(Step::Next(next)),
            Decoded::WrongCrc => "wrong CRC",
            Decoded::Truncated(why) => why,
        };
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
                // Other records are not parsed: the parser of an attachment panics on a short one.
                op::SCHEMA | op::CHANNEL => match parse_record(record.opcode, body).map(Record::into_owned) {
                    Ok(record) => {
                        if self.chunk.unchecked {
                            self.read_summary()?;
                        }
                        self.learn(record, !self.chunk.unchecked);
                    }
                    Err(_) => self.chunk.lost += 1,
                },
                _ => {}
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

    /// Adds a schema or channel; `replace`: also if its id is already known.
    pub(super) fn learn(&mut self, record: Record<'static>, replace: bool) {
        match record {
            Record::Schema { header, data } if replace || !self.schemas.contains_key(&header.id) => {
                let schema = FileSchema { name: header.name, encoding: header.encoding, data: data.into_owned() };
                self.schemas.insert(header.id, schema.into());
            }
            Record::Channel(channel) => {
                let id = usize::from(channel.id);
                if self.channels.len() <= id {
                    self.channels.resize_with(id + 1, || None);
                }
                if replace || self.channels[id].is_none() {
                    let high = channel.metadata.get(NUMBER_HIGH).and_then(|high| high.parse::<i32>().ok());
                    self.channels[id] = Some(Channel {
                        topic: self.names.intern(&channel.topic),
                        number_high: i64::from(high.unwrap_or(0)) << 32,
                        schema: self.schemas.get(&channel.schema_id).map(Arc::clone),
                    });
                }
            }
            _ => {}
        }
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
            for record in summary_records(&mut self.source, self.base)? {
                self.learn(record, false);
            }
        }
        Ok(())
    }
}
