//! A recording that a key starts and stops.

use crate::log::record_name;
use replay::record::{Filter, Progress, RecordOptions, RecordSummary, Recorder, Rotation};
use replay::udpm::Url;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

/// Free disk space reserved for replay inputs, bytes, as in `hoof log record`.
const RESERVE: u64 = 500_000_000;
/// Size of the write buffer, bytes, as in `hoof log record`.
const BUFFER: usize = 64_000_000;

/// A running recorder with its own threads and socket.
pub struct Recording {
    out: PathBuf,
    began: Instant,
    stop: Arc<AtomicBool>,
    progress: Arc<Mutex<Option<Progress>>>,
    thread: JoinHandle<Result<RecordSummary, replay::Error>>,
}

impl Recording {
    /// Starts a recording in the working directory.
    pub fn start(url: &Url) -> anyhow::Result<Self> {
        let out = record_name();
        let recorder = Recorder::start(RecordOptions {
            url: url.clone(),
            out: out.clone(),
            filter: Filter::default(),
            vital: None,
            rotation: Rotation::default(),
            reserve: RESERVE,
            buffer: BUFFER,
        })?;
        let (stop, progress) = (Arc::<AtomicBool>::default(), Arc::<Mutex<Option<Progress>>>::default());
        let (stopped, shared) = (Arc::clone(&stop), Arc::clone(&progress));
        let store = move |now: &Progress| *shared.lock().unwrap_or_else(PoisonError::into_inner) = Some(now.clone());
        let thread = std::thread::Builder::new().name("recorder".to_owned()).spawn(move || {
            let mut store = store;
            recorder.run(&|| stopped.load(Ordering::Relaxed), &mut store)
        })?;
        Ok(Recording { out, began: Instant::now(), stop, progress, thread })
    }

    /// Whether it stopped on its own because the log cannot be written.
    pub fn has_ended(&self) -> bool {
        self.thread.is_finished()
    }

    /// Status text.
    pub fn status(&self) -> String {
        let progress = self.progress.lock().unwrap_or_else(PoisonError::into_inner);
        let seconds = self.began.elapsed().as_secs_f64();
        let Some(Progress { status, file_bytes, trouble, file, .. }) = &*progress else {
            return format!("REC {}", self.out.display());
        };
        let mut text = format!("REC {} {seconds:.0} s {:.1} MB", file.display(), *file_bytes as f64 * 1e-6);
        for (count, what) in [(status.lost_duplicate_late[0], "lost"), (status.left_out, "left out")] {
            if count > 0 {
                text += &format!(" {what} {count}");
            }
        }
        if let Some(trouble) = trouble {
            text += &format!(" waiting for the disk: {trouble}");
        }
        text
    }

    /// Completes the log and returns a summary.
    pub fn end(self) -> String {
        self.stop.store(true, Ordering::Relaxed);
        match self.thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)) {
            Ok(recorded) => summary(&recorded),
            Err(error) => format!("the recording failed: {error}"),
        }
    }
}

fn summary(recorded: &RecordSummary) -> String {
    let RecordSummary { files, file_bytes, intake } = recorded;
    let files: Vec<_> = files.iter().map(|file| file.display().to_string()).collect();
    let left_out: u64 = intake.left_out.values().sum();
    let mut text = format!(
        "{}: {} events, {:.1} MB, lost {}, left out {left_out}",
        files.join(", "),
        intake.events.unwrap_or(0),
        *file_bytes as f64 * 1e-6,
        intake.lost
    );
    if let Some(failure) = &intake.failure {
        text += &format!("; the log ends early: {failure}");
    }
    text
}
