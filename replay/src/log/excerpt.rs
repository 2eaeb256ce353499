//! Copies the ticks of a part of a run. The tick decides which messages belong to the part, not the time at which the recorder received them: messages of
//! one tick are recorded in any order, seconds apart on a busy machine, and the clock of a recorder can step.

use super::copy::{CopyReport, PROGRESS_EVENTS, copy_if};
use super::run_clock::{EventTimes, RunClock, controller_time};
use super::runs::run_id;
use super::{EventFilter, EventRef, Health, LogReader, Types};
use crate::Error;
use crate::engine::{RunMessages, run_info};
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, PARAMETER_CHANGE, RUN_INFO};
use lcmtypes::{ControllerInput, Message};
use std::path::Path;

/// A part of a run, in times since its first tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Excerpt {
    /// A part that replays on its own.
    Around {
        /// Reference time, s.
        around_s: f64,
        /// Shortest time before it, s: the part starts at the last controller snapshot that is at least this early.
        before_s: f64,
        /// Time after it, s.
        after_s: f64,
    },
    /// The ticks from one time to another, inclusive, s. Its replay starts at the first snapshot in it.
    Range {
        /// Start; `None`: that of the log.
        from_s: Option<f64>,
        /// End; `None`: that of the log.
        to_s: Option<f64>,
    },
}

/// Writes a part of a run: RUN_INFO (parameters, URDF, types), every PARAMETER_CHANGE up to its end, the snapshot from which a replay starts, and every
/// message of the selected ticks. Of the other events it copies those that are recorded between the selected inputs. Times and event numbers stay those of
/// the run. `progress` receives the fraction done, 0 to 1.
///
/// # Errors
/// As [`super::copy`]; [`Error::NoRunInfo`]; [`Error::NoInput`]; [`Error::SeveralRuns`]; [`Error::NoSnapshot`] if the log has no snapshot before the part;
/// [`Error::BeyondEnd`] if the log ends before its reference time or start.
pub fn copy_excerpt(
    log: &Path,
    out: &Path,
    excerpt: Excerpt,
    mut filter: EventFilter,
    types: Types,
    progress: &mut dyn FnMut(f64),
) -> Result<CopyReport, Error> {
    let messages = RunMessages::of(&run_info(log)?);
    let clock = RunClock::read(log)?;
    let part = Part::find(log, &clock, &messages, &excerpt, &mut |part| progress(part / 2.0))?;
    let mut times = EventTimes::new(clock);
    let mut is_selected = |event: &EventRef<'_>| {
        let since_ns = times.of_place(event);
        let tick = messages.tick_of(event.channel, event.data);
        match (&**event.channel, tick) {
            (RUN_INFO, _) => true,
            // The parameters at the snapshot are those of RUN_INFO plus every change before it.
            (PARAMETER_CHANGE, Some(tick)) => tick <= part.last,
            (CONTROLLER_SNAPSHOT, Some(tick)) if Some(tick) == part.snapshot => true,
            (_, Some(tick)) => (part.first..=part.last).contains(&tick) && filter.accepts_channel(event.channel),
            (_, None) => (part.from_ns..=part.to_ns).contains(&since_ns) && filter.accepts_channel(event.channel),
        }
    };
    copy_if(log, out, types, false, &mut is_selected, &mut |part| progress(0.5 + part / 2.0))
}

/// The selected ticks.
struct Part {
    /// Tick of the snapshot to start from.
    snapshot: Option<i64>,
    first: i64,
    last: i64,
    /// Limits for events without a tick, ns since the run's first tick.
    from_ns: i64,
    to_ns: i64,
}

impl Part {
    fn find(
        log: &Path,
        clock: &RunClock,
        messages: &RunMessages,
        excerpt: &Excerpt,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Self, Error> {
        let nanoseconds = |s: f64| (s * 1e9).round() as i64;
        let (from_ns, to_ns, reference_s) = match *excerpt {
            Excerpt::Around { around_s, before_s, after_s } => {
                (nanoseconds((around_s - before_s).max(0.0)), nanoseconds(around_s + after_s), around_s)
            }
            Excerpt::Range { from_s, to_s } => {
                (from_s.map_or(i64::MIN, nanoseconds), to_s.map_or(i64::MAX, nanoseconds), from_s.unwrap_or(0.0))
            }
        };
        // Each a time, ns since the run's first tick, and a tick.
        let (mut snapshot, mut first, mut last) = (None::<(i64, i64)>, None::<(i64, i64)>, None::<(i64, i64)>);
        let (mut end_ns, mut first_of_log) = (i64::MIN, None);
        let mut reader = LogReader::open(log)?;
        let (bytes, mut events, mut health) = (reader.bytes().max(1), 0_u64, Health::default());
        while let Some(item) = reader.read()? {
            let Some(event) = health.note(item) else { continue };
            events += 1;
            if events.is_multiple_of(PROGRESS_EVENTS) {
                progress(event.offset as f64 / bytes as f64);
            }
            let is_input =
                **event.channel == *CONTROLLER_INPUT && event.fingerprint() == Some(ControllerInput::FINGERPRINT);
            if !is_input && **event.channel != *CONTROLLER_SNAPSHOT {
                continue;
            }
            if is_input && run_id(event.channel, event.data).is_some_and(|run_id| !messages.is_of_run(run_id)) {
                return Err(Error::SeveralRuns { path: log.into(), offset: event.offset });
            }
            let time = controller_time(&event).map(|t_ns| clock.since_ns(t_ns));
            let Some(place) = time.zip(super::sequence_number(event.data)) else { continue };
            if is_input {
                first_of_log.get_or_insert(place.1);
                end_ns = end_ns.max(place.0);
                if place.0 >= from_ns {
                    first = Some(first.map_or(place, |first| first.min(place)));
                }
                if place.0 <= to_ns {
                    last = last.max(Some(place));
                }
            } else if place.0 <= from_ns {
                snapshot = snapshot.max(Some(place));
            }
        }
        let path = || log.to_path_buf();
        let seconds = |ns: i64| ns as f64 * 1e-9;
        let Some(first_of_log) = first_of_log else { return Err(Error::NoInput { path: path() }) };
        if seconds(end_ns) < reference_s {
            return Err(Error::BeyondEnd { path: path(), from_s: reference_s, last_s: seconds(end_ns) });
        }
        let last = last.map_or(i64::MIN, |(_, tick)| tick);
        match (excerpt, snapshot) {
            // From tick 0 on the state is known without a snapshot; a copy without its input would lack that tick.
            (Excerpt::Around { .. }, Some((snapshot_ns, tick))) if tick != 0 || first_of_log != 0 => {
                Ok(Part { snapshot: Some(tick), first: tick.saturating_add(1), last, from_ns: snapshot_ns, to_ns })
            }
            (Excerpt::Around { .. }, None) if first_of_log != 0 => {
                Err(Error::NoSnapshot { path: path(), before_s: seconds(from_ns) })
            }
            (Excerpt::Around { .. }, _) => Ok(Part { snapshot: None, first: 0, last, from_ns: i64::MIN, to_ns }),
            (Excerpt::Range { .. }, _) => {
                let first = first.map_or(i64::MAX, |(_, tick)| tick);
                Ok(Part { snapshot: None, first, last, from_ns, to_ns })
            }
        }
    }
}
