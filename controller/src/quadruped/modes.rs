//! Modes of the controller and the transitions between them.
//!
//! | from | event | to | action |
//! |---|---|---|---|
//! | `IDLE` | first valid input, legs at standing length | `STANCE` | references start at the present posture |
//! | | request `STAND`, the robot is at rest and lies | `STAND_UP` | legs fold, then push ([`super::stand_sit`]) |
//! | | request `STAND`, the robot is at rest with legs at standing length | `STANCE` | |
//! | | request `WALK` or `SIT`, or the robot is not at rest | `IDLE` | request rejected |
//! | `STAND_UP` | the robot stands on four feet | `STANCE` | |
//! | | request `SIT` | `SIT` | |
//! | | request `WALK` or `IDLE` | `STAND_UP` | request rejected |
//! | | a joint or foot does not reach its reference in time | `DAMPING` | |
//! | `STANCE` | request `WALK` | `WALK` | the gait clock starts |
//! | | request `SIT` | `SIT` | feet lower the base, legs fold, joint stiffness decreases |
//! | | request `IDLE` | `STANCE` | request rejected: the robot would fall |
//! | `WALK` | any other request, or the operator's messages time out | `STANCE` | after the swinging feet have landed; `IDLE` is rejected |
//! | `SIT` | request `STAND` | `STAND_UP` | |
//! | | request `IDLE` | `IDLE` | when the robot lies |
//! | | request `WALK` | `SIT` | request rejected |
//! | | a joint does not reach its reference in time | `DAMPING` | |
//! | any, except `IDLE` before its first valid input | a fault ([`super::checks`], [`crate::safety`]), or request `DAMPING` | `DAMPING` | joints damped in the same tick |
//! | `DAMPING` | request `IDLE`, no fault persists, the robot is at rest | `IDLE` | |
//! | | anything else | `DAMPING` | |
//!
//! While a request is rejected, the tick's `controller_tick_t` contains FAULT_OPERATOR_REFUSED with the requested mode. A command that is too old
//! (FAULT_OPERATOR_STALE), contains non-finite numbers or has an unknown mode requests nothing: the robot stops walking, and every other mode
//! continues.

use super::checks;
use super::estimation::{Estimate, base_estimate};
use super::leg::Leg;
use super::robot::Robot;
use super::stand_sit::{REST_SPEED, StandSit};
use super::state::{Mode, MovePhase, State};
use crate::params::Params;
use crate::safety::{Fault, check_joint_limits, fault};
use crate::time::seconds;
use lcmtypes::{ControllerTick, OperatorCommand, RobotState, TickInput};

/// Length of the legs above which the robot counts as standing, as a fraction of the nominal height.
const STANDING: f64 = 0.75;
/// Time at rest after which torque may be removed or a motion may start, s.
const REST_TIME: f64 = 0.5;

/// The mode that the operator requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModeRequest {
    /// No request: there is no operator command, or none that can be used.
    None,
    /// Stand.
    Stand,
    /// Walk.
    Walk,
    /// Sit down.
    Sit,
    /// No torque.
    Idle,
    /// Damped joints at once.
    Damping,
}

/// The operator's request in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OperatorRequest {
    /// The requested mode.
    pub mode: ModeRequest,
    /// The fault to report if the command, or a part of it, is rejected.
    pub rejected: Option<Fault>,
}

/// Reads the operator's request. A command that is too old, contains non-finite numbers or has an unknown mode requests nothing; a request for
/// damping is valid at any age.
pub fn operator_request(params: &Params, input: &TickInput) -> OperatorRequest {
    let op = &input.op;
    let none = |rejected| OperatorRequest { mode: ModeRequest::None, rejected };
    if op.mode == OperatorCommand::MODE_DAMPING {
        return OperatorRequest { mode: ModeRequest::Damping, rejected: None };
    }
    if op.seq < 0 {
        return none(None);
    }
    let age = seconds(input.t_ns.saturating_sub(input.t_op_ns));
    if age > params.safety.max_operator_age {
        return none(fault(ControllerTick::FAULT_OPERATOR_STALE, None, age));
    }
    if !checks::operator_is_finite(op) {
        return none(fault(ControllerTick::FAULT_OPERATOR_NOT_FINITE, None, 0.0));
    }
    let mode = match op.mode {
        OperatorCommand::MODE_STAND => ModeRequest::Stand,
        OperatorCommand::MODE_WALK => ModeRequest::Walk,
        OperatorCommand::MODE_SIT => ModeRequest::Sit,
        OperatorCommand::MODE_IDLE => ModeRequest::Idle,
        _ => return none(rejection(op)),
    };
    OperatorRequest { mode, rejected: None }
}

