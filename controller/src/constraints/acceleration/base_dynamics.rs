//! Dynamics of the floating base: the rows of the equations of motion in which no torque acts.
//!
//! ```text
//! M_u vd - J_uᵀ F = -h_u          u: rows of the base
//! ```
//! Source: Raiola et al. 2020, eq. (4). A fixed base has no rows.

use crate::contact::FORCE_UNIT;
use crate::stack::{Constraint, ConstraintRows, ModelState, Size, Structure};

const NAMES: [&str; 6] = ["force x", "force y", "force z", "moment x", "moment y", "moment z"];

/// The constraint.
pub struct BaseDynamics {
    n_base: usize,
    n: usize,
}

impl BaseDynamics {
    /// For a robot and its contacts.
    pub fn new(of: &Structure<'_>) -> Self {
        BaseDynamics { n_base: of.model.nv_base(), n: of.variables.forces().end }
    }
}

impl Constraint for BaseDynamics {
    fn size(&self) -> Size {
        Size { equalities: self.n_base, inequalities: 0 }
    }

    fn pattern(&self, rows: &mut ConstraintRows<'_>) {
        rows.qp.A.view_mut((rows.equality, 0), (self.n_base, self.n)).fill(1.0);
    }

    fn update(&mut self, state: &ModelState<'_>, rows: &mut ConstraintRows<'_>) {
        let (qp, first) = (&mut *rows.qp, rows.equality);
        for row in 0..self.n_base {
            for col in state.variables.motion() {
                qp.A[(first + row, col)] = state.M[(row, col)];
            }
            for (contact, (at, load)) in state.at.iter().zip(state.loads).enumerate() {
                for (k, col) in state.variables.force(contact).enumerate() {
                    let there = if load.active { at.J[(k, row)] } else { 0.0 };
                    qp.A[(first + row, col)] = -there * FORCE_UNIT;
                }
            }
            qp.b[first + row] = -state.h[row];
        }
    }

    fn names(&self) -> [Vec<String>; 2] {
        let names = NAMES[..self.n_base].iter().map(|row| format!("base dynamics, {row}"));
        [names.collect(), Vec::new()]
    }
}
