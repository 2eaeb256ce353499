//! Reactions to what was not planned: a push, a step that the swing runs into, ground that gives way. Each can be switched off.
//!
//! Beyond Raiola et al. 2020, as its open successor has them.

use super::estimation::Estimate;
use super::gait::{self, Timing};
use super::leg::{Leg, LegPhase, PerLeg};
use super::robot::Robot;
use super::state::{Mode, State};
use crate::math::{cos, sin};
use crate::model::GRAVITY;
use crate::params::Params;
use nalgebra::Vector3;

/// Part of the swing, from the lift-off, in which the force on the foot is that of the ground it leaves.
const REFLEX_BLIND_PART: f64 = 0.15;
/// Reflexes of a leg in one swing.
const MAX_REFLEXES: i32 = 2;
/// Part of the load of a touch below which a standing foot carries nothing.
const UNLOADED_PART: f64 = 0.2;

/// How far footholds are moved towards where the base would come to rest, m in H.
///
/// ```text
/// Δ = k √(h/g) (v - v_cmd),   |Δ| ≤ max
/// ```
pub fn capture(robot: &Robot, params: &Params, state: &State) -> [f64; 2] {
    let recovery = &params.recovery;
    if !recovery.capture_point {
        return [0.0; 2];
    }
    let time = recovery.capture_gain * (robot.nominal_height / GRAVITY).sqrt();
    let shift = [0, 1].map(|k| time * (state.v_H_est[k] - state.v_H_des[k]));
    let length = (shift[0] * shift[0] + shift[1] * shift[1]).sqrt();
    if length <= recovery.max_capture { shift } else { shift.map(|x| x * (recovery.max_capture / length)) }
}

/// What a leg has met that its swing or stance did not reckon with.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surprises {
    /// Legs whose swing has run into something in its first half: they begin it anew.
    pub struck: PerLeg<bool>,
    /// Standing legs that have carried nothing for a while, and are not meant to: they search for the ground.
    pub lost: PerLeg<bool>,
}

/// Looks for surprises; counts for how long a standing foot has carried nothing.
///
/// The force against the step strikes, not that along the normal: a foot that is still being unloaded has one.
pub fn surprises(robot: &Robot, params: &Params, estimate: &Estimate, state: &mut State, dt: f64) -> Surprises {
    let recovery = &params.recovery;
    let timing = Timing::of(state, params);
    let mut found = Surprises::default();
    for leg in Leg::ALL {
        let (phase, f_W) = (state.leg_phase[leg], state.f_F_W[leg]);
        let heading = state.step_heading[leg];
        let forward_W = estimate.base.R_WH * Vector3::new(cos(heading), sin(heading), 0.0);
        found.struck[leg] = recovery.step_reflex
            && phase == LegPhase::SwingUp
            && state.reflexes[leg] < MAX_REFLEXES
            && state.t_leg[leg] > REFLEX_BLIND_PART * timing.T_sw
            && f_W.dot(&forward_W) < -recovery.reflex_load * robot.weight;

        let empty = estimate.n_W.dot(&f_W) < UNLOADED_PART * params.contact.touch_load * robot.weight;
        let meant_to = gait::loaded_part(state, &timing, leg) < 1.0;
        let counts = state.mode == Mode::Walk && phase.is_stance() && empty && !meant_to;
        state.t_unloaded[leg] = if counts { state.t_unloaded[leg] + dt } else { 0.0 };
        let patience = recovery.lost_contact_time;
        found.lost[leg] = patience > 0.0 && state.t_unloaded[leg] > patience;
    }
    found
}
