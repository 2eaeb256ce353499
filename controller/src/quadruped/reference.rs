//! Joint references: closed-loop inverse kinematics (CLIK) of the foot references, in swing and in stance.
//!
//! ```text
//! r = R_WB p_BF(q_d),  J = R_WB J_leg(q_d)
//! qd_d = J⁻¹ ( ṙ_d - ω × r + P (r_d - r) ),   q_d ← q_d + qd_d dt
//! ```
//! Source: Raiola et al. 2020, eqs. (27)-(32). Everything is evaluated at `q_d`, so that tracking errors cause no windup. `ω × r` removes the
//! foot motion due to the rotation of the base, so that swing and trunk do not disturb each other.
//!
//! - Swing: `r_d` moves on the ellipse from the lift-off position; `q_d` starts at the measured position.
//! - Stance, with `posture.stance_sweep`: `r_d` moves backward under the base at the commanded velocity, through the virtual foothold at mid-stance.
//!   The integral ζ of the height error shifts it up or down, and the sway of the gait shifts it sideways. `q_d` starts at its touchdown value, and
//!   the CLIK gain blends it to the new reference. `r_d` is integrated from the touchdown on, so that a new velocity or gait causes no jump. This motion moves
//!   the base: the stance feet are fixed on the ground, so legs that sweep backward carry the base forward. The source does not define the
//!   horizontal stance reference. If it stays at its touchdown value, the base does not follow the command.
//! - Stance, without it: `r_d` is the virtual foothold, and the base moves jerkily and slower than commanded.

use super::estimation::Estimate;
use super::foothold::{self, Query};
use super::gait::Transitions;
use super::leg::{Leg, LegPhase, PerLeg};
use super::params::GaitTiming;
use super::recovery;
use super::robot::Robot;
use super::state::{Mode, State};
use super::sway;
use super::swing::swing_point;
use super::terrain::GroundFrame;
use super::timing::{Timing, gait_params};
use crate::math::Rz;
use crate::model::{BaseState, Kinematics, point_jacobian_linear};
use crate::params::Params;
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Smallest time constant of the stance blend, as a fraction of the stance time. It exceeds `posture.blend_time_constant` in slow gaits.
const BLEND_FRACTION: f64 = 0.25;

/// The inputs of the references in a tick, except for the state, which is updated.
#[derive(Clone, Copy)]
pub struct Tick<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Parameters.
    pub params: &'a Params,
    /// Estimates of base and feet.
    pub estimate: &'a Estimate,
    /// Measured joint positions, nj, rad.
    pub q: &'a [f64],
    /// Transitions of the gait in this tick.
    pub transitions: &'a Transitions,
    /// Time since the last tick, s.
    pub dt: f64,
}

/// References of a tick. [`References::update`] overwrites all of them.
pub struct References {
    /// Foot contact point relative to the base origin, in H, m.
    pub p_BF_H: PerLeg<Vector3<f64>>,
    /// Velocity of the contact point in H, m/s.
    pub v_BF_H: PerLeg<Vector3<f64>>,
    /// Acceleration of the swing reference in H, m/s²; zero in stance.
    pub a_BF_H: PerLeg<Vector3<f64>>,
    /// Planned landing position of the foot relative to the base origin, in H, m.
    pub foothold_H: PerLeg<Vector3<f64>>,
    /// Joint velocity references, nj, rad/s. The position references are `State::q_des`.
    pub qd_des: Vec<f64>,
    kin: Kinematics,
    J: DMatrix<f64>,
    zeros: Vec<f64>,
}

impl References {
    /// Allocates the memory for a robot, filled with NaN.
    pub fn new(robot: &Robot) -> Self {
        let nan = PerLeg([Vector3::from_element(f64::NAN); 4]);
        References {
            p_BF_H: nan,
            v_BF_H: nan,
            a_BF_H: nan,
            foothold_H: nan,
            qd_des: vec![f64::NAN; robot.nj()],
            kin: Kinematics::new(&robot.model),
            J: DMatrix::from_element(3, robot.model.nv(), f64::NAN),
            zeros: vec![0.0; robot.nj()],
        }
    }

