//! Times of a tick.

use lcmtypes::RunInfo;

/// Number of base ticks from one state snapshot to the next.
const SNAPSHOT_TICKS: i32 = 1000;

/// Number of ticks of a component from one state snapshot to the next: 1000 base ticks, and at least one tick.
pub fn snapshot_ticks(period_ticks: i32) -> i64 {
    i64::from((SNAPSHOT_TICKS / period_ticks.max(1)).max(1))
}

/// Largest time step that references and filters of a component with a tick in every base tick are advanced by, s. A late tick then causes no jump.
const MAX_STEP: f64 = 0.01;

/// Converts nanoseconds to seconds.
pub fn seconds(ns: i64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "differences of clock values, far below 2^53 ns")]
    let seconds = ns as f64 * 1e-9;
    seconds
}

/// Largest time step of a component: a late tick causes no jump of its references.
#[derive(Clone, Copy, Debug)]
pub struct StepLimit {
    seconds: f64,
}

impl StepLimit {
    /// That of the first component of a run: 0.01 s for one that runs in every base tick, more for slower ones.
    pub fn of(info: &RunInfo) -> Self {
        let period_ticks = info.components.first().map_or(1, |component| component.period_ticks.max(1));
        StepLimit { seconds: MAX_STEP * f64::from(period_ticks) }
    }

    /// Time step from one tick to the next, from 0 to the limit, s.
    pub fn seconds(self, now_ns: i64, before_ns: i64) -> f64 {
        seconds(now_ns.saturating_sub(before_ns)).clamp(0.0, self.seconds)
    }
}

/// Time step of a component that runs in every base tick, limited to 0 to 0.01 s.
pub fn step_seconds(now_ns: i64, before_ns: i64) -> f64 {
    seconds(now_ns.saturating_sub(before_ns)).clamp(0.0, MAX_STEP)
}
