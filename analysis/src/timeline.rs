//! What happened in a run, and when: the lines of a report that a reader looks for first.
//!
//! Times are those that `hoof replay --from` and `hoof debug --at` take: seconds since the first tick of the log.

use lcmtypes::{ControllerTick, Event, OperatorCommand, WbcSolution};
use serde::Serialize;

use crate::metrics::{Safety, left_out, tick_us};
use crate::run::{Run, Tick};

/// A step between ticks longer than this many periods is a gap in the log.
const GAP_PERIODS: f64 = 1.5;
/// Like happenings closer than this are one, s.
const TOGETHER_S: f64 = 0.1;
/// An event stamped farther than this from its run was stamped by another clock, s.
const OTHER_CLOCK_S: f64 = 3600.0;

/// Something that a reader wants to know of.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimelineEntry {
    /// When it began, s since the first tick.
    pub t_s: f64,
    /// Number of the tick, where it is known.
    pub tick: Option<i64>,
    /// What kind of thing.
    pub what: What,
    /// In words.
    pub text: String,
}

/// Kind of happening.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum What {
    /// The controller changed its mode.
    Mode,
    /// The gait changed.
    Gait,
    /// The scenario pushed the base.
    Push,
    /// The robot fell.
    Fall,
    /// The controller entered a fault.
    Fault,
    /// Ticks are missing from the log.
    Gap,
    /// A state of the robot never reached the controller.
    Lost,
    /// A tick was computed from a state that had been used before.
    Stale,
    /// A tick ended after its deadline.
    Deadline,
    /// A quadratic program was not solved.
    Solver,
    /// A message on EVENT.
    Event,
    /// A message on EVENT that warns.
    Warning,
}

impl What {
    /// A reader should look at it.
    pub fn is_bad(self) -> bool {
        !matches!(self, Self::Mode | Self::Gait | Self::Push | Self::Event)
    }

    /// One word.
    pub fn word(self) -> &'static str {
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

/// Everything that happened, in the order of time.
pub fn happenings(run: &Run) -> Vec<TimelineEntry> {
    let mut all = changes(run);
    all.extend(stretches(run));
    all.extend(losses(run));
    let safety = Safety::of_run(run);
    all.extend(safety.fell_at_s.map(|t_s| {
        let at = run.ticks.partition_point(|tick| tick.t_s < t_s);
        let tick = run.ticks.get(at).and_then(Tick::number);
        TimelineEntry { t_s, tick, what: What::Fall, text: "the robot fell".to_owned() }
    }));
    all.extend(safety.faults.into_iter().map(|fault| TimelineEntry {
        t_s: fault.t_s,
        tick: Some(fault.tick),
        what: What::Fault,
        text: format!("{}, index {}, value {}", fault.fault, fault.index, fault.value),
    }));
    let t0_ns = run.first_tick_ns;
    let mut last_s = run.begin_s();
    all.extend(run.events.iter().map(|event| {
        let t_s = event.t_ns.saturating_sub(t0_ns) as f64 / 1e9;
        // By another clock, as a recorder's: then it is where it stands in the log.
        if (-OTHER_CLOCK_S..run.end_s() + OTHER_CLOCK_S).contains(&t_s) {
            last_s = t_s;
        }
        TimelineEntry {
            t_s: last_s,
            tick: (event.tick >= 0).then_some(event.tick),
            what: if event.level == Event::LEVEL_INFO { What::Event } else { What::Warning },
            text: format!("{}: {}", event.source, event.text),
        }
    }));
    all.sort_by(|a, b| a.t_s.total_cmp(&b.t_s).then(a.what.cmp(&b.what)));
    all
}

/// Changes of mode and gait.
fn changes(run: &Run) -> Vec<TimelineEntry> {
    let mut all = Vec::new();
    let (mut mode, mut gait) = (None, None);
    for tick in &run.ticks {
        let mut changed =
            |what, text: String| all.push(TimelineEntry { t_s: tick.t_s, tick: tick.number(), what, text });
        if let Some(now) = tick.status.map(|s| s.mode) {
            if mode.is_some_and(|before| before != now) {
                changed(What::Mode, format!("the controller {}", mode_text(now)));
            }
            mode = Some(now);
        }
        if let Some(now) = tick.legs.map(|l| l.gait) {
            if gait.is_some_and(|before| before != now) {
                changed(What::Gait, format!("the gait is a {} from here on", gait_text(now)));
            }
            gait = Some(now);
        }
    }
    all
}

fn mode_text(mode: i8) -> &'static str {
    match mode {
        ControllerTick::MODE_IDLE => "idles",
        ControllerTick::MODE_STANCE => "stands",
        ControllerTick::MODE_WALK => "walks",
        ControllerTick::MODE_DAMPING => "damps the joints",
        ControllerTick::MODE_STAND_UP => "has the robot get up",
        ControllerTick::MODE_SIT => "has the robot sit down",
        _ => "is in a mode that this version does not know",
    }
}

