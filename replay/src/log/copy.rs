//! From one log to another, of the same format or not: what conversion, filter, trim, recovery and merge share.

use super::{Event, EventRef, FileSchema, Format, Health, ItemRef, LogReader, LogWriter, Selection, Types};
use crate::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Events between two reports of progress.
const PROGRESS: u64 = 4096;

/// What was copied, and what could not be.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct Copied {
    /// The log that was written.
    pub out: PathBuf,
    /// Events in it.
    pub events: u64,
    /// Events that were not wanted.
    pub left_out: u64,
    /// Damaged stretches of what was read.
    pub damaged: u64,
    /// A log that was read stops inside a record.
    pub cut: bool,
    /// Bytes of it that are in no event.
    pub bytes_skipped: u64,
    /// Events that no log can be given: a negative time, a channel longer than LCM has them.
    pub refused: u64,
    /// Times that were rounded down to whole microseconds, since an LCM event log holds no others.
    pub times_rounded: u64,
}

impl Copied {
    /// Everything that was wanted is in the copy as it was.
    pub fn is_lossless(&self) -> bool {
        self.damaged == 0 && !self.cut && self.refused == 0 && self.times_rounded == 0
    }

    fn note(&mut self, health: &Health) {
        self.damaged += health.damaged.len() as u64;
        self.cut |= health.cut.is_some();
        self.bytes_skipped += health.bytes_skipped();
    }
}

/// How a log is to be copied.
#[derive(Default)]
pub struct CopyOptions {
    /// Which events.
    pub selection: Selection,
    /// Types that the log does not know itself, for the schemas of an MCAP.
    pub types: Types,
    /// Also events of chunks whose CRC does not hold: see [`LogReader::keep_unchecked`].
    pub keep_unchecked: bool,
}

/// Copies a log, numbers and times included. `progress` is told which part of it has been read, 0 to 1.
///
/// # Errors
/// As [`LogReader::open`], [`LogWriter::create`] and [`LogWriter::write`]; [`Error::SameFile`] if both are one file.
pub fn copy(log: &Path, out: &Path, options: CopyOptions, progress: &mut dyn FnMut(f64)) -> Result<Copied, Error> {
    let mut selection = options.selection;
    copy_with(log, out, options.types, options.keep_unchecked, &mut |event| selection.wants(event), progress)
}

/// [`copy`] of the events that `wants` wants.
pub(super) fn copy_with(
    log: &Path,
    out: &Path,
    types: Types,
    keep_unchecked: bool,
    wants: &mut dyn FnMut(&EventRef<'_>) -> bool,
    progress: &mut dyn FnMut(f64),
) -> Result<Copied, Error> {
    Error::unless_apart(log, out)?;
    let mut reader = LogReader::open(log)?.keep_unchecked(keep_unchecked);
    let bytes = reader.bytes().max(1);
    let mut target = Target::create(out, types)?;
    let mut health = Health::default();
    let mut read = 0_u64;
    while let Some(item) = reader.read()? {
        let Some(event) = health.note(item) else { continue };
        if read.is_multiple_of(PROGRESS) {
            progress(event.offset as f64 / bytes as f64);
        }
        read += 1;
        if wants(&event) {
            target.put(&event)?;
        } else {
            target.copied.left_out += 1;
        }
    }
    progress(1.0);
    target.copied.note(&health);
    target.finish()
}

/// A log that is written, and the account of it.
struct Target {
    log: LogWriter,
    to_event_log: bool,
    copied: Copied,
}

impl Target {
    fn create(out: &Path, types: Types) -> Result<Self, Error> {
        let to_event_log = Format::of_name(out)? == Format::LcmLog;
        let mut log = LogWriter::create(out)?;
        log.explain_by(types);
        Ok(Target { log, to_event_log, copied: Copied { out: out.into(), ..Copied::default() } })
    }

    fn put(&mut self, event: &EventRef<'_>) -> Result<(), Error> {
        match self.log.copy(event) {
            Ok(()) => {
                self.copied.events += 1;
                self.copied.times_rounded += u64::from(self.to_event_log && event.t_ns % 1000 != 0);
            }
            Err(Error::NegativeTime { .. } | Error::ChannelName { .. }) => self.copied.refused += 1,
            Err(error) => return Err(error),
        }
        Ok(())
    }

    fn finish(self) -> Result<Copied, Error> {
        self.log.finish()?;
        Ok(self.copied)
    }
}

/// Merges logs by time: at each step the earliest of their next events. Events of one log keep their order even where its times go
/// backwards. Numbers count up from 0 anew.
///
/// # Errors
/// As [`copy`].
pub fn merge(logs: &[PathBuf], out: &Path, types: Types, progress: &mut dyn FnMut(f64)) -> Result<Copied, Error> {
    let mut lanes = Vec::new();
    for log in logs {
        Error::unless_apart(log, out)?;
        lanes.push(Lane { reader: LogReader::open(log)?, next: None, clock: i64::MIN, health: Health::default() });
    }
    let total: u64 = lanes.iter().map(|lane| lane.reader.bytes()).sum();
    let mut target = Target::create(out, types)?;
    for lane in &mut lanes {
        lane.advance()?;
    }
    let mut written = 0_u64;
    while let Some(lane) = lanes.iter_mut().filter(|lane| lane.next.is_some()).min_by_key(|lane| lane.clock) {
        let Some((event, schema)) = lane.next.take() else { break };
        let Event { channel, t_ns, data, offset, .. } = &event;
        let (number, schema) = (target.copied.events as i64, schema.as_ref());
        target.put(&EventRef { channel, t_ns: *t_ns, number, data, offset: *offset, schema })?;
        lane.advance()?;
        written += 1;
        if written.is_multiple_of(PROGRESS) {
            let at: u64 = lanes.iter().map(Lane::offset).sum();
            progress(at as f64 / total.max(1) as f64);
        }
    }
    for lane in &lanes {
        target.copied.note(&lane.health);
    }
    target.finish()
}

/// One of the logs that are merged.
struct Lane {
    reader: LogReader,
    next: Option<(Event, Option<Arc<FileSchema>>)>,
    /// Latest time so far: an event that is behind its log's time goes out with the event before it.
    clock: i64,
    health: Health,
}

impl Lane {
    fn advance(&mut self) -> Result<(), Error> {
        while let Some(item) = self.reader.read()? {
            if let ItemRef::Event(event) = &item {
                self.clock = self.clock.max(event.t_ns);
                self.next = Some((event.to_event(), event.schema.map(Arc::clone)));
                return Ok(());
            }
            self.health.note(item);
        }
        Ok(())
    }

    fn offset(&self) -> u64 {
        self.next.as_ref().map_or(self.reader.bytes(), |(event, _)| event.offset)
    }
}
