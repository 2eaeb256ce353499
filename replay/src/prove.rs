//! Replays the log of a run before it is completed, and appends the verdict as the last message.

use crate::Error;
use crate::engine::{Options, ReleaseViolation, Replay, ReplayReport};
use crate::record::Target;
use lcmtypes::{Event, EventNumbers, Message, channels};
use std::path::Path;

/// [`Event::source`] of the verdict.
pub const SOURCE: &str = "proof";

/// Flushes a log, replays it, and appends the verdict as an EVENT.
///
/// - `path`: the file that `log` writes. It has no end yet, so the reader reports it as cut; this is not a failure.
/// - `jobs`: number of threads of the replay.
///
/// # Errors
/// Those of [`Target`] and of [`Replay::run`].
pub fn prove(path: &Path, log: &mut dyn Target, jobs: usize) -> Result<ReplayReport, Error> {
    log.flush()?;
    let replay = Replay::open(path)?;
    let run_id = replay.info().run_id;
    let report = replay.run(&Options { jobs, ..Options::default() }, &mut |_| {})?;
    let proved = is_proof(&report);
    let text = match &report.first_divergence {
        _ if report.release_violations.count > 0 => {
            let first = report.release_violations.first.as_ref().map_or(String::new(), ReleaseViolation::text);
            format!("does not replay: {first}")
        }
        _ if proved => format!("replays bit for bit: {} ticks, {} messages", report.ticks, report.messages_compared),
        Some(d) => format!(
            "does not replay: differs from tick {} on, first in stage {}: {} {}",
            d.tick, d.stage, d.channel, d.field
        ),
        None => format!("replays in part only: {} ticks, {} not computed", report.ticks, report.skipped_ticks),
    };
    let level = if proved { Event::LEVEL_INFO } else { Event::LEVEL_ERROR };
    let t_ns = report.last_t_ns.unwrap_or_default();
    let mut event = Event { t_ns, tick: -1, level, source: SOURCE.to_owned(), text, ..Event::default() };
    EventNumbers::new(run_id).number(&mut event);
    let mut bytes = Vec::new();
    event.encode(&mut bytes).map_err(|source| Error::Encode { path: path.into(), source: source.into() })?;
    log.write(channels::EVENT, t_ns, &bytes)?;
    Ok(report)
}

/// Whether a replay proves its log: every tick was computed and compared, and all outputs are identical.
pub fn is_proof(report: &ReplayReport) -> bool {
    let whole = report.missing_input_ticks == 0 && report.skipped_ticks == 0 && report.unverifiable_ticks == 0;
    // A component that is not replayed but should be is in no count.
    let has_all = report.components.iter().all(|component| component.replayed || component.complete);
    report.identical && whole && has_all && report.damaged == 0 && report.release_violations.count == 0
}
