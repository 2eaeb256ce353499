//! The timeline of a run: changes of mode and gait, falls, faults, losses, missed deadlines, events.
//!
//! Times are in seconds since the first tick, as for `hoof replay --from` and `hoof debug --at`.

use lcmtypes::{Event, WbcSolution, enum_names};
use serde::Serialize;

use crate::metrics::{Safety, skipped, tick_us};
use crate::run::{Run, Tick};

/// A step between ticks longer than this many periods is a gap in the log.
const GAP_PERIODS: f64 = 1.5;
/// Equal conditions closer than this are one entry, s.
const TOGETHER_S: f64 = 0.1;
/// An event farther than this from the run has the time of another clock, s.
const OTHER_CLOCK_S: f64 = 3600.0;

/// One entry of the timeline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimelineEntry {
    /// Begin, s since the first tick.
    pub t_s: f64,
    /// Number of the tick, if known.
    pub tick: Option<i64>,
    /// Kind.
    pub what: EntryKind,
    /// Description for a reader.
    pub text: String,
}

/// Kind of a timeline entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EntryKind {
    /// The mode of the controller changed.
    Mode,
    /// The gait changed.
    Gait,
    /// The scenario pushed the base.
    Push,
    /// The robot fell.
    Fall,
    /// The controller entered a fault.
    Fault,
    /// Ticks are missing in the log.
    Gap,
    /// A robot state did not reach the controller.
    Lost,
    /// A tick used the robot state of an earlier tick.
    Stale,
    /// A tick ended after its deadline, or was skipped.
    Deadline,
    /// A quadratic program was not solved.
    Solver,
    /// An EVENT of level info.
    Event,
    /// An EVENT of a higher level.
    Warning,
}

impl EntryKind {
    /// True for kinds that indicate a problem.
    pub fn is_problem(self) -> bool {
        !matches!(self, Self::Mode | Self::Gait | Self::Push | Self::Event)
    }

    /// Name, as in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mode => "mode",
            Self::Gait => "gait",
            Self::Push => "push",
            Self::Fall => "fall",
            Self::Fault => "fault",
            Self::Gap => "gap",
            Self::Lost => "lost",
            Self::Stale => "stale",
            Self::Deadline => "deadline",
            Self::Solver => "solver",
            Self::Event => "event",
            Self::Warning => "warning",
        }
    }
}

/// The timeline of a run, in order of time.
pub fn entries(run: &Run) -> Vec<TimelineEntry> {
    let mut all = changes(run);
    all.extend(intervals(run));
    if !run.is_thinned() {
        all.extend(losses(run));
    }
    let safety = Safety::of_run(run);
    all.extend(safety.fell_at_s.map(|t_s| {
        let at = run.ticks.partition_point(|tick| tick.t_s < t_s);
        let tick = run.ticks.get(at).and_then(Tick::number);
        TimelineEntry { t_s, tick, what: EntryKind::Fall, text: "the robot fell".to_owned() }
    }));
    all.extend(safety.faults.into_iter().map(|fault| TimelineEntry {
        t_s: fault.t_s,
        tick: Some(fault.tick),
        what: EntryKind::Fault,
        text: format!("{}, index {}, value {}", fault.fault, fault.index, fault.value),
    }));
    let t0_ns = run.first_tick_ns;
    let mut last_s = run.begin_s();
    all.extend(run.events.iter().map(|event| {
        let t_s = event.t_ns.saturating_sub(t0_ns) as f64 / 1e9;
        // An event with the time of another clock, such as that of a recorder, gets the time of the event before it in the log.
        if (-OTHER_CLOCK_S..run.end_s() + OTHER_CLOCK_S).contains(&t_s) {
            last_s = t_s;
        }
        TimelineEntry {
            t_s: last_s,
            tick: (event.tick >= 0).then_some(event.tick),
            what: if event.level == Event::LEVEL_INFO { EntryKind::Event } else { EntryKind::Warning },
            text: format!("{}: {}", event.source, event.text),
        }
    }));
    all.sort_by(|a, b| a.t_s.total_cmp(&b.t_s).then(a.what.cmp(&b.what)));
    all
}

/// Changes of mode and gait.
fn changes(run: &Run) -> Vec<TimelineEntry> {
    let mut all = Vec::new();
    let gaits = run.gaits();
    let name_of = |number| gaits.gait(number).map_or("?", |gait| gaits.name(gait));
    let (mut mode, mut gait) = (None, None);
    for tick in &run.ticks {
        let mut changed =
            |what, text: String| all.push(TimelineEntry { t_s: tick.t_s, tick: tick.number(), what, text });
        if let Some(now) = tick.status.map(|s| s.mode) {
            if mode.is_some_and(|before| before != now) {
                changed(EntryKind::Mode, format!("mode {}", enum_names::mode(now)));
            }
            mode = Some(now);
        }
        if let Some(now) = tick.legs.map(|l| l.gait) {
            if gait.is_some_and(|before| before != now) {
                changed(EntryKind::Gait, format!("gait {}", name_of(now)));
            }
            gait = Some(now);
        }
    }
    all
}