    /// Plans footholds, advances the foot references, and updates the joint references in `state` by CLIK.
    pub fn update(&mut self, tick: &Tick, state: &mut State) {
        let Tick { robot, params, estimate, transitions, dt, .. } = *tick;
        let R_HW = estimate.base.R_WH.transpose();
        let ground_frame = GroundFrame::of(params, &estimate.base, state);
        let p_CF_H = R_HW * estimate.n_W * robot.foot_radius;
        let zeta_dot = height_integral(robot, params, state, dt);
        sway::update(robot, params, transitions, state, dt);
        trim(params, state, dt);
        let sway_dot = state.sway_rate_H;
        let halted = state.leg_state.0.contains(&LegPhase::FaultHold);
        for leg in Leg::ALL {
            if transitions.lift_off[leg] || transitions.restart[leg] {
                lift(tick, state, leg);
            }
            if transitions.restart[leg] && state.leg_state[leg] == LegPhase::SwingUp {
                let back = Rz(state.step_heading[leg]) * Vector3::x() * params.recovery.reflex_retraction;
                state.p_lift_H[leg] -= back;
            }
            if state.leg_state[leg].is_stance() {
                let p_virtual = virtual_foothold(robot, state, leg);
                if !params.posture.stance_sweep {
                    state.p_stance_H[leg] = [p_virtual.x, p_virtual.y];
                } else if transitions.touchdown[leg] {
                    let landed = R_HW * estimate.legs[leg].p_BF_W;
                    state.p_stance_H[leg] = stance_start(robot, params, state, &p_virtual, &landed);
                } else if state.mode != Mode::Walk {
                    state.p_stance_H[leg] = [p_virtual.x, p_virtual.y];
                }
                let [x, y] = state.p_stance_H[leg];
                let v = if halted || !params.posture.stance_sweep {
                    [0.0; 2]
                } else {
                    velocity_at([x, y], robot, params, state)
                };
                state.p_stance_H[leg] = [x - v[0] * dt, y - v[1] * dt];
                let xy = [0, 1].map(|k| state.p_stance_H[leg][k] - state.sway_H[k]);
                let vxy = [0, 1].map(|k| -v[k] - sway_dot[k]);
                let level = |[x, y]: [f64; 2], z: f64| Vector3::new(x, y, z);
                (self.p_BF_H[leg], self.v_BF_H[leg]) =
                    ground_frame.carry(level(xy, p_virtual.z), level(vxy, zeta_dot), &p_CF_H);
                self.a_BF_H[leg] = Vector3::zeros();
                self.foothold_H[leg] = ground_frame.carry(p_virtual, Vector3::zeros(), &p_CF_H).0;
            } else {
                self.swing(tick, state, leg);
            }
        }
        self.clik(tick, state);
    }

    fn swing(&mut self, tick: &Tick, state: &mut State, leg: Leg) {
        let Tick { robot, params, estimate, .. } = *tick;
        let timing = Timing::of(state, params);
        let t = state.t_leg[leg];
        let R_HW = estimate.base.R_WH.transpose();
        let mut p_virtual_H = virtual_foothold(robot, state, leg);
        // Sway of the base at the planned touchdown; now for a leg that never lifts off and searches for the ground.
        let touchdown = if timing.steps(leg) { timing.lift_off[leg] + timing.T_sw } else { state.gait_clock };
        let sway = sway::at_clock(robot, params, state, touchdown);
        p_virtual_H.x -= sway[0];
        p_virtual_H.y -= sway[1];
        if t < timing.T_sw * (1.0 - params.foothold.freeze_fraction) {
            let step = foothold::plan(&Query {
                v_H: sweep_velocity(robot, params, state),
                capture_H: recovery::capture(robot, params, state),
                yaw_rate: state.yaw_rate_des,
                T_step: foothold::step_time(&timing, &params.foothold),
                p_hip_H: R_HW * estimate.legs[leg].p_hip_W,
                p_virtual_H,
                p_lift_H: state.p_lift_H[leg],
                max_length: params.foothold.max_step_length,
            });
            state.step_length[leg] = step.length;
            state.step_heading[leg] = step.heading.unwrap_or(state.step_heading[leg]);
        }
        let length = state.step_length[leg];
        let s = swing_point(t, timing.T_sw, length, state.step_height[leg], &params.swing);
        let held = state.leg_state[leg] == LegPhase::FaultHold;
        let n_H = R_HW * estimate.n_W;
        let forward = Rz(state.step_heading[leg]) * Vector3::x();
        // Along the ground: the step follows the slope.
        let along = forward - Vector3::z() * (n_H.dot(&forward) / n_H.z);
        self.p_BF_H[leg] = state.p_lift_H[leg] + along * s.x + n_H * s.z;
        self.v_BF_H[leg] = if held { Vector3::zeros() } else { along * s.xd + n_H * s.zd };
        self.a_BF_H[leg] = if held { Vector3::zeros() } else { along * s.xdd + n_H * s.zdd };
        self.foothold_H[leg] = state.p_lift_H[leg] + along * length;
    }

