//! Estimation of base orientation, kinematics, dynamics, contact forces and height in a tick.
//!
//! Base position and linear velocity are set to zero in every tick. No output changes by a bit if they are set to other values: the model computes
//! relative to the base, and the controller uses only quantities relative to the base. Source: Raiola et al. 2020, sections 2.4.1, 3 and 4.3.

use super::ground;
use super::leg::{Leg, PerLeg};
use super::robot::Robot;
use super::state::State;
use crate::contact::ContactState;
use crate::math::{Rz, quaternion, rpy_of};
use crate::model::{BaseState, Kinematics, bias_force, mass_matrix};
use crate::params::Params;
use lcmtypes::RobotState;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Base orientation and rates.
#[derive(Clone, Debug)]
pub struct BaseEstimate {
    /// Orientation of the base.
    pub R_WB: Matrix3<f64>,
    /// Heading of the base: the rotation by its yaw.
    pub R_WH: Matrix3<f64>,
    /// Tilt of the base: `R_WB = R_WH R_HB`.
    pub R_HB: Matrix3<f64>,
    /// Roll, pitch, yaw, rad.
    pub rpy: [f64; 3],
    /// Angular velocity, rad/s.
    pub w_WB_W: Vector3<f64>,
    /// Rate of the heading, rad/s.
    pub yaw_rate: f64,
}

/// Assumed position and linear velocity of the base in W. No sensor measures them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AssumedBase {
    /// Origin of the base, m.
    pub p_WB: Vector3<f64>,
    /// Velocity of the origin, m/s.
    pub v_WB: Vector3<f64>,
}

/// A leg at the measured joint positions.
#[derive(Clone, Debug)]
pub struct LegEstimate {
    /// Contact point of the foot from the base origin, in W axes, m.
    pub p_BF_W: Vector3<f64>,
    /// Velocity of the contact point relative to the base origin, in W axes, m/s.
    pub v_BF_W: Vector3<f64>,
    /// HAA joint from the base origin, in W axes, m.
    pub p_hip_W: Vector3<f64>,
    /// Columns of the contact's `J` at the leg's joints, in W axes.
    pub J_leg: Matrix3<f64>,
}

/// The estimates of a tick. [`Estimate::update`] overwrites all of them.
pub struct Estimate {
    /// Kinematics at the measured joint state and base orientation, and the assumed base position and velocity.
    pub kin: Kinematics,
    /// Base orientation and rates.
    pub base: BaseEstimate,
    /// The legs.
    pub legs: PerLeg<LegEstimate>,
    /// Contacts of the feet.
    pub contacts: PerLeg<ContactState>,
    /// Mass matrix, nv x nv.
    pub M: DMatrix<f64>,
    /// Bias force, nv.
    pub h: DVector<f64>,
    /// Terrain normal.
    pub n_W: Vector3<f64>,
}

impl Estimate {
    /// Allocates the memory for a robot, filled with NaN.
    pub fn new(robot: &Robot) -> Self {
        let nv = robot.model.nv();
        let nan = Vector3::from_element(f64::NAN);
        let nan3 = Matrix3::from_element(f64::NAN);
        let leg = LegEstimate { p_BF_W: nan, v_BF_W: nan, p_hip_W: nan, J_leg: nan3 };
        Estimate {
            kin: Kinematics::new(&robot.model),
            base: BaseEstimate {
                R_WB: nan3,
                R_WH: nan3,
                R_HB: nan3,
                rpy: [f64::NAN; 3],
                w_WB_W: nan,
                yaw_rate: f64::NAN,
            },
            legs: PerLeg([leg.clone(), leg.clone(), leg.clone(), leg]),
            contacts: PerLeg(Leg::ALL.map(|leg| robot.contacts[leg].state(&robot.model))),
            M: DMatrix::from_element(nv, nv, f64::NAN),
            h: DVector::from_element(nv, f64::NAN),
            n_W: nan,
        }
    }

    /// Computes base, kinematics and dynamics from a measurement, with the base at rest at the origin, on level ground.
    pub fn update(&mut self, robot: &Robot, measured: &RobotState) {
        self.update_at(robot, measured, &AssumedBase::default(), [0.0; 2]);
    }

    /// [`Estimate::update`] on ground with the gradient `gradient_W`, and with the assumed base position and velocity `assumed`. The assumption changes
    /// only the base of `kin`.
    pub fn update_at(&mut self, robot: &Robot, measured: &RobotState, assumed: &AssumedBase, gradient_W: [f64; 2]) {
        self.base = base_estimate(robot, measured);
        let AssumedBase { p_WB, v_WB } = *assumed;
        let base = BaseState { p_WB, R_WB: self.base.R_WB, v_WB, w_WB_W: self.base.w_WB_W };
        self.kin.update(&robot.model, &base, &measured.q, &measured.qd);
        mass_matrix(&robot.model, &self.kin, &mut self.M);
        bias_force(&robot.model, &self.kin, &mut self.h);
        self.n_W = ground::normal(gradient_W);
        for leg in Leg::ALL {
            let (of_robot, estimate, contact) = (&robot.legs[leg], &mut self.legs[leg], &mut self.contacts[leg]);
            robot.contacts[leg].update(&robot.model, &self.kin, &self.n_W, contact);
            let mut qd = Vector3::zeros();
            for (k, &joint) in of_robot.joints.iter().enumerate() {
                for row in 0..3 {
                    estimate.J_leg[(row, k)] = contact.J[(row, 6 + joint)];
                }
                qd[k] = measured.qd[joint];
            }
            estimate.p_BF_W = contact.p_BC_W;
            estimate.v_BF_W = self.base.w_WB_W.cross(&estimate.p_BF_W) + estimate.J_leg * qd;
            estimate.p_hip_W = self.kin.p_BF_W(&robot.model, of_robot.hip);
        }
    }