/// Conditions that last: missed deadlines, unsolved quadratic programs, pushes.
fn intervals(run: &Run) -> Vec<TimelineEntry> {
    let late_us = |tick: &Tick| {
        let t = tick.timing.as_ref().filter(|t| t.deadline_ns > 0)?;
        (t.end_ns > t.deadline_ns).then(|| t.end_ns.saturating_sub(t.deadline_ns) as f64 * 1e-3)
    };
    let mut all = Vec::new();
    let counts = !run.is_thinned();
    for burst in bursts(run, |tick| counts && late_us(tick).is_some()) {
        let worst = burst.iter().filter_map(|t| late_us(t)).fold(0.0, f64::max);
        let took = burst.iter().filter_map(|t| t.timing.as_ref().map(tick_us)).fold(0.0, f64::max);
        let n = burst.len();
        all.push(entry(
            &burst,
            EntryKind::Deadline,
            format!("{n} deadlines missed by at most {worst:.0} µs; longest tick {took:.0} µs"),
        ));
    }
    for burst in bursts(run, |tick| counts && tick.wbc.is_some_and(|w| is_unsolved(w.status))) {
        let n = burst.len();
        all.push(entry(&burst, EntryKind::Solver, format!("quadratic program not solved in {n} ticks")));
    }
    for burst in bursts(run, |tick| tick.truth.as_ref().is_some_and(|w| w.pushed)) {
        let last_s = burst.last().map_or(0.0, |tick| tick.t_s - burst[0].t_s) + run.period_s();
        all.push(entry(&burst, EntryKind::Push, format!("base pushed for {last_s:.2} s")));
    }
    all
}

fn is_unsolved(status: i8) -> bool {
    !matches!(status, WbcSolution::STATUS_SOLVED | WbcSolution::STATUS_ALMOST_SOLVED | WbcSolution::STATUS_NOT_RUN)
}

/// Ticks in which a condition holds, grouped if they are closer than [`TOGETHER_S`].
fn bursts(run: &Run, holds: impl Fn(&Tick) -> bool) -> Vec<Vec<&Tick>> {
    let mut bursts: Vec<Vec<&Tick>> = Vec::new();
    for tick in run.ticks.iter().filter(|tick| holds(tick)) {
        match bursts.last_mut() {
            Some(burst) if burst.last().is_some_and(|last| tick.t_s - last.t_s < TOGETHER_S) => burst.push(tick),
            _ => bursts.push(vec![tick]),
        }
    }
    bursts
}

fn entry(burst: &[&Tick], what: EntryKind, text: String) -> TimelineEntry {
    TimelineEntry { t_s: burst[0].t_s, tick: burst[0].number(), what, text }
}

/// Gaps in the log, skipped ticks, and robot states that the controller did not receive or used twice.
fn losses(run: &Run) -> Vec<TimelineEntry> {
    let mut all: Vec<TimelineEntry> = Vec::new();
    let longest = GAP_PERIODS * run.period_s();
    let mut add =
        |tick: &Tick, what, count: i64, describe: &dyn Fn(i64) -> String, burst: &mut Option<(usize, f64, i64)>| {
            let near = burst.filter(|(_, last_s, _)| tick.t_s - last_s < TOGETHER_S);
            let (at, total) = near.map_or((all.len(), count), |(at, _, sum)| (at, sum.saturating_add(count)));
            let begin = TimelineEntry { t_s: tick.t_s, tick: tick.number(), what, text: describe(total) };
            match all.get_mut(at) {
                Some(known) => known.text = describe(total),
                None => all.push(begin),
            }
            *burst = Some((at, tick.t_s, total));
        };
    let (mut lost_burst, mut stale_burst, mut skipped_burst) = (None, None, None);
    for pair in run.ticks.windows(2) {
        let [before, after] = pair else { continue };
        if after.t_s - before.t_s > longest {
            let missing = (((after.t_s - before.t_s) / run.period_s()).round() as i64).saturating_sub(1);
            if after.follows(before) {
                let timings = before.timing.as_ref().zip(after.timing.as_ref());
                let n_skipped = timings.map_or(missing, |(t0, t1)| skipped(t0, t1, run.period_s() * 1e6) as i64);
                let describe = |n: i64| format!("{n} ticks skipped: the previous tick or the wake-up was late");
                if n_skipped > 0 {
                    add(before, EntryKind::Deadline, n_skipped, &describe, &mut skipped_burst);
                }
                continue;
            }
            let seconds = after.t_s - before.t_s;
            let describe = |n: i64| format!("{n} ticks are missing in the log after this tick ({seconds:.3} s)");
            add(before, EntryKind::Gap, missing.max(1), &describe, &mut None);
            continue;
        }
        let Some((old, new)) = before.consumed.zip(after.consumed) else { continue };
        match new.seq.saturating_sub(old.seq) {
            0 => add(
                after,
                EntryKind::Stale,
                1,
                &|n| format!("{n} ticks used the robot state of an earlier tick"),
                &mut stale_burst,
            ),
            step if step > 1 => {
                add(
                    after,
                    EntryKind::Lost,
                    step - 1,
                    &|n| format!("{n} robot states did not reach the controller"),
                    &mut lost_burst,
                );
            }
            _ => {}
        }
    }
    all
}
