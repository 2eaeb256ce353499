//! Admissible forces of each contact, `a·F ≤ 0`: friction, and for a sole centre of pressure and yaw moment.
//!
//! The rows are those of [`ContactModel::friction`](crate::contact::ContactModel::friction). The least normal force of the load is the right side of
//! the first row, so that the normal force is positive on slopes too. The rows of a contact without load are zero with the right side 1.

use crate::contact::{Contact, FORCE_UNIT};
use crate::stack::{Constraint, ConstraintRows, ModelState, Size, Structure};
use std::ops::Range;

struct OfContact {
    name: String,
    rows: Range<usize>,
    columns: Range<usize>,
    names: &'static [&'static str],
}

/// The constraint.
pub struct Friction {
    contacts: Vec<OfContact>,
    c: f64,
}

impl Friction {
    /// For all contacts.
    ///
    /// - `friction`: coefficient of friction μ; the pyramids lie inside the cones, `c = μ √2/2`.
    pub fn new(of: &Structure<'_>, friction: f64) -> Self {
        let mut end = 0;
        let of_contact = |(i, contact): (usize, &Contact)| {
            let (start, names) = (end, contact.friction_names());
            end += names.len();
            OfContact { name: contact.name.clone(), rows: start..end, columns: of.variables.force(i), names }
        };
        let contacts = of.contacts.iter().enumerate().map(of_contact).collect();
        Friction { contacts, c: friction * std::f64::consts::FRAC_1_SQRT_2 }
    }
}

impl Constraint for Friction {
    fn size(&self) -> Size {
        Size { equalities: 0, inequalities: self.contacts.last().map_or(0, |last| last.rows.end) }
    }

    fn pattern(&self, rows: &mut ConstraintRows<'_>) {
        for OfContact { rows: own, columns, .. } in &self.contacts {
            rows.qp.C.view_mut((rows.inequality + own.start, columns.start), (own.len(), columns.len())).fill(1.0);
        }
    }

    fn update(&mut self, state: &ModelState<'_>, rows: &mut ConstraintRows<'_>) {
        let (qp, first) = (&mut *rows.qp, rows.inequality);
        for (i, OfContact { rows: own, columns, .. }) in self.contacts.iter().enumerate() {
            let first = first + own.start;
            let load = &state.loads[i];
            if !load.active {
                qp.C.view_mut((first, columns.start), (own.len(), columns.len())).fill(0.0);
                qp.d.rows_mut(first, own.len()).fill(1.0);
                continue;
            }
            state.contacts[i].friction(&state.at[i], self.c, &mut |row, a| {
                for (k, col) in columns.clone().enumerate() {
                    qp.C[(first + row, col)] = a[k];
                }
                qp.d[first + row] = 0.0;
            });
            qp.d[first] = -load.least_normal / FORCE_UNIT;
        }
    }

    fn names(&self) -> [Vec<String>; 2] {
        let of_contact =
            |of: &OfContact| of.names.iter().map(|row| format!("{row} of {}", of.name)).collect::<Vec<_>>();
        [Vec::new(), self.contacts.iter().flat_map(of_contact).collect()]
    }
}
