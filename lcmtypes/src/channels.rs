//! Table of all channels: name, type, tick stage and class.

use crate::{
    BaseTracking, ComponentState, ContactEstimate, ControllerInput, ControllerTick, Event, ExecutorCommand,
    GroundTruth, JointReference, LegState, Message, OperatorCommand, ParameterChange, ParameterRequest, RequestReply,
    RobotCommand, RobotInfo, RobotState, RunInfo, Running, TaskReply, TaskRequest, TaskStatus, Timing, WbcSolution,
};

/// Description of the run, which makes a log self-contained; first message of a run.
pub const RUN_INFO: &str = "RUN_INFO";
/// Robot, joints and URDF of a driver, at its start and once a second.
pub const ROBOT_INFO: &str = "ROBOT_INFO";
/// Robot, joints and URDF that a run controls, at its start and once a second.
pub const EXPECTED_ROBOT: &str = "EXPECTED_ROBOT";
/// Measurements of the robot's driver.
pub const ROBOT_STATE: &str = "ROBOT_STATE";
/// Command of an operator.
pub const OPERATOR_COMMAND: &str = "OPERATOR_COMMAND";
/// Request to start or stop a controller of a live run.
pub const EXECUTOR_COMMAND: &str = "EXECUTOR_COMMAND";
/// Which controllers of a sequence run; only inside CONTROLLER_INPUT.
pub const RUNNING: &str = "RUNNING";
/// Request to change a parameter of the controller.
pub const PARAMETER_REQUEST: &str = "PARAMETER_REQUEST";
/// Outcome of a request.
pub const REQUEST_REPLY: &str = "REQUEST_REPLY";
/// Change of a controller parameter, and the first tick that uses it.
pub const PARAMETER_CHANGE: &str = "PARAMETER_CHANGE";
/// Everything that a component consumed in one tick.
pub const CONTROLLER_INPUT: &str = "CONTROLLER_INPUT";
/// Mode and fault of the controller after a tick, with one digest per stage.
pub const CONTROLLER_TICK: &str = "CONTROLLER_TICK";
/// Positions that some joints are to reach.
pub const JOINT_REFERENCE: &str = "JOINT_REFERENCE";
/// Request to a task of a Cartesian server.
pub const TASK_REQUEST: &str = "TASK_REQUEST";
/// Answers of a Cartesian server to the requests of a tick.
pub const TASK_REPLY: &str = "TASK_REPLY";
/// Tasks and levels of a Cartesian server.
pub const TASK_STATUS: &str = "TASK_STATUS";
/// Estimated contact forces and contact flags.
pub const CONTACT_ESTIMATE: &str = "CONTACT_ESTIMATE";
/// Base orientation and height: references, estimates, errors.
pub const BASE_TRACKING: &str = "BASE_TRACKING";
/// Gait and swing state of the legs.
pub const LEG_STATE: &str = "LEG_STATE";
/// Quadratic program of the tick and its solution.
pub const WBC_SOLUTION: &str = "WBC_SOLUTION";
/// Joint command of the controller.
pub const ROBOT_COMMAND: &str = "ROBOT_COMMAND";
/// Complete state of a component, once a second.
pub const CONTROLLER_SNAPSHOT: &str = "CONTROLLER_SNAPSHOT";
/// True state of a simulation; no controller reads it.
pub const GROUND_TRUTH: &str = "GROUND_TRUTH";
/// Start, end and stage durations of a tick, by the wall clock.
pub const TIMING: &str = "TIMING";
/// Event of a run, as a sentence for people.
pub const EVENT: &str = "EVENT";

/// Stage of a controller's tick, in the order of execution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// The input as consumed.
    Input,
    /// Base, kinematics, dynamics, contact forces, height.
    Estimation,
    /// Gait clock, leg states, footholds, swing and joint references.
    Gait,
    /// Cost, constraints and bounds of the quadratic program.
    Tasks,
    /// Solution of the quadratic program.
    Qp,
    /// The command.
    Output,
}

