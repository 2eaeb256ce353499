//! Task `swing`: the feet in swing follow their references in Cartesian space.
//!
//! ```text
//! r̈ = J vd + a_bias = r̈_d + K_P (r_d - r) + K_D (ṙ_d - ṙ)          r: foot relative to the base origin, in W axes
//! ```
//! Source: Raiola et al. 2020, section 4.1 and eq. (6). The references are relative to the base, so the columns of the base's linear velocity are 0,
//! and neither position nor velocity of the base is needed. With `swing.inertia` the feedback is a force:
//!
//! ```text
//! r̈ = r̈_d + Λ⁻¹ (K' (r_d - r) + D' (ṙ_d - ṙ)),   Λ⁻¹ = J_leg M_leg⁻¹ J_legᵀ          M_leg: 3 x 3 block of M at the leg's joints
//! ```
//! Source: appendix, eq. (A9), with the inertia of the leg as in section 5.
//!
//! Twelve rows, x y z of LF RF LH RH, m/s². A leg whose three rows are in the formula has no rows in the posture task while it swings.

use super::task::{QuadrupedTask, TaskInput};
use crate::model::{frame_bias_acceleration, point_jacobian_linear};
use crate::quadruped::leg::Leg;
use crate::quadruped::robot::Robot;
use crate::stack::{Rows, Structure};
use nalgebra::{DMatrix, Matrix3, Vector3};

struct Swing {
    /// Columns of each foot in which the rows may be non-zero.
    columns: Vec<Vec<usize>>,
    /// Jacobian of a foot's centre, 3 x nv.
    J: DMatrix<f64>,
}

/// Builds the task.
pub fn new(of: &Structure<'_>, robot: &Robot) -> Box<dyn QuadrupedTask> {
    let nv = of.model.nv();
    let columns = robot.contacts.0.iter().map(|contact| contact.columns[3..].to_vec()).collect();
    Box::new(Swing { columns, J: DMatrix::from_element(3, nv, f64::NAN) })
}

impl QuadrupedTask for Swing {
    fn rows(&self) -> Rows {
        Rows::new(self.J.ncols(), self.columns.iter().map(|columns| (3, columns.clone())))
    }

    fn fill(&mut self, input: &TaskInput<'_>, rows: &mut Rows) {
        let TaskInput { robot, params, estimate, references, state, .. } = *input;
        let (kin, base) = (&estimate.kin, &estimate.base);
        let turn_W = Vector3::z() * base.yaw_rate;
        for leg in Leg::ALL {
            let swings = !state.leg_state[leg].is_stance();
            rows.switch(leg as usize, swings);
            if !swings {
                continue;
            }
            let of_robot = &robot.legs[leg];
            // The contact point stays below the centre of the foot sphere, so both have the same velocity and acceleration.
            point_jacobian_linear(&robot.model, kin, of_robot.foot, &Vector3::zeros(), self.J.as_view_mut());
            let bias = frame_bias_acceleration(&robot.model, kin, of_robot.foot);
            let r_des_W = base.R_WH * references.p_BF_H[leg];
            let v_H_W = base.R_WH * references.v_BF_H[leg];
            let v_des_W = turn_W.cross(&r_des_W) + v_H_W;
            let a_des_W =
                turn_W.cross(&turn_W.cross(&r_des_W)) + turn_W.cross(&v_H_W) * 2.0 + base.R_WH * references.a_BF_H[leg];
            let e = r_des_W - estimate.legs[leg].p_BF_W;
            let ed = v_des_W - kin.v_BF_W(&robot.model, of_robot.foot);
            let (kp, kd) = (&params.swing.kp, &params.swing.kd);
            let mut u = Vector3::from_fn(|k, _| kp[k] * e[k] + kd[k] * ed[k]);
            if params.swing.inertia {
                let joints = of_robot.joints;
                let J_leg = Matrix3::from_fn(|r, c| self.J[(r, 6 + joints[c])]);
                let M_leg = Matrix3::from_fn(|r, c| estimate.M[(6 + joints[r], 6 + joints[c])]);
                u = M_leg.try_inverse().map_or(Vector3::zeros(), |inverse| J_leg * (inverse * (J_leg.transpose() * u)));
            }
            let at = 3 * leg as usize;
            for k in 0..3 {
                for col in (3..6).chain(of_robot.joints.map(|j| 6 + j)) {
                    rows.A[(at + k, col)] = self.J[(k, col)];
                }
                rows.b[at + k] = a_des_W[k] + u[k] - bias[k];
            }
        }
    }
}
