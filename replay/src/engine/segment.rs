//! The segment of a log that is replayed, and the steps of its replay.

use super::Options;
use super::run_messages::RunMessages;
use super::seek::Places;
use super::ticks::{Beside, Tick, Ticks};
use crate::Error;
use crate::log::RunClock;
use lcmtypes::ParameterChange;
use std::path::Path;

/// The part of a log to replay.
#[derive(Debug)]
pub(super) struct Segment {
    /// Tick of the snapshot to start from; `None`: the first tick.
    pub start: Option<i64>,
    /// Chunk at which to start reading; `None`: the start of the log.
    pub chunk: Option<u64>,
    /// Last time, ns since the run's first tick.
    pub to_ns: Option<i64>,
    /// Times of the run.
    pub clock: RunClock,
    /// Last tick with a CONTROLLER_INPUT that was read.
    pub last_tick: Option<i64>,
}

impl Segment {
    /// With [`Options::from_s`] this reads the log from some seconds before that time on, if it has an index, else from its start.
    ///
    /// # Errors
    /// [`Error::BeyondEnd`] if the log ends before that time.
    pub fn find(path: &Path, messages: &RunMessages, clock: RunClock, options: &Options) -> Result<Self, Error> {
        let nanoseconds = |s: f64| (s * 1e9).round() as i64;
        let to_ns = options.to_s.map(nanoseconds);
        let Some(from_s) = options.from_s else {
            return Ok(Segment { start: None, chunk: None, to_ns, clock, last_tick: None });
        };
        let from_ns = nanoseconds(from_s);
        let mut chunk = Places::indexed(path, messages)?.before_time(&clock, from_ns)?;
        let (mut start, mut last_ns) = find(path, messages, &clock, from_ns, chunk)?;
        if start.is_none() && chunk.is_some() {
            chunk = None;
            (start, last_ns) = find(path, messages, &clock, from_ns, chunk)?;
        }
        match last_ns {
            Some(last_ns) if last_ns < from_ns => {
                Err(Error::BeyondEnd { path: path.into(), from_s, last_s: last_ns as f64 * 1e-9 })
            }
            _ => Ok(Segment { start, chunk, to_ns, clock, last_tick: None }),
        }
    }
}

/// Tick of the last snapshot before a time, and time of the last tick that was read, ns since the run's first tick.
fn find(
    path: &Path,
    messages: &RunMessages,
    clock: &RunClock,
    from_ns: i64,
    chunk: Option<u64>,
) -> Result<(Option<i64>, Option<i64>), Error> {
    let mut ticks = Ticks::open_at(path, messages, Beside::Nothing, chunk)?;
    let (mut start, mut last_ns) = (None, None);
    while let Some(tick) = ticks.next()? {
        let Some(t_ns) = tick.input.as_ref().map(|input| input.t_ns) else { continue };
        let since_ns = clock.since_ns(t_ns);
        last_ns = Some(since_ns);
        if since_ns > from_ns {
            break;
        }
        // The state after a tick: a part from that tick on compares the tick too.
        if tick.snapshot().is_some() && since_ns < from_ns {
            start = Some(tick.tick);
        }
    }
    Ok((start, last_ns))
}

/// One step of a replay.
pub(super) enum Step {
    /// Restore the state after a tick, with the parameters after these changes.
    Restore(i64, Vec<u8>, Vec<ParameterChange>),
    /// Compute a tick.
    Tick(Box<Tick>),
}

/// Reads the steps of a segment.
pub(super) struct Source<'f> {
    pub ticks: &'f mut Ticks,
    pub segment: &'f mut Segment,
    /// Length of the file.
    pub bytes: u64,
    /// Parameter changes up to the last tick read, in order.
    pub changes: Vec<ParameterChange>,
}

impl Source<'_> {
    /// Fraction of the file that was read, 0 to 1.
    pub fn fraction_read(&self) -> f64 {
        self.ticks.offset as f64 / self.bytes.max(1) as f64
    }

    /// The next step, or `None` after the last.
    pub fn next(&mut self) -> Result<Option<Step>, Error> {
        while let Some(mut tick) = self.ticks.next()? {
            self.changes.extend(tick.changes.iter().cloned());
            let t_ns = tick.input.as_ref().map(|input| input.t_ns);
            self.segment.last_tick = t_ns.map(|_| tick.tick).or(self.segment.last_tick);
            let since = t_ns.map(|t_ns| self.segment.clock.since_ns(t_ns));
            tick.since_ns = since;
            if since.zip(self.segment.to_ns).is_some_and(|(since, to)| since > to) {
                return Ok(None);
            }
            match self.segment.start {
                Some(start) if tick.tick < start => {}
                Some(start) if tick.tick == start => {
                    let changes = self.changes.clone();
                    return Ok(tick.snapshot().map(|snapshot| Step::Restore(start, snapshot.to_vec(), changes)));
                }
                _ => return Ok(Some(Step::Tick(Box::new(tick)))),
            }
        }
        Ok(None)
    }
}
