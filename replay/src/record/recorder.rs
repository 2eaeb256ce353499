//! The recorder: one socket, three threads, one log.
//!
//! ```text
//! socket --receive thread--> ring of datagrams --this thread: Intake--> ring of events --log writer--> file
//! ```
//! The receive thread only reads datagrams, so that the kernel's buffer stays empty. The intake never waits for the disk. If the log writer
//! is too slow, the ring before it drops messages by channel.

use super::bytes::{BytesIn, BytesOut, byte_ring};
use super::disk::DiskState;
use super::drop_policy::RecordLevel;
use super::files::{Files, Names, Rotation};
use super::intake::{Intake, IntakeSummary, Status};
use super::pattern::{Filter, Pattern};
use super::ring::{RingOptions, RingWriter, WhenFull};
use crate::Error;
use crate::udpm::{self, Datagram, Listener, Url};
use nix::sys::statvfs::statvfs;
use std::net::{Ipv4Addr, SocketAddrV4};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Size of the ring between socket and intake, bytes.
const DATAGRAMS: usize = 1 << 24;
/// Header of each datagram in the ring, bytes: address, port, time, kernel's drop count.
const HEADER: usize = 18;
/// Sleep of the intake while the ring is empty.
const REST: Duration = Duration::from_millis(1);
/// Time between two checks of the free disk space and two progress reports.
const CHECK: Duration = Duration::from_millis(100);
/// Time to wait for space on a full disk at the end of a recording.
const FULL_DISK_TIMEOUT: Duration = Duration::from_secs(2);

/// Options of a recording.
#[derive(Debug, Clone)]
pub struct RecordOptions {
    /// Network.
    pub url: Url,
    /// Log to write; the file extension selects the format.
    pub out: PathBuf,
    /// Channels.
    pub filter: Filter,
    /// Channels that are never dropped, in addition to those that a replay needs.
    pub vital: Option<Pattern>,
    /// When to start a new file.
    pub rotation: Rotation,
    /// Free disk space reserved for replay inputs, bytes.
    pub reserve: u64,
    /// Size of the write buffer, bytes.
    pub buffer: usize,
}

/// A running recording.
pub struct Recorder {
    intake: Intake,
    datagrams: BytesOut,
    receiver: Receiver,
    disk: Arc<DiskState>,
    names: Names,
    folder: PathBuf,
    reserve: u64,
    url: String,
    warning: Option<String>,
    moved: Option<PathBuf>,
}

/// Status of a recording and its disk.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Received messages.
    pub status: Status,
    /// Bytes written.
    pub file_bytes: u64,
    /// Free disk space, bytes; `None` if unknown.
    pub free_bytes: Option<u64>,
    /// Write error, while nothing can be written.
    pub trouble: Option<String>,
    /// Current file.
    pub file: PathBuf,
}

/// Summary of a completed recording.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct RecordSummary {
    /// Existing files, oldest first.
    pub files: Vec<PathBuf>,
    /// Bytes written.
    pub file_bytes: u64,
    /// Received and recorded messages.
    #[serde(flatten)]
    pub intake: IntakeSummary,
}

impl RecordSummary {
    /// Whether messages that were sent are missing in the log.
    pub fn is_lossy(&self) -> bool {
        self.intake.lost > 0 || !self.intake.left_out.is_empty() || self.intake.failure.is_some()
    }
}

struct Receiver {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Result<(), nix::errno::Errno>>,
}

impl Recorder {
    /// Joins the network, creates the log and starts to receive.
    ///
    /// # Errors
    /// Those of [`Listener::open`] and [`Files::create`].
    pub fn start(options: RecordOptions) -> Result<Self, Error> {
        let RecordOptions { url, out, filter, vital, rotation, reserve, buffer } = options;
        let listener = Listener::open(&url)?;
        let warning = listener.warning();
        let disk = Arc::<DiskState>::default();
        let files = Files::create(&out, rotation, Arc::clone(&disk))?;
        let (names, moved) = (files.names(), files.moved().map(Path::to_path_buf));
        let live = RingOptions::live();
        let ring_options = RingOptions { capacity: buffer, when_full: WhenFull::Drop { vital }, ..live };
        let writer = RingWriter::start(&out, Box::new(files), &ring_options)?;
        let (input, datagrams) = byte_ring(DATAGRAMS);
        let receiver = Receiver::start(listener, input).map_err(|source| Error::Io { path: out.clone(), source })?;
        let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")).into();
        let (intake, url) = (Intake::new(filter, writer), url.to_string());
        Ok(Recorder { intake, datagrams, receiver, disk, names, folder, reserve, url, warning, moved })
    }

    /// Warning for the user, such as a small receive buffer.
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// New name of an existing log with the same name; nothing is overwritten.
    pub fn moved(&self) -> Option<&Path> {
        self.moved.as_deref()
    }

    /// Records until `stop` returns true; calls `progress` ten times per second.
    ///
    /// A stop records the datagrams already received and completes the log. On a full disk it waits two seconds for space and then drops
    /// the rest: the file ends there and is readable up to there.
    ///
    /// A write error ends the recording; [`IntakeSummary::failure`] contains it.
    ///
    /// # Errors
    /// [`Error::Socket`] if the socket fails; the file is readable in any case.
    pub fn run(mut self, stop: &dyn Fn() -> bool, progress: &mut dyn FnMut(&Progress)) -> Result<RecordSummary, Error> {
        let listened = self.listen(stop, progress);
        self.finish(listened)
    }

