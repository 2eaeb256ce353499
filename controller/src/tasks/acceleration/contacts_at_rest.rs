//! The contacts that carry load are not accelerated, `J vd = -a_bias`. There is no feedback. Source: Raiola et al. 2020, eq. (7).

use crate::stack::{ModelState, Rows, Structure, Task};
use crate::tasks::velocity;

/// The task. Its rows are those of the contacts in order, 3 or 6 each, m/s² and rad/s².
pub struct ContactsAtRest(velocity::ContactsAtRest);

impl ContactsAtRest {
    /// For all contacts of a robot.
    pub fn new(of: &Structure<'_>) -> Self {
        ContactsAtRest(velocity::ContactsAtRest::new(of))
    }
}

impl Task for ContactsAtRest {
    /// The loads of the contacts are enough.
    type Reference = ();

    fn size(&self) -> usize {
        self.0.size()
    }

    fn rows(&self) -> Rows {
        self.0.rows()
    }

    fn update(&mut self, state: &ModelState<'_>, reference: &(), rows: &mut Rows) {
        self.0.update(state, reference, rows);
        let mut row = 0;
        for (at, load) in state.at.iter().zip(state.loads) {
            for k in 0..at.J.nrows() {
                if load.active {
                    rows.b[row] = -at.a_bias_W[k];
                }
                row += 1;
            }
        }
    }
}
