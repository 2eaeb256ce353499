//! A log written by a thread of its own, so that neither a slow disk nor a compressor is ever met where events come from.
//!
//! Events go through a lock-free ring that is allocated once. To write one is to copy it; the writing thread looks into the ring every
//! millisecond and hands everything on to the kernel in time, so that a process that is killed takes little with it.

use super::Pattern;
use super::bytes::{BytesIn, BytesOut, byte_ring};
use super::drop_policy::{Keep, Shedder};
use crate::Error;
use crate::log::{LogWriter, check_event};
use crate::udpm::monotonic_ns;
use lcmtypes::{Event, Message, channels};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Something that takes events in order: a log, or the way to one.
pub trait EventSink {
    /// Appends an event; see [`LogWriter::write`].
    ///
    /// # Errors
    /// If the event cannot be in a log, or the log cannot be written.
    fn write(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error>;
}

/// A whole log to write: where the writing thread puts the events, or the way to it.
pub trait Target: EventSink + Send {
    /// Hands everything so far to the kernel.
    ///
    /// # Errors
    /// If that fails.
    fn flush(&mut self) -> Result<(), Error>;

    /// Completes the log; how many events it holds.
    ///
    /// # Errors
    /// If that fails.
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

/// What happens when the ring is full.
#[derive(Debug, Clone)]
pub enum WhenFull {
    /// Whoever writes waits: nothing is ever left out. For runs that need not keep up with the world.
    Wait,
    /// Nobody waits: messages are left out, debug channels first, and the log says so. `vital` are channels never left out beside
    /// those that a replay needs.
    Shed {
        /// Channels of other projects that matter as much as replay inputs.
        vital: Option<Pattern>,
    },
}

/// How a [`RingWriter`] works.
#[derive(Debug, Clone)]
pub struct RingOptions {
    /// Bytes of the ring.
    pub capacity: usize,
    /// How long an event may stay in this process. `None`: until a buffer or a chunk is full, so that equal events give equal files.
    pub flush_every: Option<Duration>,
    /// What happens when the ring is full.
    pub when_full: WhenFull,
    /// Clock of the messages, ns, for what [`RingWriter::say`] says; `None`: it is that of the log.
    pub clock: Option<fn() -> i64>,
}

impl RingOptions {
    /// For lockstep runs: nothing is left out, and equal events give equal files.
    pub fn lockstep() -> Self {
        RingOptions { capacity: 1 << 24, flush_every: None, when_full: WhenFull::Wait, clock: None }
    }

    /// For runs that must not wait: 50 ms to the kernel, so that a killed process loses less than 100 ms. Messages have the monotonic clock.
    pub fn live() -> Self {
        let (flush_every, clock) = (Some(Duration::from_millis(50)), Some(monotonic_ns as fn() -> i64));
        RingOptions { capacity: 1 << 26, flush_every, when_full: WhenFull::Shed { vital: None }, clock }
    }
}

/// How long the writing thread rests when the ring is empty.
const REST: Duration = Duration::from_millis(1);

/// Time and length of the channel's name, before each event in the ring.
const HEADER: usize = 9;

/// Writes a log through a ring and a thread.
///
/// Dropping it completes the log; only [`RingWriter::finish`] tells whether that went well.
pub struct RingWriter {
    path: PathBuf,
    ring: Option<BytesIn>,
    thread: Option<JoinHandle<Result<u64, Error>>>,
    shedder: Option<Shedder>,
    clock: Option<fn() -> i64>,
    said: Keep,
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

    /// Writes to any target; `path` names it in errors.
    ///
    /// # Errors
    /// [`Error::Io`] if there can be no further thread.
    pub fn start(path: &Path, target: Box<dyn Target>, options: &RingOptions) -> Result<Self, Error> {
        let (input, output) = byte_ring(options.capacity);
        let (flush_every, flushed) = (options.flush_every, Arc::<AtomicU64>::default());
        let counter = Arc::clone(&flushed);
        let thread = std::thread::Builder::new()
            .name("log writer".to_owned())
            .spawn(move || drain(output, target, flush_every, &counter))
            .map_err(|source| Error::Io { path: path.into(), source })?;
        let shedder = match &options.when_full {
            WhenFull::Wait => None,
            WhenFull::Shed { vital } => Some(Shedder::new(vital.clone())),
        };
        Ok(RingWriter {
            path: path.into(),
            ring: Some(input),
            thread: Some(thread),
            shedder,
            clock: options.clock,
            said: Keep::All,
            last_ns: 0,
            message: Vec::new(),
            flushes: 0,
            flushed,
        })
    }

    /// What the space on the disk allows from now on. Without effect on a writer that waits.
    pub fn set_disk(&mut self, keep: Keep) {
        if let Some(shedder) = &mut self.shedder {
            shedder.disk = keep;
        }
    }

    /// What is recorded now.
    pub fn keep(&self) -> Keep {
        self.shedder.as_ref().map_or(Keep::All, Shedder::keep)
    }

