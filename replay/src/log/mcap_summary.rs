//! The end of an MCAP file: closing magic, footer, and the channels and schemas that the summary repeats.

use super::byte_source::ByteSource;
use super::chunk::{MAX_RECORD, PREFIX};
use super::mcap_records::Parts;
use crate::Error;
use mcap::MAGIC;
use mcap::records::{Footer, op};

/// Least length of a footer's body, bytes: two offsets and a CRC.
pub(super) const FOOTER: u64 = 20;
/// Least length of a data-end record's body, bytes: a CRC.
pub(super) const DATA_END: u64 = 4;
/// Bytes after the known parts of a footer or data-end record up to which it is searched backwards.
const MAX_ADDED: u64 = 64;

/// Bytes per step of a CRC computation.
pub(super) const STRETCH: u64 = 1 << 16;

/// Opcode and length of the record at `at`; `None` at the end of the file.
pub(super) fn prefix(source: &mut ByteSource, at: u64) -> Result<Option<(u8, u64)>, Error> {
    let bytes = source.bytes(at, PREFIX as usize)?;
    let Some((&opcode, length)) = bytes.split_first() else {
        return Ok(None);
    };
    Ok(length.first_chunk().map(|length| (opcode, u64::from_le_bytes(*length))))
}

/// Whether the file ends with the closing magic.
pub(super) fn ends_with_magic(source: &mut ByteSource) -> Result<bool, Error> {
    let at = source.len().saturating_sub(MAGIC.len() as u64);
    Ok(source.bytes(at, MAGIC.len())? == MAGIC)
}

/// The footer before the closing magic, and its offset.
pub(super) fn footer(source: &mut ByteSource) -> Result<Option<(u64, Footer)>, Error> {
    for added in 0..=MAX_ADDED {
        let length = FOOTER + added;
        let Some(at) = source.len().checked_sub(PREFIX + length + MAGIC.len() as u64) else {
            return Ok(None);
        };
        if prefix(source, at)? != Some((op::FOOTER, length)) {
            continue;
        }
        let mut parts = Parts(source.bytes(at + PREFIX, FOOTER as usize)?);
        if let (Some(summary_start), Some(summary_offset_start), Some(summary_crc)) =
            (parts.u64(), parts.u64(), parts.u32())
        {
            return Ok(Some((at, Footer { summary_start, summary_offset_start, summary_crc })));
        }
    }
    Ok(None)
}

/// Schemas and channels in the summary of the last MCAP of the file. Empty without a valid summary.
pub(super) fn summary_records(source: &mut ByteSource, base: u64) -> Result<Vec<(u8, Vec<u8>)>, Error> {
    let mut records = Vec::new();
    let Some((end, footer)) = footer(source)? else {
        return Ok(records);
    };
    let Some(mut at) = start(source, base, end, &footer)? else {
        return Ok(records);
    };
    while at < end
        && let Some((opcode, length)) = prefix(source, at)?
        && length <= MAX_RECORD.min(end - at)
    {
        if matches!(opcode, op::SCHEMA | op::CHANNEL) {
            records.push((opcode, source.bytes(at + PREFIX, length as usize)?.to_vec()));
        }
        at += PREFIX + length;
    }
    Ok(records)
}

/// Start and end of the summary of the MCAP that starts at `base`; `None` without a valid summary, or if it is not where the footer states: then the
/// offsets in it are wrong too.
pub(super) fn summary_range(source: &mut ByteSource, base: u64) -> Result<Option<(u64, u64)>, Error> {
    let Some((end, footer)) = footer(source)? else { return Ok(None) };
    let start = start(source, base, end, &footer)?;
    Ok(start.filter(|start| base.checked_add(footer.summary_start) == Some(*start)).map(|start| (start, end)))
}

/// Start of the summary: directly after the data-end record. If bytes before it are missing or added, its offset is wrong; then its CRC
/// finds it.
fn start(source: &mut ByteSource, base: u64, footer_at: u64, footer: &Footer) -> Result<Option<u64>, Error> {
    let behind = PREFIX + DATA_END;
    let is_sound = |source: &mut ByteSource, at: u64| -> Result<bool, Error> {
        let mut is_behind = false;
        for added in 0..=MAX_ADDED {
            let data_end = at.checked_sub(behind + added).map(|before| prefix(source, before)).transpose()?;
            is_behind |= data_end == Some(Some((op::DATA_END, DATA_END + added)));
        }
        // The CRC includes the footer up to its own field.
        let end = footer_at + PREFIX + FOOTER - 4;
        Ok(is_behind && (footer.summary_crc == 0 || crc(source, at, end)? == footer.summary_crc))
    };
    let claimed = base.checked_add(footer.summary_start).filter(|&at| footer.summary_start != 0 && at <= footer_at);
    if let Some(at) = claimed
        && is_sound(source, at)?
    {
        return Ok(claimed);
    }
    // The footer may belong to another MCAP after the current one.
    let other = source.find(MAGIC, base + MAGIC.len() as u64)?;
    if footer.summary_crc == 0 || other.is_some_and(|at| at < footer_at) {
        return Ok(None);
    }
    let mut pattern = [0; PREFIX as usize];
    (pattern[0], pattern[1]) = (op::DATA_END, DATA_END as u8);
    let mut from = base;
    while let Some(at) = source.find(&pattern, from)?.filter(|at| at + behind <= footer_at) {
        if is_sound(source, at + behind)? {
            return Ok(Some(at + behind));
        }
        from = at + 1;
    }
    Ok(None)
}

/// End of the known parts of a record, by the lengths inside it; `None` for a record of an unknown kind. It is after the end of the record
/// if the record's length is wrong, and before it if the record has further parts.
pub(super) fn parts_end(source: &mut ByteSource, opcode: u8, body: u64) -> Result<Option<u64>, Error> {
    // A digit: that many bytes; `s`: u32 length and content; `d`: u64 length and content.
    let parts: &[u8] = match opcode {
        op::HEADER => b"ss",
        op::FOOTER => b"884",
        op::SCHEMA => b"2sss",
        op::CHANNEL => b"22sss",
        op::MESSAGE_INDEX => b"2s",
        op::CHUNK_INDEX => b"8888s8s88",
        op::ATTACHMENT => b"88ssd4",
        op::ATTACHMENT_INDEX => b"88888ss",
        op::STATISTICS => b"82444488s",
        op::METADATA => b"ss",
        op::METADATA_INDEX => b"88s",
        op::SUMMARY_OFFSET => b"188",
        op::DATA_END => b"4",
        _ => return Ok(None),
    };
    let mut at = body;
    for part in parts {
        let width = match part {
            b's' => 4,
            b'd' => 8,
            fixed => {
                at = at.saturating_add(u64::from(fixed - b'0'));
                continue;
            }
        };
        let length = source.bytes(at, width)?.iter().rev().fold(0, |n, &byte| n << 8 | u64::from(byte));
        at = at.saturating_add(width as u64).saturating_add(length);
    }
    Ok(Some(at))
}

fn crc(source: &mut ByteSource, mut from: u64, to: u64) -> Result<u32, Error> {
    let mut crc = crc32fast::Hasher::new();
    while from < to {
        let bytes = source.bytes(from, (to - from).min(STRETCH) as usize)?;
        if bytes.is_empty() {
            break;
        }
        crc.update(bytes);
        from += bytes.len() as u64;
    }
    Ok(crc.finalize())
}