    /// Estimates contact forces and contact flags from the joint torques.
    ///
    /// ```text
    /// F_i = -(R_WB J_leg,i)⁻ᵀ (tau_i - h_i - M_i qdd_des,i)        M_i: 3 x 3 block of M at the leg's joints
    /// ```
    /// Source: Raiola et al. 2020, eq. (18), which neglects the accelerations. With [`ContactParams::inertia_compensation`] the accelerations of the
    /// swing reference are used. Those of the last QP solution cannot be used: they explain every torque, also that of a contact. Where the leg
    /// is stretched (small |det J|), the last force is kept. A contact begins when the normal force has been above a threshold for a number of
    /// consecutive samples, and ends when it is below a lower threshold.
    ///
    /// [`ContactParams::inertia_compensation`]: super::params::ContactParams::inertia_compensation
    pub fn contact_forces(&self, robot: &Robot, params: &Params, tau: &[f64], state: &mut State) {
        for leg in Leg::ALL {
            let estimate = &self.legs[leg];
            let compensated = params.contact.inertia_compensation && !state.leg_state[leg].is_stance();
            if estimate.J_leg.determinant().abs() >= params.contact.min_jacobian_det {
                let mut torque = Vector3::zeros();
                for (k, &joint) in robot.legs[leg].joints.iter().enumerate() {
                    let inertia = if compensated { self.inertia_torque(robot, state, leg, joint) } else { 0.0 };
                    torque[k] = tau[joint] - self.h[6 + joint] - inertia;
                }
                if let Some(inverse) = estimate.J_leg.transpose().try_inverse() {
                    state.f_F_W[leg] = -(inverse * torque);
                }
            }
            let least =
                if state.contact[leg] { params.contact.release_load } else { params.contact.touch_load } * robot.weight;
            let loaded = self.n_W.dot(&state.f_F_W[leg]) > least;
            let count = &mut state.contact_count[leg];
            *count = if loaded { count.saturating_add(1).min(params.contact.debounce) } else { 0 };
            state.contact[leg] = *count >= params.contact.debounce;
        }
    }

    /// Torque at one of the leg's joints that accelerates the leg as its reference, N m.
    fn inertia_torque(&self, robot: &Robot, state: &State, leg: Leg, joint: usize) -> f64 {
        robot.legs[leg].joints.iter().fold(0.0, |sum, &j| sum + self.M[(6 + joint, 6 + j)] * state.qdd_des[j])
    }

    /// Computes the height of the base above the stance feet, m. Without a stance foot the last height is kept.
    ///
    /// ```text
    /// h_b = -(1/N) Σ_stance ( (R_HB p_BF).z - g·(x, y) )            g: gradient of the ground
    /// ```
    /// Source: Raiola et al. 2020, eqs. (16)-(17), without the gradient term. On a slope, the mean without this term depends on which feet are in stance.
    pub fn height(&self, state: &mut State) {
        let (mut sum, mut count) = (0.0, 0.0);
        for (leg, estimate) in self.legs.iter() {
            if state.leg_state[leg].is_stance() {
                sum += ground::rise(state.gradient_W, &estimate.p_BF_W) - estimate.p_BF_W.z;
                count += 1.0;
            }
        }
        if count > 0.0 {
            state.height = sum / count;
        }
    }
}

/// Computes base orientation and rates from the IMU.
pub fn base_estimate(robot: &Robot, measured: &RobotState) -> BaseEstimate {
    let [w, x, y, z] = measured.q_WI_wxyz[0];
    let length = (w * w + x * x + y * y + z * z).sqrt();
    let R_WI = quaternion::to_rotation([w / length, x / length, y / length, z / length]);
    let R_WB = R_WI * robot.R_IB;
    let rpy = rpy_of(&R_WB);
    let R_WH = Rz(rpy[2]);
    let w_WB_W = R_WI * Vector3::from(measured.w_WI_I[0]);
    // The heading is that of the base's x axis, so its rate is the rate of the axis' horizontal projection.
    let x_B = R_WB.column(0).into_owned();
    let xd_B = w_WB_W.cross(&x_B);
    let horizontal = x_B.x * x_B.x + x_B.y * x_B.y;
    let yaw_rate = if horizontal > 1e-12 { (x_B.x * xd_B.y - x_B.y * xd_B.x) / horizontal } else { 0.0 };
    BaseEstimate { R_WB, R_WH, R_HB: R_WH.transpose() * R_WB, rpy, w_WB_W, yaw_rate }
}

/// Whether the norm of `wxyz` differs from 1 by less than 0.01.
pub fn is_unit_quaternion(wxyz: &[f64; 4]) -> bool {
    let [w, x, y, z] = *wxyz;
    ((w * w + x * x + y * y + z * z).sqrt() - 1.0).abs() < 1e-2
}
