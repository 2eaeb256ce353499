//! The one table of channels: name, type, and what each is for.

use crate::{
    BaseTracking, ContactEstimate, ControllerInput, ControllerTick, Event, ExecutorCommand, GroundTruth, LegState,
    Message, OperatorCommand, ParameterChange, ParameterRequest, QuadrupedState, RobotCommand, RobotState, RunInfo,
    Timing, WbcSolution,
};

/// All that a log needs to explain itself; first message of a run.
pub const RUN_INFO: &str = "RUN_INFO";
/// What the robot's driver measured.
pub const ROBOT_STATE: &str = "ROBOT_STATE";
/// What the operator wants.
pub const OPERATOR_COMMAND: &str = "OPERATOR_COMMAND";
/// What is asked of a live run's executor.
pub const EXECUTOR_COMMAND: &str = "EXECUTOR_COMMAND";
/// A parameter of the controller that somebody wants otherwise.
pub const PARAMETER_REQUEST: &str = "PARAMETER_REQUEST";
/// A parameter of the controller that is otherwise from a tick on.
pub const PARAMETER_CHANGE: &str = "PARAMETER_CHANGE";
/// Everything that the controller consumed in one tick.
pub const CONTROLLER_INPUT: &str = "CONTROLLER_INPUT";
/// What the controller was and how its tick went, with one digest a stage.
pub const CONTROLLER_TICK: &str = "CONTROLLER_TICK";
/// Contact forces and flags.
pub const CONTACT_ESTIMATE: &str = "CONTACT_ESTIMATE";
/// Base orientation and height: references, estimates, errors.
pub const BASE_TRACKING: &str = "BASE_TRACKING";
/// Gait and swing of the legs.
pub const LEG_STATE: &str = "LEG_STATE";
/// The quadratic program and its solution.
pub const WBC_SOLUTION: &str = "WBC_SOLUTION";
/// What the controller asks of the joints.
pub const ROBOT_COMMAND: &str = "ROBOT_COMMAND";
/// The controller's whole state, once a second.
pub const CONTROLLER_SNAPSHOT: &str = "CONTROLLER_SNAPSHOT";
/// What a simulator knows and no controller may read.
pub const GROUND_TRUTH: &str = "GROUND_TRUTH";
/// When a tick ran, by the wall clock.
pub const TIMING: &str = "TIMING";
/// Something that happened, for a person to read.
pub const EVENT: &str = "EVENT";

/// Part of a controller's tick, in the order in which they run.
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
    /// Its solution.
    Qp,
    /// The command.
    Output,
}

impl Stage {
    /// Every stage, in the order in which they run.
    pub const ALL: [Self; 6] = [Self::Input, Self::Estimation, Self::Gait, Self::Tasks, Self::Qp, Self::Output];

    /// Name in reports: `input`, `estimation`, `gait`, `tasks`, `qp`, `output`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Input => "input",
            Self::Estimation => "estimation",
            Self::Gait => "gait",
            Self::Tasks => "tasks",
            Self::Qp => "qp",
            Self::Output => "output",
        }
    }
}

/// What a channel is for; under pressure a recorder drops from the end of this list, and never a replay input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Class {
    /// Describes the run: without it no log can be read.
    Meta,
    /// Fed to the controller by a replay.
    ReplayInput,
    /// Computed by the controller for the robot or for itself, and compared by a replay.
    Output,
    /// For people: what the controller found on its way, which has a stage and is compared by a replay, and what others sent, which
    /// has none and reaches the controller inside its input.
    Debug,
    /// Known to a simulator only.
    Truth,
    /// Depends on a wall clock: never compared.
    Timing,
}

/// One line of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channel {
    /// Name on the bus and in logs.
    pub name: &'static str,
    /// Type with package, such as `hoofprint.robot_state_t`.
    pub type_name: &'static str,
    /// Fingerprint that its messages begin with.
    pub fingerprint: u64,
    /// Stage of the tick whose result it carries; `None` for what does not come from a tick.
    pub stage: Option<Stage>,
    /// What it is for.
    pub class: Class,
}

const fn channel<M: Message>(name: &'static str, stage: Option<Stage>, class: Class) -> Channel {
    Channel { name, type_name: M::TYPE, fingerprint: M::FINGERPRINT, stage, class }
}

/// Every channel of the stack.
pub const CHANNELS: &[Channel] = &[
    channel::<RunInfo>(RUN_INFO, None, Class::Meta),
    channel::<RobotState>(ROBOT_STATE, None, Class::Debug),
    channel::<OperatorCommand>(OPERATOR_COMMAND, None, Class::Debug),
    channel::<ExecutorCommand>(EXECUTOR_COMMAND, None, Class::Debug),
    channel::<ParameterRequest>(PARAMETER_REQUEST, None, Class::Debug),
    channel::<ParameterChange>(PARAMETER_CHANGE, None, Class::ReplayInput),
    channel::<ControllerInput>(CONTROLLER_INPUT, Some(Stage::Input), Class::ReplayInput),
    channel::<ControllerTick>(CONTROLLER_TICK, Some(Stage::Output), Class::Output),
    channel::<ContactEstimate>(CONTACT_ESTIMATE, Some(Stage::Estimation), Class::Debug),
    channel::<BaseTracking>(BASE_TRACKING, Some(Stage::Estimation), Class::Debug),
    channel::<LegState>(LEG_STATE, Some(Stage::Gait), Class::Debug),
    channel::<WbcSolution>(WBC_SOLUTION, Some(Stage::Qp), Class::Debug),
    channel::<RobotCommand>(ROBOT_COMMAND, Some(Stage::Output), Class::Output),
    channel::<QuadrupedState>(CONTROLLER_SNAPSHOT, Some(Stage::Output), Class::Output),
    channel::<GroundTruth>(GROUND_TRUTH, None, Class::Truth),
    channel::<Timing>(TIMING, None, Class::Timing),
    channel::<Event>(EVENT, None, Class::Meta),
];

/// The line of a channel.
pub fn find(name: &str) -> Option<&'static Channel> {
    CHANNELS.iter().find(|c| c.name == name)
}
