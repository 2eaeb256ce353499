//! What a task of the table in [`super`] provides.

use crate::params::Params;
use crate::quadruped::estimation::Estimate;
use crate::quadruped::reference::References;
use crate::quadruped::robot::Robot;
use crate::quadruped::state::State;
use crate::stack::Rows;
use lcmtypes::RobotState;

/// What the tasks are computed from in a tick.
#[derive(Clone, Copy)]
pub struct TaskInput<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// Parameters.
    pub params: &'a Params,
    /// Measured joint positions and velocities.
    pub measured: &'a RobotState,
    /// Estimates of base and feet.
    pub estimate: &'a Estimate,
    /// References of feet and joints.
    pub references: &'a References,
    /// State after the gait of this tick.
    pub state: &'a State,
}

/// A task that a formula can name.
pub trait Task: Send {
    /// Writes its rows of a tick. Switches every block of `rows` on or off; does not allocate.
    fn fill(&mut self, input: &TaskInput<'_>, rows: &mut Rows);
}

/// Builds a task of a robot, and its rows.
pub type NewTask = fn(&Robot) -> (Rows, Box<dyn Task>);
