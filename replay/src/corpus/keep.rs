//! Which messages of a log a golden log keeps.

use crate::Error;
use crate::engine::ticks::{Beside, Ticks, integer_at};
use crate::engine::{RunMessages, run_info};
use crate::log::{Event, LogReader, LogWriter, RunClock};
use lcmtypes::channels::{self, Class};
use lcmtypes::{ControllerInput, Message};
use std::collections::BTreeSet;
use std::path::Path;

/// Channels that a golden log keeps for every tick.
pub const CHANNELS: [&str; 6] = [
    channels::RUN_INFO,
    channels::PARAMETER_CHANGE,
    channels::CONTROLLER_INPUT,
    channels::CONTROLLER_TICK,
    channels::CONTROLLER_SNAPSHOT,
    channels::EVENT,
];

/// Period, in ticks, of the samples that a golden log keeps of all other outputs, for figures and differences.
pub const SAMPLE_TICKS: i64 = 20;

/// A part of a log for a small regression test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Middle of the part, s since the run's first tick.
    pub around_s: f64,
    /// Minimum length, s; the part starts after a snapshot, so it may be longer.
    pub span_s: f64,
}

/// Copies the messages that a golden log keeps: [`CHANNELS`], `more`, and samples of all other outputs. Returns the number of events.
///
/// # Errors
/// [`Error::SameFile`], or errors of [`LogReader`] and [`LogWriter`].
pub fn trim_to_golden(log: &Path, out: &Path, more: &[&str]) -> Result<u64, Error> {
    copy(log, out, |event| is_kept(event, |channel| more.contains(&channel)))
}

/// Whether a golden log keeps a message. `whole`: additional channels that are kept for every tick.
pub(super) fn is_kept(event: &Event, whole: impl Fn(&str) -> bool) -> bool {
    CHANNELS.contains(&&*event.channel) || whole(&event.channel) || is_sample(event)
}

fn is_sample(event: &Event) -> bool {
    is_output(&event.channel) && integer_at(&event.data, 16).is_some_and(|tick| tick % SAMPLE_TICKS == 0)
}

/// Whether a channel is an output of a tick.
fn is_output(channel: &str) -> bool {
    channels::find(channel).is_some_and(|known| known.stage.is_some() && known.class != Class::ReplayInput)
}

/// Copies the events for which `keep` returns true.
pub(super) fn copy(log: &Path, out: &Path, mut keep: impl FnMut(&Event) -> bool) -> Result<u64, Error> {
    Error::check_distinct_files(log, out)?;
    let events = LogReader::open(log)?.events();
    let mut out = LogWriter::create(out)?;
    for event in events {
        let event = event?;
        if keep(&event) {
            out.write(&event.channel, event.t_ns, &event.data)?;
        }
    }
    out.finish()
}

/// Copies the ticks around an incident: RUN_INFO, parameter changes, the snapshot before them, and the messages that a golden log keeps.
pub(super) fn copy_part(log: &Path, out: &Path, part: Part, more: &[&str]) -> Result<u64, Error> {
    let (from_s, to_s) = (part.around_s - 0.5 * part.span_s, part.around_s + 0.5 * part.span_s);
    let clock = RunClock::read(log)?;
    let (mut start, mut last) = (None, None);
    let mut ticks = Ticks::open(log, &RunMessages::of(&run_info(log)?), Beside::Nothing)?;
    while let Some(tick) = ticks.next()? {
        let Some(input) = &tick.input else { continue };
        let since_s = clock.since_ns(input.t_ns) as f64 * 1e-9;
        if since_s > to_s {
            break;
        }
        last = Some((tick.tick, since_s));
        if tick.snapshot().is_some() && since_s < from_s {
            start = Some(tick.tick);
        }
    }
    let Some((last, last_s)) = last else { return Err(Error::NoInput { path: log.into() }) };
    if last_s < part.around_s {
        return Err(Error::BeyondEnd { path: log.into(), from_s: part.around_s, last_s });
    }
    let within = |tick: i64| start.is_none_or(|start| tick > start) && tick <= last;
    copy(log, out, |event| {
        let tick = integer_at(&event.data, 16);
        let is_start = *event.channel == *channels::CONTROLLER_SNAPSHOT && start.is_some() && tick == start;
        let kept = is_kept(event, |channel| more.contains(&channel));
        // Parameter changes before the part hold in it.
        let is_change = *event.channel == *channels::PARAMETER_CHANGE && tick.is_some_and(|tick| tick <= last);
        *event.channel == *channels::RUN_INFO || is_change || is_start || kept && tick.is_some_and(within)
    })
}

/// Copies all messages except outputs, so that a changed output type does not prevent the replay. A log that starts inside a run
/// keeps its snapshots. Returns the channels of which the log has more than samples.
pub(super) fn copy_inputs(log: &Path, out: &Path) -> Result<BTreeSet<String>, Error> {
    let mut first_tick = None;
    for event in LogReader::open(log)?.events() {
        let event = event?;
        if *event.channel == *channels::CONTROLLER_INPUT {
            first_tick = ControllerInput::decode(&event.data).ok().map(|input| input.tick);
            break;
        }
    }
    let mut whole = BTreeSet::new();
    copy(log, out, |event| {
        if !is_sample(event) {
            whole.insert(event.channel.to_string());
        }
        if *event.channel == *channels::CONTROLLER_SNAPSHOT {
            first_tick != Some(0)
        } else {
            !is_output(&event.channel)
        }
    })?;
    Ok(whole)
}

/// Ticks with an output other than digest and snapshot; all ticks if there is none.
pub(super) fn shown_ticks(log: &Path) -> Result<BTreeSet<i64>, Error> {
    let (mut shown, mut all) = (BTreeSet::new(), BTreeSet::new());
    for event in LogReader::open(log)?.events() {
        let event = event?;
        let Some(tick) = integer_at(&event.data, 16) else { continue };
        if *event.channel == *channels::CONTROLLER_INPUT {
            all.insert(tick);
        } else if is_output(&event.channel) && !CHANNELS.contains(&&*event.channel) {
            shown.insert(tick);
        }
    }
    Ok(if shown.is_empty() { all } else { shown })
}

/// Copies the messages of some ticks, RUN_INFO and EVENT.
pub(super) fn copy_ticks(log: &Path, out: &Path, ticks: &BTreeSet<i64>) -> Result<(), Error> {
    copy(log, out, |event| {
        let of_tick = is_output(&event.channel) || *event.channel == *channels::CONTROLLER_INPUT;
        match of_tick {
            true => integer_at(&event.data, 16).is_some_and(|tick| ticks.contains(&tick)),
            false => [channels::RUN_INFO, channels::EVENT].contains(&&*event.channel),
        }
    })
    .map(drop)
}
