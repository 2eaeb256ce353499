//! Copies a log event by event to another file, of the same or the other format. Convert, filter, trim and recover are such copies.
//!
//! A copy from MCAP to MCAP includes schemas, encodings, metadata, publish times and attachments. An LCM event log contains only channel, time,
//! number and bytes of each event; everything else is counted in [`CopyReport::not_kept`].

use super::mcap_reader::{McapReader, SideRecord};
use super::mcap_records::{Parts, metadata};
use super::mcap_writer::McapWriter;
use super::{EventFilter, EventRef, FileChannel, Format, Health, LogReader, LogWriter, Types};
use crate::Error;
use mcap::records::{AttachmentHeader, op};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Events between two progress reports.
pub(super) const PROGRESS_EVENTS: u64 = 4096;

/// Bytes of an attachment that are copied at once.
const STEP: u64 = 1 << 20;

/// Result of a copy: events copied, omitted and lost.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct CopyReport {
    /// The log that was written.
    pub out: PathBuf,
    /// Events in it.
    pub events: u64,
    /// Events that the filter rejected.
    pub left_out: u64,
    /// Damaged ranges in the input.
    pub damaged: u64,
    /// An input ends inside a record.
    pub cut: bool,
    /// Bytes of the input that belong to no event.
    pub bytes_skipped: u64,
    /// Events that the output format cannot hold: negative time in MCAP, or a channel name of no or too many bytes or with NUL in an LCM event log.
    pub refused: u64,
    /// Times rounded down to whole microseconds, the resolution of an LCM event log.
    pub times_rounded: u64,
    /// What else the output format cannot hold, with counts.
    pub not_kept: BTreeMap<&'static str, u64>,
}

impl CopyReport {
    /// Every selected event is in the copy, unchanged, with everything that the input contains about it.
    pub fn is_lossless(&self) -> bool {
        self.damaged == 0 && !self.cut && self.refused == 0 && self.times_rounded == 0 && self.not_kept.is_empty()
    }

    pub(super) fn add_health(&mut self, health: &Health) {
        self.damaged += health.damaged.len() as u64;
        self.cut |= health.cut.is_some();
        self.bytes_skipped += health.bytes_skipped();
    }

    fn count(&mut self, what: &'static str, n: u64) {
        if n > 0 {
            *self.not_kept.entry(what).or_default() += n;
        }
    }
}

/// Options of [`copy`].
#[derive(Default)]
pub struct CopyOptions {
    /// Selects the events to copy.
    pub filter: EventFilter,
    /// Types that the log itself does not describe, for the schemas of an MCAP.
    pub types: Types,
    /// Also copy events of MCAP chunks with a wrong CRC: see [`LogReader::keep_unchecked`].
    pub keep_unchecked: bool,
}

/// Copies a log. Event numbers and times are kept. `progress` receives the fraction read, 0 to 1.
///
/// # Errors
/// As [`LogReader::open`], [`LogWriter::create`] and [`LogWriter::write`]; [`Error::SameFile`] if `log` and `out` are the same file.
pub fn copy(log: &Path, out: &Path, options: CopyOptions, progress: &mut dyn FnMut(f64)) -> Result<CopyReport, Error> {
    let mut filter = options.filter.for_log(log)?;
    copy_if(log, out, options.types, options.keep_unchecked, &mut |event| filter.accepts(event), progress)
}

