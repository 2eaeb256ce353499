//! Stretches of a log, from one snapshot to the next, dealt to threads.

use super::report::Tally;
use super::runner::Runner;
use super::stretch::{Feed, Part};
use crate::Error;
use controller::RestoreError;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Ticks that wait for a thread: two stretches from one snapshot to the next, as they usually are.
const QUEUE: usize = 2048;

/// A queue of ticks for a thread.
pub(super) fn queue() -> (SyncSender<Part>, Receiver<Part>) {
    sync_channel(QUEUE)
}

/// Hands each stretch from one snapshot to the next to another queue. Ends early when a thread has given up.
pub(super) fn deal(feed: &mut Feed, queues: &[SyncSender<Part>]) -> Result<(), Error> {
    let mut turn = queues.iter().cycle();
    let Some(mut queue) = turn.next() else { return Ok(()) };
    while let Some(part) = feed.next()? {
        let snapshot = match &part {
            Part::Tick(tick) => tick.snapshot().map(|snapshot| (tick.tick, snapshot.to_vec())),
            Part::Start(..) => None,
        };
        if queue.send(part).is_err() {
            break;
        }
        if let (Some((tick, snapshot)), Some(next)) = (snapshot, turn.next()) {
            queue = next;
            if queue.send(Part::Start(tick, snapshot)).is_err() {
                break;
            }
        }
    }
    Ok(())
}

pub(super) fn work(mut runner: Runner, parts: &Receiver<Part>) -> Result<Tally, (i64, RestoreError)> {
    for part in parts {
        match part {
            Part::Start(tick, snapshot) => runner.restore(tick, &snapshot).map_err(|source| (tick, source))?,
            Part::Tick(tick) => drop(runner.tick(&tick).map_err(|source| (tick.tick, source))?),
        }
    }
    Ok(runner.tally)
}
