//! Copies a log event by event to another file, of the same or the other format. Convert, filter, trim and recover are such copies.

use super::{EventFilter, EventRef, Format, Health, LogReader, LogWriter, Types};
use crate::Error;
use std::path::{Path, PathBuf};

/// Events between two progress reports.
pub(super) const PROGRESS_EVENTS: u64 = 4096;

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
    /// Events that the output format cannot hold: negative time, or a channel name longer than LCM allows.
    pub refused: u64,
    /// Times rounded down to whole microseconds, the resolution of an LCM event log.
    pub times_rounded: u64,
}

impl CopyReport {
    /// Every selected event is in the copy, unchanged.
    pub fn is_lossless(&self) -> bool {
        self.damaged == 0 && !self.cut && self.refused == 0 && self.times_rounded == 0
    }

    pub(super) fn add_health(&mut self, health: &Health) {
        self.damaged += health.damaged.len() as u64;
        self.cut |= health.cut.is_some();
        self.bytes_skipped += health.bytes_skipped();
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
    let mut output = CopyOutput::create(out, types)?;
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
    output.finish()
}

/// The log that is written, with its report.
pub(super) struct CopyOutput {
    log: LogWriter,
    is_event_log: bool,
    pub report: CopyReport,
}

impl CopyOutput {
    pub fn create(out: &Path, types: Types) -> Result<Self, Error> {
        let is_event_log = Format::of_name(out)? == Format::LcmLog;
        let mut log = LogWriter::create(out)?;
        log.set_types(types);
        Ok(CopyOutput { log, is_event_log, report: CopyReport { out: out.into(), ..CopyReport::default() } })
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
        Ok(())
    }

    pub fn finish(self) -> Result<CopyReport, Error> {
        self.log.finish()?;
        Ok(self.report)
    }
}
