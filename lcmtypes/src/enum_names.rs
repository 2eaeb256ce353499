//! Names of the messages' constants, for events, screens and reports. Every program takes them from here.

use crate::{ControllerTick, OperatorCommand, RequestReply};

/// Names of the legs, in the order of every array of four in a message: left front, right front, left hind, right hind.
pub const LEGS: [&str; 4] = ["LF", "RF", "LH", "RH"];

/// Name of a `controller_tick_t` MODE_*: `IDLE`, `WALK`, …; `?` for an unknown number.
pub fn mode(mode: i8) -> &'static str {
    match mode {
        ControllerTick::MODE_IDLE => "IDLE",
        ControllerTick::MODE_STANCE => "STANCE",
        ControllerTick::MODE_WALK => "WALK",
        ControllerTick::MODE_DAMPING => "DAMPING",
        ControllerTick::MODE_STAND_UP => "STAND_UP",
        ControllerTick::MODE_SIT => "SIT",
        _ => "?",
    }
}

/// Name of an `operator_command_t` MODE_*: `STAND`, `WALK`, …; `?` for an unknown number.
pub fn operator_mode(mode: i8) -> &'static str {
    match mode {
        OperatorCommand::MODE_STAND => "STAND",
        OperatorCommand::MODE_WALK => "WALK",
        OperatorCommand::MODE_DAMPING => "DAMPING",
        OperatorCommand::MODE_SIT => "SIT",
        OperatorCommand::MODE_IDLE => "IDLE",
        _ => "?",
    }
}

/// Name of a `request_reply_t` CODE_*, as in JSON output: `done`, `unknown_name`, …; `?` for an unknown number.
pub fn reply_code(code: i8) -> &'static str {
    match code {
        RequestReply::CODE_DONE => "done",
        RequestReply::CODE_REJECTED => "rejected",
        RequestReply::CODE_UNKNOWN_NAME => "unknown_name",
        RequestReply::CODE_OUT_OF_RANGE => "out_of_range",
        RequestReply::CODE_WRONG_STATE => "wrong_state",
        _ => "?",
    }
}

/// Meaning of a `controller_tick_t` FAULT_*, with the unit of its value.
pub fn fault(fault: i32) -> &'static str {
    match fault {
        ControllerTick::FAULT_NONE => "no fault",
        ControllerTick::FAULT_INPUT_SIZE => "number of joints in the state (0: no ROBOT_STATE has arrived)",
        ControllerTick::FAULT_INPUT_NOT_FINITE => "input not finite",
        ControllerTick::FAULT_ORIENTATION => "orientation is not a unit quaternion",
        ControllerTick::FAULT_STATE_STALE => "joint state too old (s)",
        ControllerTick::FAULT_CLOCK => "clock does not advance (s)",
        ControllerTick::FAULT_TILT => "tilt (rad)",
        ControllerTick::FAULT_QP => "QP failed too often (ticks)",
        ControllerTick::FAULT_OPERATOR => "requested by the operator",
        ControllerTick::FAULT_OPERATOR_NOT_FINITE => "operator command not finite",
        ControllerTick::FAULT_OPERATOR_RANGE => "operator command out of range",
        ControllerTick::FAULT_OPERATOR_STALE => "operator command too old (s)",
        ControllerTick::FAULT_JOINT_POSITION => "joint position out of range (rad)",
        ControllerTick::FAULT_JOINT_VELOCITY => "joint velocity too high (rad/s)",
        ControllerTick::FAULT_JOINT_TORQUE => "joint torque too high (N m)",
        ControllerTick::FAULT_NO_CONTACT => "no foot on the ground for too long (s)",
        ControllerTick::FAULT_CONTROLLER => "controller stopped by the executor",
        ControllerTick::FAULT_HEIGHT => "base too low (m)",
        ControllerTick::FAULT_POSTURE => "joint does not follow (rad from its reference)",
        ControllerTick::FAULT_COMMAND => "command not finite",
        ControllerTick::FAULT_OPERATOR_LIMITED => "operator command followed in part",
        ControllerTick::FAULT_NO_GROUND => "no ground under the foot (m deep)",
        ControllerTick::FAULT_COMPONENT => "commands of a component do not arrive, its joints are damped",
        ControllerTick::FAULT_OPERATOR_REFUSED => "requested mode not possible",
        _ => "?",
    }
}
