//! Digests of a tick: for each stage a hash over the bits of everything that the stage computed.

use super::estimation::Estimate;
use super::fields::Part;
use super::leg::Leg;
use super::reference::References;
use super::state::State;
use super::wbc::Wbc;
use crate::digest::Digest;

/// Digests of a tick, indexed by stage.
#[derive(Default)]
pub struct Digests(pub [i64; 6]);

/// Digest of base, kinematics, dynamics, contact forces, height and ground.
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
        d.dmat(&estimate.contacts[leg].J);
        d.vec3(&estimate.contacts[leg].linear_bias());
        state.digest_leg(Part::Estimation, leg, &mut d);
    }
    state.digest(Part::Estimation, &mut d);
    d.finish()
}

/// Digest of gait clock, leg states, footholds, swing and joint references.
pub fn gait(references: &References, state: &State) -> i64 {
    let mut d = Digest::default();
    state.digest(Part::Gait, &mut d);
    for leg in Leg::ALL {
        state.digest_leg(Part::Gait, leg, &mut d);
        d.vec3(&references.p_BF_H[leg]);
        d.vec3(&references.v_BF_H[leg]);
        d.vec3(&references.foothold_H[leg]);
    }
    state.digest_joints(Part::Gait, &mut d);
    d.finish()
}

/// Digest of the motion while the robot stands up or sits down; it takes the place of [`gait`].
pub fn stand_sit(state: &State) -> i64 {
    let mut d = Digest::default();
    state.digest(Part::StandSit, &mut d);
    state.digest_joints(Part::StandSit, &mut d);
    d.finish()
}

/// Digest of cost, constraints and bounds of the quadratic programs.
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
    // Levels that are solved without building a quadratic program are covered by the rows of the tasks.
    if wbc.stack.built().len() < wbc.stack.levels.len() {
        for rows in &wbc.tasks.rows {
            d.dmat(&rows.A);
            d.dvec(&rows.b);
        }
    }
    d.vec3(&wbc.tasks.trunk.e_o_W);
    d.vec3(&wbc.tasks.trunk.wd);
    d.dvec(&wbc.tasks.posture.qdd);
    d.finish()
}

/// Digest of the solutions, their status, and the torques.
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
