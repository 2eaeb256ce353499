//! Contact forces near the axes of the friction cones, far from the surfaces.
//!
//! ```text
//! t1·F = 0,   t2·F = 0          t1, t2: tangents of the contact
//! ```
//! Source: Raiola et al. 2020, section 2.2: forces "far away from the friction cone boundaries", there by the regularization.

use crate::contact::FORCE_UNIT;
use crate::stack::{ModelState, Rows, Structure, Task};
use std::ops::Range;

/// The task. Two rows for each contact, N; a contact without load has none.
pub struct ConeCenter {
    variables: usize,
    forces: Vec<Range<usize>>,
}

impl ConeCenter {
    /// For all contacts.
    pub fn new(of: &Structure<'_>) -> Self {
        let force = |i| {
            let start = of.variables.force(i).start;
            start..start + 3
        };
        ConeCenter { variables: of.variables.forces().end, forces: (0..of.contacts.len()).map(force).collect() }
    }
}

impl Task for ConeCenter {
    type Reference = ();

    fn size(&self) -> usize {
        2 * self.forces.len()
    }

    fn rows(&self) -> Rows {
        Rows::new(self.variables, self.forces.iter().map(|force| (2, force.clone().collect())))
    }

    fn update(&mut self, state: &ModelState<'_>, _reference: &(), rows: &mut Rows) {
        for (i, (at, load)) in state.at.iter().zip(state.loads).enumerate() {
            rows.switch(i, load.active);
            for t in (0..2).filter(|_| load.active) {
                for (k, col) in self.forces[i].clone().enumerate() {
                    rows.A[(2 * i + t, col)] = at.R_WC[(k, t)] * FORCE_UNIT;
                }
            }
        }
    }
}
