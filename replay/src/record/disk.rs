//! A file on a disk that may be full temporarily.
//!
//! A full disk is handled like a slow one: the writing thread retries until there is space, the ring before it fills up, and the drop
//! policy of the ring drops messages by channel. The file has no hole and continues when there is space.

use crate::log::Output;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Time between two attempts.
const RETRY: Duration = Duration::from_millis(20);

/// Status of writing, shared with other threads.
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

    /// Error of the last attempt, while nothing can be written.
    pub fn trouble(&self) -> Option<String> {
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Stops retrying: the file ends at the first failed write.
    pub fn give_up(&self) {
        self.give_up.store(true, Ordering::Relaxed);
    }

    fn set_trouble(&self, trouble: Option<String>) {
        *self.trouble.lock().unwrap_or_else(PoisonError::into_inner) = trouble;
    }
}

/// A writer that retries until the disk accepts the data.
pub struct RetryingFile {
    disk: Output,
    state: Arc<DiskState>,
    in_trouble: bool,
    ended: bool,
}

impl RetryingFile {
    /// Wraps `disk`.
    pub fn new(disk: Output, state: Arc<DiskState>) -> Self {
        RetryingFile { disk, state, in_trouble: false, ended: false }
    }
}

impl Write for RetryingFile {
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
                // Permanently, or later data would follow a hole.
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
