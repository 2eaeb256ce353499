//! Stacks of tasks: what the controller is to do, in which order of importance, within which limits, as a value.
//!
//! A stack is written as a formula in the parameters, `[stack] formula`:
//!
//! ```text
//! 1e6 contact + 1e3 trunk + posture << base_dynamics << friction        one level, weighted: a soft stack
//! contact / trunk[0,1] / posture << base_dynamics << friction           three levels: a hard stack
//! ```
//! `+` adds tasks of one level by their weights (1 where none stands), `/` puts what follows strictly below, `<<` adds a
//! constraint to every level, `task[0,1]` takes these rows of a task alone. `+` binds before `/`, `/` before `<<`.
//!
//! [`Formula`] is the text, read; [`Rows`] what a task says in a tick, `A vd = b`; [`Cascade`] the quadratic programs of the levels
//! and their solution. Which tasks there are and what fills their rows is the controller's part ([`crate::quadruped::tasks`]).
//!
//! Source: Raiola et al. 2020, section 2.3, eqs. (13)-(15).

mod basis;
mod cartesian;
mod cascade;
mod error;
mod formula;
mod rows;

pub use basis::{Basis, DEPENDENT};
pub use cartesian::{Cartesian, CartesianConfig};
pub use cascade::{Cascade, Level, Solver, Term};
pub use error::StackError;
pub(crate) use formula::is_name;
pub use formula::{Constraint, Formula, Priority, TaskTerm};
pub use rows::Rows;

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The weighted stack of the source, eq. (15). Weights: the source asks for a ratio of at least 1e3 between neighbours.
pub const S1: &str =
    "1e6 contact + 1e3 trunk + posture << base_dynamics << friction << joint_acceleration << force_bounds";
/// The hierarchical stack of the source, eq. (14).
pub const S3: &str = "contact / trunk / posture << base_dynamics << friction << joint_acceleration << force_bounds";

/// Stack of tasks: `[stack]` in the parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StackParams {
    /// Tasks, levels and constraints.
    pub formula: String,
    /// Tasks of one's own, by name, besides the built-in ones.
    pub tasks: BTreeMap<String, TaskConfig>,
}

impl Default for StackParams {
    fn default() -> Self {
        StackParams { formula: S1.to_owned(), tasks: BTreeMap::new() }
    }
}

/// A task of one's own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum TaskConfig {
    /// Pose of a link.
    Cartesian(CartesianConfig),
}
