//! What the controller knows of the robot in a tick: base orientation, kinematics, dynamics, contact forces, height.
//!
//! Base position and linear velocity are set to zero in every tick. That is exact, to the bit: the model computes relative to the base, and from it
//! only quantities relative to the base are read. Source: Raiola et al. 2020, sections 2.4.1, 3 and 4.3.

use super::ground;
use super::leg::{Leg, PerLeg};
use super::robot::Robot;
use super::state::State;
use crate::math::{Rz, quaternion, rpy_of};
use crate::model::{BaseState, Kinematics, bias_force, frame_bias_acceleration, mass_matrix, point_jacobian_linear};
use crate::params::Params;
use lcmtypes::RobotState;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Base orientation and rates.
#[derive(Clone, Debug)]
pub struct BaseEstimate {
    /// Orientation of the base.
    pub R_WB: Matrix3<f64>,
    /// Its heading alone.
    pub R_WH: Matrix3<f64>,
    /// Its tilt alone: `R_WB = R_WH R_HB`.
    pub R_HB: Matrix3<f64>,
    /// Roll, pitch, yaw, rad.
    pub rpy: [f64; 3],
    /// Angular velocity, rad/s.
    pub w_WB_W: Vector3<f64>,
    /// Rate of the heading, rad/s.
    pub yaw_rate: f64,
}

/// Position and linear velocity of the base, in W: what is taken for it where nobody knows it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AssumedBase {
    /// Origin of the base, m.
    pub p_WB: Vector3<f64>,
    /// Its velocity, m/s.
    pub v_WB: Vector3<f64>,
}

/// A leg at the measured joint positions.
#[derive(Clone, Debug)]
pub struct LegEstimate {
    /// Contact point of the foot from the base origin, in W axes, m.
    pub p_BF_W: Vector3<f64>,
    /// Its velocity over the base origin, in W axes, m/s.
    pub v_BF_W: Vector3<f64>,
    /// HAA joint from the base origin, in W axes, m.
    pub p_hip_W: Vector3<f64>,
    /// Velocity of the contact point of the foot, 3 x nv: `v_WF = J v`.
    pub J: DMatrix<f64>,
    /// Its columns at the leg's joints, in W axes.
    pub J_leg: Matrix3<f64>,
    /// Acceleration of the contact point at `vd = 0` that a rolling sphere on the ground would not have: `J vd = -a_bias_W` in stance, m/s².
    pub a_bias_W: Vector3<f64>,
}

/// Everything estimated in a tick. All of it is overwritten by [`Estimate::update`].
pub struct Estimate {
    /// Kinematics at the measured state, the base where it is taken to be: at the origin and without linear velocity.
    pub kin: Kinematics,
    /// Base orientation and rates.
    pub base: BaseEstimate,
    /// The legs.
    pub legs: PerLeg<LegEstimate>,
    /// Mass matrix, nv x nv.
    pub M: DMatrix<f64>,
    /// Bias force, nv.
    pub h: DVector<f64>,
    /// Terrain normal.
    pub n_W: Vector3<f64>,
}

