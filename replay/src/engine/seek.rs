//! Where to start reading a long log, so that a replay from its middle does not read what is before.

use super::run_messages::RunMessages;
use super::ticks::{Tick, integer_at};
use crate::Error;
use crate::log::{ChunkIndex, EventRef, RunClock, split_run};
use lcmtypes::channels::CONTROLLER_SNAPSHOT;
use std::path::Path;

/// Snapshots between the place where reading starts and the one that is looked for: messages of one tick are recorded seconds apart on a busy machine.
const MARGIN: usize = 5;

/// Places of a log at which reading can start, in the order of the log.
pub(super) enum Places {
    /// The chunks of an MCAP that contain a snapshot, and its channel.
    Chunks { index: Box<ChunkIndex>, chunks: Vec<u64>, channel: String },
    /// Snapshots of a log without index that has been read: tick, `t_ns`, and offset of the tick's first message.
    Scanned(Vec<(i64, i64, u64)>),
}

impl Places {
    /// Those of a component from the index of a log; none if it has no index.
    ///
    /// # Errors
    /// Those of reading the log.
    pub fn indexed(path: &Path, messages: &RunMessages) -> Result<Self, Error> {
        Ok(match ChunkIndex::read(path)? {
            Some(index) => {
                let channel = messages.in_log(CONTROLLER_SNAPSHOT);
                let chunks = index.chunks_with(&channel);
                Places::Chunks { index: Box::new(index), chunks, channel }
            }
            None => Places::none(),
        })
    }

    /// No place: a log is read from its start.
    pub fn none() -> Self {
        Places::Scanned(Vec::new())
    }

    /// Whether the log has an index.
    pub fn is_indexed(&self) -> bool {
        matches!(self, Places::Chunks { .. })
    }

    /// Takes a tick of a log without index. One run of a log has no places: which events belong to it is known only from the start.
    pub fn scan(&mut self, path: &Path, tick: &Tick) {
        if let (Places::Scanned(places), Some(snapshot)) = (self, tick.snapshot())
            && split_run(path).1.is_none()
        {
            places.push((tick.tick, integer_at(snapshot, 8).unwrap_or(i64::MAX), tick.offset));
        }
    }

    /// Offset from which a reader finds the last snapshot at or before a tick, and all messages of later ticks. `None`: the start of the log.
    ///
    /// # Errors
    /// Those of reading the log.
    pub fn before_tick(&mut self, tick: i64) -> Result<Option<u64>, Error> {
        self.before(&|number, _| number <= tick)
    }

    /// [`Places::before_tick`] of a time since the run's first tick. The controller's clock decides; that of the recorder can step.
    ///
    /// # Errors
    /// Those of reading the log.
    pub fn before_time(&mut self, clock: &RunClock, from_ns: i64) -> Result<Option<u64>, Error> {
        self.before(&|_, t_ns| clock.since_ns(t_ns) <= from_ns)
    }

    /// Offset from which a reader finds the last ticks of the log. `None`: the start of the log.
    ///
    /// # Errors
    /// Those of reading the log.
    pub fn before_end(&mut self) -> Result<Option<u64>, Error> {
        self.before(&|_, _| true)
    }

    /// - `is_before`: of tick and `t_ns` of a snapshot.
    fn before(&mut self, is_before: &dyn Fn(i64, i64) -> bool) -> Result<Option<u64>, Error> {
        let is_before_at = |places: &mut Self, at: usize| match places {
            Places::Chunks { index, chunks, channel } => {
                let mut first = None;
                index.events(chunks[at], &mut |event: &EventRef<'_>| {
                    if **event.channel == **channel {
                        first = first.or(integer_at(event.data, 16).zip(integer_at(event.data, 8)));
                    }
                })?;
                Ok::<_, Error>(first.is_some_and(|(tick, t_ns)| is_before(tick, t_ns)))
            }
            Places::Scanned(places) => Ok(is_before(places[at].0, places[at].1)),
        };
        let count = match self {
            Places::Chunks { chunks, .. } => chunks.len(),
            Places::Scanned(places) => places.len(),
        };
        let (mut low, mut high) = (0, count);
        while low < high {
            let middle = low + (high - low) / 2;
            if is_before_at(self, middle)? {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        let place = low.checked_sub(1 + MARGIN);
        Ok(place.map(|at| match self {
            Places::Chunks { chunks, .. } => chunks[at],
            Places::Scanned(places) => places[at].2,
        }))
    }
}
