//! A chunk of an MCAP file: its head, what it decompresses to, and the records in that.
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

/// Opcode and length.
pub(super) const PREFIX: u64 = 9;

/// Bytes of a chunk before the name of its compression: two times, size, CRC, length of the name.
const FIXED: usize = 8 + 8 + 8 + 4 + 4;
/// Bytes that hold the whole head: the longest name of a compression has four.
pub(super) const HEAD: usize = FIXED + 4 + 8;

/// A claimed size up to which memory is taken before the first byte has been decompressed.
const BELIEVED: usize = 1 << 22;
/// Bytes that a buffer grows by, and that it keeps from one chunk to the next.
const STEP: usize = 1 << 20;
/// Bytes of a damaged chunk that are decompressed at a time: what a failing step has put out is lost.
const MORSEL: usize = 64;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Compression {
    None,
    Lz4,
    Zstd,
}

/// The head of a chunk.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChunkHead {
    compression: Compression,
    /// Bytes after decompression.
    size: u64,
    /// Of the decompressed bytes; 0 = not computed.
    crc: u32,
    /// Bytes of the compressed records, as the chunk says.
    pub inner: u64,
    /// Where the records begin in the chunk's body.
    pub records: usize,
}

/// What became of a chunk.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Unpacked {
    /// Its CRC holds.
    Whole,
    /// All of it was decompressed, but not to what it should be, and nobody knows where it differs.
    Unchecked,
    /// It cannot be decompressed to its end; what came before is there.
    Broken(&'static str),
}

impl ChunkHead {
    /// The head of a chunk in the first [`HEAD`] bytes of a record's body, if it can be one.
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
        let head = ChunkHead { compression, size, crc, inner, records: FIXED + name.len() + 8 };
        (size <= MAX_RECORD && inner <= MAX_RECORD).then_some(head)
    }

    /// Whether this is the head of a record of `length` bytes.
    pub fn fits(&self, length: u64) -> bool {
        length <= MAX_RECORD && self.inner + self.records as u64 == length
    }
}

/// Decompresses chunks, one after the other into the same memory.
pub(super) struct Unpacker {
    zstd: zstd::bulk::Decompressor<'static>,
}

impl Unpacker {
    pub fn new() -> Self {
        Unpacker { zstd: zstd::bulk::Decompressor::default() }
    }

    /// Puts the records of a chunk into `out`. `records` may go on behind them, or end too early.
    pub fn unpack(&mut self, head: &ChunkHead, records: &[u8], out: &mut Vec<u8>) -> Unpacked {
        out.clear();
        if out.capacity() > BELIEVED {
            *out = Vec::new();
        }
        let limit = head.size as usize;
        let exact = records.get(..head.inner as usize);
        let broken = match (head.compression, exact) {
            (Compression::None, _) => {
                out.extend_from_slice(&records[..limit.min(records.len())]);
                None
            }
            (Compression::Zstd, Some(exact)) if limit <= BELIEVED => {
                out.reserve_exact(limit);
                let done = self.zstd.decompress_to_buffer(exact, out);
                done.err().and_then(|_| zstd(records, limit, MORSEL, out))
            }
            (Compression::Zstd, _) => zstd(records, limit, STEP, out).and_then(|_| zstd(records, limit, MORSEL, out)),
            (Compression::Lz4, _) => lz4(records, limit, out),
        };
        match broken {
            Some(why) => Unpacked::Broken(why),
            None if out.len() < limit => Unpacked::Broken("it ends too early"),
            None if head.crc != 0 && crc32fast::hash(out) != head.crc => Unpacked::Unchecked,
            None => Unpacked::Whole,
        }
    }
}

/// Decompresses as far as it goes, `step` bytes at a time, and says what stopped it.
fn zstd(records: &[u8], limit: usize, step: usize, out: &mut Vec<u8>) -> Option<&'static str> {
    out.clear();
    let Ok(mut decoder) = zstd::stream::raw::Decoder::new() else { return Some("zstd cannot be set up") };
    let (mut at, mut filled) = (0, 0);
    while filled < limit {
        // The buffer grows with what comes, whatever the head claims.
        out.resize((filled + STEP).min(limit), 0);
        let input = &records[at..(at + step).min(records.len())];
        let Ok(status) = decoder.run_on_buffers(input, &mut out[filled..]) else {
            out.truncate(filled);
            return Some("it cannot be decompressed to its end");
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
    let Ok(mut decoder) = lz4::Decoder::new(records) else { return Some("lz4 cannot be set up") };
    let mut filled = 0;
    while filled < limit {
        out.resize((filled + STEP).min(limit), 0);
        match decoder.read(&mut out[filled..]) {
            Ok(0) => break,
            Ok(n) => filled += n,
            Err(_) => {
                out.truncate(filled);
                return Some("it cannot be decompressed to its end");
            }
        }
    }
    out.truncate(filled);
    None
}

/// A record in decompressed bytes.
pub(super) struct RecordAt {
    pub opcode: u8,
    pub body: Range<usize>,
}

/// The record that begins at `at`, if it is whole.
#[inline]
pub(super) fn record_at(bytes: &[u8], at: usize) -> Option<RecordAt> {
    let (prefix, rest) = bytes.get(at..)?.split_first_chunk::<{ PREFIX as usize }>()?;
    let length = usize::try_from(u64::from_le_bytes(*prefix[1..].first_chunk()?)).ok()?;
    let begin = at + PREFIX as usize;
    (length <= rest.len()).then(|| RecordAt { opcode: prefix[0], body: begin..begin + length })
}

/// What a message says before its bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct MessageHead {
    pub channel: u16,
    pub sequence: u32,
    pub log_time: u64,
}

impl MessageHead {
    /// Bytes of it, the publish time included.
    pub const LENGTH: usize = 2 + 4 + 8 + 8;

    #[inline]
    pub fn parse(body: &[u8]) -> Option<Self> {
        let head = body.first_chunk::<{ MessageHead::LENGTH }>()?;
        Some(MessageHead {
            channel: u16::from_le_bytes(*head.first_chunk()?),
            sequence: u32::from_le_bytes(*head[2..].first_chunk()?),
            log_time: u64::from_le_bytes(*head[6..].first_chunk()?),
        })
    }
}

/// Whether a record of this opcode and length can be.
pub(super) fn plausible(opcode: u8, length: u64) -> bool {
    length <= MAX_RECORD && (matches!(opcode, op::HEADER..=op::DATA_END) || opcode >= 0x80)
}