impl Estimate {
    /// Memory for a robot.
    pub fn new(robot: &Robot) -> Self {
        let nv = robot.model.nv();
        let nan = Vector3::from_element(f64::NAN);
        let nan3 = Matrix3::from_element(f64::NAN);
        let leg = LegEstimate {
            p_BF_W: nan,
            v_BF_W: nan,
            p_hip_W: nan,
            J: DMatrix::from_element(3, nv, f64::NAN),
            J_leg: nan3,
            a_bias_W: nan,
        };
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
            M: DMatrix::from_element(nv, nv, f64::NAN),
            h: DVector::from_element(nv, f64::NAN),
            n_W: nan,
        }
    }

    /// Base, kinematics and dynamics from one measurement, the base at the origin and without linear velocity, on level ground.
    pub fn update(&mut self, robot: &Robot, measured: &RobotState) {
        self.update_at(robot, measured, &AssumedBase::default(), [0.0; 2]);
    }

    /// [`Estimate::update`] on ground that rises by `gradient_W` along x and y, with the base taken to be somewhere else: that makes no difference
    /// to anything but `kin`'s own base.
    pub fn update_at(&mut self, robot: &Robot, measured: &RobotState, place: &AssumedBase, gradient_W: [f64; 2]) {
        self.base = base_estimate(robot, measured);
        let AssumedBase { p_WB, v_WB } = *place;
        let base = BaseState { p_WB, R_WB: self.base.R_WB, v_WB, w_WB_W: self.base.w_WB_W };
        self.kin.update(&robot.model, &base, &measured.q, &measured.qd);
        mass_matrix(&robot.model, &self.kin, &mut self.M);
        bias_force(&robot.model, &self.kin, &mut self.h);
        self.n_W = ground::normal(gradient_W);
        let p_FC_W = self.n_W * -robot.foot_radius;
        for leg in Leg::ALL {
            let (of_robot, estimate) = (&robot.legs[leg], &mut self.legs[leg]);
            let J = estimate.J.as_view_mut();
            point_jacobian_linear(&robot.model, &self.kin, of_robot.foot, &p_FC_W, J);
            for (k, &joint) in of_robot.joints.iter().enumerate() {
                for row in 0..3 {
                    estimate.J_leg[(row, k)] = estimate.J[(row, 6 + joint)];
                }
            }
            let mut qd = Vector3::zeros();
            for (k, &joint) in of_robot.joints.iter().enumerate() {
                qd[k] = measured.qd[joint];
            }
            estimate.p_BF_W = self.kin.p_BF_W(&robot.model, of_robot.foot) + p_FC_W;
            estimate.v_BF_W = self.base.w_WB_W.cross(&estimate.p_BF_W) + estimate.J_leg * qd;
            estimate.p_hip_W = self.kin.p_BF_W(&robot.model, of_robot.hip);
            // A sphere that rolls without slip accelerates its contact point by w x (w x p_FC) towards its centre; the same term
            // stands in the bias of the material point, so it cancels and the lever of the angular bias remains.
            let bias = frame_bias_acceleration(&robot.model, &self.kin, of_robot.foot);
            let (linear, angular) = (Vector3::new(bias[0], bias[1], bias[2]), Vector3::new(bias[3], bias[4], bias[5]));
            estimate.a_bias_W = linear + angular.cross(&p_FC_W);
        }
    }

    /// Contact forces and flags from the joint torques.
    ///
    /// ```text
    /// F_i = -(R_WB J_leg,i)⁻ᵀ (tau_i - h_i - M_i qdd_des,i)        M_i: 3 x 3 block of M at the leg's joints
    /// ```
    /// Source: Raiola et al. 2020, eq. (18), which neglects the accelerations; with [`ContactParams::inertia_compensation`] those of the
    /// swing reference count. Those that the last solution asked for would not do: they explain every torque, that of a contact too. Where the
    /// leg is stretched (small |det J|) the last force is kept. A foot touches when the normal force has been above the threshold for a number of samples in a row, until it is below a lower one.
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

    /// Torque that the acceleration of the leg's reference takes at one of its joints, N m.
    fn inertia_torque(&self, robot: &Robot, state: &State, leg: Leg, joint: usize) -> f64 {
        robot.legs[leg].joints.iter().fold(0.0, |sum, &j| sum + self.M[(6 + joint, 6 + j)] * state.qdd_des[j])
    }

    /// Height of the base above the stance feet; without any, the last one is kept.
    ///
    /// ```text
    /// h_b = -(1/N) Σ_stance ( (R_HB p_BF).z - g·(x, y) )            g: gradient of the ground
    /// ```
    /// Source: Raiola et al. 2020, eqs. (16)-(17), which have no slope: on one, the mean of the feet depends on which of them stand.
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

/// Base orientation and rates from the IMU.
pub fn base_estimate(robot: &Robot, measured: &RobotState) -> BaseEstimate {
    let [w, x, y, z] = measured.q_WI_wxyz;
    let length = (w * w + x * x + y * y + z * z).sqrt();
    let R_WI = quaternion::to_rotation([w / length, x / length, y / length, z / length]);
    let R_WB = R_WI * robot.R_IB;
    let rpy = rpy_of(&R_WB);
    let R_WH = Rz(rpy[2]);
    let w_WB_W = R_WI * Vector3::from(measured.w_WI_I);
    // Heading is read off the base's x axis: its rate is that of the axis' horizontal projection.
    let x_B = R_WB.column(0).into_owned();
    let xd_B = w_WB_W.cross(&x_B);
    let horizontal = x_B.x * x_B.x + x_B.y * x_B.y;
    let yaw_rate = if horizontal > 1e-12 { (x_B.x * xd_B.y - x_B.y * xd_B.x) / horizontal } else { 0.0 };
    BaseEstimate { R_WB, R_WH, R_HB: R_WH.transpose() * R_WB, rpy, w_WB_W, yaw_rate }
}

/// Whether `wxyz` is near enough to a unit quaternion to be one.
pub fn is_unit_quaternion(wxyz: &[f64; 4]) -> bool {
    let [w, x, y, z] = *wxyz;
    ((w * w + x * x + y * y + z * z).sqrt() - 1.0).abs() < 1e-2
}
