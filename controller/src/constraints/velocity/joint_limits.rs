//! Limits of joint positions, velocities, accelerations and jerks as one bound of each joint velocity.
//!
//! ```text
//! velocity       -qd_max ≤ qd ≤ qd_max
//! acceleration   |qd - qd_before| ≤ a dt
//! position       the joint can stop before its limits with the deceleration a;  outside, it returns
//! jerk           |qd - qd_before - qdd_before dt| ≤ j dt²
//! ```
//! Where they contradict each other, the upper line wins: each line is an interval, and the next interval is clamped into it. So the interval is never empty.
//!
//! A joint that moves by `qd dt` and then loses `a dt` in every step stops after n more steps, with `n a dt < qd ≤ (n + 1) a dt`. It stops within a distance s if
//!
//! ```text
//! qd ≤ s / ((n + 1) dt) + n a dt / 2,    n = floor( (√(1 + 8 s / (a dt²)) - 1) / 2 )
//! ```
//! the discrete form of `qd ≤ √(2 a s)`; without a limit of the acceleration it is `qd ≤ s / dt`. A joint that is inside and obeys it can obey it in the next step, too, so
//! it never leaves its limits. Outside its limits a joint returns at `qd_max`, as fast as the acceleration allows and so that it can stop before the other limit.
//! Source: Laurenzi 2020, section 5.2, for velocity and position; the braking distance is summed over the steps.

use crate::stack::{Constraint, ConstraintRows, ModelState, Size, Structure};
use std::ops::Range;

/// The constraint. [`ModelState::qd`] is the velocity of the last step.
pub struct JointLimits {
    /// Acceleration of each joint in the last step, nj, rad/s² or m/s². Read only with a limit of the jerk; its caller keeps it in its state.
    pub qdd_before: Vec<f64>,
    joints: Range<usize>,
    dt: f64,
    velocity_scale: f64,
    acceleration: f64,
    jerk: f64,
}

/// A joint before a step: distances to its limits, negative outside, and its motion in the last step.
#[derive(Clone, Copy, Debug)]
struct Before {
    to_lower: f64,
    to_upper: f64,
    velocity_max: f64,
    qd: f64,
    qdd: f64,
}

/// Smallest and largest value.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Interval(f64, f64);

impl Interval {
    /// Clamps both ends into `outer`: the intersection, or the nearest end of `outer`.
    fn within(self, outer: Interval) -> Interval {
        let clamp = |x: f64| x.max(outer.0).min(outer.1);
        Interval(clamp(self.0), clamp(self.1))
    }
}

impl JointLimits {
    /// For all joints, without limits of acceleration and jerk.
    ///
    /// - `dt`: time for which a velocity is applied, s; positive.
    pub fn new(of: &Structure<'_>, dt: f64) -> Self {
        JointLimits {
            qdd_before: vec![0.0; of.model.nj()],
            joints: of.model.nv_base()..of.model.nv(),
            dt,
            velocity_scale: 1.0,
            acceleration: f64::INFINITY,
            jerk: f64::INFINITY,
        }
    }

    /// With a fraction of the velocity limits of the model and a limit of the acceleration, rad/s² or m/s²; both positive.
    #[must_use]
    pub fn with(self, velocity_scale: f64, acceleration: f64) -> Self {
        JointLimits { velocity_scale, acceleration, ..self }
    }

    /// With a limit of the jerk, rad/s³ or m/s³; positive.
    #[must_use]
    pub fn with_jerk(self, jerk: f64) -> Self {
        JointLimits { jerk, ..self }
    }

    /// Sets the time for which a velocity is applied, s; positive.
    pub fn set_dt(&mut self, dt: f64) {
        self.dt = dt;
    }

    /// The admissible velocities.
    fn interval(&self, joint: &Before) -> Interval {
        let Before { to_lower, to_upper, velocity_max, qd, qdd } = *joint;
        let change = self.acceleration * self.dt;
        let velocity = Interval(-velocity_max, velocity_max);
        let acceleration = Interval(qd - change, qd + change).within(velocity);
        let (down, up) = (-self.stopping(to_lower), self.stopping(to_upper));
        // Outside one limit, the way back ends before the other one.
        let position =
            Interval(if to_lower < 0.0 { down.min(up) } else { down }, if to_upper < 0.0 { up.max(down) } else { up });
        let (change, expected) = (self.jerk * self.dt * self.dt, qd + qdd * self.dt);
        let mut jerk = Interval(expected - change, expected + change);
        // At a position limit, or braking for it, the end of the deceleration is not limited: otherwise a joint would bounce off its limit again and again.
        if position.0 >= qd - change {
            jerk.0 = jerk.0.min(position.0);
        }
        if position.1 <= qd + change {
            jerk.1 = jerk.1.max(position.1);
        }
        jerk.within(position.within(acceleration))
    }