/// [`copy`] with a predicate that selects the events.
pub(super) fn copy_if(
    log: &Path,
    out: &Path,
    types: Types,
    keep_unchecked: bool,
    is_selected: &mut dyn FnMut(&EventRef<'_>) -> bool,
    progress: &mut dyn FnMut(f64),
) -> Result<CopyReport, Error> {
    Error::check_distinct_files(log, out)?;
    let mut reader = LogReader::open(log)?.keep_unchecked(keep_unchecked);
    let bytes = reader.bytes().max(1);
    let mut output = CopyOutput::create(out, types, &[profile(&mut reader)?])?;
    let mut health = Health::default();
    let mut read = 0_u64;
    while let Some(item) = reader.read()? {
        let Some(event) = health.note(item) else { continue };
        if read.is_multiple_of(PROGRESS_EVENTS) {
            progress(event.offset as f64 / bytes as f64);
        }
        read += 1;
        if is_selected(&event) {
            output.write(&event)?;
        } else {
            output.report.left_out += 1;
        }
    }
    progress(1.0);
    output.report.add_health(&health);
    output.side_records(&mut reader)?;
    output.finish()
}

/// Profile of an MCAP; empty for an LCM event log.
pub(super) fn profile(reader: &mut LogReader) -> Result<String, Error> {
    reader.mcap().map_or(Ok(String::new()), McapReader::read_profile)
}

/// The log that is written, with its report.
pub(super) struct CopyOutput {
    log: LogWriter,
    is_event_log: bool,
    /// Channels of MCAP files that are more than LCM channels, by address: the number of different ones is reported.
    channels: BTreeMap<usize, Arc<FileChannel>>,
    pub report: CopyReport,
}

impl CopyOutput {
    /// `profiles`: those of the inputs; the output gets theirs if they agree.
    pub fn create(out: &Path, types: Types, profiles: &[String]) -> Result<Self, Error> {
        let format = Format::of_name(out)?;
        let file = File::create(out).map_err(|source| Error::Io { path: out.into(), source })?;
        let (first, same) = (profiles.first().map_or("", String::as_str), profiles.iter().collect::<BTreeSet<_>>());
        let mut report = CopyReport { out: out.into(), ..CopyReport::default() };
        let profile = if same.len() == 1 { first } else { "" };
        if format == Format::LcmLog || same.len() > 1 {
            report.count("profiles", same.iter().filter(|profile| !profile.is_empty()).count() as u64);
        }
        let mut log = LogWriter::with_profile(out, format, Box::new(file), profile)?;
        log.set_types(types);
        Ok(CopyOutput { log, is_event_log: format == Format::LcmLog, channels: BTreeMap::new(), report })
    }

    pub fn write(&mut self, event: &EventRef<'_>) -> Result<(), Error> {
        match self.log.copy(event) {
            Ok(()) => {
                self.report.events += 1;
                self.report.times_rounded += u64::from(self.is_event_log && event.t_ns % 1000 != 0);
            }
            Err(Error::NegativeTime { .. } | Error::ChannelName { .. }) => self.report.refused += 1,
            Err(error) => return Err(error),
        }
        let Some(source) = event.source else { return Ok(()) };
        if !source.channel.is_plain_lcm() {
            self.channels.entry(Arc::as_ptr(source.channel) as usize).or_insert_with(|| Arc::clone(source.channel));
        }
        if self.is_event_log && i64::try_from(source.publish_t) != Ok(event.t_ns) {
            self.report.count("publish times", 1);
        }
        Ok(())
    }

    /// Copies attachments, metadata and private records of an input that was read to its end.
    pub fn side_records(&mut self, reader: &mut LogReader) -> Result<(), Error> {
        let Some(input) = reader.mcap() else { return Ok(()) };
        let records = std::mem::take(&mut input.side_records);
        self.report.count("records of unknown kinds", records.others);
        for record in records.list {
            let is_private = record.opcode >= 0x80;
            let what = match record.opcode {
                op::ATTACHMENT => "attachments",
                op::METADATA => "metadata records",
                _ => "records of unknown kinds",
            };
            let Some(out) = self.log.mcap() else {
                self.report.count(what, 1);
                continue;
            };
            let copied = match record.opcode {
                op::ATTACHMENT => attachment(input, &record, out)?,
                // The length was checked by the reader; a longer one is not metadata.
                _ if record.end - record.body > 1 << 28 => Ok(false),
                op::METADATA => match metadata(input.bytes(record.body, (record.end - record.body) as usize)?) {
                    Some((metadata, repeated)) => {
                        self.report.count("repeated metadata keys", repeated);
                        out.metadata(&metadata).map(|()| true)
                    }
                    None => Ok(false),
                },
                opcode if is_private => {
                    let body = input.bytes(record.body, (record.end - record.body) as usize)?;
                    out.private(opcode, body).map(|()| true)
                }
                _ => Ok(false),
            };
            match copied {
                Ok(true) => {}
                Ok(false) => self.report.count(what, 1),
                Err(source) => return Err(self.log.mcap_failed(source)),
            }
        }
        Ok(())
    }

    pub fn finish(mut self) -> Result<CopyReport, Error> {
        for channel in self.channels.values() {
            if self.is_event_log {
                self.report.count("schemas", u64::from(channel.schema.is_some()));
                self.report.count("message encodings", u64::from(channel.message_encoding != "lcm"));
                self.report.count("metadata of channels", u64::from(!channel.metadata.is_empty()));
            }
            self.report.count("repeated metadata keys", channel.repeated_keys);
        }
        self.log.finish()?;
        Ok(self.report)
    }
}

/// Copies an attachment piece by piece; `false` if it is malformed or its CRC is wrong.
fn attachment(
    input: &mut McapReader,
    record: &SideRecord,
    out: &mut McapWriter,
) -> Result<mcap::McapResult<bool>, Error> {
    let head = input.bytes(record.body, STEP.min(record.end - record.body) as usize)?;
    let mut parts = Parts(head);
    let mut fields = || {
        let (log_time, create_time) = (parts.u64()?, parts.u64()?);
        let header = AttachmentHeader { log_time, create_time, name: parts.text()?, media_type: parts.text()? };
        Some((header, parts.u64()?))
    };
    let Some((header, length)) = fields() else { return Ok(Ok(false)) };
    let begin = record.body + (head.len() - parts.0.len()) as u64;
    let Some(end) = begin.checked_add(length).filter(|end| end.saturating_add(4) <= record.end) else {
        return Ok(Ok(false));
    };
    let expected = input.bytes(end, 4)?.first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
    let mut crc = crc32fast::Hasher::new();
    let mut at = record.body;
    while expected != 0 && at < end {
        let bytes = input.bytes(at, STEP.min(end - at) as usize)?;
        crc.update(bytes);
        at += bytes.len().max(1) as u64;
    }
    if expected != 0 && crc.finalize() != expected {
        return Ok(Ok(false));
    }
    if let Err(why) = out.start_attachment(length, header) {
        return Ok(Err(why));
    }
    let mut at = begin;
    while at < end {
        let bytes = input.bytes(at, STEP.min(end - at) as usize)?;
        if bytes.is_empty() {
            break;
        }
        at += bytes.len() as u64;
        if let Err(why) = out.put_attachment(bytes) {
            return Ok(Err(why));
        }
    }
    Ok(out.finish_attachment().map(|()| true))
}