    fn listen(&mut self, stop: &dyn Fn() -> bool, progress: &mut dyn FnMut(&Progress)) -> Result<(), Error> {
        let mut datagram = Vec::new();
        let mut checked: Option<Instant> = None;
        loop {
            if stop() {
                self.receiver.stop.store(true, Ordering::Relaxed);
            }
            // Check this before reading the ring: the receiver drops its end only after its last datagram.
            let ended = self.datagrams.is_abandoned();
            let mut idle = true;
            while !is_time(checked) && self.datagrams.pop(&mut datagram) {
                idle = false;
                self.intake.datagram(&unpacked(&datagram))?;
            }
            if is_time(checked) {
                checked = Some(Instant::now());
                progress(&self.check());
                self.intake.update(udpm::now_ns())?;
            } else if idle && ended {
                return Ok(());
            } else if idle {
                std::thread::park_timeout(REST);
            }
        }
    }

    fn check(&mut self) -> Progress {
        let free_bytes = statvfs(&self.folder).ok().map(|disk| disk.blocks_available() * disk.fragment_size());
        self.intake.set_disk_level(match free_bytes {
            Some(free) if free < self.reserve => RecordLevel::Inputs,
            Some(free) if free < self.reserve.saturating_mul(2) => RecordLevel::Replay,
            _ => RecordLevel::All,
        });
        let names = self.names.lock().unwrap_or_else(PoisonError::into_inner);
        Progress {
            status: self.intake.status(),
            file_bytes: self.disk.bytes(),
            free_bytes,
            trouble: self.disk.trouble(),
            file: names.back().cloned().unwrap_or_default(),
        }
    }

    fn finish(self, listened: Result<(), Error>) -> Result<RecordSummary, Error> {
        let Recorder { intake, receiver, disk, names, url, .. } = self;
        receiver.stop.store(true, Ordering::Relaxed);
        let received = receiver.thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        // Stop waiting for a full disk after the timeout; no effect if the disk is not full.
        let waiting = Arc::clone(&disk);
        std::thread::spawn(move || {
            std::thread::sleep(FULL_DISK_TIMEOUT);
            waiting.give_up();
        });
        let mut summary = intake.finish();
        if summary.failure.is_some() {
            // The error of the operating system is the cause.
            summary.failure = disk.trouble().or(summary.failure);
        }
        // A write error is already in the summary; the loop returns no other error.
        drop(listened);
        received.map_err(|errno| Error::Socket { url, at: "recvmsg", source: errno.into() })?;
        let files = names.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect();
        Ok(RecordSummary { files, file_bytes: disk.bytes(), intake: summary })
    }
}

impl Receiver {
    fn start(mut listener: Listener, mut ring: BytesIn) -> std::io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let receive = move || {
            while !stopped.load(Ordering::Relaxed) {
                if let Some(datagram) = listener.receive()? {
                    put(&mut ring, &datagram);
                }
            }
            // Record the datagrams received before the stop, within a time limit.
            let until = Instant::now() + CHECK;
            while let (Some(datagram), true) = (listener.receive_now()?, Instant::now() < until) {
                put(&mut ring, &datagram);
            }
            Ok(())
        };
        let thread = std::thread::Builder::new().name("receiver".to_owned()).spawn(receive)?;
        Ok(Receiver { stop, thread })
    }
}

/// Appends a datagram to the ring. While the ring is full, datagrams stay in the kernel, which counts those that it drops.
fn put(ring: &mut BytesIn, datagram: &Datagram) {
    let Datagram { sender, t_ns, kernel_dropped, bytes } = datagram;
    let mut header = [0; HEADER];
    header[..4].copy_from_slice(&sender.ip().octets());
    header[4..6].copy_from_slice(&sender.port().to_ne_bytes());
    header[6..14].copy_from_slice(&t_ns.to_ne_bytes());
    header[14..].copy_from_slice(&kernel_dropped.to_ne_bytes());
    while !ring.push(&[&header, bytes]) && !ring.is_abandoned() {
        std::thread::park_timeout(REST);
    }
}

fn unpacked(record: &[u8]) -> Datagram<'_> {
    let mut rest = record;
    let ip = Ipv4Addr::from(taken::<4>(&mut rest));
    let port = u16::from_ne_bytes(taken(&mut rest));
    let t_ns = i64::from_ne_bytes(taken(&mut rest));
    let kernel_dropped = u32::from_ne_bytes(taken(&mut rest));
    Datagram { sender: SocketAddrV4::new(ip, port), t_ns, kernel_dropped, bytes: rest }
}

fn taken<const N: usize>(bytes: &mut &[u8]) -> [u8; N] {
    let (first, rest) = bytes.split_first_chunk().expect("each record has a header");
    *bytes = rest;
    *first
}

fn is_time(checked: Option<Instant>) -> bool {
    checked.is_none_or(|at| at.elapsed() >= CHECK)
}
