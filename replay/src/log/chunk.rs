//! A chunk of an MCAP file: header, decompression and records.
//!
//! Source: MCAP specification, <https://mcap.dev/spec>. Integers are little-endian.
//!
//! ```text
//! start u64 | end u64 | size u64 | CRC-32 u32 | compression (u32, text) | length u64 | records        record: opcode u8 | length u64 | body
//! ```

use mcap::records::op;
use std::io::Read;
use std::ops::Range;
use zstd::stream::raw::Operation;

/// Largest record that is read into memory, compressed or not.
pub(super) const MAX_RECORD: u64 = 1 << 29;

/// Bytes of a record before its body: opcode and length.
pub(super) const PREFIX: u64 = 9;

/// Bytes of a chunk before the name of its compression: start and end time, size, CRC, length of the name.
const FIXED: usize = 8 + 8 + 8 + 4 + 4;
/// Upper limit of the header length, bytes: the longest compression name has four.
pub(super) const HEADER: usize = FIXED + 4 + 8;

/// Claimed size up to which the whole output buffer is allocated before decompression, bytes.
const MAX_PREALLOCATED: usize = 1 << 22;
/// Growth of the output buffer for larger chunks, bytes.
const STEP: usize = 1 << 20;
/// Input bytes per step for a damaged chunk: the output of the failing step is lost.
const SALVAGE_STEP: usize = 64;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Compression {
    None,
    Lz4,
    Zstd,
}

/// Header of a chunk.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChunkHeader {
    compression: Compression,
    /// Size after decompression, bytes.
    size: u64,
    /// CRC-32 of the decompressed bytes; 0: not available.
    crc: u32,
    /// Claimed size of the compressed records, bytes.
    pub inner: u64,
    /// Offset of the records in the chunk's body.
    pub records: usize,
}

/// Result of the decompression of a chunk.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Decoded {
    /// Complete, and the CRC is correct.
    Complete,
    /// Decompressed completely, but the CRC is wrong: some bytes differ at unknown positions.
    WrongCrc,
    /// Decompressed up to an error; the bytes before it are available.
    Truncated(&'static str),
}

impl ChunkHeader {
    /// Parses the first [`HEADER`] bytes of a record's body; `None` if they are not a chunk header.
    pub fn parse(body: &[u8]) -> Option<Self> {
        let (fixed, rest) = body.split_first_chunk::<FIXED>()?;
        let size = u64::from_le_bytes(*fixed[16..].first_chunk()?);
        let crc = u32::from_le_bytes(*fixed[24..].first_chunk()?);
        let name = u32::from_le_bytes(*fixed[28..].first_chunk()?) as usize;
        let (name, rest) = rest.split_at_checked(name)?;
        let compression = match name {
            b"" => Compression::None,
            b"lz4" => Compression::Lz4,
            b"zstd" => Compression::Zstd,
            _ => return None,
        };
        let inner = u64::from_le_bytes(*rest.first_chunk()?);
        let head = ChunkHeader { compression, size, crc, inner, records: FIXED + name.len() + 8 };
        (size <= MAX_RECORD && inner <= MAX_RECORD).then_some(head)
    }

    /// Whether a checksum shows that the records are undamaged.
    pub fn has_crc(&self) -> bool {
        self.crc != 0 && self.inner > 0
    }

    /// Whether the lengths fit a record of `length` bytes.
    pub fn fits(&self, length: u64) -> bool {
        length <= MAX_RECORD && self.end() == length
    }

    /// Length of a record that ends with the chunk's records, bytes.
    pub fn end(&self) -> u64 {
        self.inner + self.records as u64
    }
}

/// Decompresses chunks into a reused buffer.
pub(super) struct ChunkDecoder {
    zstd: zstd::bulk::Decompressor<'static>,
}

impl ChunkDecoder {
    pub fn new() -> Self {
        ChunkDecoder { zstd: zstd::bulk::Decompressor::default() }
    }

