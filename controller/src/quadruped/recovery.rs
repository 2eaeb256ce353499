//! Reactions to disturbances: a push, an obstacle in the way of a swinging foot, ground that gives way. Each can be switched off by a parameter.
//!
//! Not part of Raiola et al. 2020; its open-source successor contains similar reactions.

use super::estimation::Estimate;
use super::foot_load::load_fraction;
use super::leg::{Leg, LegPhase, PerLeg};
use super::robot::Robot;
use super::state::{Mode, State};
use super::timing::Timing;
use crate::math::{cos, sin};
use crate::model::GRAVITY;
use crate::params::Params;
use nalgebra::Vector3;

/// Fraction of the swing time after the lift-off in which no collision is detected: the force on the foot may still be that of the stance.
const REFLEX_BLIND_FRACTION: f64 = 0.15;
/// Largest number of reflexes of a leg in one swing.
const MAX_REFLEXES: i32 = 2;
/// Fraction of the contact threshold below which a standing foot counts as unloaded.
const UNLOADED_FRACTION: f64 = 0.2;

/// Shift of the footholds towards the point where the base would come to rest, m in H.
///
/// ```text
/// Δ = k √(h/g) (v - v_cmd) max(0, 1 - threshold / |v - v_cmd|),   |Δ| ≤ max
/// ```
pub fn capture(robot: &Robot, params: &Params, state: &State) -> [f64; 2] {
    let recovery = &params.recovery;
    if !recovery.capture_point {
        return [0.0; 2];
    }
    let time = recovery.capture_gain * (robot.nominal_height / GRAVITY).sqrt();
    let error = [0, 1].map(|k| state.v_H_est[k] - state.v_H_des[k]);
    let speed = (error[0] * error[0] + error[1] * error[1]).sqrt();
    if speed <= recovery.capture_threshold {
        return [0.0; 2];
    }
    let above = 1.0 - recovery.capture_threshold / speed;
    let shift = error.map(|v| time * v * above);
    let length = (shift[0] * shift[0] + shift[1] * shift[1]).sqrt();
    if length <= recovery.max_capture { shift } else { shift.map(|x| x * (recovery.max_capture / length)) }
}

/// Contact events that the gait did not plan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactEvents {
    /// Legs that hit an obstacle in the first half of their swing. They restart the swing.
    pub collision: PerLeg<bool>,
    /// Standing legs that lost their load for longer than `recovery.lost_contact_time` although they should carry it. They search for the ground.
    pub lost: PerLeg<bool>,
}

/// Detects contact events, and counts the time for which each standing foot has been unloaded.
///
/// A collision is a force against the direction of the step. The normal force is no criterion: a foot that is still unloading has one.
pub fn contact_events(
    robot: &Robot,
    params: &Params,
    estimate: &Estimate,
    state: &mut State,
    dt: f64,
) -> ContactEvents {
    let recovery = &params.recovery;
    let timing = Timing::of(state, params);
    let mut events = ContactEvents::default();
    for leg in Leg::ALL {
        let (phase, f_W) = (state.leg_state[leg], state.f_F_W[leg]);
        let heading = state.step_heading[leg];
        let forward_W = estimate.base.R_WH * Vector3::new(cos(heading), sin(heading), 0.0);
        events.collision[leg] = recovery.step_reflex
            && phase == LegPhase::SwingUp
            && state.reflexes[leg] < MAX_REFLEXES
            && state.t_leg[leg] > REFLEX_BLIND_FRACTION * timing.T_sw
            && f_W.dot(&forward_W) < -recovery.reflex_load * robot.weight;

        let unloaded = estimate.n_W.dot(&f_W) < UNLOADED_FRACTION * params.contact.touch_load * robot.weight;
        let unloading = load_fraction(state, &timing, leg) < 1.0;
        let counts = state.mode == Mode::Walk && phase.is_stance() && unloaded && !unloading;
        state.t_unloaded[leg] = if counts { state.t_unloaded[leg] + dt } else { 0.0 };
        let limit = recovery.lost_contact_time;
        events.lost[leg] = limit > 0.0 && state.t_unloaded[leg] > limit;
    }
    events
}
