//! Where to start reading a long log, so that a replay from its middle does not read what is before.

use crate::Error;
use crate::log::{ChunkIndex, RunClock};
use lcmtypes::channels::CONTROLLER_SNAPSHOT;
use std::path::Path;

/// Snapshots between the place where reading starts and the one that is looked for: messages of one tick are recorded seconds apart on a busy machine.
const MARGIN: usize = 5;

/// Offset of a chunk from which a reader finds the last snapshot at or before a time, and all messages of later ticks. `None`: the start of the log.
///
/// - `from_ns`: time since the run's first tick.
///
/// # Errors
/// Those of reading the log.
pub(super) fn chunk_before(path: &Path, clock: &RunClock, from_ns: i64) -> Result<Option<u64>, Error> {
    let Some(mut index) = ChunkIndex::read(path)? else { return Ok(None) };
    let chunks = index.chunks_with(CONTROLLER_SNAPSHOT);
    // The controller's clock decides; that of the recorder can step.
    let (mut low, mut high) = (0, chunks.len());
    while low < high {
        let middle = low + (high - low) / 2;
        let mut first = None;
        index.events(chunks[middle], &mut |event| {
            if **event.channel == *CONTROLLER_SNAPSHOT {
                first = first.or(super::ticks::integer_at(event.data, 8));
            }
        })?;
        if first.is_some_and(|t_ns| clock.since_ns(t_ns) <= from_ns) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    Ok(low.checked_sub(1 + MARGIN).map(|at| chunks[at]))
}
