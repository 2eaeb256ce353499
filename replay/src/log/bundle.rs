//! A small log around a moment that replays by itself, from the middle of the run.

use super::copy::{Copied, copy_with};
use super::{EventRef, Health, LogReader, Selection, Types};
use crate::Error;
use lcmtypes::channels::{self, CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, PARAMETER_CHANGE, RUN_INFO};
use std::path::Path;

/// The stretch of a log that a bundle is to hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Around {
    /// The moment, s since the first tick of the log, as for a replay; of a log without one, since its first event.
    pub moment_s: f64,
    /// Before it, s; the bundle begins at the last snapshot that leaves so much.
    pub before_s: f64,
    /// Behind it, s.
    pub after_s: f64,
}

/// Writes the bundle: RUN_INFO (parameters, URDF, types), every change of parameters up to its end, the snapshot from which a replay can start, and every event of the stretch
/// behind that snapshot's tick. Times and numbers stay those of the run.
///
/// # Errors
/// As [`super::copy`]; [`Error::NoRunInfo`]; [`Error::NoSnapshot`] if no snapshot stands in front of the stretch;
/// [`Error::NothingThere`] if the log ends before the moment.
pub fn bundle(
    log: &Path,
    out: &Path,
    around: Around,
    mut selection: Selection,
    types: Types,
    progress: &mut dyn FnMut(f64),
) -> Result<Copied, Error> {
    let nanoseconds = |s: f64| (s * 1e9).round() as i64;
    let from = nanoseconds((around.moment_s - around.before_s).max(0.0));
    let start = Start::find(log, from, &around, &mut |part| progress(part / 2.0))?;
    let to_ns = start.origin_ns.saturating_add(nanoseconds(around.moment_s + around.after_s));
    let mut wants = |event: &EventRef<'_>| {
        match (&**event.channel, tick_of(event)) {
            (RUN_INFO, _) => true,
            // The snapshot's state belongs to the parameters as they had become by then.
            (PARAMETER_CHANGE, _) => event.t_ns <= to_ns,
            (CONTROLLER_SNAPSHOT, Some(tick)) if Some(tick) == start.snapshot => true,
            // What the controller did up to the snapshot cannot be computed from it.
            (_, Some(tick)) if start.snapshot.is_some_and(|snapshot| tick <= snapshot) => false,
            (_, None) if start.snapshot_ns.is_some_and(|t_ns| event.t_ns < t_ns) => false,
            _ => event.t_ns <= to_ns && selection.wants_channel(event.channel),
        }
    };
    copy_with(log, out, types, false, &mut wants, &mut |part| progress(0.5 + part / 2.0))
}

/// Where a bundle begins. Times are those of the events in the log, ns.
#[derive(Default)]
struct Start {
    /// Tick of the snapshot; `None`: at tick 0, where no snapshot is needed.
    snapshot: Option<i64>,
    snapshot_ns: Option<i64>,
    /// From when on moments are counted: the first input's time.
    origin_ns: i64,
}

impl Start {
    fn find(log: &Path, from: i64, around: &Around, progress: &mut dyn FnMut(f64)) -> Result<Self, Error> {
        let mut reader = LogReader::open(log)?;
        let (bytes, mut events) = (reader.bytes().max(1), 0_u64);
        let mut start = Start::default();
        let (mut first_ns, mut first_input_ns, mut last_ns) = (None, None, i64::MIN);
        let (mut run_info, mut first_tick) = (false, None);
        let mut health = Health::default();
        while let Some(item) = reader.read()? {
            let Some(event) = health.note(item) else { continue };
            events += 1;
            if events.is_multiple_of(4096) {
                progress(event.offset as f64 / bytes as f64);
            }
            let (channel, t_ns) = (&**event.channel, event.t_ns);
            run_info |= *channel == *RUN_INFO;
            first_ns.get_or_insert(t_ns);
            last_ns = last_ns.max(t_ns);
            let Some(tick) = tick_of(&event) else { continue };
            first_tick.get_or_insert(tick);
            if *channel == *CONTROLLER_INPUT {
                first_input_ns.get_or_insert(t_ns);
            }
            start.origin_ns = first_input_ns.or(first_ns).unwrap_or_default();
            if *channel == *CONTROLLER_SNAPSHOT && t_ns.saturating_sub(start.origin_ns) <= from {
                (start.snapshot, start.snapshot_ns) = (Some(tick), Some(t_ns));
            }
        }
        let path = || log.to_path_buf();
        let seconds = |ns: i64| ns as f64 * 1e-9;
        if !run_info {
            return Err(Error::NoRunInfo { path: path(), events });
        }
        let last = seconds(last_ns.saturating_sub(start.origin_ns));
        if last < around.moment_s {
            return Err(Error::NothingThere { path: path(), moment_s: around.moment_s, duration_s: last });
        }
        if start.snapshot.is_none() && first_tick != Some(0) {
            return Err(Error::NoSnapshot { path: path(), before_s: seconds(from) });
        }
        Ok(start)
    }
}

/// Tick of a message that a controller consumed or put out.
fn tick_of(event: &EventRef<'_>) -> Option<i64> {
    let stage = channels::find(event.channel)?.stage;
    stage.and_then(|_| super::counter::second_integer(event.data))
}
