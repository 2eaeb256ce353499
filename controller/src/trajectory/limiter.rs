//! On-line trajectory generator of one coordinate: the next state towards a target within limits of velocity, acceleration and jerk.
//!
//! The crate rsruckig 3.0 is not used. It calls `cbrt`, `acos`, `sin` and `cos` of the system's libm as soon as any crate of the build enables
//! `num-traits/std`, and it keeps a plan with heap memory that no snapshot can contain. Its time-optimal durations are what the tests expect.
//!
//! # Method
//!
//! With limited jerk, a motion to a goal is a motion towards the largest velocity, and then the fastest stop. Both are a
//! velocity profile, a function of the state alone. A step follows the first until the stop would end at the goal, and the second from then on; the
//! time of the change inside the step is a root of the position at which the stop ends. So jerk, acceleration and velocity are limited at all
//! times, not at ticks only, and a motion that starts at rest neither overshoots nor takes longer than necessary.
//!
//! A goal that lies before the end of the stop is passed: the motion turns after it. Limits that are lowered during the motion are reached again with the
//! full jerk and acceleration.
//!
//! - Infinite jerk: [`approach`]; the acceleration is constant during a step, and `a` is its value.
//! - Infinite jerk and acceleration: the velocity is constant during a step, `v` is its value, and `a` is 0.
//! - No limits: [`Axis::follow`] takes the target with its own velocity, so a jump of the target is no velocity of the reference.

use crate::trajectory::approach::approach;
use crate::trajectory::error::ReferenceError;
use crate::trajectory::velocity_profile::VelocityProfile;

/// Positions that differ by less are equal, m or rad.
const RESOLUTION: f64 = 1e-12;
/// Largest number of iterations for the time at which a stop begins.
const MAX_ITERATIONS: usize = 60;
/// Relative tolerance with which a moving target may exceed the limits and is still followed: rounding, not more.
const ROUNDING: f64 = 1e-9;

/// Limits of one coordinate, in m or rad and s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest absolute velocity, or infinity.
    pub v: f64,
    /// Largest absolute acceleration, or infinity.
    pub a: f64,
    /// Largest absolute jerk, or infinity.
    pub j: f64,
}

impl Limits {
    /// No limits.
    pub const NONE: Limits = Limits { v: f64::INFINITY, a: f64::INFINITY, j: f64::INFINITY };

    /// Checks the limits.
    ///
    /// # Errors
    /// [`ReferenceError::Limit`] if a limit is NaN, zero or negative.
    pub fn check(&self) -> Result<(), ReferenceError> {
        let Limits { v, a, j } = *self;
        let error = |name, found| Err(ReferenceError::Limit { name, found });
        match (v > 0.0, a > 0.0, j > 0.0) {
            (false, ..) => error("velocity", v),
            (_, false, _) => error("acceleration", a),
            (.., false) => error("jerk", j),
            _ => Ok(()),
        }
    }
}

/// State of one coordinate, in m or rad and s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Axis {
    /// Position.
    pub p: f64,
    /// Velocity.
    pub v: f64,
    /// Acceleration.
    pub a: f64,
}

impl Axis {
    /// At rest in a position.
    pub fn at_rest(p: f64) -> Self {
        Axis { p, v: 0.0, a: 0.0 }
    }

    /// The state after the time `t`, s, with constant jerk `j`.
    pub(super) fn after(self, j: f64, t: f64) -> Axis {
        let Axis { p, v, a } = self;
        if t == 0.0 {
            return self;
        }
        Axis { p: p + t * (v + t * (0.5 * a + t * j / 6.0)), v: v + t * (a + 0.5 * t * j), a: a + t * j }
    }

    /// The state after a step towards a goal, at which the motion ends at rest.
    ///
    /// - `goal`: finite.
    /// - `limits`: checked by [`Limits::check`].
    /// - `dt`: duration of the step, s; nothing changes if it is 0.
    ///
    /// The goal is reached exactly: `p == goal`, `v == 0`.
    #[must_use]
    pub fn step_to(self, goal: f64, limits: &Limits, dt: f64) -> Axis {
        if dt <= 0.0 {
            return self;
        }
        if limits.j.is_finite() {
            return self.step_to_with_jerk(goal, limits, dt);
        }
        if limits.a.is_finite() {
            let (p, v) = approach((self.p, self.v), goal, limits.v, limits.a, dt);
            return Axis { p, v, a: (v - self.v) / dt };
        }
        let (left, reach) = (goal - self.p, limits.v * dt);
        if left.abs() <= reach {
            // The velocity of this step; the next one is at rest.
            return Axis { p: goal, v: left / dt, a: 0.0 };
        }
        let v = limits.v.copysign(left);
        Axis { p: self.p + v * dt, v, a: 0.0 }
    }