    /// Messages left out so far, by channel.
    pub fn left_out(&self) -> BTreeMap<String, u64> {
        self.shedder.as_ref().map_or_else(BTreeMap::new, |shedder| shedder.total.clone())
    }

    /// How many messages were left out so far.
    pub fn left_out_total(&self) -> u64 {
        self.shedder.as_ref().map_or(0, |shedder| shedder.total.values().sum())
    }

    /// Part of the ring that is in use, 0 to 1.
    #[expect(clippy::cast_precision_loss, reason = "a fraction for people")]
    pub fn fill(&self) -> f64 {
        self.ring.as_ref().map_or(0.0, |ring| ring.waiting() as f64 / ring.capacity() as f64)
    }

    /// Says something in the log, on channel EVENT, as the recorder; never left out but where nothing fits any more.
    ///
    /// - `t_ns`: when, by the clock of the log; the message has the time of [`RingOptions::clock`].
    ///
    /// # Errors
    /// As [`EventSink::write`].
    pub fn say(&mut self, t_ns: i64, level: i8, text: String) -> Result<(), Error> {
        let message_ns = self.clock.map_or(t_ns, |clock| clock());
        let event = Event { t_ns: message_ns, tick: -1, level, source: "recorder".to_owned(), text };
        let mut bytes = std::mem::take(&mut self.message);
        bytes.clear();
        event.encode(&mut bytes).map_err(|source| Error::Encode { path: self.path.clone(), source: source.into() })?;
        let written = self.put(channels::EVENT, t_ns, &bytes);
        self.message = bytes;
        written
    }

    /// Waits until everything is written and completes the log; how many events it holds.
    ///
    /// # Errors
    /// What the writing thread met with.
    pub fn finish(mut self) -> Result<u64, Error> {
        if self.shedder.as_ref().is_some_and(Shedder::has_unsaid) {
            // Once more with the writer's own failure in mind: that one is told below.
            let _ = self.tell();
        }
        self.close().unwrap_or(Ok(0))
    }

    fn close(&mut self) -> Option<Result<u64, Error>> {
        self.ring = None;
        let thread = self.thread.take()?;
        thread.thread().unpark();
        Some(thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    }

    /// Says in the log what is recorded from here on, and what was left out before.
    fn tell(&mut self) -> Result<(), Error> {
        let Some(shedder) = &mut self.shedder else { return Ok(()) };
        let keep = shedder.keep();
        let why = if shedder.disk >= keep && keep > Keep::All { " (too little space on the disk)" } else { "" };
        let mut text = format!("{}{why}", keep.text());
        if shedder.has_unsaid() {
            text += &format!("; not recorded until here: {}", shedder.say());
        }
        self.said = keep;
        let level = if keep == Keep::All { Event::LEVEL_INFO } else { Event::LEVEL_WARNING };
        self.say(self.last_ns, level, text)
    }

    /// Puts an event into the ring; counts it where it does not fit and nobody may wait.
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
            if let Some(shedder) = &mut self.shedder {
                shedder.left_out(channel);
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
    /// Copies an event into the ring. With [`WhenFull::Shed`] it never waits, and what is left out is counted and told, not an error.
    ///
    /// # Errors
    /// As [`LogWriter::write`] for a bad channel, time or length; [`Error::RingTooSmall`]; [`Error::WriterFailed`] once the writing thread
    /// has failed: [`RingWriter::finish`] says why.
    fn write(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error> {
        check_event(&self.path, channel, t_ns, data)?;
        self.last_ns = t_ns;
        if let (Some(shedder), Some(ring)) = (&mut self.shedder, &self.ring) {
            shedder.see(ring.waiting(), ring.capacity());
            let keep = shedder.keep();
            let taken = shedder.takes(channel);
            if keep != self.said {
                self.tell()?;
            }
            if let (false, Some(shedder)) = (taken, &mut self.shedder) {
                shedder.left_out(channel);
                return Ok(());
            }
        }
        self.put(channel, t_ns, data)
    }
}

impl Target for RingWriter {
    /// Waits until everything so far is with the kernel; not for a control loop.
    fn flush(&mut self) -> Result<(), Error> {
        let failed = || Error::WriterFailed { path: self.path.clone() };
        let ring = self.ring.as_mut().ok_or_else(failed)?;
        self.flushes += 1;
        // An event without a channel, which no log holds, is the request.
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

/// The writing thread: until nobody puts in any more and the ring is empty.
fn drain(
    mut ring: BytesOut,
    mut target: Box<dyn Target>,
    flush_every: Option<Duration>,
    flushed: &AtomicU64,
) -> Result<u64, Error> {
    let mut event = Vec::new();
    let mut unflushed: Option<Instant> = None;
    loop {
        // Asked before the ring is: whoever put in the last event has let go of the ring afterwards.
        let ended = ring.is_abandoned();
        if ring.pop(&mut event) {
            let (header, rest) = event.split_first_chunk::<HEADER>().expect("put in with a header");
            let (time, length) = header.split_first_chunk().expect("the header begins with the time");
            let (channel, data) = rest.split_at(usize::from(length[0]));
            let channel = std::str::from_utf8(channel).expect("put in as text");
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
