//! Quadratic programs: the problem, the interface of a solver back-end, and two back-ends: [`ActiveSetSolver`] for the robot and
//! [`ClarabelSolver`] as the reference. The parameter `[qp] solver` selects one.
//!
//! ```text
//! min  ½ xᵀ H x + gᵀ x     subject to   A x = b,   C x ≤ d,   l ≤ x ≤ u
//! ```
//! Sizes are constant for a controller: a row that is switched off keeps its index and gets bounds that are never active.

mod active_set;
mod clarabel_backend;
mod constraints;
mod envelope;
mod explain;
pub mod hierarchy;
mod levels;
mod null_space;
mod program;
mod search;
mod working_set;

pub use active_set::ActiveSetSolver;
pub use clarabel_backend::ClarabelSolver;
pub use explain::{NamedViolation, RowNames, explain};
pub(crate) use levels::{Levels, SquareRow};
pub use program::{Qp, QpInfo, QpRow, QpSolver, QpStatus};

use serde::{Deserialize, Serialize};

/// Parameters `[qp]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct QpParams {
    /// Solver back-end.
    pub solver: Backend,
}

impl Default for QpParams {
    fn default() -> Self {
        QpParams { solver: Backend::ActiveSet }
    }
}

/// Solver back-ends, by their names in the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Backend {
    /// [`ActiveSetSolver`].
    ActiveSet,
    /// [`ClarabelSolver`].
    Clarabel,
}

impl Backend {
    /// Builds a solver for programs with the sparsity pattern of `pattern`. `tolerance` is used by Clarabel only.
    pub fn build(self, pattern: &Qp, max_iterations: u32, tolerance: f64) -> Box<dyn QpSolver> {
        match self {
            Backend::ActiveSet => Box::new(ActiveSetSolver::new(pattern, max_iterations)),
            Backend::Clarabel => Box::new(ClarabelSolver::new(pattern, max_iterations, tolerance)),
        }
    }
}