    /// Largest velocity towards a limit from which a joint stops within a distance; beyond the limit the velocity that returns to it in one step, negative.
    fn stopping(&self, distance: f64) -> f64 {
        let a_dt = self.acceleration * self.dt;
        let steps = (((1.0 + 8.0 * distance.max(0.0) / (a_dt * self.dt)).sqrt() - 1.0) / 2.0).floor();
        if steps > 0.0 && steps < f64::INFINITY {
            distance / ((steps + 1.0) * self.dt) + 0.5 * steps * a_dt
        } else {
            distance / self.dt
        }
    }
}

impl Constraint for JointLimits {
    fn size(&self) -> Size {
        Size::default()
    }

    fn pattern(&self, rows: &mut ConstraintRows<'_>) {
        for i in self.joints.clone() {
            (rows.qp.lower[i], rows.qp.upper[i]) = (-1.0, 1.0);
        }
    }

    fn update(&mut self, state: &ModelState<'_>, rows: &mut ConstraintRows<'_>) {
        for (j, i) in self.joints.clone().enumerate() {
            let joint = &state.model.joints[j];
            let before = Before {
                to_lower: state.q[j] - joint.lower,
                to_upper: joint.upper - state.q[j],
                velocity_max: self.velocity_scale * joint.velocity,
                qd: state.qd[j],
                qdd: self.qdd_before[j],
            };
            Interval(rows.qp.lower[i], rows.qp.upper[i]) = self.interval(&before);
        }
    }