impl Stage {
    /// All stages, in the order of execution.
    pub const ALL: [Self; 6] = [Self::Input, Self::Estimation, Self::Gait, Self::Tasks, Self::Qp, Self::Output];
    /// Their names, as a component that has all of them lists them in RUN_INFO.
    pub const NAMES: [&'static str; 6] = ["input", "estimation", "gait", "tasks", "qp", "output"];

    /// Name in reports: `input`, `estimation`, `gait`, `tasks`, `qp`, `output`.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// Purpose of a channel. An overloaded recorder drops channels from the end of this list first; it never drops a replay input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Class {
    /// Describes the run; a log cannot be read without it.
    Meta,
    /// Fed to the controller by a replay.
    ReplayInput,
    /// Computed by the controller for the robot or for its own next tick; compared by a replay.
    Output,
    /// For people. Intermediate results of the controller have a stage and are compared by a replay; messages of other senders have none: they
    /// reach the controller inside its input.
    Debug,
    /// Known only to a simulator.
    Truth,
    /// Depends on the wall clock; never compared.
    Timing,
}

/// One row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channel {
    /// Name on the bus and in logs.
    pub name: &'static str,
    /// Type with package, such as `hoofprint.robot_state_t`.
    pub type_name: &'static str,
    /// Fingerprint: the first 8 bytes of each message.
    pub fingerprint: u64,
    /// Stage that computes its messages; `None` if no stage of a tick does.
    pub stage: Option<Stage>,
    /// Purpose.
    pub class: Class,
}

const fn channel<M: Message>(name: &'static str, stage: Option<Stage>, class: Class) -> Channel {
    Channel { name, type_name: M::TYPE, fingerprint: M::FINGERPRINT, stage, class }
}

/// All channels of the stack.
pub const CHANNELS: &[Channel] = &[
    channel::<RunInfo>(RUN_INFO, None, Class::Meta),
    channel::<RobotInfo>(ROBOT_INFO, None, Class::Meta),
    channel::<RobotInfo>(EXPECTED_ROBOT, None, Class::Meta),
    channel::<RobotState>(ROBOT_STATE, None, Class::Debug),
    channel::<OperatorCommand>(OPERATOR_COMMAND, None, Class::Debug),
    channel::<ExecutorCommand>(EXECUTOR_COMMAND, None, Class::Debug),
    channel::<Running>(RUNNING, None, Class::Debug),
    channel::<ParameterRequest>(PARAMETER_REQUEST, None, Class::Debug),
    channel::<RequestReply>(REQUEST_REPLY, None, Class::Debug),
    channel::<ParameterChange>(PARAMETER_CHANGE, None, Class::ReplayInput),
    channel::<ControllerInput>(CONTROLLER_INPUT, Some(Stage::Input), Class::ReplayInput),
    channel::<ControllerTick>(CONTROLLER_TICK, Some(Stage::Output), Class::Output),
    channel::<JointReference>(JOINT_REFERENCE, None, Class::Debug),
    channel::<TaskRequest>(TASK_REQUEST, None, Class::Debug),
    channel::<TaskReply>(TASK_REPLY, Some(Stage::Output), Class::Debug),
    channel::<TaskStatus>(TASK_STATUS, Some(Stage::Output), Class::Debug),
    channel::<ContactEstimate>(CONTACT_ESTIMATE, Some(Stage::Estimation), Class::Debug),
    channel::<BaseTracking>(BASE_TRACKING, Some(Stage::Estimation), Class::Debug),
    channel::<LegState>(LEG_STATE, Some(Stage::Gait), Class::Debug),
    channel::<WbcSolution>(WBC_SOLUTION, Some(Stage::Qp), Class::Debug),
    channel::<RobotCommand>(ROBOT_COMMAND, Some(Stage::Output), Class::Output),
    channel::<ComponentState>(CONTROLLER_SNAPSHOT, Some(Stage::Output), Class::Output),
    channel::<GroundTruth>(GROUND_TRUTH, None, Class::Truth),
    channel::<Timing>(TIMING, None, Class::Timing),
    channel::<Event>(EVENT, None, Class::Meta),
];

/// Component and name of a channel: `arms/ROBOT_COMMAND` is ROBOT_COMMAND of `arms`; the component is empty for a channel without one in front.
pub fn split(channel: &str) -> (&str, &str) {
    channel.split_once('/').unwrap_or(("", channel))
}

/// Row of a channel by its name.
pub fn find(name: &str) -> Option<&'static Channel> {
    CHANNELS.iter().find(|c| c.name == name)
}
