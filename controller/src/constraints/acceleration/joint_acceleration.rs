//! Bounds of the joint accelerations, `|qdd| ≤ limit`. Source: Raiola et al. 2020, eq. (11).

use crate::stack::{Constraint, ConstraintRows, ModelState, Size, Structure};
use std::ops::Range;

/// The constraint.
pub struct JointAcceleration {
    joints: Range<usize>,
    limit: f64,
}

impl JointAcceleration {
    /// For all joints.
    ///
    /// - `limit`: largest acceleration, rad/s² or m/s².
    pub fn new(of: &Structure<'_>, limit: f64) -> Self {
        JointAcceleration { joints: of.model.nv_base()..of.model.nv(), limit }
    }

    fn bound(&self, rows: &mut ConstraintRows<'_>, limit: f64) {
        for j in self.joints.clone() {
            rows.qp.lower[j] = -limit;
            rows.qp.upper[j] = limit;
        }
    }
}

impl Constraint for JointAcceleration {
    fn size(&self) -> Size {
        Size::default()
    }

    fn pattern(&self, rows: &mut ConstraintRows<'_>) {
        self.bound(rows, 1.0);
    }

    fn update(&mut self, _state: &ModelState<'_>, rows: &mut ConstraintRows<'_>) {
        self.bound(rows, self.limit);
    }

    fn names(&self) -> [Vec<String>; 2] {
        [Vec::new(), Vec::new()]
    }
}