    fn clik(&mut self, tick: &Tick, state: &mut State) {
        let Tick { robot, params, estimate, q, transitions, dt } = *tick;
        let base = &estimate.base;
        let at_reference =
            BaseState { p_WB: Vector3::zeros(), R_WB: base.R_WB, v_WB: Vector3::zeros(), w_WB_W: Vector3::zeros() };
        self.kin.update(&robot.model, &at_reference, &state.q_des, &self.zeros);
        let p_FC_W = estimate.n_W * -robot.foot_radius;
        let blend_in_stance =
            if params.posture.stance_sweep { BLEND_FRACTION * Timing::of(state, params).T_st } else { 0.0 };
        let turn_W = Vector3::z() * base.yaw_rate;
        for leg in Leg::ALL {
            let of_robot = &robot.legs[leg];
            let p_WF = self.kin.p_WF(&robot.model, of_robot.foot);
            let r_W = p_WF + p_FC_W;
            point_jacobian_linear(&robot.model, &self.kin, of_robot.foot, &Vector3::zeros(), self.J.as_view_mut());
            let mut J_leg = Matrix3::zeros();
            for (k, joint) in of_robot.joints.into_iter().enumerate() {
                for row in 0..3 {
                    J_leg[(row, k)] = self.J[(row, 6 + joint)];
                }
            }
            let r_des_W = base.R_WH * self.p_BF_H[leg];
            let rd_des_W = turn_W.cross(&r_des_W) + base.R_WH * self.v_BF_H[leg];
            let stance = state.leg_state[leg].is_stance();
            let gain = if stance {
                1.0 / params.posture.blend_time_constant.max(blend_in_stance)
            } else {
                params.swing.clik_gain
            };
            // The contact point stays below the centre of the foot sphere while the base rotates: only the centre moves with the base.
            let rd_W = rd_des_W - base.w_WB_W.cross(&p_WF) + (r_des_W - r_W) * gain;
            let qd = damped_inverse(&J_leg) * rd_W;
            for (k, joint) in of_robot.joints.into_iter().enumerate() {
                let limits = &robot.model.joints[joint];
                let mut moved = (state.q_des[joint] + qd[k] * dt).clamp(limits.lower, limits.upper);
                let free = moved > limits.lower && moved < limits.upper;
                if stance {
                    // Limits the restoring motion after the base was pushed or has sunk.
                    let lead = params.posture.max_stance_lead;
                    moved = q[joint] + (moved - q[joint]).clamp(-lead, lead);
                }
                let qd_des = if free { qd[k] } else { 0.0 };
                // At the lift-off the reference jumps from stance to swing.
                let smooth = !stance && !transitions.lift_off[leg] && !transitions.restart[leg] && dt > 0.0;
                state.qdd_des[joint] = if smooth { (qd_des - state.qd_des[joint]) / dt } else { 0.0 };
                state.qd_des[joint] = qd_des;
                self.qd_des[joint] = qd_des;
                state.q_des[joint] = moved;
            }
        }
    }
}

/// Starts a swing at the present position of the foot.
fn lift(tick: &Tick, state: &mut State, leg: Leg) {
    let Tick { robot, params, estimate, q, transitions, .. } = *tick;
    state.p_lift_H[leg] = estimate.base.R_WH.transpose() * estimate.legs[leg].p_BF_W;
    if transitions.step_height > 0.0 {
        state.step_height[leg] = transitions.step_height;
    } else if state.step_height[leg] == 0.0 {
        state.step_height[leg] = params.swing.height;
    }
    for joint in robot.legs[leg].joints {
        state.q_des[joint] = q[joint];
    }
}

