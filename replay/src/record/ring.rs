//! A log writer with its own thread, so that neither a slow disk nor compression delays the caller.
//!
//! Events go through a preallocated lock-free ring; writing one is a copy. The writing thread reads the ring every millisecond and flushes
//! to the kernel at a fixed interval, so that a killed process loses little.

use super::Pattern;
use super::bytes::{BytesIn, BytesOut, byte_ring};
use super::drop_policy::{DropPolicy, RecordLevel};
use crate::Error;
use crate::log::{LogWriter, check_event};
use crate::udpm::monotonic_ns;
use lcmtypes::{Event, EventNumbers, Message, channels, new_sender_id};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Receives events in order: a log, or a writer in front of one.
pub trait EventSink {
    /// Appends an event; see [`LogWriter::write`].
    ///
    /// # Errors
    /// If the event cannot be in a log, or the log cannot be written.
    fn write(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error>;
}

/// A log that can be flushed and completed.
pub trait Target: EventSink + Send {
    /// Writes everything so far to the kernel.
    ///
    /// # Errors
    /// If the write fails.
    fn flush(&mut self) -> Result<(), Error>;

    /// Completes the log. Returns its number of events.
    ///
    /// # Errors
    /// If the write fails.
    fn finish(self: Box<Self>) -> Result<u64, Error>;
}

impl EventSink for LogWriter {
    fn write(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error> {
        LogWriter::write(self, channel, t_ns, data)
    }
}

impl Target for LogWriter {
    fn flush(&mut self) -> Result<(), Error> {
        LogWriter::flush(self)
    }

    fn finish(self: Box<Self>) -> Result<u64, Error> {
        LogWriter::finish(*self)
    }
}

/// Behaviour when the ring is full.
#[derive(Debug, Clone)]
pub enum WhenFull {
    /// The caller waits; nothing is dropped. For runs without real-time requirements.
    Wait,
    /// The caller never waits: messages are dropped, debug channels first, and the log reports it.
    Drop {
        /// Channels that are never dropped, in addition to those that a replay needs.
        vital: Option<Pattern>,
    },
}

/// Options of a [`RingWriter`].
#[derive(Debug, Clone)]
pub struct RingOptions {
    /// Size of the ring, bytes.
    pub capacity: usize,
    /// Longest time until an event is flushed to the kernel. `None`: until a buffer or a chunk is full, so that equal events give equal files.
    pub flush_every: Option<Duration>,
    /// Behaviour when the ring is full.
    pub when_full: WhenFull,
    /// Clock for `t_ns` of the messages of [`RingWriter::report`], ns; `None`: the log time.
    pub clock: Option<fn() -> i64>,
}

impl RingOptions {
    /// For lockstep runs: nothing is dropped, and equal events give equal files.
    pub fn lockstep() -> Self {
        RingOptions { capacity: 1 << 24, flush_every: None, when_full: WhenFull::Wait, clock: None }
    }

    /// For real-time runs: flush every 50 ms, so that a killed process loses less than 100 ms. Messages have monotonic times.
    pub fn live() -> Self {
        let (flush_every, clock) = (Some(Duration::from_millis(50)), Some(monotonic_ns as fn() -> i64));
        RingOptions { capacity: 1 << 26, flush_every, when_full: WhenFull::Drop { vital: None }, clock }
    }
}

/// Sleep of the writing thread while the ring is empty.
const REST: Duration = Duration::from_millis(1);

/// Header of each event in the ring, bytes: time and length of the channel's name.
const HEADER: usize = 9;

/// Writes a log through a ring and a thread.
///
/// Dropping it completes the log without reporting errors; [`RingWriter::finish`] reports them.
pub struct RingWriter {
    path: PathBuf,
    ring: Option<BytesIn>,
    thread: Option<JoinHandle<Result<u64, Error>>>,
    policy: Option<DropPolicy>,
    clock: Option<fn() -> i64>,
    events: EventNumbers,
    reported_level: RecordLevel,
    last_ns: i64,
    message: Vec<u8>,
    flushes: u64,
    flushed: Arc<AtomicU64>,
}

impl RingWriter {
    /// Creates the log, as [`LogWriter::create`] does, and the thread that writes it.
    ///
    /// # Errors
    /// Those of [`LogWriter::create`].
    pub fn create(path: impl AsRef<Path>, options: &RingOptions) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::start(path, Box::new(LogWriter::create(path)?), options)
    }

