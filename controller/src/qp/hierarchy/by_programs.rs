//! Each level as a quadratic program, by the three strategies of the source and any back-end: the reference for [`super::NullSpaceCascade`]. It allocates, and is
//! not for use in a tick.
//!
//! ```text
//! A  optimality:  x free,                A_j x = A_j x*_j for j < k             eq. (5.20); only λ limits what dependent rows do
//! B  projectors:  x = x*_(k-1) + P z,    P_k = P_(k-1) - (A_k P_(k-1))⁺ A_k P_(k-1)         eq. (5.12)
//! C  null space:  x = x*_(k-1) + N z,    N_k = N_(k-1) N(A_k N_(k-1))           eq. (5.18)
//! ```
//! B and C solve eq. (5.21): bounds become general rows. Ranks and pseudo-inverses come from singular values, exact ones for P: a damped inverse there would
//! let lower levels disturb higher ones.

use super::selective::jacobi;
use super::{Entries, Hierarchy, Level, LevelReport};
use crate::qp::Backend;
use crate::qp::program::{Qp, QpInfo, QpRow, QpStatus};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// Singular values below this fraction of the largest one count as zero.
const DEPENDENT: f64 = 1e-6;
/// Smallest λ relative to the largest element of a Hessian: a program must be strictly convex.
const LEAST: f64 = 1e-13;

/// Largest violation of a row without variables.
const CONSISTENT: f64 = 1e-8;

/// How a level keeps the solutions of the levels above.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Strategy {
    /// A: equality rows.
    Optimality,
    /// B: projectors.
    Projectors,
    /// C: null-space bases.
    NullSpace,
}

/// The reference solver.
#[derive(Clone, Copy, Debug)]
pub struct ByPrograms {
    /// Strategy.
    pub strategy: Strategy,
    /// Solver of each program.
    pub backend: Backend,
    /// Limit of the iterations of each level.
    pub max_iterations: u32,
    /// Tolerance of Clarabel.
    pub tolerance: f64,
}

impl ByPrograms {
    /// Solves the levels in order until one has no solution. Returns the solution of the last level that has one, or zero, and the reports.
    pub fn solve(&self, problem: &Hierarchy) -> (DVector<f64>, Vec<LevelReport>) {
        let n = problem.n();
        let mut x = DVector::zeros(n);
        let mut null = DMatrix::identity(n, n);
        let mut reports = vec![LevelReport::OPEN; problem.levels.len()];
        // Rows of the levels above.
        let mut above = DMatrix::zeros(0, n);
        for (k, level) in problem.levels.iter().enumerate() {
            let (a, b) = weighted(level, n);
            let span = match self.strategy {
                Strategy::Optimality => DMatrix::identity(n, n),
                // Nothing is left: the projector would be a matrix of rounding errors.
                Strategy::Projectors if null.ncols() == 0 => null.clone(),
                Strategy::Projectors => &null * null.transpose(),
                Strategy::NullSpace => null.clone(),
            };
            let origin = if self.strategy == Strategy::Optimality { DVector::zeros(n) } else { x.clone() };
            let fixed = if self.strategy == Strategy::Optimality { above.clone() } else { DMatrix::zeros(0, n) };
            let (qp, equalities) = program(problem, k, (&a, &b), &span, &origin, (&fixed, &x));
            let mut z = DVector::zeros(span.ncols());
            let info = if span.ncols() == 0 {
                nothing_left(&qp)
            } else {
                self.backend.build(&qp, self.max_iterations, self.tolerance).solve(&qp, &mut z)
            };
            let report = &mut reports[k];
            report.status = Some(info.status);
            (report.iterations, report.active) = (info.iterations, info.n_active);
            if !report.solved() {
                report.row = info.row.and_then(|row| original(problem, k, row, &equalities));
                break;
            }
            x = origin + &span * z;
            let (rank, rest) = split(&(&a * &null));
            report.rank = rank;
            null *= rest;
            above = DMatrix::from_fn(above.nrows() + a.nrows(), n, |i, j| {
                if i < above.nrows() { above[(i, j)] } else { a[(i - above.nrows(), j)] }
            });
        }
        (x, reports)
    }
}

/// Report of a program without variables: its rows hold at 0 or not.
fn nothing_left(qp: &Qp) -> QpInfo {
    let is_solved = qp.violation(&DVector::zeros(0)) <= CONSISTENT;
    let status = if is_solved { QpStatus::Solved } else { QpStatus::Infeasible };
    QpInfo { status, iterations: 0, n_active: 0, row: None }
}

/// Rows of a level multiplied by the roots of their weights.
fn weighted(level: &Level, n: usize) -> (DMatrix<f64>, DVector<f64>) {
    let (mut a, mut b) = (DMatrix::zeros(level.len(), n), DVector::zeros(level.len()));
    for (i, (entries, right, weight)) in level.rows().enumerate() {
        let root = weight.sqrt();
        match entries {
            Entries::Dense(row) => row.iter().enumerate().for_each(|(j, x)| a[(i, j)] = root * x),
            Entries::One(column, factor) => a[(i, column)] = root * factor,
        }
        b[i] = root * right;
    }
    (a, b)
}