/// Updates ζ and returns its rate, m/s.
///
/// ```text
/// ζ̇ = -P (h_d - h_b)          the foot moves down to raise the base
/// ```
fn height_integral(robot: &Robot, params: &Params, state: &mut State, dt: f64) -> f64 {
    let error = robot.nominal_height + state.height_offset - state.height;
    let limit = params.trunk.max_height_correction;
    let before = state.zeta;
    state.zeta = (before - params.trunk.height_gain * error * dt).clamp(-limit, limit);
    if dt > 0.0 { (state.zeta - before) / dt } else { 0.0 }
}

/// Position of a foot while the robot stands: constant in H, at the commanded height, m.
fn virtual_foothold(robot: &Robot, state: &State, leg: Leg) -> Vector3<f64> {
    robot.legs[leg].p_nominal_H + Vector3::new(0.0, 0.0, state.zeta - state.height_offset)
}

/// Start of the stance reference of a leg that has just landed, without sway, m in H, xy.
///
/// In a trot it is the planned foothold, not the landing position: this moves the base back above its two feet. In a gait with planned sway it is the
/// landing position, because a single foot of three does not move the base. With the planned foothold a crawl is 6 % faster than commanded,
/// since feet land 4 mm ahead of their reference.
fn stance_start(
    robot: &Robot,
    params: &Params,
    state: &State,
    p_virtual: &Vector3<f64>,
    landed: &Vector3<f64>,
) -> [f64; 2] {
    if gait_params(state.gait, params).sway > 0.0 {
        return [landed.x + state.sway_H[0], landed.y + state.sway_H[1]];
    }
    let T_st = Timing::of(state, params).T_st;
    let v = velocity_at([p_virtual.x, p_virtual.y], robot, params, state);
    let capture = recovery::capture(robot, params, state);
    [p_virtual.x + capture[0] + 0.5 * T_st * v[0], p_virtual.y + capture[1] + 0.5 * T_st * v[1]]
}

/// Backward velocity, in H, of a standing foot under the base for the commanded motion, m/s. Zero unless walking.
fn velocity_at(p_H: [f64; 2], robot: &Robot, params: &Params, state: &State) -> [f64; 2] {
    if state.mode != Mode::Walk {
        return [0.0; 2];
    }
    let ([vx, vy], turn) = (sweep_velocity(robot, params, state), state.yaw_rate_des);
    [vx - robot.sweep[0] * turn * p_H[1], vy + robot.sweep[1] * turn * p_H[0]]
}

/// The part of [`velocity_at`] that is the same for all feet. Without the sweep it is the velocity of the base.
fn sweep_velocity(robot: &Robot, params: &Params, state: &State) -> [f64; 2] {
    let row = gait_params(state.gait, params);
    let trim = if trims(row) { state.v_trim_H } else { [0.0; 2] };
    let ratio = if params.posture.stance_sweep { robot.sweep } else { [1.0; 2] };
    [0, 1].map(|k| row.velocity_gain * ratio[k] * (state.v_H_des[k] + trim[k]))
}

/// Whether the commanded velocity is trimmed: not in gaits with planned sway, where it causes falls, and not in a gait in which a leg never lifts
/// off, which stays in place.
fn trims(row: &GaitTiming) -> bool {
    row.sway == 0.0 && row.all_step()
}

/// Updates the trim of the commanded velocity: a slow integral of the difference between commanded velocity and the velocity that the legs
/// measure. It compensates losses at the feet and on the ground.
fn trim(params: &Params, state: &mut State, dt: f64) {
    if state.mode != Mode::Walk || state.gait_clock < 0.0 || !trims(gait_params(state.gait, params)) {
        return;
    }
    let limit = params.foothold.max_speed_trim;
    for k in 0..2 {
        let error = state.v_H_des[k] - state.v_H_est[k];
        state.v_trim_H[k] = (state.v_trim_H[k] + params.foothold.speed_trim_gain * error * dt).clamp(-limit, limit);
    }
}

/// `J⁻¹`, or near a singularity the damped least-squares inverse `Jᵀ (J Jᵀ + 1e-4 I)⁻¹`.
fn damped_inverse(J: &Matrix3<f64>) -> Matrix3<f64> {
    if J.determinant().abs() > 1e-3
        && let Some(inverse) = J.try_inverse()
    {
        return inverse;
    }
    let JJt = J * J.transpose() + Matrix3::identity() * 1e-4;
    J.transpose() * JJt.try_inverse().unwrap_or_else(Matrix3::zeros)
}
