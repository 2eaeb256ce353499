//! Joint velocities towards a posture, `qd = qd_des + k (q_des - q)`. Source: Laurenzi 2020, section 2.4.

use crate::stack::{ModelState, Rows, Structure, Task};

/// The task: one row for each joint, rad/s or m/s.
pub struct JointPositions {
    nv: usize,
    n_base: usize,
    gain: f64,
}

impl JointPositions {
    /// - `gain`: 1/s.
    pub fn new(of: &Structure<'_>, gain: f64) -> Self {
        JointPositions { nv: of.model.nv(), n_base: of.model.nv_base(), gain }
    }
}

impl Task for JointPositions {
    /// Position and velocity of each joint, rad and rad/s (m and m/s).
    type Reference = [(f64, f64)];

    fn size(&self) -> usize {
        self.nv - self.n_base
    }

    fn rows(&self) -> Rows {
        Rows::selection(self.nv, self.n_base..self.nv)
    }

    fn update(&mut self, state: &ModelState<'_>, reference: &[(f64, f64)], rows: &mut Rows) {
        for (j, ((q_des, qd_des), q)) in reference.iter().zip(state.q).enumerate() {
            rows.b[j] = qd_des + self.gain * (q_des - q);
        }
    }
}
