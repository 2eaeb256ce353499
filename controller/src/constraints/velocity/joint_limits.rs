//! Limits of joint positions and velocities as one bound of each joint velocity.
//!
//! ```text
//! max(-qd_max, (q_min - q)/dt) ≤ qd ≤ min(qd_max, (q_max - q)/dt)
//! ```
//! Outside its limits a joint returns at `qd_max`: the interval would be empty. Source: Laurenzi 2020, section 5.2.

use crate::stack::{Constraint, ConstraintRows, ModelState, Size, Structure};
use std::ops::Range;

/// The constraint.
pub struct JointLimits {
    joints: Range<usize>,
    dt: f64,
}

impl JointLimits {
    /// For all joints.
    ///
    /// - `dt`: time for which a velocity is applied, s; positive.
    pub fn new(of: &Structure<'_>, dt: f64) -> Self {
        JointLimits { joints: of.model.nv_base()..of.model.nv(), dt }
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
            let most = joint.velocity;
            let (down, up) = ((joint.lower - state.q[j]) / self.dt, (joint.upper - state.q[j]) / self.dt);
            // Each limit of the position is clamped to the reachable velocities, so the lower bound never exceeds the upper one.
            (rows.qp.lower[i], rows.qp.upper[i]) = (down.max(-most).min(most), up.min(most).max(-most));
        }
    }

    fn names(&self) -> [Vec<String>; 2] {
        [Vec::new(), Vec::new()]
    }
}
