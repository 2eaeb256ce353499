//! Task `relative_feet`: the stance task with feedback on the positions of the standing feet relative to each other.
//!
//! ```text
//! J_i vd = -a_bias,i + K_P (e_i - ē) + K_D (ė_i - ē̇),   e_i = r_d,i - r_i,  ė_i = -ṙ_i          ē, ē̇: means over the standing feet
//! ```
//! Source: Raiola et al. 2020, section 6: feet that lost contact diverge, because the contact task, eq. (7), has no feedback; a task of earlier work keeps
//! their relative positions. The differences `e_i - e_j` do not depend on position and velocity of the base, so no state estimate is needed. The feedback
//! has no mean: it does not move the base. Without errors the rows are those of the task `contact`, which this task replaces in a formula.
//!
//! `r_d` is the stance reference of the posture task. Twelve rows, x y z of LF RF LH RH, m/s²; a foot without load has none.

use super::task::{QuadrupedTask, TaskInput};
use crate::quadruped::foot_load::carries;
use crate::quadruped::leg::{Leg, PerLeg};
use crate::quadruped::robot::Robot;
use crate::stack::{Rows, Structure, Task};
use crate::tasks::acceleration::ContactsAtRest;
use nalgebra::Vector3;

struct RelativeFeet(ContactsAtRest);

/// Builds the task.
pub fn new(of: &Structure<'_>, _robot: &Robot) -> Box<dyn QuadrupedTask> {
    Box::new(RelativeFeet(ContactsAtRest::new(of)))
}

impl QuadrupedTask for RelativeFeet {
    fn rows(&self) -> Rows {
        self.0.rows()
    }

    fn fill(&mut self, input: &TaskInput<'_>, rows: &mut Rows) {
        let TaskInput { params, estimate, references, state, .. } = *input;
        let gains = &params.relative_feet;
        let mut feedback = PerLeg([Vector3::zeros(); 4]);
        let (mut sum, mut count) = (Vector3::zeros(), 0.0);
        for leg in Leg::ALL {
            if carries(state, leg) {
                let of_leg = &estimate.legs[leg];
                let e = estimate.base.R_WH * references.p_BF_H[leg] - of_leg.p_BF_W;
                feedback[leg] = e * gains.kp - of_leg.v_BF_W * gains.kd;
                sum += feedback[leg];
                count += 1.0;
            }
        }
        self.0.update(&input.model, &(), rows);
        for leg in Leg::ALL.into_iter().filter(|leg| carries(state, *leg)) {
            let asked = feedback[leg] - sum / count - estimate.contacts[leg].linear_bias();
            for k in 0..3 {
                rows.b[3 * leg as usize + k] = asked[k];
            }
        }
    }
}
