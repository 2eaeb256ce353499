//! Quadratic programs: the problem as the tasks build it, the contract of a back-end, and two of them: [`ActiveSetSolver`] for the robot,
//! [`ClarabelSolver`] as the reference. `[qp] solver` chooses.
//!
//! ```text
//! min  ½ xᵀ H x + gᵀ x     subject to   A x = b,   C x ≤ d,   l ≤ x ≤ u
//! ```
//! Sizes are constant for a controller: what is switched off keeps its rows and has its numbers released.

mod active_set;
mod clarabel_backend;
mod constraints;
mod dense;
mod envelope;
mod explain;
mod working_set;

pub use active_set::ActiveSetSolver;
pub use clarabel_backend::ClarabelSolver;
pub use explain::{NamedViolation, RowNames, explain};

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Which back-end solves: `[qp]` in the parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct QpParams {
    /// The back-end.
    pub solver: Backend,
}

impl Default for QpParams {
    fn default() -> Self {
        QpParams { solver: Backend::ActiveSet }
    }
}

/// A back-end, by its name in the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Backend {
    /// [`ActiveSetSolver`].
    ActiveSet,
    /// [`ClarabelSolver`].
    Clarabel,
}

impl Backend {
    /// A solver for programs with the pattern of `pattern`; `tolerance` is Clarabel's, the active set needs none.
    pub fn build(self, pattern: &Qp, max_iterations: u32, tolerance: f64) -> Box<dyn QpSolver> {
        match self {
            Backend::ActiveSet => Box::new(ActiveSetSolver::new(pattern, max_iterations)),
            Backend::Clarabel => Box::new(ClarabelSolver::new(pattern, max_iterations, tolerance)),
        }
    }
}

/// A convex quadratic program, `H` symmetric positive definite.
#[derive(Clone, Debug, PartialEq)]
pub struct Qp {
    /// Hessian, n x n, both triangles filled.
    pub H: DMatrix<f64>,
    /// Gradient at 0, n.
    pub g: DVector<f64>,
    /// Equality rows, `n_eq` x n.
    pub A: DMatrix<f64>,
    /// Their right side.
    pub b: DVector<f64>,
    /// Inequality rows, `n_in` x n.
    pub C: DMatrix<f64>,
    /// Their upper side.
    pub d: DVector<f64>,
    /// Lower bounds, n; -∞ where there is none, for good.
    pub lower: DVector<f64>,
    /// Upper bounds, n; +∞ where there is none, for good.
    pub upper: DVector<f64>,
}

impl Qp {
    /// A program of `n` variables, `n_eq` equality and `n_in` inequality rows, all numbers 0 and all variables unbounded.
    pub fn zeros(n: usize, n_eq: usize, n_in: usize) -> Self {
        Qp {
            H: DMatrix::zeros(n, n),
            g: DVector::zeros(n),
            A: DMatrix::zeros(n_eq, n),
            b: DVector::zeros(n_eq),
            C: DMatrix::zeros(n_in, n),
            d: DVector::zeros(n_in),
            lower: DVector::from_element(n, f64::NEG_INFINITY),
            upper: DVector::from_element(n, f64::INFINITY),
        }
    }

    /// Number of variables.
    pub fn n(&self) -> usize {
        self.g.len()
    }

    /// Largest violation of a row or bound at `x`, each in its own unit.
    pub fn violation(&self, x: &DVector<f64>) -> f64 {
        let row = |m: &DMatrix<f64>, i: usize| (0..x.len()).fold(0.0, |sum, j| sum + m[(i, j)] * x[j]);
        let mut worst = 0.0_f64;
        for i in 0..self.b.len() {
            worst = worst.max((row(&self.A, i) - self.b[i]).abs());
        }
        for i in 0..self.d.len() {
            worst = worst.max(row(&self.C, i) - self.d[i]);
        }
        for i in 0..x.len() {
            worst = worst.max(self.lower[i] - x[i]).max(x[i] - self.upper[i]);
        }
        worst
    }
}

/// How a solve went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QpStatus {
    /// Within tolerance.
    Solved,
    /// Within the solver's reduced tolerance.
    AlmostSolved,
    /// No point satisfies the constraints.
    Infeasible,
    /// Out of iterations, or numerical trouble.
    Failed,
}

/// What a back-end says besides the solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QpInfo {
    /// How it went.
    pub status: QpStatus,
    /// Iterations it took.
    pub iterations: u32,
    /// Inequality rows and bounds that hold with equality.
    pub n_active: usize,
    /// Of an infeasible program, the row that contradicts others, if the back-end knows it.
    pub row: Option<QpRow>,
}

/// A row or bound of a program, by its index there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QpRow {
    /// Of `A x = b`.
    Equality(usize),
    /// Of `C x ≤ d`.
    Inequality(usize),
    /// Lower bound of a variable.
    Lower(usize),
    /// Upper bound of a variable.
    Upper(usize),
}

/// A back-end. What it remembers between calls must not change a bit of a solution.
pub trait QpSolver: Send {
    /// Writes the minimizer to `x`, n; `x` is to be used only if the status says so.
    fn solve(&mut self, qp: &Qp, x: &mut DVector<f64>) -> QpInfo;
}
