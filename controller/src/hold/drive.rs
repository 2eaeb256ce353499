//! What controllers share that move joints by the position loops of the drives alone: gains, postures, checks and messages.

use super::params::HoldParams;
use crate::digest::command_digest;
use crate::error::LoadError;
use crate::model::{JointDescription, JointInfo, RobotDescription};
use crate::outbox::Outbox;
use crate::safety::{Fault, SafetyParams, check_joint_limits, check_joint_values, fault, limit_command};
use crate::time::seconds;
use lcmtypes::channels;
use lcmtypes::{ControllerTick, Message, OperatorCommand, RobotCommand, TickInput};

/// Gains of the position loop of the drives, by joint: those of `[robot.joints]`, else `hold.kp` and `hold.kd`.
#[derive(Clone, Debug)]
pub(crate) struct Gains {
    /// Stiffness, N m/rad or N/m.
    kp: Vec<f64>,
    /// Damping, N m s/rad or N s/m.
    kd: Vec<f64>,
    /// Damping in the safe state, N m s/rad or N s/m.
    safe: Vec<f64>,
}

impl Gains {
    pub fn new(robot: &RobotDescription, params: &HoldParams, safety: &SafetyParams) -> Self {
        let joints = robot.joints.iter();
        Gains {
            kp: joints.clone().map(|joint| joint.stiffness.unwrap_or(params.kp)).collect(),
            kd: joints.map(|joint| joint.damping.unwrap_or(params.kd)).collect(),
            safe: safety.damping_of(robot),
        }
    }

    /// Sets mode and gains of a command.
    ///
    /// - `mode`: `controller_tick_t` MODE_*.
    pub fn fill(&self, mode: i8, command: &mut RobotCommand) {
        match mode {
            ControllerTick::MODE_STAND_UP | ControllerTick::MODE_STANCE => {
                command.mode = RobotCommand::MODE_TORQUE;
                command.kp.copy_from_slice(&self.kp);
                command.kd.copy_from_slice(&self.kd);
            }
            ControllerTick::MODE_IDLE => {
                command.mode = RobotCommand::MODE_IDLE;
                command.kp.fill(0.0);
                command.kd.fill(0.0);
            }
            _ => {
                command.mode = RobotCommand::MODE_DAMPING;
                command.kp.fill(0.0);
                command.kd.copy_from_slice(&self.safe);
            }
        }
    }
}

/// Positions of all joints in a posture of a robot, in the order of the URDF, rad or m.
///
/// # Errors
/// The robot does not have the posture, or the posture lacks a joint.
pub(crate) fn posture_of(robot: &RobotDescription, name: &str) -> Result<Vec<f64>, LoadError> {
    let posture = robot.posture(name)?;
    let of_joint = |joint: &JointDescription| {
        let what = || format!("joint {} is missing in posture {name}", joint.name);
        posture.get(&joint.name).copied().ok_or_else(|| LoadError::Robot { robot: robot.name.clone(), what: what() })
    };
    robot.joints.iter().map(of_joint).collect()
}

/// Checks an input. Tilt and contacts are not checked: a robot on a stand may lean, and its feet need no ground.
fn check(joints: &[JointInfo], params: &SafetyParams, input: &TickInput) -> Option<Fault> {
    if let Some(found) = check_joint_values(joints.len(), &input.state) {
        return Some(found);
    }
    let age = seconds(input.t_ns.saturating_sub(input.state.t_ns));
    if age.abs() > params.max_state_age {
        return fault(ControllerTick::FAULT_STATE_STALE, None, age);
    }
    if let Some(found) = check_joint_limits(joints, params, &input.state) {
        return Some(found);
    }
    if input.op.mode == OperatorCommand::MODE_DAMPING {
        return fault(ControllerTick::FAULT_OPERATOR, None, 0.0);
    }
    None
}

/// The fault of a tick, and whether the motion goes on. After an invalid input `mode` becomes `DAMPING`; before the first valid one it stays `IDLE`,
/// because the robot has no torque then.
pub(crate) fn judge(joints: &[JointInfo], params: &SafetyParams, input: &TickInput, mode: &mut i8) -> (Fault, bool) {
    let found = check(joints, params, input);
    if found.is_some() && *mode != ControllerTick::MODE_IDLE {
        *mode = ControllerTick::MODE_DAMPING;
    }
    (found.or_else(|| rejection(&input.op)).unwrap_or_default(), found.is_none())
}

