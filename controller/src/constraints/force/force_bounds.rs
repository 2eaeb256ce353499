//! Bounds of the contact forces, along the axes of W. Source: Raiola et al. 2020, eq. (12).
//!
//! A contact that carries no load keeps its variables. Equal lower and upper bounds would leave no interior for an interior-point solver. Therefore
//! the columns of that force are zero except in its own bounds, which are ±`RELEASED`. The regularization then gives F = 0 up to rounding, and the
//! force is read as 0.

use crate::contact::FORCE_UNIT;
use crate::stack::{Constraint, ConstraintRows, ModelState, Size, Structure};
use std::ops::Range;

/// Half width of the bounds on the force of a contact without load, in [`FORCE_UNIT`].
const RELEASED: f64 = 1.0;

/// The constraint.
pub struct ForceBounds {
    forces: Range<usize>,
}

impl ForceBounds {
    /// For all contacts.
    pub fn new(of: &Structure<'_>) -> Self {
        ForceBounds { forces: of.variables.forces() }
    }
}

impl Constraint for ForceBounds {
    fn size(&self) -> Size {
        Size::default()
    }

    fn pattern(&self, rows: &mut ConstraintRows<'_>) {
        for i in self.forces.clone() {
            (rows.qp.lower[i], rows.qp.upper[i]) = (-1.0, 1.0);
        }
    }

    fn update(&mut self, state: &ModelState<'_>, rows: &mut ConstraintRows<'_>) {
        for (contact, load) in state.loads.iter().enumerate() {
            for (k, i) in state.variables.force(contact).enumerate() {
                (rows.qp.lower[i], rows.qp.upper[i]) = if load.active {
                    (load.lower[k] / FORCE_UNIT, load.upper[k] / FORCE_UNIT)
                } else {
                    (-RELEASED, RELEASED)
                };
            }
        }
    }

    fn names(&self) -> [Vec<String>; 2] {
        [Vec::new(), Vec::new()]
    }
}
