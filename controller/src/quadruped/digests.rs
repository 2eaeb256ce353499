//! Digests of a tick: one hash a stage of the bits of everything that the stage computed.

use super::estimation::Estimate;
use super::leg::Leg;
use super::reference::References;
use super::state::{Motion, State};
use super::wbc::Wbc;
use crate::digest::Digest;
use lcmtypes::ControllerInput;

/// Digests of a tick, by stage.
#[derive(Default)]
pub struct Digests(pub [i64; 6]);

/// The input as consumed.
pub fn input(input: &ControllerInput) -> i64 {
    let ControllerInput { t_ns, tick, running, t_op_ns, state, op } = input;
    let mut d = Digest::default();
    for word in [t_ns, tick, running, t_op_ns, &state.t_ns, &state.seq, &op.t_ns, &op.seq] {
        d.word(word.cast_unsigned());
    }
    d.word(u64::from(state.nj.cast_unsigned()));
    for values in [&state.q, &state.qd, &state.tau] {
        d.word(values.len() as u64);
        d.f64s(values);
    }
    d.f64s(&state.q_WI_wxyz);
    d.f64s(&state.w_WI_I);
    d.f64s(&state.a_I);
    d.word(u64::from(op.mode.cast_unsigned()));
    d.word(u64::from(op.gait.cast_unsigned()));
    d.f64s(&op.v_H);
    d.f64s(&[op.yaw_rate, op.roll, op.pitch, op.height_offset, op.swing_frequency, op.duty, op.step_height]);
    d.finish()
}

/// Base, kinematics, dynamics, contact forces, height, ground.
pub fn estimation(estimate: &Estimate, state: &State) -> i64 {
    let mut d = Digest::default();
    d.mat3(&estimate.base.R_WB);
    d.vec3(&estimate.base.w_WB_W);
    d.f64s(&estimate.base.rpy);
    d.f64(estimate.base.yaw_rate);
    d.dmat(&estimate.M);
    d.dvec(&estimate.h);
    d.vec3(&estimate.n_W);
    for (leg, of_leg) in estimate.legs.iter() {
        d.vec3(&of_leg.p_BF_W);
        d.vec3(&of_leg.p_hip_W);
        d.dmat(&of_leg.J);
        d.vec3(&of_leg.a_bias_W);
        d.vec3(&state.f_F_W[leg]);
        d.vec3(&state.p_ground_W[leg]);
        d.word(u64::from(state.contact[leg]));
    }
    d.f64(state.height);
    d.f64s(&state.v_H_est);
    d.f64s(&state.gradient_W);
    d.finish()
}

/// Gait clock, leg states, footholds, swing and joint references.
pub fn gait(references: &References, state: &State) -> i64 {
    let mut d = Digest::default();
    d.f64s(&[state.gait_clock, state.yaw_des, state.height_offset, state.zeta, state.yaw_rate_des]);
    d.f64s(&[state.cadence.swing_frequency, state.cadence.duty]);
    d.f64s(&state.rp_des);
    d.f64s(&state.v_H_des);
    d.f64s(&state.v_trim_H);
    d.f64s(&state.sway_H);
    d.word(state.gait as u64);
    d.word(state.mode as u64);
    for leg in Leg::ALL {
        d.word(state.leg_phase[leg] as u64);
        d.word(u64::from(state.reflexes[leg].cast_unsigned()));
        d.f64s(&[state.t_leg[leg], state.t_unloaded[leg]]);
        d.f64s(&[state.step_length[leg], state.step_heading[leg], state.step_height[leg]]);
        d.vec3(&references.p_BF_H[leg]);
        d.vec3(&references.v_BF_H[leg]);
        d.vec3(&references.foothold_H[leg]);
    }
    d.f64s(&state.q_des);
    d.f64s(&state.qd_des);
    d.f64s(&state.qdd_des);
    d.finish()
}

/// What takes the place of the gait while the robot gets up or sits down.
pub fn posture(state: &State) -> i64 {
    let Motion { phase, progress, start, q, support, t_held } = &state.motion;
    let mut d = Digest::default();
    d.word(state.mode as u64);
    d.word(*phase as u64);
    d.f64s(&[*progress, *start, *support, *t_held]);
    for values in [q, &state.q_des, &state.qd_des, &state.tau_last] {
        d.f64s(values);
    }
    d.finish()
}

/// Cost, constraints and bounds of the programs.
pub fn tasks(wbc: &Wbc) -> i64 {
    let mut d = Digest::default();
    for level in wbc.stack.built() {
        for matrix in [&level.qp.H, &level.qp.A, &level.qp.C] {
            d.dmat(matrix);
        }
        for vector in [&level.qp.g, &level.qp.b, &level.qp.d, &level.qp.lower, &level.qp.upper] {
            d.dvec(vector);
        }
    }
    // Of levels whose programs are not built the rows of the tasks are all there is.
    if wbc.stack.built().len() < wbc.stack.levels.len() {
        for rows in &wbc.tasks.rows {
            d.dmat(&rows.A);
            d.dvec(&rows.b);
        }
    }
    d.vec3(&wbc.tasks.e_o_W);
    d.vec3(&wbc.tasks.wd_trunk);
    d.dvec(&wbc.tasks.qdd_posture);
    d.finish()
}

/// Their solution and status, and the torques.
pub fn qp(wbc: &Wbc) -> i64 {
    let mut d = Digest::default();
    for level in &wbc.stack.levels {
        if let Some(info) = level.info {
            d.word(info.status as u64);
            d.word(u64::from(info.iterations));
        }
        d.dvec(&level.x);
    }
    d.dvec(&wbc.tau);
    d.finish()
}
