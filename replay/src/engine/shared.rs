//! Stretches of a log, from one snapshot to the next, by several threads.
//!
//! Who is done with a stretch takes the next one out of the log: no thread only reads, no tick goes from thread to thread, and memory goes back to the
//! thread that it came from.

use super::report::Tally;
use super::runner::Runner;
use super::stretch::{Feed, Part};
use crate::Error;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Ticks that a thread holds at most: two stretches from one snapshot to the next, as they usually are.
const MOST: usize = 2048;

/// The log, from which one thread reads at a time.
struct Source<'f> {
    feed: Feed<'f>,
    /// Where the next stretch begins, if that is not where the feed does.
    start: Option<Part>,
    /// Stretches taken so far.
    taken: u64,
    /// Nothing is left, or a thread has given up.
    over: bool,
}

impl Source<'_> {
    /// Takes the parts up to the next snapshot, but [`MOST`] at a time: whether the stretch has its end.
    fn take(&mut self, parts: &mut Vec<Part>) -> Result<bool, Error> {
        parts.extend(self.start.take());
        while parts.len() < MOST {
            let Some(part) = self.feed.next()? else {
                self.over = true;
                return Ok(true);
            };
            let changes = &self.feed.changes;
            let snapshot = match &part {
                Part::Tick(tick) => {
                    tick.snapshot().map(|snapshot| Part::Start(tick.tick, snapshot.to_vec(), changes.clone()))
                }
                Part::Start(..) => None,
            };
            parts.push(part);
            if snapshot.is_some() {
                self.start = snapshot;
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// Leads each runner through stretches of its own, until none is left.
///
/// # Errors
/// The one that comes first in the log, as if a single runner had gone through it.
pub(super) fn run(feed: Feed, runners: Vec<Runner>, progress: &mut dyn FnMut(f64)) -> Result<Tally, Error> {
    let source = &Mutex::new(Source { feed, start: None, taken: 0, over: false });
    std::thread::scope(|scope| {
        let (read, told) = channel();
        let work = |runner| {
            let read = read.clone();
            scope.spawn(move || work(runner, source, &read))
        };
        let threads: Vec<_> = runners.into_iter().map(work).collect();
        drop(read);
        told.iter().for_each(progress);
        let (mut tally, mut failed) = (Tally::default(), None);
        for thread in threads {
            match thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)) {
                Ok(done) => tally.add(done),
                Err((stretch, _)) if failed.as_ref().is_some_and(|(first, _)| *first < stretch) => {}
                Err(error) => failed = Some(error),
            }
        }
        failed.map_or(Ok(tally), |(_, error)| Err(error))
    })
}

/// Takes stretches and goes through them. An error comes with the number of its stretch.
fn work(mut runner: Runner, source: &Mutex<Source>, read: &Sender<f64>) -> Result<Tally, (u64, Error)> {
    let mut parts = Vec::new();
    let mut lead = |part| match part {
        Part::Start(tick, snapshot, changes) => runner.start(tick, &snapshot, &changes),
        Part::Tick(tick) => runner.tick(&tick).map(drop),
    };
    loop {
        let mut log = lock(source);
        if log.over {
            return Ok(runner.tally);
        }
        let stretch = log.taken;
        log.taken += 1;
        let done = (|| {
            // While no snapshot is in sight nobody else can go on either, so the log is kept.
            while !log.take(&mut parts)? {
                parts.drain(..).try_for_each(&mut lead)?;
            }
            // Nobody listens any more only if all is lost anyway.
            let _ = read.send(log.feed.read());
            drop(log);
            parts.drain(..).try_for_each(&mut lead)
        })();
        if let Err(error) = done {
            lock(source).over = true;
            return Err((stretch, error));
        }
    }
}

/// What a thread that panics leaves behind is not gone on with: its panic is passed on.
fn lock<'m, 'f>(source: &'m Mutex<Source<'f>>) -> MutexGuard<'m, Source<'f>> {
    source.lock().unwrap_or_else(PoisonError::into_inner)
}
