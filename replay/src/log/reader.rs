//! Reads a log of either format.

use super::byte_source::ByteSource;
use super::event_log::{self, EventLogReader};
use super::mcap_reader::McapReader;
use super::run_path::split_run;
use super::runs::Runs;
use super::{Event, EventRef, FileChannel, Format, Health, Item, ItemRef, McapSource};
use crate::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Reads a log from start to end, skipping damage.
///
/// An iterator of [`Item`]; iteration that ends without an [`Item::Cut`] has reached the end of the log. After an `Err` (the operating
/// system failed to read) iteration ends. [`LogReader::read`] returns the same items without copying each message.
pub struct LogReader {
    format: Format,
    bytes: u64,
    reader: Option<Reader>,
    /// Reads only one run of the log.
    selected: Option<SelectedRun>,
}

/// An event; for an MCAP also its channel in the file and its publish time, ns.
type Selected = (Event, Option<(Arc<FileChannel>, u64)>);

/// The selection of one run.
struct SelectedRun {
    path: PathBuf,
    number: usize,
    runs: Runs,
    /// The last selected event.
    event: Option<Selected>,
}

enum Reader {
    EventLog(Box<EventLogReader>),
    Mcap(Box<McapReader>),
}

impl LogReader {
    /// Opens a log, or one run of it: [`super::path_of_run`]. The format is detected from the content, not from the name.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::NotAFile`], [`Error::EmptyFile`], or [`Error::NotALog`] if the content matches neither format.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        let (file, number) = split_run(path.as_ref());
        let mut log = Self::new(ByteSource::open(&file)?, false)?;
        log.selected = number.map(|number| SelectedRun { path: file, number, runs: Runs::default(), event: None });
        Ok(log)
    }

    /// [`LogReader::open`] for a log that is still being written. An incomplete record at the end is not reported as a cut: the reader
    /// returns `None` there and can be called again after more was written.
    ///
    /// # Errors
    /// As [`LogReader::open`].
    pub fn open_growing(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::new(ByteSource::open(path.as_ref())?, true)
    }

    /// A log in memory; `name` is the path in error messages.
    ///
    /// # Errors
    /// As [`LogReader::open`], without the errors of the operating system.
    pub fn from_bytes(name: impl AsRef<Path>, bytes: Vec<u8>) -> Result<Self, Error> {
        Self::new(ByteSource::from_bytes(name.as_ref(), bytes), false)
    }

    fn new(mut source: ByteSource, growing: bool) -> Result<Self, Error> {
        let bytes = source.len();
        if bytes == 0 {
            return Err(Error::EmptyFile { path: source.path().into() });
        }
        let format = detect(&mut source)?;
        let reader = match format {
            Format::LcmLog => Reader::EventLog(Box::new(EventLogReader::new(source, growing))),
            Format::Mcap => Reader::Mcap(Box::new(McapReader::new(source, growing))),
        };
        Ok(LogReader { format, bytes, reader: Some(reader), selected: None })
    }

    /// Also returns the readable events of damaged MCAP chunks; some of their bytes may be wrong.
    #[must_use]
    pub fn keep_unchecked(mut self, keep: bool) -> Self {
        if let Some(Reader::Mcap(reader)) = &mut self.reader {
            reader.keep_unchecked = keep;
        }
        self
    }

    /// Whether the file is known to be complete: an MCAP read through its closing magic. An event log has no end mark.
    pub fn is_complete(&self) -> bool {
        matches!(&self.reader, Some(Reader::Mcap(reader)) if reader.is_complete())
    }

    /// Whether the part that was read consists of several MCAPs, one after the other: then [`LogReader::seek`] finds wrong channels.
    pub(crate) fn is_joined(&self) -> bool {
        matches!(&self.reader, Some(Reader::Mcap(reader)) if reader.is_joined())
    }

    /// Continues at the record at this offset: [`super::EventRef::offset`] of an event of the same file, or 0.
    ///
    /// # Errors
    /// As [`LogReader::read`].
    pub fn seek(&mut self, offset: u64) -> Result<(), Error> {
        match self.reader.as_mut() {
            Some(Reader::EventLog(reader)) => reader.seek(offset),
            Some(Reader::Mcap(reader)) if offset > 0 => reader.seek(offset)?,
            Some(Reader::Mcap(reader)) => reader.rewind(),
            None => {}
        }
        Ok(())
    }

    /// The reader of an MCAP.
    pub(super) fn mcap(&mut self) -> Option<&mut McapReader> {
        match self.reader.as_mut() {
            Some(Reader::Mcap(reader)) => Some(reader),
            _ => None,
        }
    }

    /// The next item, borrowed from the reader; `None` at the end.
    ///
    /// # Errors
    /// [`Error::Io`] if the operating system fails to read, [`Error::NoSuchRun`] at the end of a log without the selected run; iteration ends.
    #[inline]
    pub fn read(&mut self) -> Result<Option<ItemRef<'_>>, Error> {
        match &mut self.selected {
            None => next(&mut self.reader),
            Some(selected) => selected.read(&mut self.reader),
        }
    }

    /// Format of the file.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Length of the file when it was opened.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// An iterator of the events only; damage is collected in [`Events::health`].
    pub fn events(self) -> Events {
        Events { reader: self, health: Health::default() }
    }
}

