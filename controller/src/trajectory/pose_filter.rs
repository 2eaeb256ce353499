//! A pose that moves towards a target within limits: each translation axis for itself, and the rotation about the axis to the target.
//!
//! Everything is in the axes of the frame in which the pose is expressed, the base link of a task: `p_bd`, `R_bd`, velocity of the origin of d relative
//! to b, angular velocity of d relative to b.

use crate::math::quaternion::{from_rotation, normalized, to_rotation};
use crate::model::Pose;
use crate::trajectory::error::{ReferenceError, ValueError, check_finite};
use crate::trajectory::limiter::{Axis, Limits, reachable};
use nalgebra::{Vector3, Vector6};

/// Largest difference of a quaternion's length from 1.
pub const UNIT_TOLERANCE: f64 = 1e-6;

/// Limits of a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseLimits {
    /// Of each translation axis, in m and s.
    pub linear: Limits,
    /// Of the rotation, in rad and s: the lengths of the vectors of velocity, acceleration and jerk.
    pub angular: Limits,
}

impl PoseLimits {
    /// Checks the limits.
    ///
    /// # Errors
    /// [`ReferenceError::Limit`], as [`Limits::check`].
    pub fn check(&self) -> Result<(), ReferenceError> {
        self.linear.check()?;
        self.angular.check()
    }
}

/// A pose of a reference: a goal, a way-point, a start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseGoal {
    /// Position, m.
    pub p: [f64; 3],
    /// Orientation: unit quaternion `[w, x, y, z]`.
    pub q: [f64; 4],
}

impl PoseGoal {
    /// The pose of a frame in itself.
    pub const IDENTITY: PoseGoal = PoseGoal { p: [0.0; 3], q: [1.0, 0.0, 0.0, 0.0] };

    /// The pose with its quaternion normalized.
    ///
    /// # Errors
    /// [`ValueError::NotFinite`]; [`ValueError::NotUnit`] if the length of the quaternion is not 1 within [`UNIT_TOLERANCE`].
    pub fn checked(&self) -> Result<Self, ValueError> {
        check_finite("position", &self.p)?;
        check_finite("orientation", &self.q)?;
        let [w, x, y, z] = self.q;
        let found = (w * w + x * x + y * y + z * z).sqrt();
        if (found - 1.0).abs() > UNIT_TOLERANCE {
            return Err(ValueError::NotUnit { found, tolerance: UNIT_TOLERANCE });
        }
        Ok(PoseGoal { p: self.p, q: normalized(self.q) })
    }

    /// From a pose whose numbers are finite.
    pub fn of(pose: &Pose) -> Self {
        PoseGoal { p: pose.p.into(), q: from_rotation(&pose.R) }
    }
}

/// A pose with its velocity and acceleration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingPose {
    /// The three translation axes.
    pub axes: [Axis; 3],
    /// Orientation: unit quaternion `[w, x, y, z]`.
    pub q: [f64; 4],
    /// Angular velocity, rad/s.
    pub w: Vector3<f64>,
    /// Angular acceleration, rad/s².
    pub al: Vector3<f64>,
}

impl MovingPose {
    /// At rest in a pose.
    pub fn at_rest(goal: &PoseGoal) -> Self {
        MovingPose { axes: goal.p.map(Axis::at_rest), q: goal.q, w: Vector3::zeros(), al: Vector3::zeros() }
    }

    /// The pose.
    pub fn pose(&self) -> Pose {
        Pose { p: Vector3::from(self.axes.map(|axis| axis.p)), R: to_rotation(self.q) }
    }

    /// The pose without its motion.
    pub fn goal(&self) -> PoseGoal {
        PoseGoal { p: self.axes.map(|axis| axis.p), q: self.q }
    }

    /// Linear velocity, m/s, then angular velocity, rad/s.
    pub fn twist(&self) -> Vector6<f64> {
        let [x, y, z] = self.axes.map(|axis| axis.v);
        Vector6::new(x, y, z, self.w.x, self.w.y, self.w.z)
    }

    /// A step towards a target. Axes whose target is within reach take it, so a target within the limits is followed exactly.
    ///
    /// - `target`: where the target is at the end of the step, with its velocity and acceleration.
    /// - `limits`: checked.
    /// - `dt`: duration of the step, s; nothing changes if it is 0.
    pub fn follow(&mut self, target: &MovingPose, limits: &PoseLimits, dt: f64) {
        if dt <= 0.0 {
            return;
        }
        for (axis, target) in self.axes.iter_mut().zip(&target.axes) {
            *axis = axis.follow(target, &limits.linear, dt);
        }
        let way = self.rotation_to(target.q);
        let from: [Axis; 3] = std::array::from_fn(|i| Axis { p: 0.0, v: self.w[i], a: self.al[i] });
        let to: [Axis; 3] = std::array::from_fn(|i| Axis { p: way[i], v: target.w[i], a: target.al[i] });
        if reachable(&from, &to, &limits.angular, dt) {
            (self.q, self.w, self.al) = (target.q, target.w, target.al);
        } else {
            self.rotate_to(target.q, &limits.angular, dt);
        }
    }

    /// A step towards a twist.
    ///
    /// - `twist`: finite; linear velocity of each axis and length of the angular velocity are reduced to the limits.
    /// - `limits`, `dt`: as in [`MovingPose::follow`].
    pub fn follow_twist(&mut self, twist: &Vector6<f64>, limits: &PoseLimits, dt: f64) {
        if dt <= 0.0 {
            return;
        }
        for (axis, v) in self.axes.iter_mut().zip(twist.iter()) {
            *axis = axis.step_to_velocity(*v, &limits.linear, dt);
        }
        self.rotate_at(twist.fixed_rows::<3>(3).into_owned(), &limits.angular, dt);
    }
}
