//! Replays the segments between snapshots in several threads.
//!
//! An idle worker reads the next segment from the log: there is no separate reading thread, and no tick moves between threads.

use super::report::Counts;
use super::segment::{Source, Step};
use super::stepper::Stepper;
use crate::Error;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Largest number of ticks read at once: two segments at the usual snapshot period.
const MAX_STEPS: usize = 2048;

/// The log, shared by the workers.
struct Shared<'f> {
    source: Source<'f>,
    /// First step of the next segment, except at the start of the log.
    start: Option<Step>,
    /// Segments taken so far.
    taken: u64,
    /// The log is at its end, or a worker failed.
    is_done: bool,
}

impl Shared<'_> {
    /// Reads the steps up to the next snapshot, at most [`MAX_STEPS`]. Returns whether the segment is complete.
    fn take(&mut self, steps: &mut Vec<Step>) -> Result<bool, Error> {
        steps.extend(self.start.take());
        while steps.len() < MAX_STEPS {
            let Some(step) = self.source.next()? else {
                self.is_done = true;
                return Ok(true);
            };
            let changes = &self.source.changes;
            let snapshot = match &step {
                Step::Tick(tick) => {
                    tick.snapshot().map(|snapshot| Step::Restore(tick.tick, snapshot.to_vec(), changes.clone()))
                }
                Step::Restore(..) => None,
            };
            steps.push(step);
            if snapshot.is_some() {
                self.start = snapshot;
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Runs each stepper in its own thread until all segments are replayed.
///
/// # Errors
/// The first one in log order, as in a serial replay.
pub(super) fn run(source: Source, steppers: Vec<Stepper>, progress: &mut dyn FnMut(f64)) -> Result<Counts, Error> {
    let shared = &Mutex::new(Shared { source, start: None, taken: 0, is_done: false });
    std::thread::scope(|scope| {
        let (fraction, fractions) = channel();
        let work = |stepper| {
            let fraction = fraction.clone();
            scope.spawn(move || work(stepper, shared, &fraction))
        };
        let threads: Vec<_> = steppers.into_iter().map(work).collect();
        drop(fraction);
        fractions.iter().for_each(progress);
        let (mut counts, mut failed) = (Counts::default(), None);
        for thread in threads {
            match thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)) {
                Ok(done) => counts.add(done),
                Err((segment, _)) if failed.as_ref().is_some_and(|(first, _)| *first < segment) => {}
                Err(error) => failed = Some(error),
            }
        }
        failed.map_or(Ok(counts), |(_, error)| Err(error))
    })
}

/// Replays segments until none is left. An error contains the number of its segment.
fn work(mut stepper: Stepper, shared: &Mutex<Shared>, fraction: &Sender<f64>) -> Result<Counts, (u64, Error)> {
    let mut steps = Vec::new();
    let mut run = |step| match step {
        Step::Restore(tick, snapshot, changes) => stepper.start(tick, &snapshot, &changes),
        Step::Tick(tick) => stepper.tick(&tick).map(drop),
    };
    loop {
        let mut log = lock(shared);
        if log.is_done {
            return Ok(stepper.counts);
        }
        let segment = log.taken;
        log.taken += 1;
        let done = (|| {
            // Keep the lock until the segment is complete: no other worker can start without a snapshot.
            while !log.take(&mut steps)? {
                steps.drain(..).try_for_each(&mut run)?;
            }
            // Fails only if the receiving thread panicked.
            let _ = fraction.send(log.source.fraction_read());
            drop(log);
            steps.drain(..).try_for_each(&mut run)
        })();
        if let Err(error) = done {
            lock(shared).is_done = true;
            return Err((segment, error));
        }
    }
}

/// Locks the log. A poisoned lock is used as is: the panic is propagated when the thread is joined.
fn lock<'m, 'f>(shared: &'m Mutex<Shared<'f>>) -> MutexGuard<'m, Shared<'f>> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}
