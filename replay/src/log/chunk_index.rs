//! The chunk index of an MCAP: which chunks contain a channel, so that a few messages of a long log are found without reading all of it.

use super::byte_source::ByteSource;
use super::chunk::{MAX_RECORD, PREFIX};
use super::mcap_summary::{DATA_END, prefix, summary_range};
use super::{EventRef, Health, LogReader};
use crate::Error;
use mcap::MAGIC;
use mcap::records::op;
use std::collections::BTreeMap;
use std::path::Path;

/// The chunk index of one file.
pub(crate) struct ChunkIndex {
    reader: LogReader,
    /// Offset of each chunk, in the order of the file, and the ids of its channels.
    chunks: Vec<(u64, Vec<u16>)>,
    topics: BTreeMap<u16, String>,
}

impl ChunkIndex {
    /// Reads the index. `None` if it is absent or does not cover all messages: an LCM event log, a cut or joined MCAP, an MCAP with records outside of
    /// chunks, one run of a log.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn read(path: &Path) -> Result<Option<Self>, Error> {
        // The index does not know runs.
        if super::split_run(path).1.is_some() {
            return Ok(None);
        }
        let mut source = ByteSource::open(path)?;
        if source.bytes(0, MAGIC.len())? != MAGIC {
            return Ok(None);
        }
        let Some((summary, end)) = summary_range(&mut source, 0)? else { return Ok(None) };
        let Some((op::HEADER, header)) = prefix(&mut source, MAGIC.len() as u64)? else { return Ok(None) };
        let mut index = ChunkIndex { reader: LogReader::open(path)?, chunks: Vec::new(), topics: BTreeMap::new() };
        // From the header to the record that ends the data, each chunk must follow the one before it: there can be messages in a gap.
        let mut chunks_end = (MAGIC.len() as u64 + PREFIX).checked_add(header);
        let mut at = summary;
        while at < end
            && let Some((opcode, length)) = prefix(&mut source, at)?
            && length <= MAX_RECORD.min(end - at)
        {
            let body = source.bytes(at + PREFIX, length as usize)?;
            match opcode {
                op::CHANNEL => {
                    if let Some((id, topic)) = channel(body) {
                        index.topics.insert(id, topic);
                    }
                }
                op::CHUNK_INDEX => {
                    let Some(chunk) = IndexedChunk::parse(body) else { return Ok(None) };
                    if chunk.channels.is_empty() || chunks_end != Some(chunk.offset) {
                        return Ok(None);
                    }
                    chunks_end = chunk.offset.checked_add(chunk.length);
                    index.chunks.push((chunk.offset, chunk.channels));
                }
                _ => {}
            }
            at += PREFIX + length;
        }
        let is_whole = chunks_end.and_then(|end| end.checked_add(PREFIX + DATA_END)) == Some(summary);
        Ok(Some(index).filter(|index| is_whole && !index.chunks.is_empty()))
    }

    /// Offsets of the chunks that contain a channel, in the order of the file.
    pub fn chunks_with(&self, channel: &str) -> Vec<u64> {
        let ids: Vec<u16> = self.topics.iter().filter(|(_, topic)| *topic == channel).map(|(id, _)| *id).collect();
        let holds = |(_, channels): &&(u64, Vec<u16>)| channels.iter().any(|id| ids.contains(id));
        self.chunks.iter().filter(holds).map(|(offset, _)| *offset).collect()
    }

    /// Calls `take` for each event of a chunk.
    ///
    /// # Errors
    /// Those of reading the log.
    pub fn events(&mut self, offset: u64, take: &mut dyn FnMut(&EventRef<'_>)) -> Result<(), Error> {
        let mut health = Health::default();
        self.reader.seek(offset)?;
        while let Some(item) = self.reader.read()? {
            match health.note(item) {
                Some(event) if event.offset != offset => return Ok(()),
                Some(event) => take(&event),
                None => {}
            }
        }
        Ok(())
    }
}

/// A chunk-index record.
struct IndexedChunk {
    offset: u64,
    /// Of the chunk and its message indexes, bytes.
    length: u64,
    channels: Vec<u16>,
}

impl IndexedChunk {
    fn parse(body: &[u8]) -> Option<Self> {
        // Start and end time, offset and length of the chunk, 10 bytes for each channel in it, length of its message indexes.
        let size = u32::from_le_bytes(*body.get(32..)?.first_chunk()?) as usize;
        let entries = body.get(36..)?.get(..size)?;
        let id = |entry: &[u8]| entry.first_chunk().map(|id| u16::from_le_bytes(*id));
        let channels = entries.chunks_exact(10).map(id).collect::<Option<_>>()?;
        let length = u64_at(body, 24)?.checked_add(u64_at(body, 36 + size)?)?;
        Some(IndexedChunk { offset: u64_at(body, 16)?, length, channels })
    }
}

/// Id and topic of a channel record.
fn channel(body: &[u8]) -> Option<(u16, String)> {
    let id = u16::from_le_bytes(*body.first_chunk()?);
    let length = u32::from_le_bytes(*body.get(4..)?.first_chunk()?) as usize;
    let topic = body.get(8..)?.get(..length)?;
    Some((id, String::from_utf8_lossy(topic).into_owned()))
}

fn u64_at(body: &[u8], at: usize) -> Option<u64> {
    body.get(at..)?.first_chunk().map(|bytes| u64::from_le_bytes(*bytes))
}
