//! The files of a recording: one, or one after another.

use super::disk::{DiskState, PatientFile};
use super::fresh::Fresh;
use super::ring::{EventSink, Target};
use crate::Error;
use crate::log::{Format, LogWriter, Output};
use lcmtypes::channels;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// When a new file begins, and how many are kept.
#[derive(Debug, Clone, Copy, Default)]
pub struct Rotation {
    /// Bytes in a file.
    pub bytes: Option<u64>,
    /// Time from a file's first to its last event, ns.
    pub time_ns: Option<i64>,
    /// Files kept: the oldest goes when one more begins.
    pub keep: Option<usize>,
}

impl Rotation {
    fn is_on(&self) -> bool {
        self.bytes.is_some() || self.time_ns.is_some()
    }
}

/// Makes a file.
pub type Create = Box<dyn Fn(&Path) -> std::io::Result<Output> + Send>;

/// Writes events to a file, and to the next one when it is time.
///
/// Every further file begins with the RUN_INFO heard last, so that it explains itself.
pub struct Files {
    path: PathBuf,
    rotation: Rotation,
    create: Create,
    state: Arc<DiskState>,
    log: LogWriter,
    index: u32,
    /// Bytes of the state when this file began.
    began_at: u64,
    first_ns: Option<i64>,
    run_info: Option<Vec<u8>>,
    names: Names,
    moved: Option<PathBuf>,
    events: u64,
}

/// Names of the files, for whoever watches.
pub type Names = Arc<Mutex<VecDeque<PathBuf>>>;

impl Files {
    /// The first file: `path`, or `path` with a number before its ending where others may follow. What is there is moved aside ([`Files::moved`]),
    /// and what is written is locked.
    ///
    /// # Errors
    /// [`Error::UnknownExtension`]; [`Error::Io`] if it cannot be created or another process records into it.
    pub fn create(path: &Path, rotation: Rotation, state: Arc<DiskState>) -> Result<Self, Error> {
        let moved = Arc::<Mutex<Option<PathBuf>>>::default();
        let tell = Arc::clone(&moved);
        let create = move |path: &Path| {
            let fresh = Fresh::create(path)?;
            *tell.lock().unwrap_or_else(PoisonError::into_inner) = fresh.moved;
            Ok(Box::new(fresh.file) as Output)
        };
        let mut files = Self::create_on(path, rotation, state, Box::new(create))?;
        files.moved = moved.lock().unwrap_or_else(PoisonError::into_inner).take();
        Ok(files)
    }

    /// The same on any kind of disk.
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
            began_at: 0,
            first_ns: None,
            run_info: None,
            names,
            moved: None,
            events: 0,
        })
    }

    /// Names of the files that are there, oldest first; goes on being true while the recording does.
    pub fn names(&self) -> Names {
        Arc::clone(&self.names)
    }

    /// What had the name of the first file before, by its new name.
    pub fn moved(&self) -> Option<&Path> {
        self.moved.as_deref()
    }

    fn is_due(&self, t_ns: i64) -> bool {
        let Some(first_ns) = self.first_ns else { return false };
        let bytes = self.state.bytes() - self.began_at;
        self.rotation.bytes.is_some_and(|limit| bytes >= limit)
            || self.rotation.time_ns.is_some_and(|limit| t_ns.saturating_sub(first_ns) >= limit)
    }

    /// Ends this file and begins the next. Where none can be created, this one goes on.
    fn next(&mut self, t_ns: i64) -> Result<(), Error> {
        let next = numbered(&self.path, &self.rotation, self.index + 1);
        // So that another attempt is made at the next limit, not at every event.
        self.began_at = self.state.bytes();
        self.first_ns = Some(t_ns);
        let Ok(log) = open(&next, &self.create, &self.state) else { return Ok(()) };
        self.index += 1;
        let ended = std::mem::replace(&mut self.log, log);
        self.events += ended.finish()?;
        self.began_at = self.state.bytes();
        if let Some(info) = &self.run_info {
            self.log.write(channels::RUN_INFO, t_ns, info)?;
        }
        let mut names = self.names.lock().unwrap_or_else(PoisonError::into_inner);
        names.push_back(next);
        while self.rotation.keep.is_some_and(|keep| names.len() > keep.max(1)) {
            // A file that somebody has taken away already is gone, which is what was wanted.
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
    LogWriter::to_output(path, format, Box::new(PatientFile::new(disk, Arc::clone(state))))
}

/// `run.mcap`, or `run_0000.mcap` where others follow.
fn numbered(path: &Path, rotation: &Rotation, index: u32) -> PathBuf {
    if !rotation.is_on() {
        return path.into();
    }
    let part = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    path.with_file_name(format!("{}_{index:04}.{}", part(path.file_stem()), part(path.extension())))
}
