//! Writes a log of either format.

use super::event_log::EventLogWriter;
use super::mcap_writer::McapWriter;
use super::types::Types;
use super::{EventRef, Format, MAX_CHANNEL, MAX_CHANNEL_IN_LOG, MAX_MESSAGE};
use crate::Error;
use crate::names::name_bytes;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes a log. Equal events produce equal bytes.
///
/// The `.lcm` texts in an MCAP come from a RUN_INFO that is written, from [`LogWriter::add_types`], or else from this build.
///
/// Dropping the writer writes buffered events, but only [`LogWriter::finish`] reports whether that succeeded.
pub struct LogWriter {
    path: PathBuf,
    sink: Sink,
    events: u64,
    failed: bool,
}

/// Destination of the bytes of a log.
pub type Output = Box<dyn Write + Send>;

enum Sink {
    EventLog(EventLogWriter),
    Mcap(Box<McapWriter>, Box<Types>),
}

impl LogWriter {
    /// Creates or truncates the file. The extension of the name selects the format: `.lcmlog` or `.mcap`.
    ///
    /// # Errors
    /// [`Error::UnknownExtension`] for another extension, [`Error::Io`] if the file cannot be created.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let format = Format::of_name(path)?;
        let file = File::create(path).map_err(|source| io_error(path, source))?;
        Self::to_output(path, format, Box::new(file))
    }

    /// Writes a log to any byte sink; `path` is the path in error messages.
    ///
    /// # Errors
    /// [`Error::Mcap`] if the first bytes cannot be written.
    pub fn to_output(path: &Path, format: Format, out: Output) -> Result<Self, Error> {
        Self::with_profile(path, format, out, "")
    }

    /// As [`LogWriter::to_output`]; `profile`: that of an MCAP's header.
    pub(super) fn with_profile(path: &Path, format: Format, out: Output, profile: &str) -> Result<Self, Error> {
        let sink = match format {
            Format::LcmLog => Sink::EventLog(EventLogWriter::new(out)),
            Format::Mcap => {
                let writer = McapWriter::new(out, profile).map_err(|source| mcap_error(path, source))?;
                Sink::Mcap(Box::new(writer), Box::default())
            }
        };
        Ok(LogWriter { path: path.into(), sink, events: 0, failed: false })
    }

    /// Adds `.lcm` texts, as (name, text), for types of an older log or of another project. Call it before the first event of such a type.
    /// No effect on an LCM event log, which contains no types.
    ///
    /// # Errors
    /// [`Error::Types`] if a text is invalid.
    pub fn add_types(&mut self, sources: &[(String, String)]) -> Result<(), Error> {
        if let Sink::Mcap(_, types) = &mut self.sink {
            types.add(&self.path, sources)?;
        }
        Ok(())
    }

    /// Replaces the known types. No effect on an LCM event log.
    pub fn set_types(&mut self, types: Types) {
        if let Sink::Mcap(_, known) = &mut self.sink {
            **known = types;
        }
    }

    /// Appends an event.
    ///
    /// - `channel`: 1 to 999 bytes without NUL in an LCM event log, which are the limits of LCM's own reader; any name in MCAP.
    /// - `t_ns`: log time, ns, not negative in MCAP. An LCM event log rounds it down to whole microseconds. Nothing of a run is lost by that: its
    ///   ticks are whole microseconds, and each message contains its own `t_ns`.
    /// - `data`: the encoded message, at most [`MAX_MESSAGE`] bytes.
    ///
    /// # Errors
    /// After an error of channel, time or length the log is unchanged. After a failed write every later write fails, so that no log has a
    /// hole.
    pub fn write(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error> {
        let number = self.events as i64;
        self.write_numbered(channel, t_ns, number, data)
    }

    /// [`LogWriter::write`] with a number other than the next one.
    ///
    /// # Errors
    /// As [`LogWriter::write`].
    pub fn write_numbered(&mut self, channel: &str, t_ns: i64, number: i64, data: &[u8]) -> Result<(), Error> {
        self.put(channel, t_ns, t_ns.unsigned_abs(), number, data)
    }

    fn put(&mut self, channel: &str, t_ns: i64, publish_t: u64, number: i64, data: &[u8]) -> Result<(), Error> {
        self.check(channel, t_ns, data)?;
        let written = match &mut self.sink {
            Sink::EventLog(out) => {
                out.write(channel, t_ns, number, data).map_err(|source| io_error(&self.path, source))
            }
            Sink::Mcap(out, types) => {
                types.learn_run_info(channel, data);
                let schema = |fingerprint| types.schema(channel, fingerprint);
                let times = [t_ns.unsigned_abs(), publish_t];
                out.write(channel, times, number, data, schema).map_err(|source| mcap_error(&self.path, source))
            }
        };
        self.failed = written.is_err();
        self.events += u64::from(written.is_ok());
        written
    }

    /// Copies an event of another log with its number. From MCAP to MCAP, schema, encodings, metadata of the channel and publish time are kept.
    ///
    /// # Errors
    /// As [`LogWriter::write`].
    pub fn copy(&mut self, event: &EventRef<'_>) -> Result<(), Error> {
        let (Sink::Mcap(out, types), Some(source)) = (&mut self.sink, event.source) else {
            return self.write_numbered(event.channel, event.t_ns, event.number, event.data);
        };
        if source.channel.is_plain_lcm() {
            if let Some(schema) = &source.channel.schema {
                types.learn_schema(schema);
            }
            return self.put(event.channel, event.t_ns, source.publish_t, event.number, event.data);
        }
        if self.failed {
            return Err(Error::WriterFailed { path: self.path.clone() });
        }
        let times = [event.t_ns.unsigned_abs(), source.publish_t];
        let copied = out.copy(source.channel, times, event.number as u32, event.data);
        self.failed = copied.is_err();
        self.events += u64::from(copied.is_ok());
        copied.map_err(|source| mcap_error(&self.path, source))
    }

    /// The writer of an MCAP, for records that are no messages.
    pub(super) fn mcap(&mut self) -> Option<&mut McapWriter> {
        match &mut self.sink {
            Sink::Mcap(out, _) => Some(out),
            Sink::EventLog(_) => None,
        }
    }

    /// The error of an operation of [`LogWriter::mcap`].
    pub(super) fn mcap_failed(&mut self, source: mcap::McapError) -> Error {
        self.failed = true;
        mcap_error(&self.path, source)
    }

    /// Checks an event against the limits of the format.
    fn check(&self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error> {
        if self.failed {
            return Err(Error::WriterFailed { path: self.path.clone() });
        }
        let is_mcap = matches!(self.sink, Sink::Mcap(..));
        let length = name_bytes(channel).len();
        if !is_mcap && (!(1..=MAX_CHANNEL_IN_LOG).contains(&length) || channel.contains('\0')) {
            return Err(Error::ChannelName { path: self.path.clone(), channel: channel.into() });
        }
        if is_mcap && t_ns < 0 {
            return Err(Error::NegativeTime { path: self.path.clone(), channel: channel.into(), t_ns });
        }
        check_length(&self.path, channel, data)
    }

    /// Writes buffered events to the file. In MCAP this ends a chunk: call it a few times per second, not per event.
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
    /// [`Error::WriterFailed`] after a failed write; else as [`LogWriter::flush`].
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

/// Checks an event of a network or a run, which both formats have to hold.
///
/// # Errors
/// [`Error::ChannelName`], [`Error::NegativeTime`], [`Error::MessageTooLong`]
pub(crate) fn check_event(path: &Path, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error> {
    if !(1..=MAX_CHANNEL).contains(&name_bytes(channel).len()) || channel.contains('\0') {
        return Err(Error::ChannelName { path: path.into(), channel: channel.into() });
    }
    if t_ns < 0 {
        return Err(Error::NegativeTime { path: path.into(), channel: channel.into(), t_ns });
    }
    check_length(path, channel, data)
}

fn check_length(path: &Path, channel: &str, data: &[u8]) -> Result<(), Error> {
    let (bytes, limit) = (data.len(), MAX_MESSAGE);
    if bytes > limit {
        return Err(Error::MessageTooLong { path: path.into(), channel: channel.into(), bytes, limit });
    }
    Ok(())
}

impl Format {
    /// The format for a file name.
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
