//! The recorder: a socket, three threads, a log.
//!
//! ```text
//! socket --receive thread--> ring of datagrams --this thread: Intake--> ring of events --log writer--> file
//! ```
//! The receive thread does nothing but fetch datagrams, so that the kernel's buffer stays empty. The desk never waits for the disk. What the
//! log writer cannot take in time is left out by channel, at the ring before it.

use super::bytes::{BytesIn, BytesOut, byte_ring};
use super::disk::DiskState;
use super::drop_policy::Keep;
use super::files::{Files, Names, Rotation};
use super::intake::{Heard, Intake, Status};
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

/// Bytes of the ring between socket and desk.
const DATAGRAMS: usize = 1 << 24;
/// Address, port, time, count of the kernel: before each datagram in the ring.
const HEADER: usize = 18;
/// How long the desk rests when nothing has come.
const REST: Duration = Duration::from_millis(1);
/// How often free space is looked up and the caller is told how it goes.
const LOOK: Duration = Duration::from_millis(100);
/// How long a full disk is waited for when the recording is to end.
const PATIENCE: Duration = Duration::from_secs(2);

/// What to record, and where to.
#[derive(Debug, Clone)]
pub struct RecordOptions {
    /// Network.
    pub url: Url,
    /// Log; the format is that of the name's ending.
    pub out: PathBuf,
    /// Channels.
    pub filter: Filter,
    /// Channels that are never left out, beside those that a replay needs.
    pub vital: Option<Pattern>,
    /// When a new file begins.
    pub rotation: Rotation,
    /// Free space that only replay inputs may use, bytes.
    pub reserve: u64,
    /// Bytes of the ring before the disk.
    pub buffer: usize,
}

/// A recording that has begun.
pub struct Recorder {
    desk: Intake,
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

/// How a recording goes, and how its disk does.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// What was heard.
    pub status: Status,
    /// Bytes in the files.
    pub file_bytes: u64,
    /// Bytes free on the disk, where that is known.
    pub free_bytes: Option<u64>,
    /// Why nothing can be written at the moment.
    pub trouble: Option<String>,
    /// The file that is being written.
    pub file: PathBuf,
}

/// How a recording went.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Recorded {
    /// Files that are there, oldest first.
    pub files: Vec<PathBuf>,
    /// Bytes written.
    pub file_bytes: u64,
    /// What was heard.
    #[serde(flatten)]
    pub heard: Heard,
}

impl Recorded {
    /// Something is missing in the log that was sent.
    pub fn is_lossy(&self) -> bool {
        self.heard.lost > 0 || !self.heard.left_out.is_empty() || self.heard.failure.is_some()
    }
}

struct Receiver {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<Result<(), nix::errno::Errno>>,
}

impl Recorder {
    /// Joins the network, creates the log and begins to listen.
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
        let ring_options = RingOptions { capacity: buffer, when_full: WhenFull::Shed { vital }, ..live };
        let writer = RingWriter::start(&out, Box::new(files), &ring_options)?;
        let (input, datagrams) = byte_ring(DATAGRAMS);
        let receiver = Receiver::start(listener, input).map_err(|source| Error::Io { path: out.clone(), source })?;
        let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")).into();
        let (desk, url) = (Intake::new(filter, writer), url.to_string());
        Ok(Recorder { desk, datagrams, receiver, disk, names, folder, reserve, url, warning, moved })
    }

    /// What a person should know before it goes on.
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// What had the log's name before, by its new name: nothing is overwritten.
    pub fn moved(&self) -> Option<&Path> {
        self.moved.as_deref()
    }

    /// Records until `stop` says so; `progress` is told ten times a second how it goes.
    ///
    /// A stop fetches what has already come and completes the log. Where the disk is full, it waits two seconds for room, then leaves out
    /// what does not fit: the file ends there, and can be read up to there.
    ///
    /// A log that cannot be written any more ends the recording, and [`Heard::failure`] says why.
    ///
    /// # Errors
    /// [`Error::Socket`] if the network fails; the file can be read in any case.
    pub fn run(mut self, stop: &dyn Fn() -> bool, progress: &mut dyn FnMut(&Progress)) -> Result<Recorded, Error> {
        let listened = self.listen(stop, progress);
        self.finish(listened)
    }

    fn listen(&mut self, stop: &dyn Fn() -> bool, progress: &mut dyn FnMut(&Progress)) -> Result<(), Error> {
        let mut datagram = Vec::new();
        let mut looked: Option<Instant> = None;
        loop {
            if stop() {
                self.receiver.stop.store(true, Ordering::Relaxed);
            }
            // Asked before the ring is: the receiver has put in its last datagram before it lets go.
            let ended = self.datagrams.is_abandoned();
            let mut idle = true;
            while !is_time(looked) && self.datagrams.pop(&mut datagram) {
                idle = false;
                self.desk.datagram(&unpacked(&datagram))?;
            }
            if is_time(looked) {
                looked = Some(Instant::now());
                progress(&self.look());
                self.desk.look_up(udpm::now_ns())?;
            } else if idle && ended {
                return Ok(());
            } else if idle {
                std::thread::park_timeout(REST);
            }
        }
    }

    fn look(&mut self) -> Progress {
        let free_bytes = statvfs(&self.folder).ok().map(|disk| disk.blocks_available() * disk.fragment_size());
        self.desk.set_disk(match free_bytes {
            Some(free) if free < self.reserve => Keep::Inputs,
            Some(free) if free < self.reserve.saturating_mul(2) => Keep::Replay,
            _ => Keep::All,
        });
        let names = self.names.lock().unwrap_or_else(PoisonError::into_inner);
        Progress {
            status: self.desk.status(),
            file_bytes: self.disk.bytes(),
            free_bytes,
            trouble: self.disk.trouble(),
            file: names.back().cloned().unwrap_or_default(),
        }
    }

    fn finish(self, listened: Result<(), Error>) -> Result<Recorded, Error> {
        let Recorder { desk, receiver, disk, names, url, .. } = self;
        receiver.stop.store(true, Ordering::Relaxed);
        let received = receiver.thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        // Whoever waits for a full disk is told to give up after a while; if nobody does, nobody hears it.
        let waiting = Arc::clone(&disk);
        std::thread::spawn(move || {
            std::thread::sleep(PATIENCE);
            waiting.give_up();
        });
        let mut heard = desk.finish();
        if heard.failure.is_some() {
            // What the operating system said is more than what became of it in the layers above.
            heard.failure = disk.trouble().or(heard.failure);
        }
        // That the log cannot be written is told with what is in it; nothing else ends the listening.
        drop(listened);
        received.map_err(|errno| Error::Socket { url, at: "recvmsg", source: errno.into() })?;
        let files = names.lock().unwrap_or_else(PoisonError::into_inner).iter().cloned().collect();
        Ok(Recorded { files, file_bytes: disk.bytes(), heard })
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
            // What came before the stop belongs to the recording; what goes on coming does not hold it up.
            let until = Instant::now() + LOOK;
            while let (Some(datagram), true) = (listener.receive_now()?, Instant::now() < until) {
                put(&mut ring, &datagram);
            }
            Ok(())
        };
        let thread = std::thread::Builder::new().name("receiver".to_owned()).spawn(receive)?;
        Ok(Receiver { stop, thread })
    }
}

/// Where the ring is full, datagrams wait in the kernel, which counts what it has to drop.
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
    let (first, rest) = bytes.split_first_chunk().expect("put in with a header");
    *bytes = rest;
    *first
}

fn is_time(looked: Option<Instant>) -> bool {
    looked.is_none_or(|at| at.elapsed() >= LOOK)
}
