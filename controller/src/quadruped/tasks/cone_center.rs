//! Task `cone_center`: contact forces near the axes of the friction cones, far from the surfaces.
//!
//! ```text
//! t1·F = 0,   t2·F = 0          t1, t2: tangents of the ground
//! ```
//! Source: Raiola et al. 2020, section 2.2: forces "far away from the friction cone boundaries", there by the regularization. Eight rows, t1 t2 of LF RF
//! LH RH, N; a foot without load has none.

use super::forces::{FORCE_UNIT, force_column};
use super::task::{Task, TaskInput};
use crate::quadruped::foot_load::carries;
use crate::quadruped::ground;
use crate::quadruped::leg::Leg;
use crate::quadruped::robot::Robot;
use crate::stack::Rows;

struct ConeCenter;

/// Builds the task.
pub fn new(robot: &Robot) -> (Rows, Box<dyn Task>) {
    let nv = robot.model.nv();
    let of_foot = |leg: Leg| (2, (0..3).map(|k| force_column(nv, leg, k)).collect());
    (Rows::new(nv + 12, Leg::ALL.map(of_foot)), Box::new(ConeCenter))
}

impl Task for ConeCenter {
    fn fill(&mut self, input: &TaskInput<'_>, rows: &mut Rows) {
        let nv = input.robot.model.nv();
        let tangents = ground::tangents(&input.estimate.n_W);
        for leg in Leg::ALL {
            let loaded = carries(input.state, leg);
            rows.switch(leg as usize, loaded);
            for (i, tangent) in tangents.iter().enumerate().filter(|_| loaded) {
                for k in 0..3 {
                    rows.A[(2 * leg as usize + i, force_column(nv, leg, k))] = tangent[k] * FORCE_UNIT;
                }
            }
        }
    }
}