    fn names(&self) -> [Vec<String>; 2] {
        [Vec::new(), Vec::new()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Rng;

    const FREE: f64 = f64::INFINITY;

    fn limits(dt: f64, acceleration: f64, jerk: f64) -> JointLimits {
        JointLimits { qdd_before: vec![], joints: 0..0, dt, velocity_scale: 1.0, acceleration, jerk }
    }

    fn before(to_lower: f64, to_upper: f64, velocity_max: f64, qd: f64) -> Before {
        Before { to_lower, to_upper, velocity_max, qd, qdd: 0.0 }
    }

    fn near(found: Interval, expected: Interval) {
        assert!((found.0 - expected.0).abs() + (found.1 - expected.1).abs() < 1e-12, "{found:?} {expected:?}");
    }

    /// Joints up to 0.2 rad outside their limits, at rest or with any velocity, with wide and narrow limits, that then take the largest, the smallest or a random admissible velocity in every step.
    #[test]
    fn joints_return_and_never_leave_their_limits_again() {
        let mut rng = Rng::new(5, "joint limits");
        let (mut returned, mut at_end) = (0, 0);
        for trial in 0..3000 {
            let dt = rng.uniform(2e-3, 2e-2);
            let mut or_free = |low, high| if rng.uniform(0.0, 1.0) < 0.3 { FREE } else { rng.uniform(low, high) };
            let limits = limits(dt, or_free(2.0, 50.0), or_free(10.0, 1e3));
            let (velocity_max, width) = (rng.uniform(0.5, 5.0), [0.1, 2.0][trial % 2]);
            let (lower, upper) = (-rng.uniform(0.01, width), rng.uniform(0.01, width));
            let mut q = rng.uniform(lower - 0.2, upper + 0.2);
            let starts_at_rest = trial % 4 < 2;
            let (mut v, mut a) = (rng.uniform(-velocity_max, velocity_max), rng.uniform(-10.0, 10.0));
            if starts_at_rest {
                (v, a) = (0.0, 0.0);
            }
            let (mut can_stay, mut time_inside) = (false, 0.0);
            for _ in 0..12_000 {
                let joint = Before { to_lower: q - lower, to_upper: upper - q, velocity_max, qd: v, qdd: a };
                // Inside, and the velocity of the next step can be one from which the joint stops: so it is on the way back from rest.
                let change = limits.acceleration * dt;
                let can_stop =
                    v - change <= limits.stopping(joint.to_upper) && v + change >= -limits.stopping(joint.to_lower);
                can_stay |= joint.to_lower.min(joint.to_upper) >= 0.0 && (can_stop || starts_at_rest);
                let interval = limits.interval(&joint);
                let Interval(low, high) = interval;
                assert!(low <= high, "{interval:?}");
                let next = [high, low, rng.uniform(low, high)][trial % 3];
                assert!(next.abs() * dt <= velocity_max * dt + 1e-9);
                assert!((next - v).abs() <= limits.acceleration * dt * (1.0 + 1e-12) + 1e-15);
                q += next * dt;
                (a, v) = ((next - v) / dt, next);
                let is_inside = q >= lower - 1e-9 && q <= upper + 1e-9;
                assert!(is_inside || !can_stay, "{trial}: at {q} of {lower}..{upper} with {v} rad/s");
                time_inside += if can_stay { dt } else { 0.0 };
                if time_inside > 15.0 {
                    break;
                }
            }
            returned += usize::from(can_stay);
            let end = [upper, lower, q][trial % 3];
            at_end += usize::from((q - end).abs() < 1e-9);
        }
        assert_eq!((returned, at_end), (3000, 3000));
    }

    #[test]
    fn a_joint_brakes_in_whole_steps() {
        let limits = limits(0.1, 1.0, FREE);
        // 0.2, 0.1 and 0 m/s for 0.1 s each are 0.03 m; in continuous time, √(2 a s) = 0.245 m/s would be allowed.
        for (s, velocity) in [(0.03, 0.2), (0.01, 0.1), (0.06, 0.3), (0.005, 0.05), (0.045, 0.25)] {
            assert!((limits.stopping(s) - velocity).abs() < 1e-12, "{s}");
        }
        assert_eq!((limits.stopping(FREE), limits.stopping(-0.2)), (FREE, -2.0));
    }

    /// Intervals by hand, dt 0.01 s, 10 rad/s²: a change of at most 0.1 rad/s.
    #[test]
    fn velocity_goes_before_acceleration_and_acceleration_before_position() {
        let limits = limits(0.01, 10.0, FREE);
        // Faster than allowed: the limit at once.
        near(limits.interval(&before(9.0, 9.0, 1.0, 3.0)), Interval(1.0, 1.0));
        // 1 mrad from the limit at 1 rad/s: it cannot stop and brakes as fast as possible.
        near(limits.interval(&before(9.0, 0.001, 1.0, 1.0)), Interval(0.9, 0.9));
        // Outside at rest: it returns with the largest change; already on the way at the velocity limit, it keeps that.
        near(limits.interval(&before(9.0, -0.1, 1.0, 0.0)), Interval(-0.1, -0.1));
        near(limits.interval(&before(-0.1, 9.0, 1.0, 1.0)), Interval(1.0, 1.0));
        // Outside of a narrow range: it returns at the velocity from which it stops before the other limit.
        assert!((limits.stopping(0.003) - 0.2).abs() < 1e-12);
        near(limits.interval(&before(0.003, -0.01, 1.0, -0.25)), Interval(-0.2, -0.2));
        near(limits.interval(&before(-0.01, 0.003, 1.0, 0.25)), Interval(0.2, 0.2));
    }

    /// The limit of the jerk, 100 rad/s³ for 0.01 s: a change of the acceleration by 1 rad/s², and of the velocity by 0.01 rad/s. Position goes before it.
    #[test]
    fn the_jerk_comes_last() {
        let limits = limits(0.01, 10.0, 100.0);
        near(limits.interval(&before(9.0, 9.0, 1.0, 0.5)), Interval(0.49, 0.51));
        let accelerating = Before { qdd: 5.0, ..before(9.0, 9.0, 1.0, 0.5) };
        near(limits.interval(&accelerating), Interval(0.54, 0.56));
        let near_limit = limits.interval(&Before { qdd: 5.0, ..before(9.0, 0.001, 1.0, 0.1) });
        near(near_limit, Interval(0.1, 0.1));
    }

    #[test]
    fn a_joint_without_limits_is_free() {
        near(limits(0.01, FREE, FREE).interval(&before(FREE, FREE, 2.0, 0.0)), Interval(-2.0, 2.0));
        assert_eq!(limits(0.01, FREE, FREE).interval(&before(FREE, FREE, FREE, 0.0)), Interval(-FREE, FREE));
    }
}
