//! The states of the controller as a whole, and what leads from one to another.
//!
//! | from | event | to | action |
//! |---|---|---|---|
//! | `IDLE` | first good input, the legs stretched as in standing | `STANCE` | references begin where the robot is |
//! | | operator asks to `STAND`, the robot rests and lies | `STAND_UP` | legs fold, then push ([`super::stand_sit`]) |
//! | | operator asks to `STAND`, the robot rests on stretched legs | `STANCE` | |
//! | | operator asks to `WALK` or `SIT`, or the robot does not rest | `IDLE` | refused |
//! | `STAND_UP` | stands on four feet | `STANCE` | |
//! | | operator asks to `SIT` | `SIT` | |
//! | | operator asks for `WALK` or `IDLE` | `STAND_UP` | refused |
//! | | a joint or foot does not get there in time | `DAMPING` | |
//! | `STANCE` | operator asks to `WALK` | `WALK` | the gait's clock starts |
//! | | operator asks to `SIT` | `SIT` | feet lower the base, legs fold, joints grow soft |
//! | | operator asks for `IDLE` | `STANCE` | refused: it would fall |
//! | `WALK` | operator asks for anything else, or is lost | `STANCE` | once the steps begun have landed; `IDLE` is refused |
//! | `SIT` | operator asks to `STAND` | `STAND_UP` | |
//! | | operator asks for `IDLE` | `IDLE` | once the robot lies |
//! | | operator asks for `WALK` | `SIT` | refused |
//! | | a joint does not get there in time | `DAMPING` | |
//! | any but `IDLE` before its first good input | a fault of [`super::safety`], or the operator asks for `DAMPING` | `DAMPING` | joints damped in the same tick |
//! | `DAMPING` | operator asks for `IDLE`, nothing is wrong any more, the robot rests | `IDLE` | |
//! | | anything else | `DAMPING` | |
//!
//! What is refused stands as FAULT_OPERATOR_REFUSED in the tick's `controller_tick_t`, with the mode asked for, for as long as it is asked for.
//! An operator who is lost (FAULT_OPERATOR_STALE), sends no numbers or an unknown mode asks for nothing: a walk ends, everything else stays.

use super::estimation::Estimate;
use super::leg::Leg;
use super::robot::Robot;
use super::safety::{self, fault, seconds};
use super::stand_sit::{REST_SPEED, Rise};
use super::state::{Fault, Mode, MovePhase, State};
use crate::params::Params;
use lcmtypes::{ControllerInput, ControllerTick, OperatorCommand, RobotState};

/// Part of the nominal height from which on a robot stands.
const STANDING: f64 = 0.75;
/// Time of rest after which torque may be taken away or a move begin, s.
const REST_TIME: f64 = 0.5;

/// What the operator wants of the robot as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// Nothing: there is no operator, or none that can be understood.
    None,
    /// To stand.
    Stand,
    /// To walk.
    Walk,
    /// To sit down.
    Sit,
    /// To be without torque.
    Idle,
    /// To be damped at once.
    Damping,
}

/// The wish of a tick, and what of it cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// What is followed.
    pub wish: Wish,
    /// Why that is not all that was asked.
    pub refused: Option<Fault>,
}

/// Reads the operator's wish. A command that is too old, holds numbers that are none, or a mode without meaning asks for nothing; the wish to be
/// damped is never too old.
pub fn asked(params: &Params, input: &ControllerInput) -> Asked {
    let op = &input.op;
    let nothing = |refused| Asked { wish: Wish::None, refused };
    if op.mode == OperatorCommand::MODE_DAMPING {
        return Asked { wish: Wish::Damping, refused: None };
    }
    if op.seq < 0 {
        return nothing(None);
    }
    let age = seconds(input.t_ns.saturating_sub(input.t_op_ns));
    if age > params.safety.max_operator_age {
        return nothing(fault(ControllerTick::FAULT_OPERATOR_STALE, None, age));
    }
    if !safety::operator_is_finite(op) {
        return nothing(fault(ControllerTick::FAULT_OPERATOR_NOT_FINITE, None, 0.0));
    }
    let wish = match op.mode {
        OperatorCommand::MODE_STAND => Wish::Stand,
        OperatorCommand::MODE_WALK => Wish::Walk,
        OperatorCommand::MODE_SIT => Wish::Sit,
        OperatorCommand::MODE_IDLE => Wish::Idle,
        _ => return nothing(refusal(op)),
    };
    Asked { wish, refused: None }
}

