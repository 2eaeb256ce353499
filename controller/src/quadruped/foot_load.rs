//! Which feet carry load, and how much they may carry.

use super::leg::Leg;
use super::state::{Mode, State};
use super::timing::{Timing, gait_params, time_to_lift_off};
use crate::model::GRAVITY;
use crate::params::Params;

/// Time without a foot on the ground after which the robot counts as airborne, s: longer than contact estimates take to change from one pair of
/// legs to the next.
const AIRBORNE_TIME: f64 = 0.05;
/// Upper limit of the lower force bound of a foot, as a fraction of the load at which its contact ends.
const MAX_LOWER_BOUND: f64 = 0.8;

/// Whether a foot carries load: it is in stance, and the robot is not airborne.
pub fn carries(state: &State, leg: Leg) -> bool {
    state.leg_state[leg].is_stance() && !is_airborne(state)
}

/// Whether the robot is airborne: no contact force acts, and the trunk could be turned only by swinging the legs.
pub fn is_airborne(state: &State) -> bool {
    state.t_no_contact > AIRBORNE_TIME
}

/// Bounds on the vertical force of a foot, N: the stance values, zero in swing, and ramps between them so that no force jumps.
///
/// Source: Raiola et al. 2020, section 6, where the upper bound decreases continuously to zero before the lift-off. On the ramps the lower bound is
/// at most half the upper bound, so that the feasible set has an interior point. While a leg unloads or swings, the lower bound of the
/// opposite leg increases to the gait's residual load: this keeps the centre of mass away from the edge of the support triangle, over which the robot
/// would tip. The lower bound stays below the load at which a contact ends. Otherwise the commanded force alone would make a light robot's
/// feet count as in contact while they are in the air.
///
/// - `timing`: the timing in use.
/// - `mass`: mass of the robot, kg.
pub fn force_bounds(state: &State, params: &Params, timing: &Timing, mass: f64, leg: Leg) -> (f64, f64) {
    if !state.leg_state[leg].is_stance() {
        return (0.0, 0.0);
    }
    let upper = params.wbc.f_z_max * load_fraction(state, timing, leg);
    let weight = mass * GRAVITY;
    let least = params.wbc.f_z_min.min(MAX_LOWER_BOUND * params.contact.release_load * weight);
    let residual = (gait_params(state.gait, params).residual_load * weight - least).max(0.0);
    let lower = least + residual * (1.0 - load_fraction(state, timing, leg.opposite()));
    (lower.min(0.5 * upper), upper)
}

/// Fraction of its full load that a foot may carry, 0 to 1.
pub fn load_fraction(state: &State, timing: &Timing, leg: Leg) -> f64 {
    if !state.leg_state[leg].is_stance() {
        return 0.0;
    }
    let mut fraction = 1.0_f64;
    if state.mode == Mode::Walk {
        fraction = fraction.min((state.t_leg[leg] + 1e-3) / timing.T_ramp);
        if state.gait_running {
            fraction = fraction.min(time_to_lift_off(state, timing, leg) / timing.T_ramp);
        }
    }
    fraction.max(0.0)
}
