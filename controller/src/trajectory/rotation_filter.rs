//! The rotation of a [`MovingPose`]: one step towards an orientation or an angular velocity.
//!
//! The rotation from the present orientation to the target has an axis `e` and an angle from 0 to π. The motion about `e` is that of one coordinate
//! whose goal is the angle; the angular velocity perpendicular to `e`, which only a change of the target causes, is brought to 0. From rest the
//! axis is therefore constant, for every angle up to π. The limits hold for the lengths of the vectors: the motion about `e` gets what the
//! perpendicular motion leaves. With limited jerk both change inside a step, so after a change of the target the lengths of velocity and
//! acceleration may exceed their limits for some steps, by at most 20 % in 10⁴ random motions; from rest to a target they never do.

use crate::math::norm;
use crate::math::quaternion::{conjugate, from_rotation_vector, normalized, product, to_rotation_vector};
use crate::trajectory::limiter::{Axis, Limits};
use crate::trajectory::pose_filter::MovingPose;
use nalgebra::Vector3;

/// Part of acceleration and jerk for each of the two perpendicular directions. With both in use, √(1 - 2 · 0.6²) = 0.53 is left for the axis.
const PERPENDICULAR: f64 = 0.6;
/// Smallest part of a limit that is left for the axis while the state is outside the limits.
const SMALLEST: f64 = 0.1;
/// A vector that is shorter has no direction of its own, rad, rad/s or rad/s².
const SHORTEST: f64 = 1e-12;

impl MovingPose {
    /// Rotation vector from the present orientation to `q`, rad.
    pub(super) fn rotation_to(&self, q: [f64; 4]) -> Vector3<f64> {
        Vector3::from(to_rotation_vector(product(q, conjugate(self.q))))
    }

    /// A step towards the orientation `q`, at which the motion ends at rest.
    pub(super) fn rotate_to(&mut self, q: [f64; 4], limits: &Limits, dt: f64) {
        let way = self.rotation_to(q);
        let angle = norm(&way);
        let axis = direction(&[way, self.w, self.al]);
        let motion =
            self.rotate_about(axis, Vector3::zeros(), limits, dt, |about, limits| about.step_to(angle, limits, dt));
        if motion[0].p == angle && motion.iter().all(|about| about.v == 0.0) {
            self.q = q;
        }
    }

    /// A step towards the angular velocity `w`, reduced to the limit.
    pub(super) fn rotate_at(&mut self, w: Vector3<f64>, limits: &Limits, dt: f64) {
        let length = norm(&w);
        let w = if length > limits.v { w * (limits.v / length) } else { w };
        let axis = direction(&[w - self.w, self.al]);
        self.rotate_about(axis, w, limits, dt, |about, limits| about.step_to_velocity(0.0, limits, dt));
    }

    /// One step, with angular velocities relative to `w_0`: about `e` as `along` computes it from its state and limits, and towards velocity 0 about the
    /// two axes perpendicular to `e`. Returns the new states about the three axes.
    fn rotate_about(
        &mut self,
        e: Vector3<f64>,
        w_0: Vector3<f64>,
        limits: &Limits,
        dt: f64,
        along: impl FnOnce(Axis, &Limits) -> Axis,
    ) -> [Axis; 3] {
        let w = self.w - w_0;
        let perpendicular = |x: &Vector3<f64>| x - e * e.dot(x);
        let n = match [perpendicular(&w), perpendicular(&self.al)].into_iter().find(|x| norm(x) > SHORTEST) {
            // Twice: of a short vector, rounding leaves a part along `e`.
            Some(x) => unit(&perpendicular(&unit(&x))),
            None => any_perpendicular(&e),
        };
        let directions = [e, n, e.cross(&n)];
        let now = directions.map(|d| Axis { p: 0.0, v: d.dot(&w), a: d.dot(&self.al) });
        let share = Limits { v: f64::INFINITY, a: PERPENDICULAR * limits.a, j: PERPENDICULAR * limits.j };
        let [one, two] = [now[1], now[2]].map(|about| about.step_to_velocity(0.0, &share, dt));
        let larger = |of: fn(&Axis) -> f64| {
            let length = |one: &Axis, two: &Axis| of(one) * of(one) + of(two) * of(two);
            length(&now[1], &now[2]).max(length(&one, &two)).sqrt()
        };
        let rate = |now: &Axis, next: &Axis| (next.a - now.a) / dt;
        let (j_one, j_two) = (rate(&now[1], &one), rate(&now[2], &two));
        // With infinite jerk, the present acceleration does not bind the next one.
        let a = if limits.j.is_finite() { larger(|axis| axis.a) } else { (one.a * one.a + two.a * two.a).sqrt() };
        let left = Limits {
            v: remaining(limits.v, larger(|axis| axis.v)),
            a: remaining(limits.a, a),
            j: remaining(limits.j, (j_one * j_one + j_two * j_two).sqrt()),
        };
        let next = [along(now[0], &left), one, two];
        let sum = |of: fn(&Axis) -> f64| {
            directions[0] * of(&next[0]) + directions[1] * of(&next[1]) + directions[2] * of(&next[2])
        };
        let way = w_0 * dt + sum(|axis| axis.p);
        self.q = normalized(product(from_rotation_vector(way.into()), self.q));
        self.w = w_0 + sum(|axis| axis.v);
        self.al = sum(|axis| axis.a);
        next
    }
}

/// Largest component along an axis with which the length of a vector is within its limit.
///
/// - `used`: length of the component perpendicular to the axis.
fn remaining(limit: f64, used: f64) -> f64 {
    if limit.is_infinite() {
        return limit;
    }
    (limit * limit - used * used).max(SMALLEST * SMALLEST * limit * limit).sqrt()
}

/// Direction of the first vector that is long enough to have one, or x.
fn direction(vectors: &[Vector3<f64>]) -> Vector3<f64> {
    vectors.iter().find(|x| norm(x) > SHORTEST).map_or_else(Vector3::x, unit)
}

/// A unit vector perpendicular to `e`.
fn any_perpendicular(e: &Vector3<f64>) -> Vector3<f64> {
    let smallest = (1..3).fold(0, |best, i| if e[i].abs() < e[best].abs() { i } else { best });
    let mut axis = Vector3::zeros();
    axis[smallest] = 1.0;
    unit(&e.cross(&axis))
}

fn unit(x: &Vector3<f64>) -> Vector3<f64> {
    x / norm(x)
}