/// The fault for a request that the controller does not follow: it only stands.
fn rejection(op: &OperatorCommand) -> Option<Fault> {
    let is_followed = op.seq < 0 || op.mode == OperatorCommand::MODE_STAND;
    let refused = Fault { code: ControllerTick::FAULT_OPERATOR_REFUSED, index: op.mode.into(), value: 0.0 };
    (!is_followed).then_some(refused)
}

/// Joint references with which a controller starts: those of the last command of the controller before it, so that a switch of controllers is
/// continuous. The executor delivers that command (ROBOT_COMMAND) in the tick in which a controller starts. Scratch: used in the same tick.
pub(crate) struct Handover {
    /// The last command.
    command: RobotCommand,
    has_command: bool,
}

impl Handover {
    /// For a robot with `nj` joints.
    pub fn new(nj: usize) -> Self {
        Handover { command: RobotCommand::zeros(nj), has_command: false }
    }

    /// Takes the last command; false if it cannot be decoded or is for another robot.
    pub fn take(&mut self, data: &[u8], nj: usize) -> bool {
        let decoded = self.command.decode_into(data).is_ok();
        self.has_command = decoded && self.command.q_des.len() == nj && self.command.kp.len() == nj;
        self.has_command
    }

    /// Fills the references of the first tick: the last command's where its drive followed a position within the limits of the joint, else the
    /// measured position.
    pub fn start(&self, joints: &[JointInfo], measured: &[f64], q_ref: &mut [f64]) {
        let RobotCommand { mode, q_des, kp, .. } = &self.command;
        let follows = self.has_command && *mode == RobotCommand::MODE_TORQUE;
        for (j, joint) in joints.iter().enumerate() {
            let is_followed = follows && kp[j] > 0.0 && (joint.lower..=joint.upper).contains(&q_des[j]);
            q_ref[j] = if is_followed { q_des[j] } else { measured[j] };
        }
    }

    /// Forgets the command.
    pub fn clear(&mut self) {
        self.has_command = false;
    }
}

/// Stages of a tick.
pub(crate) const STAGES: [&str; 2] = ["input", "output"];

/// The messages of a tick: command and status.
pub(crate) struct Output {
    /// The command, before effort limits.
    pub command: RobotCommand,
    status: ControllerTick,
}

impl Output {
    /// Allocates the messages of a robot with `nj` joints.
    pub fn new(nj: usize, digest_parameters: i64) -> Self {
        let status = ControllerTick {
            n_stages: i32::try_from(STAGES.len()).expect("two stages"),
            digest: vec![0; STAGES.len()],
            digest_parameters,
            ..ControllerTick::default()
        };
        Output { command: RobotCommand::zeros(nj), status }
    }

    /// Limits the command and fills the outbox.
    ///
    /// - `digest_input`: digest of the input.
    /// - `mode`, `fault`: those of the tick.
    pub fn publish(
        &mut self,
        joints: &[JointInfo],
        input: &TickInput,
        digest_input: i64,
        mode: i8,
        fault: Fault,
        out: &mut Outbox,
    ) {
        let Output { command, status } = self;
        (command.t_ns, command.tick, command.run_id) = (input.t_ns, input.tick, input.run_id);
        limit_command(joints, command, &input.state);
        (status.t_ns, status.tick, status.run_id) = (input.t_ns, input.tick, input.run_id);
        (status.mode, status.n_ignored) = (mode, input.n_ignored);
        (status.fault, status.fault_index, status.fault_value) = (fault.code, fault.index, fault.value);
        status.digest.copy_from_slice(&[digest_input, command_digest(command)]);
        out.clear();
        let put = out.put(channels::ROBOT_COMMAND, command).and_then(|()| out.put(channels::CONTROLLER_TICK, status));
        put.expect("every array has the length of the robot since construction");
    }

    /// Fills the command with NaN.
    pub fn poison(&mut self) {
        let RobotCommand { tau, q_des, qd_des, kp, kd, .. } = &mut self.command;
        for values in [tau, q_des, qd_des, kp, kd] {
            values.fill(f64::NAN);
        }
    }
}
