//! Stacks of tasks: the tasks of a controller, their priorities and the constraints.
//!
//! A stack is a formula in the parameters, `[stack] formula`:
//!
//! ```text
//! 1e6 contact + 1e3 trunk + posture << base_dynamics << friction        one level, weighted: a soft stack
//! contact / trunk[0,1] / posture << base_dynamics << friction           three levels: a hard stack
//! ```
//! `+` combines tasks of one level by their weights (default 1), `/` starts a level of strictly lower priority, `<<` adds a
//! constraint to every level, and `task[0,1]` uses only these rows of a task. `+` binds stronger than `/`, `/` stronger than `<<`.
//!
//! [`Formula`] is the parsed text, [`Rows`] the rows `A vd = b` of a task in a tick, [`Cascade`] the quadratic programs of the levels
//! and their solution. The controller defines the tasks and fills their rows ([`crate::quadruped::tasks`]).
//!
//! Source: Raiola et al. 2020, section 2.3, eqs. (13)-(15).

mod basis;
mod cascade;
mod error;
mod formula;
mod physical;
mod registry;
mod rows;
mod variables;

pub use basis::{Basis, DEPENDENT};
pub use cascade::{Cascade, Level, Solver, Term};
pub use error::StackError;
pub(crate) use formula::is_name;
pub use formula::{ConstraintTerm, Formula, Priority, TaskTerm};
pub use physical::{Constraint, ConstraintRows, ModelState, PhysicalLevel, Size, Structure, Task, pattern, update_all};
pub use registry::{Entry, Registry};
pub use rows::Rows;
pub use variables::Variables;

use crate::tasks::acceleration::CartesianConfig;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The weighted stack of the source, eq. (15), and the torque limits, which the source does not have. The source requires a ratio of at least 1e3 between the weights of adjacent tasks.
pub const S1: &str = "1e6 contact + 1e3 trunk + posture << base_dynamics << friction << joint_acceleration << force_bounds << torque_limits";
/// The hierarchical stack of the source, eq. (14), and the torque limits.
pub const S3: &str =
    "contact / trunk / posture << base_dynamics << friction << joint_acceleration << force_bounds << torque_limits";

/// Parameters `[stack]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StackParams {
    /// Tasks, levels and constraints.
    pub formula: String,
    /// User-defined tasks by name, in addition to the built-in tasks.
    pub tasks: BTreeMap<String, TaskConfig>,
}

impl Default for StackParams {
    fn default() -> Self {
        StackParams { formula: S1.to_owned(), tasks: BTreeMap::new() }
    }
}

/// A user-defined task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum TaskConfig {
    /// Pose of a link.
    Cartesian(CartesianConfig),
}