fn gait_text(gait: i8) -> &'static str {
    match gait {
        OperatorCommand::GAIT_TROT => "trot",
        OperatorCommand::GAIT_CRAWL => "crawl",
        _ => "gait that this version does not know",
    }
}

/// Pushes, missed deadlines, late states, unsolved programs: what lasts or comes in bursts.
fn stretches(run: &Run) -> Vec<TimelineEntry> {
    let late_us = |tick: &Tick| {
        let t = tick.timing.as_ref().filter(|t| t.deadline_ns > 0)?;
        (t.end_ns > t.deadline_ns).then(|| (t.end_ns - t.deadline_ns) as f64 * 1e-3)
    };
    let mut all = Vec::new();
    for burst in bursts(run, |tick| late_us(tick).is_some()) {
        let worst = burst.iter().filter_map(|t| late_us(t)).fold(0.0, f64::max);
        let took = burst.iter().filter_map(|t| t.timing.as_ref().map(tick_us)).fold(0.0, f64::max);
        let n = burst.len();
        all.push(happening(
            &burst,
            What::Deadline,
            format!("{n} deadlines missed by up to {worst:.0} µs, ticks of up to {took:.0} µs"),
        ));
    }
    for burst in bursts(run, |tick| tick.wbc.is_some_and(|w| is_unsolved(w.status))) {
        let n = burst.len();
        all.push(happening(&burst, What::Solver, format!("the quadratic program was not solved in {n} ticks")));
    }
    for burst in bursts(run, |tick| tick.truth.as_ref().is_some_and(|w| w.pushed)) {
        let last_s = burst.last().map_or(0.0, |tick| tick.t_s - burst[0].t_s) + run.period_s();
        all.push(happening(&burst, What::Push, format!("the base is pushed for {last_s:.2} s")));
    }
    all
}

fn is_unsolved(status: i8) -> bool {
    !matches!(status, WbcSolution::STATUS_SOLVED | WbcSolution::STATUS_ALMOST_SOLVED | WbcSolution::STATUS_NOT_RUN)
}

/// Ticks for which a condition holds, those close to each other together.
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

fn happening(burst: &[&Tick], what: What, text: String) -> TimelineEntry {
    TimelineEntry { t_s: burst[0].t_s, tick: burst[0].number(), what, text }
}

/// Gaps in the log, and states that were lost or used twice on the way to the controller.
fn losses(run: &Run) -> Vec<TimelineEntry> {
    let mut all: Vec<TimelineEntry> = Vec::new();
    let longest = GAP_PERIODS * run.period_s();
    let mut add =
        |tick: &Tick, what, count: i64, words: &dyn Fn(i64) -> String, burst: &mut Option<(usize, f64, i64)>| {
            let near = burst.filter(|(_, last_s, _)| tick.t_s - last_s < TOGETHER_S);
            let (at, total) = near.map_or((all.len(), count), |(at, _, sum)| (at, sum + count));
            let begin = TimelineEntry { t_s: tick.t_s, tick: tick.number(), what, text: words(total) };
            match all.get_mut(at) {
                Some(known) => known.text = words(total),
                None => all.push(begin),
            }
            *burst = Some((at, tick.t_s, total));
        };
    let (mut lost_burst, mut stale_burst, mut out_burst) = (None, None, None);
    for pair in run.ticks.windows(2) {
        let [before, after] = pair else { continue };
        if after.t_s - before.t_s > longest {
            let missing = ((after.t_s - before.t_s) / run.period_s()).round() as i64 - 1;
            if after.follows(before) {
                let timings = before.timing.as_ref().zip(after.timing.as_ref());
                let out = timings.map_or(missing, |(t0, t1)| left_out(t0, t1, run.period_s() * 1e6) as i64);
                let words = |n: i64| format!("{n} ticks were left out: the controller came too late for them");
                if out > 0 {
                    add(before, What::Deadline, out, &words, &mut out_burst);
                }
                continue;
            }
            let seconds = after.t_s - before.t_s;
            let words = |n: i64| format!("{n} ticks are missing from the log after this one: {seconds:.3} s");
            add(before, What::Gap, missing.max(1), &words, &mut None);
            continue;
        }
        let Some((old, new)) = before.consumed.zip(after.consumed) else { continue };
        match new.seq - old.seq {
            0 => add(
                after,
                What::Stale,
                1,
                &|n| format!("{n} ticks were computed from a state used before"),
                &mut stale_burst,
            ),
            step if step > 1 => {
                add(
                    after,
                    What::Lost,
                    step - 1,
                    &|n| format!("{n} states of the robot did not reach the controller"),
                    &mut lost_burst,
                );
            }
            _ => {}
        }
    }
    all
}
