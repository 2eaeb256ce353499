//! The files of a recording: one, or several with rotation.

use super::disk::{DiskState, RetryingFile};
use super::new_file::NewFile;
use super::ring::{EventSink, Target};
use crate::Error;
use crate::log::{Format, LogWriter, Output};
use lcmtypes::channels;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// When to start a new file, and how many to keep.
#[derive(Debug, Clone, Copy, Default)]
pub struct Rotation {
    /// Largest size of a file, bytes.
    pub bytes: Option<u64>,
    /// Longest time from a file's first to its last event, ns.
    pub time_ns: Option<i64>,
    /// Number of files to keep; the oldest is deleted.
    pub keep: Option<usize>,
}

impl Rotation {
    fn is_on(&self) -> bool {
        self.bytes.is_some() || self.time_ns.is_some()
    }
}

/// Creates a file.
pub type Create = Box<dyn Fn(&Path) -> std::io::Result<Output> + Send>;

/// Writes events to a file and rotates it.
///
/// Every further file starts with the last RUN_INFO, so that it can be read on its own.
pub struct Files {
    path: PathBuf,
    rotation: Rotation,
    create: Create,
    state: Arc<DiskState>,
    log: LogWriter,
    index: u32,
    /// Bytes written before this file.
    bytes_before: u64,
    first_ns: Option<i64>,
    run_info: Option<Vec<u8>>,
    names: Names,
    moved: Option<PathBuf>,
    events: u64,
}

/// Names of the files, shared with other threads.
pub type Names = Arc<Mutex<VecDeque<PathBuf>>>;

impl Files {
    /// Creates the first file: `path`, or with rotation `path` with a number before its extension. An existing file is renamed
    /// ([`Files::moved`]); the new file is locked.
    ///
    /// # Errors
    /// [`Error::UnknownExtension`]; [`Error::Io`] if it cannot be created or another process records into it.
    pub fn create(path: &Path, rotation: Rotation, state: Arc<DiskState>) -> Result<Self, Error> {
        let moved = Arc::<Mutex<Option<PathBuf>>>::default();
        let shared = Arc::clone(&moved);
        let create = move |path: &Path| {
            let new = NewFile::create(path)?;
            *shared.lock().unwrap_or_else(PoisonError::into_inner) = new.moved;
            Ok(Box::new(new.file) as Output)
        };
        let mut files = Self::create_on(path, rotation, state, Box::new(create))?;
        files.moved = moved.lock().unwrap_or_else(PoisonError::into_inner).take();
        Ok(files)
    }

    /// [`Files::create`] with another way to create a file.
    ///
    /// # Errors
    /// As [`Files::create`].
    pub fn create_on(path: &Path, rotation: Rotation, state: Arc<DiskState>, create: Create) -> Result<Self, Error> {
        let names = Names::default();
        let first = numbered(path, &rotation, 0);
        let log = open(&first, &create, &state)?;
        names.lock().unwrap_or_else(PoisonError::into_inner).push_back(first);
        Ok(Files {
            path: path.into(),
            rotation,
            create,
            state,
            log,
            index: 0,
            bytes_before: 0,
            first_ns: None,
            run_info: None,
            names,
            moved: None,
            events: 0,
        })
    }

    /// Names of the existing files, oldest first; updated during the recording.
    pub fn names(&self) -> Names {
        Arc::clone(&self.names)
    }

    /// New name of the file that had the name of the first file before.
    pub fn moved(&self) -> Option<&Path> {
        self.moved.as_deref()
    }

    fn is_due(&self, t_ns: i64) -> bool {
        let Some(first_ns) = self.first_ns else { return false };
        let bytes = self.state.bytes() - self.bytes_before;
        self.rotation.bytes.is_some_and(|limit| bytes >= limit)
            || self.rotation.time_ns.is_some_and(|limit| t_ns.saturating_sub(first_ns) >= limit)
    }

    /// Completes this file and starts the next. If the next cannot be created, this one continues.
    fn next(&mut self, t_ns: i64) -> Result<(), Error> {
        let next = numbered(&self.path, &self.rotation, self.index + 1);
        // The next attempt is at the next limit, not at the next event.
        self.bytes_before = self.state.bytes();
        self.first_ns = Some(t_ns);
        let Ok(log) = open(&next, &self.create, &self.state) else { return Ok(()) };
        self.index += 1;
        let ended = std::mem::replace(&mut self.log, log);
        self.events += ended.finish()?;
        self.bytes_before = self.state.bytes();
        if let Some(info) = &self.run_info {
            self.log.write(channels::RUN_INFO, t_ns, info)?;
        }
        let mut names = self.names.lock().unwrap_or_else(PoisonError::into_inner);
        names.push_back(next);
        while self.rotation.keep.is_some_and(|keep| names.len() > keep.max(1)) {
            // The file may have been deleted already.
            let _ = names.pop_front().map(std::fs::remove_file);
        }
        Ok(())
    }
}

impl EventSink for Files {
    fn write(&mut self, channel: &str, t_ns: i64, data: &[u8]) -> Result<(), Error> {
        if self.is_due(t_ns) {
            self.next(t_ns)?;
        }
        if channel == channels::RUN_INFO {
            self.run_info = Some(data.to_vec());
        }
        self.first_ns.get_or_insert(t_ns);
        self.log.write(channel, t_ns, data)
    }
}

impl Target for Files {
    fn flush(&mut self) -> Result<(), Error> {
        self.log.flush()
    }

    fn finish(self: Box<Self>) -> Result<u64, Error> {
        Ok(self.events + self.log.finish()?)
    }
}

fn open(path: &Path, create: &Create, state: &Arc<DiskState>) -> Result<LogWriter, Error> {
    let format = Format::of_name(path)?;
    let disk = create(path).map_err(|source| Error::Io { path: path.into(), source })?;
    LogWriter::to_output(path, format, Box::new(RetryingFile::new(disk, Arc::clone(state))))
}

/// `run.mcap`, or `run_0000.mcap` with rotation.
fn numbered(path: &Path, rotation: &Rotation, index: u32) -> PathBuf {
    if !rotation.is_on() {
        return path.into();
    }
    let part = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    path.with_file_name(format!("{}_{index:04}.{}", part(path.file_stem()), part(path.extension())))
}
