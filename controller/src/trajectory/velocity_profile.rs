//! The fastest change of one coordinate's velocity within limits of acceleration and jerk.

use crate::trajectory::limiter::{Axis, Limits};

/// A motion from a state to a velocity with acceleration 0: phases of constant jerk, then constant velocity.
///
/// An acceleration outside its limit is first reduced to the limit. Then the acceleration rises to a peak, stays there if the peak is the limit,
/// and falls to 0. Each phase has the full jerk, so no motion within the limits is faster.
#[derive(Clone, Copy, Debug)]
pub(super) struct VelocityProfile {
    start: Axis,
    /// Duration, s, and jerk of each phase.
    phases: [(f64, f64); 4],
    /// Velocity after the last phase.
    v_end: f64,
}

impl VelocityProfile {
    /// The motion from `start` to the velocity `v_end`.
    ///
    /// With the velocity `Δv` to be gained in the direction of the peak `a_p`, and `a` the present acceleration in that direction:
    ///
    /// ```text
    /// a_p = min(a_max, √(j Δv + a²/2)),   t = [ (a_p - a)/j ; (Δv - (2 a_p² - a²)/(2 j))/a_p ; a_p/j ]
    /// ```
    /// - `limits`: jerk finite.
    pub fn new(start: Axis, v_end: f64, limits: &Limits) -> Self {
        let (a_max, j) = (limits.a, limits.j);
        let reduce = (-j.copysign(start.a), (start.a.abs() - a_max).max(0.0) / j);
        let Axis { v, a, .. } = start.after(reduce.0, reduce.1);
        let v_at_zero_acceleration = v + 0.5 * a * a.abs() / j;
        let sign = if v_end < v_at_zero_acceleration { -1.0 } else { 1.0 };
        let (gain, a) = (sign * (v_end - v), sign * a);
        let unlimited = (j * gain + 0.5 * a * a).max(0.0).sqrt();
        let peak = unlimited.min(a_max);
        let hold = if unlimited > a_max { (gain - (peak * peak - 0.5 * a * a) / j) / peak } else { 0.0 };
        let rise = (peak - a).max(0.0) / j;
        let phases = [(reduce.1, reduce.0), (rise, sign * j), (hold.max(0.0), 0.0), (peak / j, -sign * j)];
        VelocityProfile { start, phases, v_end }
    }

    /// Time until the velocity is reached, s.
    pub fn duration(&self) -> f64 {
        self.phases[0].0 + self.phases[1].0 + self.phases[2].0 + self.phases[3].0
    }

    /// The state after the time `t`, s.
    pub fn at(&self, t: f64) -> Axis {
        let (mut state, mut left) = (self.start, t);
        for (duration, jerk) in self.phases {
            if left < duration {
                return state.after(jerk, left);
            }
            state = state.after(jerk, duration);
            left -= duration;
        }
        Axis { p: state.p + self.v_end * left, v: self.v_end, a: 0.0 }
    }

    /// Position at which the velocity is reached.
    pub fn p_end(&self) -> f64 {
        self.phases.iter().fold(self.start, |state, (duration, jerk)| state.after(*jerk, *duration)).p
    }
}