impl SelectedRun {
    /// The next item of the run.
    fn read(&mut self, reader: &mut Option<Reader>) -> Result<Option<ItemRef<'_>>, Error> {
        // Closed after an error.
        let is_open = reader.is_some();
        loop {
            match next(reader)? {
                None if self.event.is_none() && is_open => {
                    let (path, runs) = (self.path.clone(), self.runs.summaries().len());
                    return Err(Error::NoSuchRun { path, number: self.number, runs });
                }
                None => return Ok(None),
                Some(ItemRef::Event(event)) if self.runs.see(&event) + 1 == self.number => {
                    let source = event.source.map(|source| (Arc::clone(source.channel), source.publish_t));
                    self.event = Some((event.to_event(), source));
                    break;
                }
                Some(ItemRef::Event(_)) => {}
                Some(ItemRef::Damaged(damaged)) => return Ok(Some(ItemRef::Damaged(damaged))),
                Some(ItemRef::Cut(cut)) => return Ok(Some(ItemRef::Cut(cut))),
            }
        }
        Ok(self.event.as_ref().map(|(event, source)| {
            let Event { channel, t_ns, number, data, offset } = event;
            let (t_ns, number, offset) = (*t_ns, *number, *offset);
            let source = source.as_ref().map(|(channel, publish_t)| McapSource { channel, publish_t: *publish_t });
            ItemRef::Event(EventRef { channel, t_ns, number, data, offset, source })
        }))
    }
}

#[inline]
fn next(reader: &mut Option<Reader>) -> Result<Option<ItemRef<'_>>, Error> {
    match reader {
        Some(Reader::EventLog(reader)) => reader.next(),
        Some(Reader::Mcap(reader)) => reader.next(),
        None => Ok(None),
    }
}

impl Iterator for LogReader {
    type Item = Result<Item, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        let item = self.read().map(|item| item.map(|item| item.to_item()));
        if item.is_err() {
            self.reader = None;
        }
        item.transpose()
    }
}

/// Iterator of the events of a log.
pub struct Events {
    reader: LogReader,
    health: Health,
}

impl Events {
    /// Damage found in the part of the log that has been read.
    pub fn health(&self) -> &Health {
        &self.health
    }

    pub(crate) fn is_joined(&self) -> bool {
        self.reader.is_joined()
    }
}

impl Iterator for Events {
    type Item = Result<Event, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            match self.reader.next()? {
                Ok(Item::Event(event)) => return Some(Ok(event)),
                Ok(Item::Damaged(damaged)) => self.health.damaged.push(damaged),
                Ok(Item::Cut(cut)) => self.health.cut = Some(cut),
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

fn detect(source: &mut ByteSource) -> Result<Format, Error> {
    let first = source.bytes(0, mcap::MAGIC.len())?;
    if first.starts_with(&event_log::SYNC) {
        return Ok(Format::LcmLog);
    }
    if first == mcap::MAGIC {
        return Ok(Format::Mcap);
    }
    let found = first.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ");
    // The first bytes may be damaged, in any number.
    if McapReader::looks_like_one(source)? {
        return Ok(Format::Mcap);
    }
    match (EventLogReader::first_event(source)?, McapReader::first_chunk(source)?) {
        (Some(event), chunk) if chunk.is_none_or(|chunk| event < chunk) => return Ok(Format::LcmLog),
        (_, Some(_)) => return Ok(Format::Mcap),
        _ => {}
    }
    Err(Error::NotALog { path: source.path().into(), bytes: source.len(), found })
}
