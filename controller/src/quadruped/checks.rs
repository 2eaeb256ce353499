//! Checks of the input and of the robot's state that lead to the safe state in the same tick. Checks that other controllers share are in
//! [`crate::safety`].

use super::estimation::{Estimate, is_unit_quaternion};
use super::leg::{Leg, LegPhase};
use super::robot::Robot;
use super::state::State;
use super::swing::held_depth;
use crate::params::Params;
use crate::safety::{Fault, check_joint_values, fault, is_plausible};
use crate::time::seconds;
use lcmtypes::{ControllerTick, OperatorCommand, RobotState, TickInput};

/// Depth below the end of the search for the ground at which a robot with a held foot is falling, as a multiple of the step height.
const SINKING: f64 = 1.5;

/// Checks an input: array sizes, non-finite or implausible values, the norm of the orientation quaternion, the age of the measurement, and that the
/// clock advances. The accelerometer is not checked, because nothing is computed from it.
pub fn check_input(robot: &Robot, params: &Params, state: &State, input: &TickInput) -> Option<Fault> {
    let RobotState { t_ns, q_WI_wxyz, w_WI_I, .. } = &input.state;
    if let Some(found) = check_joint_values(robot.nj(), &input.state) {
        return Some(found);
    }
    // The base is estimated from the first IMU; the others are not used.
    let (Some(q_WI_wxyz), Some(w_WI_I)) = (q_WI_wxyz.first(), w_WI_I.first()) else {
        return fault(ControllerTick::FAULT_INPUT_SIZE, None, 0.0);
    };
    if let Some(x) = w_WI_I.iter().find(|x| !is_plausible(**x)) {
        return fault(ControllerTick::FAULT_INPUT_NOT_FINITE, None, *x);
    }
    if !is_unit_quaternion(q_WI_wxyz) {
        return fault(ControllerTick::FAULT_ORIENTATION, None, q_WI_wxyz[0]);
    }
    if state.started && input.t_ns <= state.t_ns {
        return fault(ControllerTick::FAULT_CLOCK, None, seconds(input.t_ns.saturating_sub(state.t_ns)));
    }
    let age = seconds(input.t_ns.saturating_sub(*t_ns));
    if age > params.safety.max_state_age {
        return fault(ControllerTick::FAULT_STATE_STALE, None, age);
    }
    // A measurement with a time in the future would never become too old.
    if age < -params.safety.max_state_age {
        return fault(ControllerTick::FAULT_CLOCK, None, age);
    }
    None
}

/// Checks that roll and pitch of the base are within the limit. No command can cause a larger tilt, so the robot is falling.
pub fn check_tilt(params: &Params, rpy: &[f64; 3]) -> Option<Fault> {
    let worst = if rpy[0].abs() > rpy[1].abs() { rpy[0] } else { rpy[1] };
    if worst.abs() > params.safety.max_tilt { fault(ControllerTick::FAULT_TILT, None, worst) } else { None }
}

/// Checks a standing or walking robot: the time without a foot on the ground, which it counts in `state`, and the height of the base.
pub fn check_ground_contact(robot: &Robot, params: &Params, state: &mut State, dt: f64) -> Option<Fault> {
    let safety = &params.safety;
    state.t_no_contact = if state.contact.0.contains(&true) { 0.0 } else { state.t_no_contact + dt };
    if state.t_no_contact > safety.max_flight_time {
        return fault(ControllerTick::FAULT_NO_CONTACT, None, state.t_no_contact);
    }
    if state.height < safety.min_height * robot.nominal_height {
        return fault(ControllerTick::FAULT_HEIGHT, None, state.height);
    }
    None
}

/// Checks that a robot which waits for a foot without ground ([`LegPhase::FaultHold`]) does not sink into the hole: that the foot, along the normal of the
/// ground, is at most `SINKING` step heights deeper below the standing feet than the search for the ground goes. Beyond that the robot is falling.
pub fn check_held_foot(params: &Params, estimate: &Estimate, state: &State) -> Option<Fault> {
    let height = |leg: Leg| estimate.n_W.dot(&estimate.legs[leg].p_BF_W);
    let (mut sum, mut n) = (0.0, 0.0);
    for leg in Leg::ALL.into_iter().filter(|leg| state.leg_state[*leg].is_stance()) {
        (sum, n) = (sum + height(leg), n + 1.0);
    }
    for leg in Leg::ALL.into_iter().filter(|leg| state.leg_state[*leg] == LegPhase::FaultHold) {
        // A leg that has never swung has no step height.
        let step_height = state.step_height[leg].max(params.swing.height);
        let limit = held_depth(step_height, &params.swing) + SINKING * step_height;
        let depth = if n > 0.0 { sum / n - height(leg) } else { 0.0 };
        if depth > limit {
            return fault(ControllerTick::FAULT_NO_GROUND, Some(leg as usize), depth);
        }
    }
    None
}

/// FAULT_NO_GROUND for the first leg whose search for the ground has ended ([`LegPhase::FaultHold`]): its foot is held, and the robot does not step on.
pub fn held_foot(params: &Params, state: &State) -> Option<Fault> {
    let leg = Leg::ALL.into_iter().find(|leg| state.leg_state[*leg] == LegPhase::FaultHold)?;
    let depth = held_depth(state.step_height[leg], &params.swing);
    fault(ControllerTick::FAULT_NO_GROUND, Some(leg as usize), depth)
}

/// Whether every number of an operator command is finite.
pub fn operator_is_finite(op: &OperatorCommand) -> bool {
    let OperatorCommand { v_H, yaw_rate, roll, pitch, height_offset, swing_frequency, duty, step_height, .. } = op;
    let numbers = [v_H[0], v_H[1], *yaw_rate, *roll, *pitch, *height_offset, *swing_frequency, *duty, *step_height];
    numbers.iter().all(|x| x.is_finite())
}
