//! The contacts that carry load do not slip, `J v = 0`: feet and soles stay, wheels roll without slip.
//!
//! `J v` is the velocity of the material point at the contact. Source: Laurenzi 2020, eq. (5.30).

use crate::stack::{ModelState, Rows, Structure, Task};

/// The task. Its rows are those of the contacts in order, 3 or 6 each, m/s and rad/s.
pub struct ContactsAtRest {
    nv: usize,
    blocks: Vec<(usize, Vec<usize>)>,
}

impl ContactsAtRest {
    /// For all contacts of a robot.
    pub fn new(of: &Structure<'_>) -> Self {
        let block = |contact: &crate::contact::Contact| (contact.size(), contact.columns.clone());
        ContactsAtRest { nv: of.model.nv(), blocks: of.contacts.iter().map(block).collect() }
    }
}

impl Task for ContactsAtRest {
    type Reference = ();

    fn size(&self) -> usize {
        self.blocks.iter().map(|(rows, _)| rows).sum()
    }

    fn rows(&self) -> Rows {
        Rows::new(self.nv, self.blocks.iter().cloned())
    }

    fn update(&mut self, state: &ModelState<'_>, _reference: &(), rows: &mut Rows) {
        let mut first = 0;
        for (i, (at, load)) in state.at.iter().zip(state.loads).enumerate() {
            let (size, columns) = &self.blocks[i];
            rows.switch(i, load.active);
            if load.active {
                for &col in columns {
                    for k in 0..*size {
                        rows.A[(first + k, col)] = at.J[(k, col)];
                    }
                }
            }
            first += size;
        }
    }
}