    /// Writes to any target. `path`: name of the log in errors.
    ///
    /// # Errors
    /// [`Error::Io`] if the thread cannot be created.
    pub fn start(path: &Path, target: Box<dyn Target>, options: &RingOptions) -> Result<Self, Error> {
        let (input, output) = byte_ring(options.capacity);
        let (flush_every, flushed) = (options.flush_every, Arc::<AtomicU64>::default());
        let counter = Arc::clone(&flushed);
        let thread = std::thread::Builder::new()
            .name("log writer".to_owned())
            .spawn(move || drain(output, target, flush_every, &counter))
            .map_err(|source| Error::Io { path: path.into(), source })?;
        let policy = match &options.when_full {
            WhenFull::Wait => None,
            WhenFull::Drop { vital } => Some(DropPolicy::new(vital.clone())),
        };
        Ok(RingWriter {
            path: path.into(),
            ring: Some(input),
            thread: Some(thread),
            policy,
            clock: options.clock,
            events: EventNumbers::new(new_sender_id()),
            reported_level: RecordLevel::All,
            last_ns: 0,
            message: Vec::new(),
            flushes: 0,
            flushed,
        })
    }

    /// Sets the channels that the free disk space permits. No effect with [`WhenFull::Wait`].
    pub fn set_disk_level(&mut self, level: RecordLevel) {
        if let Some(policy) = &mut self.policy {
            policy.disk = level;
        }
    }

    /// Channels that are recorded now.
    pub fn level(&self) -> RecordLevel {
        self.policy.as_ref().map_or(RecordLevel::All, DropPolicy::level)
    }

    /// Dropped messages by channel.
    pub fn left_out(&self) -> BTreeMap<String, u64> {
        self.policy.as_ref().map_or_else(BTreeMap::new, |policy| policy.total.clone())
    }

    /// Number of dropped messages.
    pub fn left_out_total(&self) -> u64 {
        self.policy.as_ref().map_or(0, |policy| policy.total.values().sum())
    }

    /// Used part of the ring, 0 to 1.
    #[expect(clippy::cast_precision_loss, reason = "a fraction for display")]
    pub fn fill(&self) -> f64 {
        self.ring.as_ref().map_or(0.0, |ring| ring.waiting() as f64 / ring.capacity() as f64)
    }

    /// Writes an EVENT with source `recorder`; it is dropped only if the ring is full.
    ///
    /// - `t_ns`: log time; the message has the time of [`RingOptions::clock`].
    ///
    /// # Errors
    /// As [`EventSink::write`].
    pub fn report(&mut self, t_ns: i64, level: i8, text: String) -> Result<(), Error> {
        let message_ns = self.clock.map_or(t_ns, |clock| clock());
        let source = super::SOURCE.to_owned();
        let mut event = Event { t_ns: message_ns, tick: -1, level, source, text, ..Event::default() };
        self.events.number(&mut event);
        let mut bytes = std::mem::take(&mut self.message);
        bytes.clear();
        event.encode(&mut bytes).map_err(|source| Error::Encode { path: self.path.clone(), source: source.into() })?;
        let written = self.put(channels::EVENT, t_ns, &bytes);
        self.message = bytes;
        written
    }

    /// Waits until everything is written and completes the log. Returns its number of events.
    ///
    /// # Errors
    /// Those of the writing thread.
    pub fn finish(mut self) -> Result<u64, Error> {
        if self.policy.as_ref().is_some_and(DropPolicy::has_unreported) {
            // If this fails, the writing thread has failed; its error is returned below.
            let _ = self.report_level();
        }
        self.close().unwrap_or(Ok(0))
    }

