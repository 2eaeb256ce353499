//! Durations of ticks, deadlines, and the quadratic program.

use lcmtypes::{Timing, WbcSolution};
use serde::Serialize;

use crate::run::{Run, Wbc};
use crate::stats::Distribution;

/// Name of the stage of the quadratic program in RUN_INFO.
const QP_STAGE: &str = "qp";

/// Durations by the wall clock, µs.
#[derive(Clone, Debug, Serialize)]
pub struct TimingMetrics {
    /// From the begin of a tick to its command, µs.
    pub tick_us: Option<Distribution>,
    /// Stages, by the names in RUN_INFO.
    pub stages: Vec<StageTime>,
    /// From the wake-up of the executor to the begin of the tick, µs.
    pub start_latency_us: Option<Distribution>,
    /// Jitter: time between wake-ups − control period, µs. `null` in lockstep, which has no wake-ups.
    pub period_error_us: Option<Distribution>,
    /// Ticks with a deadline; 0 in lockstep.
    pub with_deadline: u64,
    /// Ticks that ended after their deadline.
    pub missed_deadlines: u64,
    /// Ticks skipped by a live run, because it was woken too late or the previous tick took too long.
    pub left_out: u64,
    /// Ticks that took longer than the control period.
    pub longer_than_period: u64,
}

/// Duration of one stage, µs.
#[derive(Clone, Debug, Serialize)]
pub struct StageTime {
    /// Name of the stage.
    pub stage: String,
    /// Duration of the stage, µs.
    pub us: Option<Distribution>,
}

/// The quadratic program over the run.
#[derive(Clone, Debug, Serialize)]
pub struct Qp {
    /// Iterations of the solver, in the ticks in which it ran.
    pub iterations: Option<Distribution>,
    /// Largest number of variables, equality rows and inequality rows.
    pub size: [i32; 3],
    /// Number of ticks by outcome.
    pub status: QpStatus,
}

/// Number of ticks by outcome of the quadratic program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct QpStatus {
    /// Solved to tolerance.
    pub solved: u64,
    /// Solved to the reduced tolerance.
    pub almost_solved: u64,
    /// The solver failed.
    pub failed: u64,
    /// No point satisfies the constraints.
    pub infeasible: u64,
    /// The solver did not run.
    pub not_run: u64,
}

/// Duration of a tick, µs.
pub(crate) fn tick_us(timing: &Timing) -> f64 {
    timing.end_ns.saturating_sub(timing.start_ns) as f64 * 1e-3
}

/// Index of the stage of the quadratic program; `None` if the controller has none.
pub(crate) fn qp_stage(run: &Run) -> Option<usize> {
    run.info.as_ref()?.stages().iter().position(|name| name == QP_STAGE)
}

/// Duration of a stage, µs; `None` if the message does not have it.
pub(crate) fn stage_us(timing: &Timing, stage: usize) -> Option<f64> {
    timing.stage_ns.get(stage).map(|ns| *ns as f64 * 1e-3)
}

/// Time between the wake-ups of a tick and the next, µs; `None` if ticks between them are missing.
pub(crate) fn period_us(before: &Timing, after: &Timing) -> Option<f64> {
    (before.tick.checked_add(1) == Some(after.tick)).then(|| after.wake_ns.saturating_sub(before.wake_ns) as f64 * 1e-3)
}

/// Ticks skipped between two consecutive messages; 0 if messages between them are missing in the log.
pub(crate) fn skipped(before: &Timing, after: &Timing, period_us: f64) -> u64 {
    let due = before.deadline_ns > 0 && before.tick.checked_add(1) == Some(after.tick) && period_us > 0.0;
    let periods = after.deadline_ns.saturating_sub(before.deadline_ns) as f64 * 1e-3 / period_us;
    if due { (periods.round() - 1.0).max(0.0) as u64 } else { 0 }
}

impl TimingMetrics {
    pub(super) fn of(run: &Run) -> Option<Self> {
        let timings: Vec<&Timing> = run.ticks.iter().filter_map(|tick| tick.timing.as_ref()).collect();
        if timings.is_empty() {
            return None;
        }
        let nominal_us = run.period_s() * 1e6;
        let live = timings.iter().any(|t| t.deadline_ns > 0);
        let periods = timings.windows(2).filter_map(|pair| period_us(pair[0], pair[1]));
        let period_errors = periods.map(|us| us - nominal_us);
        let stages = run.info.as_ref().map_or(&[][..], |info| info.stages());
        let stage = |(k, name): (usize, &String)| StageTime {
            stage: if name == QP_STAGE { "QP".to_owned() } else { name.clone() },
            us: Distribution::of(timings.iter().filter_map(|t| stage_us(t, k))),
        };
        Some(Self {
            tick_us: Distribution::of(timings.iter().map(|t| tick_us(t))),
            stages: stages.iter().enumerate().map(stage).collect(),
            start_latency_us: Distribution::of(
                timings.iter().map(|t| t.start_ns.saturating_sub(t.wake_ns) as f64 * 1e-3),
            ),
            period_error_us: live.then(|| Distribution::of(period_errors)).flatten(),
            with_deadline: timings.iter().filter(|t| t.deadline_ns > 0).count() as u64,
            missed_deadlines: timings.iter().filter(|t| t.deadline_ns > 0 && t.end_ns > t.deadline_ns).count() as u64,
            left_out: timings.windows(2).map(|pair| skipped(pair[0], pair[1], nominal_us)).sum(),
            longer_than_period: timings.iter().filter(|t| nominal_us > 0.0 && tick_us(t) > nominal_us).count() as u64,
        })
    }
}

impl Qp {
    pub(super) fn of(run: &Run) -> Option<Self> {
        let records: Vec<&Wbc> = run.ticks.iter().filter_map(|tick| tick.wbc.as_ref()).collect();
        if records.is_empty() {
            return None;
        }
        let mut status = QpStatus::default();
        for record in &records {
            *match record.status {
                WbcSolution::STATUS_SOLVED => &mut status.solved,
                WbcSolution::STATUS_ALMOST_SOLVED => &mut status.almost_solved,
                WbcSolution::STATUS_INFEASIBLE => &mut status.infeasible,
                WbcSolution::STATUS_NOT_RUN => &mut status.not_run,
                _ => &mut status.failed,
            } += 1;
        }
        let ran = || records.iter().filter(|r| r.status != WbcSolution::STATUS_NOT_RUN);
        let largest = |size: fn(&Wbc) -> i32| records.iter().map(|r| size(r)).max().unwrap_or(0);
        Some(Self {
            iterations: Distribution::of(ran().map(|r| f64::from(r.iterations))),
            size: [largest(|r| r.n_var), largest(|r| r.n_eq), largest(|r| r.n_ineq)],
            status,
        })
    }
}
