//! References of tasks: limits, arrival, way-points, modes, snapshots. Motions are random, with a seed.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod limiter;
mod pose;
mod task;
mod waypoints;

use controller::math::quaternion::{conjugate, from_rotation_vector, product, to_rotation_vector};
use controller::math::{Rng, norm};
use controller::trajectory::{Limits, MovingPose, PoseGoal, PoseLimits};
use nalgebra::{Vector3, Vector6};
use std::f64::consts::PI;

/// Random motions per property.
pub const MOTIONS: usize = 10_000;
pub const INFINITY: f64 = f64::INFINITY;
pub const DT: f64 = 5e-3;
/// Limits of acceleration, without limits of jerk.
pub const LIMITS: PoseLimits =
    PoseLimits { linear: Limits { v: 0.5, a: 2.0, j: INFINITY }, angular: Limits { v: 1.0, a: 4.0, j: INFINITY } };

pub fn vector(rng: &mut Rng, size: f64) -> [f64; 3] {
    [(); 3].map(|()| rng.uniform(-size, size))
}

/// Any pose within 1 m, with a rotation up to π.
pub fn pose(rng: &mut Rng) -> PoseGoal {
    let (axis, angle) = (Vector3::from(vector(rng, 1.0)), rng.uniform(0.0, PI));
    let p = vector(rng, 1.0);
    PoseGoal { p, q: from_rotation_vector((axis * (angle / norm(&axis))).into()) }
}

pub fn limits(rng: &mut Rng, kind: usize) -> PoseLimits {
    let mut of = || {
        let [v, a, j] =
            [(-1.0, 0.5), (-0.3, 1.3), (0.5, 2.5)].map(|(low, high)| libm::pow(10.0, rng.uniform(low, high)));
        [Limits { v, a, j: INFINITY }, Limits { v, a, j }, Limits { v, a: INFINITY, j: INFINITY }][kind % 3]
    };
    PoseLimits { linear: of(), angular: of() }
}

pub fn twist(rng: &mut Rng, size: f64) -> Vector6<f64> {
    let ([a, b, c], [d, e, f]) = (vector(rng, size), vector(rng, size));
    Vector6::new(a, b, c, d, e, f)
}

/// Rotation vector from one orientation to another.
pub fn turn(from: &MovingPose, to: &MovingPose) -> Vector3<f64> {
    Vector3::from(to_rotation_vector(product(to.q, conjugate(from.q))))
}

/// Whether a step is within the limits. A state outside of them must not move further outside.
pub fn check_step(from: &MovingPose, to: &MovingPose, limits: &PoseLimits, dt: f64) {
    // Angular velocity and acceleration may exceed their limits by this part with limited jerk, while the axis of the motion changes.
    let excess = if limits.angular.j.is_finite() { 0.2 } else { 1e-9 };
    let within = |x: f64, limit: f64, tolerance: f64| {
        assert!(x <= limit * (1.0 + tolerance) + 1e-14, "{x} beyond {limit}: {from:?} {to:?} {limits:?} {dt}");
    };
    for (from, to) in from.axes.iter().zip(&to.axes) {
        let v = limits.linear.v.max(from.v.abs());
        within((to.p - from.p).abs(), v * dt, 1e-12 + 1e-15 / (v * dt));
        within(to.v.abs(), v, 1e-12);
        within((to.v - from.v).abs(), limits.linear.a * dt, 1e-9);
        if limits.linear.j.is_finite() {
            within((to.a - from.a).abs(), limits.linear.j * dt, 1e-9);
        }
    }
    let w = limits.angular.v.max(norm(&from.w));
    within(norm(&turn(from, to)), w * dt, excess);
    within(norm(&to.w), w, excess);
    within(norm(&(to.w - from.w)), limits.angular.a * dt, excess);
    if limits.angular.j.is_finite() {
        within(norm(&(to.al - from.al)), limits.angular.j * dt, 1e-9);
    }
}

pub fn at(motion: &MovingPose, goal: &PoseGoal) -> bool {
    motion.goal() == *goal && motion.twist() == Vector6::zeros()
}
