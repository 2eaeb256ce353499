//! Which ticks of a log are replayed, and the state from which.

use super::Options;
use super::ticks::{Beside, Tick, Ticks};
use crate::Error;
use crate::log::RunClock;
use lcmtypes::ParameterChange;
use std::path::Path;

/// The part of a log that is to be replayed.
#[derive(Debug)]
pub(super) struct Stretch {
    /// Tick whose snapshot the replay starts from.
    pub start: Option<i64>,
    /// Time behind which it ends, ns since the run's first tick.
    pub to_ns: Option<i64>,
    /// Times of the run.
    pub clock: RunClock,
    /// At least one CONTROLLER_INPUT was read.
    pub has_input: bool,
}

impl Stretch {
    /// With [`Options::from_s`] the log is read once more, up to there.
    ///
    /// # Errors
    /// [`Error::BeyondEnd`] if it ends before.
    pub fn find(path: &Path, clock: RunClock, options: &Options) -> Result<Self, Error> {
        let nanoseconds = |s: f64| (s * 1e9).round() as i64;
        let to_ns = options.to_s.map(nanoseconds);
        let Some(from_s) = options.from_s else { return Ok(Stretch { start: None, to_ns, clock, has_input: false }) };
        let from_ns = nanoseconds(from_s);
        let mut ticks = Ticks::open(path, Beside::Nothing)?;
        let (mut start, mut last_ns) = (None, None);
        while let Some(tick) = ticks.next()? {
            let Some(t_ns) = tick.input.as_ref().map(|input| input.t_ns) else { continue };
            let since_ns = clock.since_ns(t_ns);
            last_ns = Some(since_ns);
            if since_ns > from_ns {
                break;
            }
            if tick.snapshot().is_some() {
                start = Some(tick.tick);
            }
        }
        match last_ns {
            Some(last_ns) if last_ns < from_ns => {
                Err(Error::BeyondEnd { path: path.into(), from_s, last_s: last_ns as f64 * 1e-9 })
            }
            _ => Ok(Stretch { start, to_ns, clock, has_input: false }),
        }
    }
}

/// What a runner is given.
pub(super) enum Part {
    /// Take over the state that was recorded after a tick, and the parameters that held after these changes.
    Start(i64, Vec<u8>, Vec<ParameterChange>),
    /// Go on by a tick.
    Tick(Box<Tick>),
}

/// The parts of the stretch that is to be replayed.
pub(super) struct Feed<'f> {
    pub ticks: &'f mut Ticks,
    pub stretch: &'f mut Stretch,
    /// Length of the file.
    pub bytes: u64,
    /// Changes of parameters up to the last tick read, in order.
    pub changes: Vec<ParameterChange>,
}

impl Feed<'_> {
    /// Which part of the file has been read, 0 to 1.
    pub fn read(&self) -> f64 {
        self.ticks.offset as f64 / self.bytes.max(1) as f64
    }

    /// The next part, or `None` behind the last.
    pub fn next(&mut self) -> Result<Option<Part>, Error> {
        while let Some(mut tick) = self.ticks.next()? {
            self.changes.extend(tick.changes.iter().cloned());
            let t_ns = tick.input.as_ref().map(|input| input.t_ns);
            self.stretch.has_input |= t_ns.is_some();
            let since = t_ns.map(|t_ns| self.stretch.clock.since_ns(t_ns));
            tick.since_ns = since;
            if since.zip(self.stretch.to_ns).is_some_and(|(since, to)| since > to) {
                return Ok(None);
            }
            match self.stretch.start {
                Some(start) if tick.tick < start => {}
                Some(start) if tick.tick == start => {
                    let changes = self.changes.clone();
                    return Ok(tick.snapshot().map(|snapshot| Part::Start(start, snapshot.to_vec(), changes)));
                }
                _ => return Ok(Some(Part::Tick(Box::new(tick)))),
            }
        }
        Ok(None)
    }
}
