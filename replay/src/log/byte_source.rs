//! Random access to the bytes of a log through a read window, so that looking ahead and stepping back need no further read.
//!
//! Files are read, not memory-mapped. For a reader that goes from start to end a cached window is as fast as a mapping, a file that is
//! truncated meanwhile ends early instead of killing the process with SIGBUS, and no `unsafe` is needed.

use crate::Error;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Bytes per read.
const WINDOW: usize = 1 << 18;

/// A regular file, or bytes in memory.
pub(super) struct ByteSource {
    path: PathBuf,
    /// `None`: `window` holds all bytes.
    file: Option<File>,
    /// Length at the last [`ByteSource::refresh_len`].
    len: u64,
    window: Vec<u8>,
    /// Offset of `window` in the file.
    start: u64,
}

impl ByteSource {
    pub fn open(path: &Path) -> Result<Self, Error> {
        let io = |source| Error::Io { path: path.into(), source };
        let file = File::open(path).map_err(io)?;
        let metadata = file.metadata().map_err(io)?;
        if !metadata.is_file() {
            return Err(Error::NotAFile { path: path.into() });
        }
        Ok(ByteSource { path: path.into(), file: Some(file), len: metadata.len(), window: Vec::new(), start: 0 })
    }

    /// `name` is the path in error messages.
    pub fn from_bytes(name: &Path, bytes: Vec<u8>) -> Self {
        ByteSource { path: name.into(), file: None, len: bytes.len() as u64, window: bytes, start: 0 }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn len(&self) -> u64 {
        self.len
    }

    /// Updates the length of a file that is still being written. Bytes already read stay valid: a log is only appended to.
    pub fn refresh_len(&mut self) -> Result<(), Error> {
        if let Some(file) = &self.file {
            self.len = file.metadata().map_err(|source| Error::Io { path: self.path.clone(), source })?.len();
        }
        Ok(())
    }

    /// The `n` bytes at `offset`, or fewer at the end of the file. The caller has checked `n` against a limit.
    #[inline]
    pub fn bytes(&mut self, offset: u64, n: usize) -> Result<&[u8], Error> {
        let n = (n as u64).min(self.len.saturating_sub(offset)) as usize;
        let inside = offset >= self.start && offset + n as u64 <= self.start + self.window.len() as u64;
        if !inside {
            self.load(offset, n.max(WINDOW))?;
        }
        let from = offset.saturating_sub(self.start).min(self.window.len() as u64) as usize;
        let to = (from + n).min(self.window.len());
        Ok(&self.window[from..to])
    }

    /// Offset of the next complete occurrence of `pattern` at or after `offset`.
    pub fn find(&mut self, pattern: &[u8], mut offset: u64) -> Result<Option<u64>, Error> {
        loop {
            let bytes = self.bytes(offset, WINDOW)?;
            if bytes.len() < pattern.len() {
                return Ok(None);
            }
            if let Some(found) = position(bytes, pattern) {
                return Ok(Some(offset + found as u64));
            }
            offset += (bytes.len() - pattern.len() + 1) as u64;
        }
    }

    #[cold]
    fn load(&mut self, offset: u64, n: usize) -> Result<(), Error> {
        let Some(file) = &self.file else { return Ok(()) };
        let n = (n as u64).min(self.len.saturating_sub(offset)) as usize;
        // Free the memory of a window that one long record enlarged.
        if self.window.capacity() > 8 * n.max(WINDOW) {
            self.window = Vec::new();
        }
        self.window.resize(n, 0);
        self.start = offset;
        let mut filled = 0;
        while filled < n {
            match file.read_at(&mut self.window[filled..], offset + filled as u64) {
                Ok(0) => {
                    // The file was truncated after its length was read.
                    self.len = offset + filled as u64;
                    break;
                }
                Ok(count) => filled += count,
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(source) => {
                    return Err(Error::Io { path: self.path.clone(), source });
                }
            }
        }
        self.window.truncate(filled);
        Ok(())
    }
}

/// Index of the first occurrence of `pattern` in `bytes`; searches for its first byte.
fn position(bytes: &[u8], pattern: &[u8]) -> Option<usize> {
    let (first, last) = (*pattern.first()?, bytes.len().checked_sub(pattern.len())?);
    let mut at = 0;
    while at <= last {
        at += bytes[at..=last].iter().position(|&byte| byte == first)?;
        if bytes[at..].starts_with(pattern) {
            return Some(at);
        }
        at += 1;
    }
    None
}