    /// Decompresses the records of a chunk into `out`. `records` may be longer than the chunk, or end early.
    pub fn decode(&mut self, head: &ChunkHeader, records: &[u8], out: &mut Vec<u8>) -> Decoded {
        out.clear();
        if out.capacity() > MAX_PREALLOCATED {
            *out = Vec::new();
        }
        let limit = head.size as usize;
        let exact = records.get(..head.inner as usize);
        let broken = match (head.compression, exact) {
            (Compression::None, _) => {
                out.extend_from_slice(&records[..limit.min(records.len())]);
                None
            }
            (Compression::Zstd, Some(exact)) if limit <= MAX_PREALLOCATED => {
                out.reserve_exact(limit);
                let done = self.zstd.decompress_to_buffer(exact, out);
                done.err().and_then(|_| zstd(records, limit, SALVAGE_STEP, out))
            }
            (Compression::Zstd, _) => {
                zstd(records, limit, STEP, out).and_then(|_| zstd(records, limit, SALVAGE_STEP, out))
            }
            (Compression::Lz4, _) => lz4(records, limit, out),
        };
        match broken {
            Some(why) => Decoded::Truncated(why),
            None if out.len() < limit => Decoded::Truncated("chunk ends early"),
            None if head.crc != 0 && crc32fast::hash(out) != head.crc => Decoded::WrongCrc,
            None => Decoded::Complete,
        }
    }
}

/// Decompresses up to an error or the end, `step` input bytes at a time. Returns the error.
fn zstd(records: &[u8], limit: usize, step: usize, out: &mut Vec<u8>) -> Option<&'static str> {
    out.clear();
    let Ok(mut decoder) = zstd::stream::raw::Decoder::new() else { return Some("zstd decoder not available") };
    let (mut at, mut filled) = (0, 0);
    while filled < limit {
        // Grow with the actual output, not with the claimed size.
        out.resize((filled + STEP).min(limit), 0);
        let input = &records[at..(at + step).min(records.len())];
        let Ok(status) = decoder.run_on_buffers(input, &mut out[filled..]) else {
            out.truncate(filled);
            return Some("decompression error");
        };
        at += status.bytes_read;
        filled += status.bytes_written;
        if status.bytes_read == 0 && status.bytes_written == 0 {
            break;
        }
    }
    out.truncate(filled);
    None
}

fn lz4(records: &[u8], limit: usize, out: &mut Vec<u8>) -> Option<&'static str> {
    let Ok(mut decoder) = lz4::Decoder::new(records) else { return Some("lz4 decoder not available") };
    let mut filled = 0;
    while filled < limit {
        out.resize((filled + STEP).min(limit), 0);
        match decoder.read(&mut out[filled..]) {
            Ok(0) => break,
            Ok(n) => filled += n,
            Err(_) => {
                out.truncate(filled);
                return Some("decompression error");
            }
        }
    }
    out.truncate(filled);
    None
}

/// Position of a record in decompressed bytes.
pub(super) struct RecordAt {
    pub opcode: u8,
    pub body: Range<usize>,
}

/// The record at `at`, if it is complete.
#[inline]
pub(super) fn record_at(bytes: &[u8], at: usize) -> Option<RecordAt> {
    let (prefix, rest) = bytes.get(at..)?.split_first_chunk::<{ PREFIX as usize }>()?;
    let length = usize::try_from(u64::from_le_bytes(*prefix[1..].first_chunk()?)).ok()?;
    let begin = at + PREFIX as usize;
    (length <= rest.len()).then(|| RecordAt { opcode: prefix[0], body: begin..begin + length })
}

/// Header of a message record.
#[derive(Debug, Clone, Copy)]
pub(super) struct MessageHeader {
    pub channel: u16,
    pub sequence: u32,
    pub log_time: u64,
    pub publish_time: u64,
}

impl MessageHeader {
    /// Length in bytes, with the publish time.
    pub const LENGTH: usize = 2 + 4 + 8 + 8;

    #[inline]
    pub fn parse(body: &[u8]) -> Option<Self> {
        let head = body.first_chunk::<{ MessageHeader::LENGTH }>()?;
        Some(MessageHeader {
            channel: u16::from_le_bytes(*head.first_chunk()?),
            sequence: u32::from_le_bytes(*head[2..].first_chunk()?),
            log_time: u64::from_le_bytes(*head[6..].first_chunk()?),
            publish_time: u64::from_le_bytes(*head[14..].first_chunk()?),
        })
    }
}

/// Whether opcode and length are allowed for a record.
pub(super) fn plausible(opcode: u8, length: u64) -> bool {
    length <= MAX_RECORD && (matches!(opcode, op::HEADER..=op::DATA_END) || opcode >= 0x80)
}
