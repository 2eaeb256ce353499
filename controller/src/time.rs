//! Times of a tick.

/// Number of ticks from one state snapshot to the next.
pub const SNAPSHOT_TICKS: i64 = 1000;

/// Largest time step that references and filters are advanced by, s. A late tick then causes no jump.
const MAX_STEP: f64 = 0.01;

/// Converts nanoseconds to seconds.
pub fn seconds(ns: i64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "differences of clock values, far below 2^53 ns")]
    let seconds = ns as f64 * 1e-9;
    seconds
}

/// Time step from one tick to the next, limited to 0 to 0.01 s.
pub fn step_seconds(now_ns: i64, before_ns: i64) -> f64 {
    seconds(now_ns.saturating_sub(before_ns)).clamp(0.0, MAX_STEP)
}
