//! The tasks and constraints that the formula of a quadruped can name: one line each, the name, the physical level and the constructor.

use super::tasks::{FromLoads, QuadrupedTask, relative_feet, swing};
use crate::constraints::acceleration::{BaseDynamics, JointAcceleration};
use crate::constraints::force::{ForceBounds, Friction, TorqueLimits};
use crate::params::Params;
use crate::quadruped::robot::Robot;
use crate::stack::PhysicalLevel::{Acceleration, Force};
use crate::stack::{Constraint, Entry, PhysicalLevel, Registry, Structure};
use crate::tasks::force::{ConeCenter, InternalForces};

/// Constructor of a task.
pub enum NewTask {
    /// Computed in every tick, because messages contain its errors; see [`Tasks`](super::tasks::Tasks).
    BuiltIn,
    /// Computed if the formula names it.
    Further(fn(&Structure<'_>, &Robot) -> Box<dyn QuadrupedTask>),
}

/// Constructor of a constraint. The number is the unit of the slack, N m.
pub type NewConstraint = fn(&Structure<'_>, &Params, f64) -> Box<dyn Constraint>;

/// Name of the constraint that needs the slack.
pub const TORQUE_LIMITS: &str = "torque_limits";
/// Name of the Cartesian swing task.
pub const SWING: &str = "swing";

const BUILT_IN: NewTask = NewTask::BuiltIn;

const fn task(name: &'static str, level: PhysicalLevel, new: NewTask) -> Entry<NewTask> {
    Entry { name, level, new }
}

const fn constraint(name: &'static str, level: PhysicalLevel, new: NewConstraint) -> Entry<NewConstraint> {
    Entry { name, level, new }
}

/// The table.
pub const REGISTRY: Registry<NewTask, NewConstraint> = Registry {
    tasks: &[
        task("contact", Acceleration, BUILT_IN),
        task("trunk", Acceleration, BUILT_IN),
        task("posture", Acceleration, BUILT_IN),
        task("relative_feet", Acceleration, NewTask::Further(relative_feet::new)),
        task(SWING, Acceleration, NewTask::Further(swing::new)),
        task("cone_center", Force, NewTask::Further(|of, _| Box::new(FromLoads(ConeCenter::new(of))))),
        task("internal_forces", Force, NewTask::Further(|of, _| Box::new(FromLoads(InternalForces::new(of))))),
    ],
    constraints: &[
        constraint("base_dynamics", Acceleration, |of, _, _| Box::new(BaseDynamics::new(of))),
        constraint("friction", Force, |of, params, _| Box::new(Friction::new(of, params.wbc.friction))),
        constraint("joint_acceleration", Acceleration, |of, params, _| {
            Box::new(JointAcceleration::new(of, params.wbc.qdd_max))
        }),
        constraint("force_bounds", Force, |of, _, _| Box::new(ForceBounds::new(of))),
        constraint(TORQUE_LIMITS, Force, |of, _, slack_unit| Box::new(TorqueLimits::new(of, slack_unit))),
    ],
    needed: &["base_dynamics", "force_bounds"],
};
