//! Copies a short time window of a run's log into a small log that replays on its own, from the middle of the run.

use super::copy::{CopyReport, PROGRESS_EVENTS, copy_if};
use super::{EventFilter, EventRef, Health, LogReader, RunClock, Types};
use crate::Error;
use lcmtypes::channels::{self, CONTROLLER_SNAPSHOT, PARAMETER_CHANGE, RUN_INFO};
use std::path::Path;

/// Time window of an excerpt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExcerptWindow {
    /// Reference time, s since the run's first tick; see [`RunClock`].
    pub around_s: f64,
    /// Shortest time before `around_s`, s: the excerpt starts at the last controller snapshot that is at least this early.
    pub before_s: f64,
    /// Time after `around_s`, s.
    pub after_s: f64,
}

/// Writes an excerpt: RUN_INFO (parameters, URDF, types), every PARAMETER_CHANGE up to its end, the snapshot from which a replay starts,
/// and every event of the window after that snapshot's tick. Times and event numbers stay those of the run. `progress` receives the
/// fraction done, 0 to 1.
///
/// # Errors
/// As [`super::copy`]; [`Error::NoRunInfo`]; [`Error::NoSnapshot`] if the log has no snapshot before the window;
/// [`Error::BeyondEnd`] if the log ends before `around_s`.
pub fn copy_excerpt(
    log: &Path,
    out: &Path,
    window: ExcerptWindow,
    mut filter: EventFilter,
    types: Types,
    progress: &mut dyn FnMut(f64),
) -> Result<CopyReport, Error> {
    let nanoseconds = |s: f64| (s * 1e9).round() as i64;
    let from = nanoseconds((window.around_s - window.before_s).max(0.0));
    let clock = RunClock::read(log)?;
    let start = Start::find(log, &clock, from, &window, &mut |part| progress(part / 2.0))?;
    let to_ns = nanoseconds(window.around_s + window.after_s);
    let mut is_selected = |event: &EventRef<'_>| {
        match (&**event.channel, tick_of(event)) {
            (RUN_INFO, _) => true,
            // The parameters at the snapshot are those of RUN_INFO plus every change before it.
            (PARAMETER_CHANGE, _) => clock.of_event(event) <= to_ns,
            (CONTROLLER_SNAPSHOT, Some(tick)) if Some(tick) == start.snapshot => true,
            // Outputs up to the snapshot cannot be computed from it.
            (_, Some(tick)) if start.snapshot.is_some_and(|snapshot| tick <= snapshot) => false,
            (_, None) if start.snapshot_ns.is_some_and(|t_ns| clock.of_event(event) < t_ns) => false,
            _ => clock.of_event(event) <= to_ns && filter.accepts_channel(event.channel),
        }
    };
    copy_if(log, out, types, false, &mut is_selected, &mut |part| progress(0.5 + part / 2.0))
}

/// Start of an excerpt.
#[derive(Default)]
struct Start {
    /// Tick of the snapshot; `None` if the excerpt starts at tick 0, which needs no snapshot.
    snapshot: Option<i64>,
    /// Its time, ns since the run's first tick.
    snapshot_ns: Option<i64>,
}

impl Start {
    fn find(
        log: &Path,
        clock: &RunClock,
        from: i64,
        window: &ExcerptWindow,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Self, Error> {
        let mut reader = LogReader::open(log)?;
        let (bytes, mut events) = (reader.bytes().max(1), 0_u64);
        let mut start = Start::default();
        let (mut run_info, mut first_tick, mut last_ns) = (false, None, i64::MIN);
        let mut health = Health::default();
        while let Some(item) = reader.read()? {
            let Some(event) = health.note(item) else { continue };
            events += 1;
            if events.is_multiple_of(PROGRESS_EVENTS) {
                progress(event.offset as f64 / bytes as f64);
            }
            let (channel, t_ns) = (&**event.channel, clock.of_event(&event));
            run_info |= *channel == *RUN_INFO;
            last_ns = last_ns.max(t_ns);
            let Some(tick) = tick_of(&event) else { continue };
            first_tick.get_or_insert(tick);
            if *channel == *CONTROLLER_SNAPSHOT && t_ns <= from {
                (start.snapshot, start.snapshot_ns) = (Some(tick), Some(t_ns));
            }
        }
        let path = || log.to_path_buf();
        let seconds = |ns: i64| ns as f64 * 1e-9;
        if !run_info {
            return Err(Error::NoRunInfo { path: path(), events });
        }
        let last = seconds(last_ns);
        if last < window.around_s {
            return Err(Error::BeyondEnd { path: path(), from_s: window.around_s, last_s: last });
        }
        if start.snapshot.is_none() && first_tick != Some(0) {
            return Err(Error::NoSnapshot { path: path(), before_s: seconds(from) });
        }
        Ok(start)
    }
}

/// Tick of an input or output message of a controller; `None` for other channels.
fn tick_of(event: &EventRef<'_>) -> Option<i64> {
    let stage = channels::find(event.channel)?.stage;
    stage.and_then(|_| super::sequence_gaps::sequence_number(event.data))
}
