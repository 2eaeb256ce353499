//! Errors of building a controller and of restoring its state.

use crate::model::{DescriptionError, ModelError};
use crate::params::ParamsError;
use crate::stack::StackError;
use crate::trajectory::error::ReferenceError;

/// A snapshot that a controller cannot restore.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreError {
    /// The bytes are not an encoded state message.
    #[error("snapshot cannot be decoded: {0}")]
    Decode(#[from] lcmtypes::DecodeError),
    /// The state belongs to a robot with another number of joints.
    #[error("snapshot has {found} joints, the robot has {expected}")]
    Joints {
        /// Joints in the snapshot.
        found: usize,
        /// Joints of the model.
        expected: usize,
    },
    /// The state belongs to a run in which another number of components command joints.
    #[error("snapshot holds the commands of {found} other components, the run has {expected}")]
    Components {
        /// Components in the snapshot.
        found: usize,
        /// Components of the run.
        expected: usize,
    },
    /// The state belongs to another stack of tasks.
    #[error("snapshot holds {found} tasks, or tasks of other sizes; the stack has {expected}")]
    Tasks {
        /// Tasks in the snapshot.
        found: usize,
        /// Tasks of the stack.
        expected: usize,
    },
    /// The state belongs to a sequence with another number of controllers.
    #[error("snapshot holds {found} controllers, the run has {expected}")]
    Controllers {
        /// Controllers in the snapshot.
        found: usize,
        /// Controllers of the run.
        expected: usize,
    },
    /// A non-finite value in a field that the controller computes with.
    #[error("snapshot field {field} is not finite")]
    NotFinite {
        /// Field of the message.
        field: &'static str,
    },
    /// A reference of a task that no command could have set.
    #[error("snapshot: {0}")]
    Reference(#[from] ReferenceError),
    /// A number that names no value of its enumeration, such as an unknown leg state.
    #[error("snapshot field {field} is {found}, expected 0 to {last}")]
    Value {
        /// Field of the message.
        field: &'static str,
        /// Number in the snapshot.
        found: i64,
        /// Largest valid number.
        last: i64,
    },
}

/// A run description from which no controller can be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// No controller has this name.
    #[error(
        "unknown controller \"{found}\", expected quadruped, hold, posture, tour, cartesian_ik, or a list such as sequence(hold, quadruped)"
    )]
    UnknownController {
        /// Name in the run description.
        found: String,
    },
    /// The URDF is invalid.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The parameters are invalid.
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// The table `[robot]` does not fit the URDF.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// The stack of tasks is invalid, or does not fit the robot.
    #[error(transparent)]
    Stack(#[from] StackError),
    /// A stack file of the controller `cartesian_ik` is invalid, or does not fit the robot.
    #[error("stack file: {what}")]
    StackFile {
        /// What was found and what was expected.
        what: String,
    },
    /// The components of a run cannot share the joints of the robot.
    #[error("component \"{component}\": {what}")]
    Component {
        /// Name of the component.
        component: String,
        /// What was found and what was expected.
        what: String,
    },
    /// The controllers of a sequence cannot run together.
    #[error("sequence of controllers: {what}")]
    Sequence {
        /// What was found and what was expected.
        what: String,
    },
    /// The parameters do not fit the robot.
    #[error("robot \"{robot}\": {what}")]
    Robot {
        /// Name of the robot.
        robot: String,
        /// What was found and what was expected.
        what: String,
    },
}
