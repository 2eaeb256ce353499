//! A dual active-set solver for small, dense, strictly convex programs: the real-time back-end.
//!
//! ```text
//! H = L Lᵀ,   v = Lᵀ x = -L⁻¹ g - Σ λ_i L⁻¹ n_i          n_i: rows that hold with equality
//! ```
//! The search starts at the minimizer under the equality rows alone. Each iteration adds the most violated row to the working set, and
//! each iterate is optimal for the rows in the working set. Source: D. Goldfarb, A. Idnani, *A numerically stable dual method for solving
//! strictly convex quadratic programs*, Mathematical Programming 27 (1983). Difference: the source keeps a complete orthogonal
//! factor, which every row rotates; this solver keeps an orthonormal basis of the working set only ([`super::working_set`]). The
//! iterations are in [`super::search`].
//!
//! Every solve starts without a working set of an earlier one, so a solution is a function of the program alone. Ties go to the lowest index, sums run in
//! a fixed order, and nothing is allocated. Variables are factorized in reverse order: the base comes first, couples with every joint and
//! costs least at the end of the factor ([`Envelope`]). A variable without a row and without coupling to another variable, such as
//! the force of a foot in the air, is solved on its own.

use super::constraints::Constraints;
use super::envelope::Envelope;
use super::program::{Qp, QpInfo, QpRow, QpSolver, QpStatus, Unsolved};
use super::search::{Coordinates, Search};
use nalgebra::DVector;
use std::ops::Range;

/// Solver for programs up to a maximum size.
pub struct ActiveSetSolver {
    max_iterations: u32,
    /// Number of leading variables that are always treated as coupled.
    n_coupled: usize,
    /// Variables that couple with others, the last variable first. The index in this list is the *place* of a variable.
    pub(super) places: Vec<usize>,
    /// Number of uncoupled variables at a bound.
    clamped: usize,
    factor: Envelope,
    pub(super) search: Search,
}

impl ActiveSetSolver {
    /// Allocates memory for programs of the size of `pattern`. Inequality rows may have non-zero numbers only where those of `pattern` do.
    ///
    /// - `max_iterations`: limit on the number of rows that enter or leave the working set.
    pub fn new(pattern: &Qp, max_iterations: u32) -> Self {
        Self::with_coupled(pattern, max_iterations, 0)
    }

    /// As [`ActiveSetSolver::new`], but the first `n_coupled` variables are always treated as coupled, because lower levels couple them.
    pub(super) fn with_coupled(pattern: &Qp, max_iterations: u32, n_coupled: usize) -> Self {
        let n = pattern.n();
        ActiveSetSolver {
            max_iterations,
            n_coupled,
            places: Vec::with_capacity(n),
            clamped: 0,
            factor: Envelope::new(n),
            search: Search::new(n, Constraints::new(pattern)),
        }
    }

    /// Number of uncoupled variables that the last solve put at a bound.
    pub(super) fn clamped(&self) -> usize {
        self.clamped
    }

    /// Solves for the uncoupled variables (writes `alone`) and loads the program of the others.
    fn take(&mut self, qp: &Qp, alone: &mut [f64]) -> Result<(), Unsolved> {
        self.places.clear();
        self.clamped = 0;
        for i in (0..qp.n()).rev() {
            let (lower, upper) = (qp.lower[i], qp.upper[i]);
            if lower.is_nan() || upper.is_nan() {
                return Err(Unsolved::failed());
            }
            if lower > upper {
                return Err(Unsolved::infeasible(QpRow::Lower(i)));
            }
            if i < self.n_coupled || couples(qp, i) {
                self.places.push(i);
                continue;
            }
            let h = qp.H[(i, i)];
            if !(h > 0.0 && h < f64::INFINITY) {
                return Err(Unsolved::failed());
            }
            let free = -qp.g[i] / h;
            alone[i] = free.max(lower).min(upper);
            self.clamped += usize::from(alone[i] != free);
        }
        let places = &self.places;
        let column = |i: usize| qp.H.as_slice()[i * qp.n()..].as_ref();
        if !self.factor.factor(places.len(), |i, j| column(places[i])[places[j]]) {
            return Err(Unsolved::failed());
        }
        self.search.constraints.take(qp, places)
    }

    fn run(&mut self, qp: &Qp, x: &mut [f64]) -> Result<u32, Unsolved> {
        self.take(qp, x)?;
        let ActiveSetSolver { max_iterations, places, factor, search, .. } = self;
        for (v, &i) in search.v.iter_mut().zip(places.iter()) {
            *v = -qp.g[i];
        }
        factor.forward(0..places.len(), &mut search.v[..places.len()]);
        search.start(factor);
        search.equalities(factor)?;
        let iterations = search.inequalities(factor, *max_iterations)?;
        finish(places, &search.x, x)?;
        Ok(iterations)
    }
}

/// Copies a solution from places to variables; fails if a number is not finite.
pub(super) fn finish(places: &[usize], found: &[f64], x: &mut [f64]) -> Result<(), Unsolved> {
    for (&i, value) in places.iter().zip(found) {
        x[i] = *value;
    }
    if x.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(Unsolved::failed()) }
}

/// The report of a solve; sets `x` to zero if there is no solution.
pub(super) fn report(solved: Result<u32, Unsolved>, n_active: usize, x: &mut DVector<f64>) -> QpInfo {
    match solved {
        Ok(iterations) => QpInfo { status: QpStatus::Solved, iterations, n_active, row: None },
        Err(Unsolved { status, row }) => {
            x.fill(0.0);
            QpInfo { status, iterations: 0, n_active: 0, row }
        }
    }
}

impl QpSolver for ActiveSetSolver {
    fn solve(&mut self, qp: &Qp, x: &mut DVector<f64>) -> QpInfo {
        let solved = self.run(qp, x.as_mut_slice());
        report(solved, self.clamped + self.search.n_active(), x)
    }
}

impl Coordinates for Envelope {
    fn len(&self) -> usize {
        self.n()
    }

    fn pull(&mut self, normal: &[f64], at: Range<usize>, row: &mut [f64]) -> Range<usize> {
        row.copy_from_slice(&normal[..row.len()]);
        self.forward(at, row)
    }

    fn place(&mut self, v: &[f64], x: &mut [f64]) {
        x[..v.len()].copy_from_slice(v);
        self.backward(&mut x[..v.len()]);
    }
}

/// Whether a variable has a non-zero number in a row or an off-diagonal entry in the Hessian.
fn couples(qp: &Qp, i: usize) -> bool {
    let n = qp.n();
    let of_others = &qp.H.as_slice()[i * n..(i + 1) * n];
    let any = |xs: &[f64]| xs.iter().any(|x| *x != 0.0);
    let rows = |m: &nalgebra::DMatrix<f64>| {
        let rows = m.nrows();
        any(&m.as_slice()[i * rows..(i + 1) * rows])
    };
    any(&of_others[..i]) || any(&of_others[i + 1..]) || rows(&qp.A) || rows(&qp.C)
}
