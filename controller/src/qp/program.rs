//! The quadratic program, the report of a solve, and the interface of a back-end.

use nalgebra::{DMatrix, DVector};

/// A convex quadratic program, `H` symmetric positive definite.
#[derive(Clone, Debug, PartialEq)]
pub struct Qp {
    /// Hessian, n x n, both triangles filled.
    pub H: DMatrix<f64>,
    /// Gradient at 0, n.
    pub g: DVector<f64>,
    /// Equality rows, `n_eq` x n.
    pub A: DMatrix<f64>,
    /// Right side of the equality rows, `n_eq`.
    pub b: DVector<f64>,
    /// Inequality rows, `n_in` x n.
    pub C: DMatrix<f64>,
    /// Upper limit of the inequality rows, `n_in`.
    pub d: DVector<f64>,
    /// Lower bounds, n; -∞ for a variable that never has one.
    pub lower: DVector<f64>,
    /// Upper bounds, n; +∞ for a variable that never has one.
    pub upper: DVector<f64>,
}

impl Qp {
    /// A program with `n` variables, `n_eq` equality and `n_in` inequality rows. All numbers are 0; no variable has a bound.
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

/// Result of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QpStatus {
    /// Within tolerance.
    Solved,
    /// Within the solver's reduced tolerance.
    AlmostSolved,
    /// No point satisfies the constraints.
    Infeasible,
    /// Iteration limit reached, non-finite data, or a numerical failure.
    Failed,
}

impl QpStatus {
    /// Name, as in dumps.
    pub fn name(self) -> &'static str {
        match self {
            QpStatus::Solved => "Solved",
            QpStatus::AlmostSolved => "AlmostSolved",
            QpStatus::Infeasible => "Infeasible",
            QpStatus::Failed => "Failed",
        }
    }
}

/// What a back-end reports besides the solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QpInfo {
    /// Result.
    pub status: QpStatus,
    /// Number of iterations.
    pub iterations: u32,
    /// Number of inequality rows and bounds that hold with equality.
    pub n_active: usize,
    /// For an infeasible program: a row that contradicts others, if the back-end knows it.
    pub row: Option<QpRow>,
}

/// A row or bound of a program, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QpRow {
    /// Row of `A x = b`.
    Equality(usize),
    /// Row of `C x ≤ d`.
    Inequality(usize),
    /// Lower bound of a variable.
    Lower(usize),
    /// Upper bound of a variable.
    Upper(usize),
}

/// Interface of a back-end. Memory from earlier calls must not change a bit of a solution.
pub trait QpSolver: Send {
    /// Writes the minimizer to `x`, n. `x` is valid only with status `Solved` or `AlmostSolved`.
    fn solve(&mut self, qp: &Qp, x: &mut DVector<f64>) -> QpInfo;
}

/// Reason why a solve ended without a solution, and the row concerned.
pub(super) struct Unsolved {
    pub status: QpStatus,
    pub row: Option<QpRow>,
}

impl Unsolved {
    /// Iteration limit reached, or non-finite numbers.
    pub fn failed() -> Self {
        Unsolved { status: QpStatus::Failed, row: None }
    }

    /// No point satisfies this row and those before it.
    pub fn infeasible(row: QpRow) -> Self {
        Unsolved { status: QpStatus::Infeasible, row: Some(row) }
    }
}
