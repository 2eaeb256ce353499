//! A file read at any place through a window, so that looking ahead and going back cost no seek.

use crate::Error;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// Bytes read at a time.
const WINDOW: usize = 1 << 18;

/// A regular file of the length that it had when it was opened: what is appended later is not seen.
pub(super) struct Source {
    path: PathBuf,
    file: File,
    len: u64,
    window: Vec<u8>,
    start: u64,
}

impl Source {
    pub fn open(path: &Path) -> Result<Self, Error> {
        let io = |source| Error::Io { path: path.into(), source };
        let file = File::open(path).map_err(io)?;
        let metadata = file.metadata().map_err(io)?;
        if !metadata.is_file() {
            return Err(Error::NotAFile { path: path.into() });
        }
        Ok(Source { path: path.into(), file, len: metadata.len(), window: Vec::new(), start: 0 })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn len(&self) -> u64 {
        self.len
    }

    /// The `n` bytes at `offset`, or as many as the file has there. The caller has checked `n` against a limit.
    pub fn bytes(&mut self, offset: u64, n: usize) -> Result<&[u8], Error> {
        let n = (n as u64).min(self.len.saturating_sub(offset)) as usize;
        let inside = offset >= self.start && offset + n as u64 <= self.start + self.window.len() as u64;
        if !inside {
            self.load(offset, n.max(WINDOW))?;
        }
        let from = (offset - self.start).min(self.window.len() as u64) as usize;
        let to = (from + n).min(self.window.len());
        Ok(&self.window[from..to])
    }

    /// Where `pattern` next occurs at or after `offset`; only occurrences that lie wholly in the file count.
    pub fn find(&mut self, pattern: &[u8], mut offset: u64) -> Result<Option<u64>, Error> {
        loop {
            let bytes = self.bytes(offset, WINDOW)?;
            if bytes.len() < pattern.len() {
                return Ok(None);
            }
            if let Some(found) = bytes.windows(pattern.len()).position(|w| w == pattern) {
                return Ok(Some(offset + found as u64));
            }
            offset += (bytes.len() - pattern.len() + 1) as u64;
        }
    }

    fn load(&mut self, offset: u64, n: usize) -> Result<(), Error> {
        let n = (n as u64).min(self.len.saturating_sub(offset)) as usize;
        self.window.resize(n, 0);
        self.start = offset;
        let mut filled = 0;
        while filled < n {
            match self.file.read_at(&mut self.window[filled..], offset + filled as u64) {
                Ok(0) => {
                    // The file has become shorter since it was opened.
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
