//! When the controller gives up: every check that leads to the safe state, in the same tick and with its reason.

use super::estimation::is_unit_quaternion;
use super::robot::Robot;
use super::state::{Fault, State};
use crate::model::JointInfo;
use crate::params::Params;
use lcmtypes::{ControllerInput, ControllerTick, OperatorCommand, RobotCommand, RobotState};

/// Largest number that a joint sensor or gyro may give, in its own unit: far above any real one, and far below where squares overflow. What is
/// above counts as not finite.
const MAX_MAGNITUDE: f64 = 1e6;

/// What is wrong with an input, if anything: sizes, numbers that are not finite, an orientation that is none, data that are old or
/// from the future, a clock that does not advance. The accelerometer is not looked at: nothing is computed from it.
pub fn check_input(robot: &Robot, params: &Params, state: &State, input: &ControllerInput) -> Option<Fault> {
    let RobotState { t_ns, q, qd, tau, q_WI_wxyz, w_WI_I, .. } = &input.state;
    let nj = robot.nj();
    for found in [q.len(), qd.len(), tau.len()] {
        if found != nj {
            #[expect(clippy::cast_precision_loss, reason = "a count for a person to read")]
            return fault(ControllerTick::FAULT_INPUT_SIZE, None, found as f64);
        }
    }
    for values in [q, qd, tau] {
        if let Some(j) = values.iter().position(|x| !is_plausible(*x)) {
            return fault(ControllerTick::FAULT_INPUT_NOT_FINITE, Some(j), values[j]);
        }
    }
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
    // A measurement from the future would never grow old.
    if age < -params.safety.max_state_age {
        return fault(ControllerTick::FAULT_CLOCK, None, age);
    }
    None
}

/// What a joint sensor or gyro can give.
pub fn is_plausible(x: f64) -> bool {
    x.abs() <= MAX_MAGNITUDE
}

/// The base leans further than any command may ask: the robot is falling.
pub fn check_tilt(params: &Params, rpy: &[f64; 3]) -> Option<Fault> {
    let worst = if rpy[0].abs() > rpy[1].abs() { rpy[0] } else { rpy[1] };
    if worst.abs() > params.safety.max_tilt { fault(ControllerTick::FAULT_TILT, None, worst) } else { None }
}

/// A joint that is where or as fast as it cannot be, or gives more torque than it can: by its limits in the URDF.
///
/// - `joints`: as many as the measurement has.
pub fn check_joints(joints: &[JointInfo], params: &Params, measured: &RobotState) -> Option<Fault> {
    let safety = &params.safety;
    for (j, joint) in joints.iter().enumerate() {
        let (q, qd, tau) = (measured.q[j], measured.qd[j], measured.tau[j]);
        if q < joint.lower - safety.position_margin || q > joint.upper + safety.position_margin {
            return fault(ControllerTick::FAULT_JOINT_POSITION, Some(j), q);
        }
        if qd.abs() > safety.velocity_factor * joint.velocity {
            return fault(ControllerTick::FAULT_JOINT_VELOCITY, Some(j), qd);
        }
        if tau.abs() > safety.torque_factor * joint.effort {
            return fault(ControllerTick::FAULT_JOINT_TORQUE, Some(j), tau);
        }
    }
    None
}

/// Of a robot that stands or walks: no foot has been on the ground for too long, or the base is too low over its feet.
pub fn check_footing(robot: &Robot, params: &Params, state: &mut State, dt: f64) -> Option<Fault> {
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

/// A command in which a number is none.
pub fn check_command(command: &RobotCommand) -> Option<Fault> {
    let RobotCommand { tau, q_des, qd_des, kp, kd, .. } = command;
    for values in [tau, q_des, qd_des, kp, kd] {
        if let Some(j) = values.iter().position(|x| !x.is_finite()) {
            return fault(ControllerTick::FAULT_COMMAND, Some(j), values[j]);
        }
    }
    None
}

/// The last step before a command leaves: what the drives will make of it at the measured state, `tau + kp (q_des - q) + kd (qd_des - qd)`, stays
/// within each joint's effort, in the safe state too.
pub fn limit(joints: &[JointInfo], command: &mut RobotCommand, measured: &RobotState) {
    for (j, joint) in joints.iter().enumerate() {
        let (Some(&q), Some(&qd)) = (measured.q.get(j), measured.qd.get(j)) else { continue };
        // What no sensor gives bounds nothing: it would take all damping away.
        if !is_plausible(q) || !is_plausible(qd) {
            continue;
        }
        match command.mode {
            RobotCommand::MODE_TORQUE => {
                let loop_ = command.kp[j] * (command.q_des[j] - q) + command.kd[j] * (command.qd_des[j] - qd);
                let total = command.tau[j] + loop_;
                if total.abs() > joint.effort {
                    command.tau[j] = total.clamp(-joint.effort, joint.effort) - loop_;
                }
            }
            RobotCommand::MODE_DAMPING if qd.abs() * command.kd[j] > joint.effort => {
                command.kd[j] = joint.effort / qd.abs();
            }
            _ => {}
        }
    }
}

/// Whether every number of a command is one.
pub fn operator_is_finite(op: &OperatorCommand) -> bool {
    let OperatorCommand { v_H, yaw_rate, roll, pitch, height_offset, swing_frequency, duty, step_height, .. } = op;
    let numbers = [v_H[0], v_H[1], *yaw_rate, *roll, *pitch, *height_offset, *swing_frequency, *duty, *step_height];
    numbers.iter().all(|x| x.is_finite())
}

/// A fault of a code, at a joint or leg, with the value found.
pub fn fault(code: i32, index: Option<usize>, value: f64) -> Option<Fault> {
    let index = index.map_or(-1, |i| i32::try_from(i).unwrap_or(i32::MAX));
    Some(Fault { code, index, value })
}

/// Nanoseconds to seconds.
pub fn seconds(ns: i64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "differences of clock values, far below 2^53 ns")]
    let seconds = ns as f64 * 1e-9;
    seconds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_with_a_number_that_is_none_is_a_fault_of_its_joint() {
        let zeros = || vec![0.0; 3];
        let good = RobotCommand {
            tau: zeros(),
            q_des: zeros(),
            qd_des: zeros(),
            kp: zeros(),
            kd: zeros(),
            ..Default::default()
        };
        assert_eq!(check_command(&good), None);
        let bad: [fn(&mut RobotCommand) -> &mut Vec<f64>; 5] =
            [|c| &mut c.tau, |c| &mut c.q_des, |c| &mut c.qd_des, |c| &mut c.kp, |c| &mut c.kd];
        for (number, values) in [f64::NAN, f64::INFINITY].into_iter().flat_map(|x| bad.map(|values| (x, values))) {
            let mut command = good.clone();
            values(&mut command)[2] = number;
            let found = check_command(&command).unwrap();
            assert_eq!((found.code, found.index), (ControllerTick::FAULT_COMMAND, 2));
        }
    }
}