/// Changes the mode as requested; returns the fault that leads to the safe state, if any. [`super::gait`] starts and ends walking.
///
/// The input must have passed [`checks::check_input`]. If the request is not possible in the present mode, `request.rejected` is set.
pub fn follow(
    robot: &Robot,
    params: &Params,
    stand_sit: &StandSit,
    estimate: &mut Estimate,
    state: &mut State,
    input: &TickInput,
    request: &mut OperatorRequest,
) -> Option<Fault> {
    let measured = &input.state;
    if state.mode == Mode::StandUp && state.move_phase == MovePhase::None {
        enter_stance(robot, state, measured);
    }
    let at_rest = state.t_still >= REST_TIME;
    let mut reject = || request.rejected = request.rejected.or(rejection(&input.op));
    match (state.mode, request.mode) {
        (_, ModeRequest::Damping) => return fault(ControllerTick::FAULT_OPERATOR, None, 0.0),
        (Mode::Idle, ModeRequest::Idle) => state.started = true,
        (Mode::Idle, mode) if !state.started => {
            state.started = true;
            if is_standing(robot, estimate, measured) {
                enter_stance(robot, state, measured);
            } else if mode != ModeRequest::None {
                reject();
            }
        }
        (Mode::Idle, ModeRequest::Stand) if at_rest && is_standing(robot, estimate, measured) => {
            enter_stance(robot, state, measured);
        }
        (Mode::Idle, ModeRequest::Stand) if at_rest => stand_sit.stand_up(measured, state),
        (Mode::Idle, ModeRequest::Stand | ModeRequest::Walk | ModeRequest::Sit) => reject(),
        (Mode::StandUp | Mode::Stance, ModeRequest::Sit) => stand_sit.sit(measured, state),
        (Mode::StandUp, ModeRequest::Walk | ModeRequest::Idle)
        | (Mode::Stance | Mode::Walk, ModeRequest::Idle)
        | (Mode::Sit, ModeRequest::Walk) => reject(),
        (Mode::Sit, ModeRequest::Stand) => stand_sit.stand_up(measured, state),
        (Mode::Sit, ModeRequest::Idle) if state.move_phase == MovePhase::Lie => state.enter(Mode::Idle),
        (Mode::Damping, ModeRequest::Idle) => {
            estimate.update(robot, measured);
            let persists = check_joint_limits(&robot.model.joints, &params.safety, measured)
                .or_else(|| checks::check_tilt(params, &estimate.base.rpy))
                .or_else(|| if at_rest { None } else { rejection(&input.op) });
            match persists {
                Some(cause) => state.set_fault(cause),
                None => state.enter(Mode::Idle),
            }
        }
        _ => {}
    }
    if matches!(state.mode, Mode::Idle | Mode::Damping) {
        return None;
    }
    check_joint_limits(&robot.model.joints, &params.safety, measured)
}

/// Enters stance with references at the measured posture.
pub fn enter_stance(robot: &Robot, state: &mut State, measured: &RobotState) {
    state.enter(Mode::Stance);
    state.q_des.copy_from_slice(&measured.q);
    state.yaw_des = base_estimate(robot, measured).rpy[2];
    state.height = robot.nominal_height;
}

/// Counts the time for which all joints have been at rest.
pub fn update_rest_time(state: &mut State, measured: &RobotState, dt: f64) {
    let at_rest = measured.qd.iter().all(|qd| qd.abs() < REST_SPEED);
    state.t_still = if at_rest { state.t_still + dt } else { 0.0 };
}

/// Whether the legs have their standing length, on the ground or in the air.
fn is_standing(robot: &Robot, estimate: &mut Estimate, measured: &RobotState) -> bool {
    estimate.update(robot, measured);
    let depth = Leg::ALL.into_iter().fold(0.0, |sum, leg| sum - estimate.legs[leg].p_BF_W.z) / 4.0;
    depth > STANDING * robot.nominal_height
}

fn rejection(op: &OperatorCommand) -> Option<Fault> {
    Some(Fault { code: ControllerTick::FAULT_OPERATOR_REFUSED, index: op.mode.into(), value: 0.0 })
}
