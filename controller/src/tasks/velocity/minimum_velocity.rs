//! No motion, `v = 0`: on the last level, or with a small weight, what other tasks leave free does not move.

use crate::stack::{ModelState, Rows, Structure, Task};

/// The task: one row for each generalized velocity, m/s and rad/s.
pub struct MinimumVelocity {
    nv: usize,
}

impl MinimumVelocity {
    /// For the base and all joints.
    pub fn new(of: &Structure<'_>) -> Self {
        MinimumVelocity { nv: of.model.nv() }
    }
}

impl Task for MinimumVelocity {
    type Reference = ();

    fn size(&self) -> usize {
        self.nv
    }

    fn rows(&self) -> Rows {
        Rows::selection(self.nv, 0..self.nv)
    }

    fn update(&mut self, _state: &ModelState<'_>, _reference: &(), rows: &mut Rows) {
        rows.b.fill(0.0);
    }
}