    fn close(&mut self) -> Option<Result<u64, Error>> {
        self.ring = None;
        let thread = self.thread.take()?;
        thread.thread().unpark();
        Some(thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    }

    /// Writes an EVENT with the channels recorded from now on and the messages dropped before.
    fn report_level(&mut self) -> Result<(), Error> {
        let Some(policy) = &mut self.policy else { return Ok(()) };
        let level = policy.level();
        let why = if policy.disk >= level && level > RecordLevel::All { " (low disk space)" } else { "" };
        let mut text = format!("{}{why}", level.text());
        let is_loss = level > RecordLevel::All || policy.has_unreported();
        if policy.has_unreported() {
            text += &format!("; dropped before this event: {}", policy.take_report());
        }
        self.reported_level = level;
        let event_level = if is_loss { Event::LEVEL_WARNING } else { Event::LEVEL_INFO };
        self.report(self.last_ns, event_level, text)
    }

    /// Puts an event into the ring. If the ring is full, waits or counts the event as dropped.
    fn put(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error> {
        let failed = || Error::WriterFailed { path: self.path.clone() };
        let ring = self.ring.as_mut().ok_or_else(failed)?;
        let (time, length) = (t_ns.to_ne_bytes(), [channel.len() as u8]);
        let parts = [&time[..], &length, channel.as_bytes(), data];
        let bytes = HEADER + channel.len() + data.len();
        loop {
            if ring.is_abandoned() {
                return Err(failed());
            }
            if ring.push(&parts) {
                return Ok(());
            }
            if let Some(policy) = &mut self.policy {
                policy.count_dropped(channel);
                return Ok(());
            }
            if bytes > ring.longest() {
                let limit = ring.longest();
                return Err(Error::RingTooSmall { path: self.path.clone(), channel: channel.to_owned(), bytes, limit });
            }
            if let Some(thread) = &self.thread {
                thread.thread().unpark();
            }
            std::thread::yield_now();
        }
    }
}

impl EventSink for RingWriter {
    /// Copies an event into the ring. With [`WhenFull::Drop`] it never waits; dropped events are counted and reported and are not an error.
    ///
    /// # Errors
    /// As [`LogWriter::write`] for a bad channel, time or length; [`Error::RingTooSmall`]; [`Error::WriterFailed`] once the writing thread
    /// has failed: [`RingWriter::finish`] returns its error.
    fn write(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error> {
        check_event(&self.path, channel, t_ns, data)?;
        self.last_ns = t_ns;
        if let (Some(policy), Some(ring)) = (&mut self.policy, &self.ring) {
            policy.update(ring.waiting(), ring.capacity());
            let level = policy.level();
            let taken = policy.takes(channel);
            if level != self.reported_level {
                self.report_level()?;
            }
            if let (false, Some(policy)) = (taken, &mut self.policy) {
                policy.count_dropped(channel);
                return Ok(());
            }
        }
        self.put(channel, t_ns, data)
    }
}

impl Target for RingWriter {
    /// Waits until everything so far is flushed to the kernel. Not for use in a control loop.
    fn flush(&mut self) -> Result<(), Error> {
        let failed = || Error::WriterFailed { path: self.path.clone() };
        let ring = self.ring.as_mut().ok_or_else(failed)?;
        self.flushes += 1;
        // An event without a channel name requests a flush.
        while !ring.push(&[&[0; HEADER]]) && !ring.is_abandoned() {
            std::thread::yield_now();
        }
        while self.flushed.load(Ordering::Acquire) < self.flushes {
            if ring.is_abandoned() {
                return Err(failed());
            }
            std::thread::yield_now();
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<u64, Error> {
        RingWriter::finish(*self)
    }
}

impl Drop for RingWriter {
    fn drop(&mut self) {
        drop(self.close());
    }
}

/// The writing thread: runs until the writing end of the ring is dropped and the ring is empty.
fn drain(
    mut ring: BytesOut,
    mut target: Box<dyn Target>,
    flush_every: Option<Duration>,
    flushed: &AtomicU64,
) -> Result<u64, Error> {
    let mut event = Vec::new();
    let mut unflushed: Option<Instant> = None;
    loop {
        // Check this before reading the ring: the writing end is dropped only after the last event.
        let ended = ring.is_abandoned();
        if ring.pop(&mut event) {
            let (header, rest) = event.split_first_chunk::<HEADER>().expect("each event has a header");
            let (time, length) = header.split_first_chunk().expect("the header begins with the time");
            let (channel, data) = rest.split_at(usize::from(length[0]));
            let channel = std::str::from_utf8(channel).expect("written from a str");
            if channel.is_empty() {
                target.flush()?;
                flushed.fetch_add(1, Ordering::Release);
                unflushed = None;
                continue;
            }
            target.write(channel, i64::from_ne_bytes(*time), data)?;
            unflushed.get_or_insert_with(Instant::now);
        } else if ended {
            return target.finish();
        } else {
            std::thread::park_timeout(REST);
        }
        if let (Some(since), Some(every)) = (unflushed, flush_every)
            && since.elapsed() >= every
        {
            target.flush()?;
            unflushed = None;
        }
    }
}