/// The program of a level in `z`, `x = origin + span z`; and the general constraints that became its first equality rows.
fn program(
    problem: &Hierarchy,
    k: usize,
    (a, b): (&DMatrix<f64>, &DVector<f64>),
    span: &DMatrix<f64>,
    origin: &DVector<f64>,
    (fixed, reached): (&DMatrix<f64>, &DVector<f64>),
) -> (Qp, Vec<usize>) {
    let n = problem.n();
    let is_identity = span.is_square() && span.is_identity(0.0);
    let mut equal: Vec<(DVector<f64>, f64)> = Vec::new();
    let mut below: Vec<(DVector<f64>, f64)> = Vec::new();
    let mut equalities = Vec::new();
    for (i, (c, sides)) in problem.general.iter().enumerate().filter(|(_, (_, sides))| sides.from <= k) {
        let c = DVector::from_row_slice(c);
        if sides.is_equality() {
            equalities.push(i);
            equal.push((c, sides.upper));
            continue;
        }
        if sides.lower > f64::NEG_INFINITY {
            below.push((-&c, -sides.lower));
        }
        if sides.upper < f64::INFINITY {
            below.push((c, sides.upper));
        }
    }
    for i in 0..fixed.nrows() {
        let row = fixed.row(i).transpose();
        let side = row.dot(reached);
        equal.push((row, side));
    }
    if !is_identity {
        for i in 0..n {
            let unit = DVector::from_fn(n, |j, _| f64::from(u8::from(i == j)));
            if problem.lower[i] > f64::NEG_INFINITY {
                below.push((-&unit, -problem.lower[i]));
            }
            if problem.upper[i] < f64::INFINITY {
                below.push((unit, problem.upper[i]));
            }
        }
    }
    let mut qp = Qp::zeros(span.ncols(), equal.len(), below.len());
    let rows = a * span;
    qp.H = rows.tr_mul(&rows);
    let lambda = problem.regularization.max(LEAST * qp.H.diagonal().iter().fold(1e-9_f64, |most, h| most.max(*h)));
    // λ |origin + span z|²: the columns of `span` are orthonormal, or an orthogonal projector, which gets the identity to be regular.
    for i in 0..span.ncols() {
        qp.H[(i, i)] += lambda;
    }
    qp.g = -(rows.tr_mul(&(b - a * origin))) + span.tr_mul(origin) * lambda;
    for (i, (row, side)) in equal.iter().enumerate() {
        qp.A.set_row(i, &(row.transpose() * span));
        qp.b[i] = side - row.dot(origin);
    }
    for (i, (row, side)) in below.iter().enumerate() {
        qp.C.set_row(i, &(row.transpose() * span));
        qp.d[i] = side - row.dot(origin);
    }
    if is_identity {
        qp.lower.copy_from_slice(&problem.lower);
        qp.upper.copy_from_slice(&problem.upper);
    }
    (qp, equalities)
}

/// The row of the hierarchy that a row of a program comes from, if it is a general equality or a bound.
fn original(problem: &Hierarchy, k: usize, row: QpRow, equalities: &[usize]) -> Option<QpRow> {
    match row {
        QpRow::Equality(i) => equalities.get(i).map(|&i| QpRow::Equality(i)),
        QpRow::Inequality(i) => {
            let of =
                problem.general.iter().enumerate().filter(|(_, (_, sides))| sides.from <= k && !sides.is_equality());
            let sides = of.flat_map(|(i, (_, sides))| {
                let count = usize::from(sides.lower > f64::NEG_INFINITY) + usize::from(sides.upper < f64::INFINITY);
                std::iter::repeat_n(i, count)
            });
            sides.map(QpRow::Inequality).nth(i)
        }
        bound => Some(bound),
    }
}

/// Rank of a matrix, and an orthonormal basis of its null space.
fn split(a: &DMatrix<f64>) -> (usize, DMatrix<f64>) {
    let (rows, columns) = a.shape();
    let mut t = a.as_slice().to_vec();
    let mut v = DMatrix::zeros(columns, columns);
    if rows == 0 || columns == 0 {
        return (0, DMatrix::identity(columns, columns));
    }
    jacobi(&mut t, rows, v.as_mut_slice(), columns, columns);
    let norms: Vec<f64> = t.chunks_exact(rows).map(|t| t.iter().fold(0.0, |sum, t| sum + t * t).sqrt()).collect();
    let least = DEPENDENT * norms.iter().copied().fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let null: Vec<usize> = (0..columns).filter(|&k| norms[k] <= least).collect();
    (columns - null.len(), v.select_columns(null.iter()))
}
