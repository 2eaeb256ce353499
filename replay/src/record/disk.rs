//! A file on a disk that may be full for a while.
//!
//! A full disk is met as a slow one: the writing thread tries again until there is room, the ring before it fills, and what is left out is
//! decided there, by channel. So the file never has a hole, and once there is room it goes on.

use crate::log::Output;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// How long to wait before trying again.
const RETRY: Duration = Duration::from_millis(20);

/// How writing goes, for whoever watches.
#[derive(Default)]
pub struct DiskState {
    bytes: AtomicU64,
    give_up: AtomicBool,
    trouble: Mutex<Option<String>>,
}

impl DiskState {
    /// Bytes written, over all files of a recording.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Why nothing can be written at the moment.
    pub fn trouble(&self) -> Option<String> {
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Ends the waiting: what cannot be written now is left out, and the file ends there.
    pub fn give_up(&self) {
        self.give_up.store(true, Ordering::Relaxed);
    }

    fn set_trouble(&self, trouble: Option<String>) {
        *self.trouble.lock().unwrap_or_else(PoisonError::into_inner) = trouble;
    }
}

/// Writes to a disk, however long it takes.
pub struct PatientFile {
    disk: Output,
    state: Arc<DiskState>,
    in_trouble: bool,
    ended: bool,
}

impl PatientFile {
    /// Writes to `disk`.
    pub fn new(disk: Output, state: Arc<DiskState>) -> Self {
        PatientFile { disk, state, in_trouble: false, ended: false }
    }
}

impl Write for PatientFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.ended {
            return Err(io::ErrorKind::StorageFull.into());
        }
        loop {
            let error = match self.disk.write(bytes) {
                Ok(0) if !bytes.is_empty() => io::ErrorKind::StorageFull.into(),
                Ok(count) => {
                    self.state.bytes.fetch_add(count as u64, Ordering::Relaxed);
                    if std::mem::take(&mut self.in_trouble) {
                        self.state.set_trouble(None);
                    }
                    return Ok(count);
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => error,
            };
            if self.state.give_up.load(Ordering::Relaxed) {
                // For good, or the next piece would follow a hole.
                self.ended = true;
                return Err(error);
            }
            if !std::mem::replace(&mut self.in_trouble, true) {
                self.state.set_trouble(Some(error.to_string()));
            }
            std::thread::sleep(RETRY);
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.disk.flush()
    }
}
