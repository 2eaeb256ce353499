//! The chunk at hand: its messages, and the channels that they name.

use super::super::chunk::{ChunkHead, MessageHead, PREFIX, Unpacked, record_at};
use super::super::mcap_summary::summary_records;
use super::{Channel, McapReader, NUMBER_HIGH, Step};
use crate::Error;
use crate::log::{Damaged, FileSchema, ItemRef};
use mcap::read::parse_record;
use mcap::records::{Record, op};
use std::ops::Range;
use std::sync::Arc;

impl McapReader {
    /// Unpacks a chunk; its messages are handed out from then on.
    pub(super) fn chunk(&mut self, at: u64, head: &ChunkHead, length: u64) -> Result<Step, Error> {
        let next = at + PREFIX + length;
        self.loose = false;
        self.sure = next;
        let why = match self.unpack(at, head, length)? {
            Unpacked::Whole => return Ok(Step::Next(next)),
            Unpacked::Unchecked => "its CRC does not hold",
            Unpacked::Broken(why) => why,
        };
        if !self.keep_unchecked {
            self.chunk.records.clear();
            return Ok(Step::Bad(next, format!("a chunk: {why}")));
        }
        self.crc = None;
        let why = format!("a chunk: {why}; its events are kept, unchecked");
        self.chunk.then = Some(ItemRef::Damaged(Damaged { offset: at, bytes: next - at, why }));
        Ok(Step::Next(next))
    }

    pub(super) fn unpack(&mut self, at: u64, head: &ChunkHead, length: u64) -> Result<Unpacked, Error> {
        let body = self.source.bytes(at + PREFIX, length as usize)?;
        let records = body.get(head.records..).unwrap_or_default();
        (self.chunk.at, self.chunk.offset, self.chunk.lost) = (0, at, 0);
        let unpacked = self.unpacker.unpack(head, records, &mut self.chunk.records);
        self.chunk.unchecked = unpacked != Unpacked::Whole;
        Ok(unpacked)
    }

    /// The next message of the chunk at hand: its head, its time and where its data stands.
    pub(super) fn message_of_chunk(&mut self) -> Result<Option<(MessageHead, i64, Range<usize>)>, Error> {
        while self.chunk.at < self.chunk.records.len() {
            let Some(record) = record_at(&self.chunk.records, self.chunk.at) else {
                // In a chunk that is broken off this is the place; in a whole one it was written so.
                self.chunk.lost += u64::from(self.chunk.then.is_none());
                break;
            };
            self.chunk.at = record.body.end;
            let body = &self.chunk.records[record.body.clone()];
            match record.opcode {
                op::MESSAGE => {
                    let head = MessageHead::parse(body);
                    let t_ns = head.and_then(|head| i64::try_from(head.log_time).ok());
                    if let Some((head, t_ns)) = head.zip(t_ns)
                        && self.is_known(head.channel)?
                    {
                        let data = record.body.start + MessageHead::LENGTH..record.body.end;
                        return Ok(Some((head, t_ns, data)));
                    }
                    self.chunk.lost += 1;
                }
                // Only these are parsed: the parser of an attachment panics on a short one.
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
            self.tell_lost(self.chunk.offset, lost);
        }
        self.told.extend(self.chunk.then.take());
        Ok(None)
    }

    pub(super) fn tell_lost(&mut self, offset: u64, lost: u64) {
        let why = format!("{lost} messages are malformed, have no channel, or a time beyond 292 years");
        self.told.push_back(ItemRef::Damaged(Damaged { offset, bytes: 0, why }));
    }

    /// Takes a schema or channel; `anew` also where the id is known already.
    pub(super) fn learn(&mut self, record: Record<'static>, anew: bool) {
        match record {
            Record::Schema { header, data } if anew || !self.schemas.contains_key(&header.id) => {
                let schema = FileSchema { name: header.name, encoding: header.encoding, data: data.into_owned() };
                self.schemas.insert(header.id, schema.into());
            }
            Record::Channel(channel) => {
                let id = usize::from(channel.id);
                if self.channels.len() <= id {
                    self.channels.resize_with(id + 1, || None);
                }
                if anew || self.channels[id].is_none() {
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

    /// Whether a channel is known. Where its record was in a damaged chunk, it stands in the summary again.
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
