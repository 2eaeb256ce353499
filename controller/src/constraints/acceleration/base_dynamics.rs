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
        let (qp, first, n) = (&mut *rows.qp, rows.equality, self.n_base);
        // By columns, which are contiguous.
        for col in state.variables.motion() {
            qp.A.column_mut(col).as_mut_slice()[first..first + n].copy_from_slice(&state.M.column(col).as_slice()[..n]);
        }
        for (contact, (at, load)) in state.at.iter().zip(state.loads).enumerate() {
            for (k, col) in state.variables.force(contact).enumerate() {
                let mut column = qp.A.column_mut(col);
                let column = &mut column.as_mut_slice()[first..first + n];
                // -0.0 as the product with a force unit of a Jacobian that is 0.
                column.fill(-0.0);
                if load.active {
                    column.iter_mut().enumerate().for_each(|(row, entry)| *entry = -at.J[(k, row)] * FORCE_UNIT);
                }
            }
        }
        for row in 0..n {
            qp.b[first + row] = -state.h[row];
        }
    }

    fn names(&self) -> [Vec<String>; 2] {
        let names = NAMES[..self.n_base].iter().map(|row| format!("base dynamics, {row}"));
        [names.collect(), Vec::new()]
    }
}