    /// The state after a step towards a velocity.
    ///
    /// - `v_target`: finite; limited to `limits.v`.
    /// - `dt`: duration of the step, s; nothing changes if it is 0.
    #[must_use]
    pub fn step_to_velocity(self, v_target: f64, limits: &Limits, dt: f64) -> Axis {
        if dt <= 0.0 {
            return self;
        }
        let v_target = v_target.clamp(-limits.v, limits.v);
        if limits.j.is_finite() {
            return VelocityProfile::new(self, v_target, limits).at(dt);
        }
        if limits.a.is_finite() {
            let v = v_target.clamp(self.v - limits.a * dt, self.v + limits.a * dt);
            return Axis { p: self.p + 0.5 * (self.v + v) * dt, v, a: (v - self.v) / dt };
        }
        Axis { p: self.p + v_target * dt, v: v_target, a: 0.0 }
    }

    /// The state after a step with a moving target: the target itself if the limits allow it, else a step towards the target's position.
    ///
    /// - `target`: where the target is at the end of the step.
    #[must_use]
    pub fn follow(self, target: &Axis, limits: &Limits, dt: f64) -> Axis {
        let ahead = Axis { p: target.p - self.p, ..*target };
        let offset = Axis { p: 0.0, ..self };
        if dt > 0.0 && reachable(&[offset], &[ahead], limits, dt) {
            *target
        } else {
            self.step_to(target.p, limits, dt)
        }
    }

    /// [`Axis::step_to`] with finite jerk.
    fn step_to_with_jerk(self, goal: f64, limits: &Limits, dt: f64) -> Axis {
        let stop_from = |state: Axis| VelocityProfile::new(state, 0.0, limits);
        let left = goal - stop_from(self).p_end();
        let sign = if left < 0.0 { -1.0 } else { 1.0 };
        let towards = VelocityProfile::new(self, sign * limits.v, limits);
        // How far a stop that begins at `t` ends beyond the goal.
        let beyond = |t: f64| sign * (stop_from(towards.at(t)).p_end() - goal);
        let begin = if left.abs() <= RESOLUTION { 0.0 } else { time_of_zero(beyond, -left.abs(), dt) };
        let stop = stop_from(towards.at(begin));
        if begin < dt && stop.duration() <= dt - begin {
            return Axis::at_rest(goal);
        }
        stop.at(dt - begin)
    }
}

/// Whether the state `to` can be reached from `from` in a step within the limits. The coordinates are those of a vector; its length is limited.
///
/// With the velocities at both ends given, the position can differ from that of constant acceleration by up to `a dt² / 4`. The same holds for
/// the velocity, with the jerk; the position can then differ from that of constant jerk by about `j dt³ / 8`. With limited jerk the velocity goes on to `v + a |a| / (2 j)`, which must be within the limit, too.
pub(super) fn reachable<const N: usize>(from: &[Axis; N], to: &[Axis; N], limits: &Limits, dt: f64) -> bool {
    let length = |of: &dyn Fn(&Axis, &Axis) -> f64| {
        from.iter().zip(to).fold(0.0, |sum, (from, to)| sum + of(from, to) * of(from, to)).sqrt()
    };
    let within = |x: f64, limit: f64| x <= limit * (1.0 + ROUNDING);
    let Limits { v, a, j } = *limits;
    let a_end = length(&|_, to| to.a);
    within(length(&|_, to| to.v), v)
        && within(length(&|from, to| to.p - from.p), v * dt)
        && (a.is_infinite()
            || within(length(&|from, to| to.v - from.v), a * dt)
                && within(length(&|from, to| to.p - from.p - 0.5 * (from.v + to.v) * dt), 0.25 * a * dt * dt))
        && (j.is_infinite()
            || within(a_end, a)
                && within(length(&|_, to| to.v + to.a * a_end / (2.0 * j)), v)
                && within(length(&|from, to| to.a - from.a), j * dt)
                && within(length(&|from, to| to.v - from.v - 0.5 * (from.a + to.a) * dt), 0.25 * j * dt * dt)
                && within(
                    length(&|from, to| to.p - from.p - dt * (from.v + dt * (2.0 * from.a + to.a) / 6.0)),
                    0.125 * j * dt * dt * dt,
                ))
}

/// The zero of an increasing function between 0 and `end`, or `end` if the function is not positive there.
///
/// - `at_0`: value at 0, negative.
///
/// Regula falsi; the value at an end that stays is halved (the Illinois method), so the convergence is superlinear.
fn time_of_zero(f: impl Fn(f64) -> f64, at_0: f64, end: f64) -> f64 {
    let (mut low, mut f_low, mut high, mut f_high) = (0.0, at_0, end, f(end));
    if f_high <= 0.0 {
        return end;
    }
    let mut last = 0.0;
    for _ in 0..MAX_ITERATIONS {
        let t = low + (high - low) * (f_low / (f_low - f_high));
        let value = f(t);
        if value.abs() <= 0.5 * RESOLUTION {
            return t;
        }
        if value < 0.0 {
            (low, f_low) = (t, value);
            f_high *= if last < 0.0 { 0.5 } else { 1.0 };
        } else {
            (high, f_high) = (t, value);
            f_low *= if last > 0.0 { 0.5 } else { 1.0 };
        }
        last = value;
    }
    low
}
