//! Writing a log of either format.

use super::event_log::EventLogWriter;
use super::mcap_writer::McapWriter;
use super::types::Types;
use super::{EventRef, Format, MAX_CHANNEL, MAX_MESSAGE};
use crate::Error;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes a log. Equal events give equal bytes.
///
/// In MCAP the `.lcm` texts of the types come from a RUN_INFO that is written, from [`LogWriter::explain`], else they are our own.
///
/// Dropping it writes out what is buffered, but only [`LogWriter::finish`] tells whether that went well.
pub struct LogWriter {
    path: PathBuf,
    sink: Sink,
    events: u64,
    failed: bool,
}

/// Where the bytes of a log go.
pub type Output = Box<dyn Write + Send>;

enum Sink {
    EventLog(EventLogWriter),
    Mcap(Box<McapWriter>, Box<Types>),
}

impl LogWriter {
    /// Creates the file, or empties it. The format is that of the name's ending: `.lcmlog` or `.mcap`.
    ///
    /// # Errors
    /// [`Error::UnknownExtension`] for another ending, [`Error::Io`] if the file cannot be created.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let format = Format::of_name(path)?;
        let file = File::create(path).map_err(|source| io_error(path, source))?;
        Self::to_output(path, format, Box::new(file))
    }

    /// Writes a log to anything that takes bytes in order; `path` names it in errors.
    ///
    /// # Errors
    /// [`Error::Mcap`] if the first bytes cannot be written.
    pub fn to_output(path: &Path, format: Format, out: Output) -> Result<Self, Error> {
        let sink = match format {
            Format::LcmLog => Sink::EventLog(EventLogWriter::new(out)),
            Format::Mcap => {
                let writer = McapWriter::new(out).map_err(|source| mcap_error(path, source))?;
                Sink::Mcap(Box::new(writer), Box::default())
            }
        };
        Ok(LogWriter { path: path.into(), sink, events: 0, failed: false })
    }

    /// Explains types by other `.lcm` texts too, given as (name, text): those of an older log, or of another project. To be called
    /// before the first event of such a type; without effect on an LCM event log, which holds no types.
    ///
    /// # Errors
    /// [`Error::Types`] if the texts cannot be used.
    pub fn add_types(&mut self, sources: &[(String, String)]) -> Result<(), Error> {
        if let Sink::Mcap(_, types) = &mut self.sink {
            types.add(&self.path, sources)?;
        }
        Ok(())
    }

    /// [`LogWriter::explain`] by everything that is known of the types of a log.
    pub fn set_types(&mut self, types: Types) {
        if let Sink::Mcap(_, known) = &mut self.sink {
            **known = types;
        }
    }

    /// Appends an event.
    ///
    /// - `t_ns`: ns, not negative. An LCM event log holds microseconds: the rest is rounded down there. Ticks are whole microseconds,
    ///   and a message carries its own `t_ns`, so nothing of a run is lost.
    /// - `data`: the encoded message, at most [`MAX_MESSAGE`] bytes.
    ///
    /// # Errors
    /// A bad channel, time or length leaves the log as it was. After a failed write every later one fails too, so that no log has a hole.
    pub fn write(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error> {
        let number = self.events as i64;
        self.write_numbered(channel, t_ns, number, data)
    }

    /// [`LogWriter::write`] with a number other than the next one.
    ///
    /// # Errors
    /// As [`LogWriter::write`].
    pub fn write_numbered(&mut self, channel: &str, t_ns: i64, number: i64, data: &[u8]) -> Result<(), Error> {
        let t = self.check(channel, t_ns, data)?;
        let written = match &mut self.sink {
            Sink::EventLog(out) => {
                out.write(channel, t_ns, number, data).map_err(|source| io_error(&self.path, source))
            }
            Sink::Mcap(out, types) => {
                types.learn_run_info(channel, data);
                let schema = |fingerprint| types.schema(channel, fingerprint);
                out.write(channel, t, number, data, schema).map_err(|source| mcap_error(&self.path, source))
            }
        };
        self.failed = written.is_err();
        self.events += u64::from(written.is_ok());
        written
    }

    /// Copies an event of another log, its number and what that file says of its type included.
    ///
    /// # Errors
    /// As [`LogWriter::write`].
    pub fn copy(&mut self, event: &EventRef<'_>) -> Result<(), Error> {
        if let (Sink::Mcap(_, types), Some(schema)) = (&mut self.sink, event.schema) {
            types.learn_schema(schema);
        }
        self.write_numbered(event.channel, event.t_ns, event.number, event.data)
    }

    /// The time, if an event can be written.
    fn check(&self, channel: &str, t_ns: i64, data: &[u8]) -> Result<u64, Error> {
        if self.failed {
            return Err(Error::WriterFailed { path: self.path.clone() });
        }
        check_event(&self.path, channel, t_ns, data)
    }

    /// Hands everything so far to the operating system. In MCAP this ends a chunk: call it a few times a second, not per event.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Mcap`] if that fails.
    pub fn flush(&mut self) -> Result<(), Error> {
        let flushed = match &mut self.sink {
            Sink::EventLog(out) => out.flush().map_err(|source| io_error(&self.path, source)),
            Sink::Mcap(out, _) => out.flush().map_err(|source| mcap_error(&self.path, source)),
        };
        self.failed |= flushed.is_err();
        flushed
    }

    /// Completes the file. Returns the number of events in it.
    ///
    /// # Errors
    /// [`Error::WriterFailed`] after a failed write, otherwise as [`LogWriter::flush`].
    pub fn finish(mut self) -> Result<u64, Error> {
        if self.failed {
            return Err(Error::WriterFailed { path: self.path });
        }
        match self.sink {
            Sink::EventLog(ref mut out) => out.flush().map_err(|source| io_error(&self.path, source))?,
            Sink::Mcap(out, _) => out.finish().map_err(|source| mcap_error(&self.path, source))?,
        }
        Ok(self.events)
    }

    /// Events written so far.
    pub fn events(&self) -> u64 {
        self.events
    }
}

/// The time of an event that a log can hold, ns.
///
/// # Errors
/// [`Error::ChannelName`], [`Error::NegativeTime`], [`Error::MessageTooLong`]
pub(crate) fn check_event(path: &Path, channel: &str, t_ns: i64, data: &[u8]) -> Result<u64, Error> {
    if channel.is_empty() || channel.len() > MAX_CHANNEL || channel.contains('\0') {
        return Err(Error::ChannelName { path: path.into(), channel: channel.into() });
    }
    let Ok(t) = u64::try_from(t_ns) else {
        return Err(Error::NegativeTime { path: path.into(), channel: channel.into(), t_ns });
    };
    if data.len() > MAX_MESSAGE {
        let (channel, bytes) = (channel.into(), data.len());
        return Err(Error::MessageTooLong { path: path.into(), channel, bytes, limit: MAX_MESSAGE });
    }
    Ok(t)
}

impl Format {
    /// The format that a file of this name is written in.
    ///
    /// # Errors
    /// [`Error::UnknownExtension`] unless the name ends with `.lcmlog` or `.mcap`.
    pub fn of_name(path: &Path) -> Result<Self, Error> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("lcmlog") => Ok(Format::LcmLog),
            Some("mcap") => Ok(Format::Mcap),
            _ => Err(Error::UnknownExtension { path: path.into() }),
        }
    }
}

fn io_error(path: &Path, source: std::io::Error) -> Error {
    Error::Io { path: path.into(), source }
}

fn mcap_error(path: &Path, source: mcap::McapError) -> Error {
    Error::Mcap { path: path.into(), source: source.into() }
}
