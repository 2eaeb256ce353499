//! What a task of the quadruped's table provides.

use crate::params::Params;
use crate::quadruped::estimation::Estimate;
use crate::quadruped::reference::References;
use crate::quadruped::robot::Robot;
use crate::quadruped::state::State;
use crate::stack::{ModelState, Rows, Task};
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
    /// The same, as tasks for any robot read it.
    pub model: ModelState<'a>,
}

/// A task that a formula of the quadruped can name.
pub trait QuadrupedTask: Send {
    /// Allocates its rows.
    fn rows(&self) -> Rows;

    /// Writes its rows of a tick. Switches every block of `rows` on or off; does not allocate.
    fn fill(&mut self, input: &TaskInput<'_>, rows: &mut Rows);
}

/// A task for any robot that needs no reference besides the loads of the contacts.
pub struct FromLoads<T>(pub T);

impl<T: Task<Reference = ()>> QuadrupedTask for FromLoads<T> {
    fn rows(&self) -> Rows {
        self.0.rows()
    }

    fn fill(&mut self, input: &TaskInput<'_>, rows: &mut Rows) {
        self.0.update(&input.model, &(), rows);
    }
}