/// Follows the wish from state to state; gives the fault that leads to the safe state, if any. Walking begins and ends in [`super::gait`].
///
/// Whether an input is good has been found before: it is, here.
pub fn follow(
    robot: &Robot,
    params: &Params,
    rise: &Rise,
    estimate: &mut Estimate,
    state: &mut State,
    input: &ControllerInput,
    asked: &mut Asked,
) -> Option<Fault> {
    let measured = &input.state;
    if state.mode == Mode::StandUp && state.motion.phase == MovePhase::None {
        stand(robot, state, measured);
    }
    let rests = state.t_still >= REST_TIME;
    let mut refuse = || asked.refused = asked.refused.or(refusal(&input.op));
    match (state.mode, asked.wish) {
        (_, Wish::Damping) => return fault(ControllerTick::FAULT_OPERATOR, None, 0.0),
        (Mode::Idle, Wish::Idle) => state.started = true,
        (Mode::Idle, wish) if !state.started => {
            state.started = true;
            if stands(robot, estimate, measured) {
                stand(robot, state, measured);
            } else if wish != Wish::None {
                refuse();
            }
        }
        (Mode::Idle, Wish::Stand) if rests && stands(robot, estimate, measured) => stand(robot, state, measured),
        (Mode::Idle, Wish::Stand) if rests => rise.stand_up(measured, state),
        (Mode::Idle, Wish::Stand | Wish::Walk | Wish::Sit) => refuse(),
        (Mode::StandUp | Mode::Stance, Wish::Sit) => rise.sit(measured, state),
        (Mode::StandUp, Wish::Walk | Wish::Idle) | (Mode::Stance | Mode::Walk, Wish::Idle) => refuse(),
        (Mode::Sit, Wish::Stand) => rise.stand_up(measured, state),
        (Mode::Sit, Wish::Idle) if state.motion.phase == MovePhase::Lie => state.begin(Mode::Idle),
        (Mode::Sit, Wish::Walk) => refuse(),
        (Mode::Damping, Wish::Idle) => {
            estimate.update(robot, measured);
            let persists = safety::check_joints(&robot.model.joints, params, measured)
                .or_else(|| safety::check_tilt(params, &estimate.base.rpy))
                .or_else(|| if rests { None } else { refusal(&input.op) });
            match persists {
                Some(cause) => state.fault = cause,
                None => state.begin(Mode::Idle),
            }
        }
        _ => {}
    }
    if matches!(state.mode, Mode::Idle | Mode::Damping) {
        return None;
    }
    safety::check_joints(&robot.model.joints, params, measured)
}

/// Begins to stand where the robot is.
pub fn stand(robot: &Robot, state: &mut State, measured: &RobotState) {
    state.begin(Mode::Stance);
    state.q_des.copy_from_slice(&measured.q);
    state.yaw_des = super::estimation::base_estimate(robot, measured).rpy[2];
    state.height = robot.nominal_height;
}

/// Counts for how long the joints have been at rest.
pub fn rest(state: &mut State, measured: &RobotState, dt: f64) {
    let rests = measured.qd.iter().all(|qd| qd.abs() < REST_SPEED);
    state.t_still = if rests { state.t_still + dt } else { 0.0 };
}

/// The legs are as long as in standing, be it on the ground or in the air.
fn stands(robot: &Robot, estimate: &mut Estimate, measured: &RobotState) -> bool {
    estimate.update(robot, measured);
    let depth = Leg::ALL.into_iter().fold(0.0, |sum, leg| sum - estimate.legs[leg].p_BF_W.z) / 4.0;
    depth > STANDING * robot.nominal_height
}

fn refusal(op: &OperatorCommand) -> Option<Fault> {
    let mode = Fault { code: ControllerTick::FAULT_OPERATOR_REFUSED, index: op.mode.into(), value: 0.0 };
    Some(mode)
}
