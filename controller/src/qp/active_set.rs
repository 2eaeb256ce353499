//! A dual active-set solver for small, dense, strictly convex programs: the real-time back-end.
//!
//! ```text
//! H = L Lᵀ,   v = Lᵀ x = -L⁻¹ g - Σ λ_i L⁻¹ n_i          n_i: rows that hold with equality
//! ```
//! From the minimizer under the equality rows alone it goes, violated row after violated row, to the minimizer under all, and every stop
//! on the way is optimal for the rows in the working set. Source: D. Goldfarb, A. Idnani, *A numerically stable dual method for solving
//! strictly convex quadratic programs*, Mathematical Programming 27 (1983), departing from it in what it keeps: instead of a whole orthogonal
//! factor, all of which every row rotates, an orthonormal basis of the working set alone ([`super::working_set`]). The steps stand in
//! [`super::search`].
//!
//! Every solve starts cold: nothing is remembered, so a solution is a function of the program alone. Ties go to the lowest index, sums run in
//! a fixed order, and nothing is allocated. Variables are taken last first, since a base, which couples with every joint, stands
//! first and costs least at the end of the factor ([`Envelope`]). A variable that stands in no row and couples with no
//! other, such as the force of a foot in the air, is set by itself.

use super::constraints::Constraints;
use super::envelope::Envelope;
use super::search::{Coordinates, Search};
use super::{Qp, QpInfo, QpRow, QpSolver, QpStatus};
use nalgebra::DVector;
use std::ops::Range;

/// A solver of programs up to a size.
pub struct ActiveSetSolver {
    max_iterations: u32,
    /// Variables before this one are never taken as standing alone.
    together: usize,
    /// Variables that couple with others, last first; the place of each is its index here.
    pub(super) places: Vec<usize>,
    /// Variables that stand alone, at a bound.
    clamped: usize,
    factor: Envelope,
    pub(super) search: Search,
}

/// Why a solve ended without a solution, and at which row.
pub(super) struct Trouble {
    status: QpStatus,
    row: Option<QpRow>,
}

impl Trouble {
    /// Out of iterations, or numbers that are none.
    pub fn failed() -> Self {
        Trouble { status: QpStatus::Failed, row: None }
    }

    /// No point satisfies this row and those before it.
    pub fn infeasible(row: QpRow) -> Self {
        Trouble { status: QpStatus::Infeasible, row: Some(row) }
    }
}

impl ActiveSetSolver {
    /// Memory for programs of the size of `pattern`, whose inequality rows have numbers only where its have.
    ///
    /// - `max_iterations`: rows that may enter or leave the working set.
    pub fn new(pattern: &Qp, max_iterations: u32) -> Self {
        Self::keeping(pattern, max_iterations, 0)
    }

    /// The same, for a program whose first `together` variables others will couple.
    pub(super) fn keeping(pattern: &Qp, max_iterations: u32, together: usize) -> Self {
        let n = pattern.n();
        ActiveSetSolver {
            max_iterations,
            together,
            places: Vec::with_capacity(n),
            clamped: 0,
            factor: Envelope::new(n),
            search: Search::new(n, Constraints::new(pattern)),
        }
    }

    /// Variables that the last solve has set alone, at a bound.
    pub(super) fn clamped(&self) -> usize {
        self.clamped
    }

    /// Sets the variables that stand alone, and takes over the program of the others.
    fn take(&mut self, qp: &Qp, alone: &mut [f64]) -> Result<(), Trouble> {
        self.places.clear();
        self.clamped = 0;
        for i in (0..qp.n()).rev() {
            let (lower, upper) = (qp.lower[i], qp.upper[i]);
            if lower.is_nan() || upper.is_nan() {
                return Err(Trouble::failed());
            }
            if lower > upper {
                return Err(Trouble::infeasible(QpRow::Lower(i)));
            }
            if i < self.together || couples(qp, i) {
                self.places.push(i);
                continue;
            }
            let h = qp.H[(i, i)];
            if !(h > 0.0 && h < f64::INFINITY) {
                return Err(Trouble::failed());
            }
            let free = -qp.g[i] / h;
            alone[i] = free.max(lower).min(upper);
            self.clamped += usize::from(alone[i] != free);
        }
        let places = &self.places;
        let column = |i: usize| qp.H.as_slice()[i * qp.n()..].as_ref();
        if !self.factor.factor(places.len(), |i, j| column(places[i])[places[j]]) {
            return Err(Trouble::failed());
        }
        self.search.constraints.take(qp, places)
    }

    fn run(&mut self, qp: &Qp, x: &mut [f64]) -> Result<u32, Trouble> {
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

/// Writes a solution by places to the variables; numbers that are none are no solution.
pub(super) fn finish(places: &[usize], found: &[f64], x: &mut [f64]) -> Result<(), Trouble> {
    for (&i, value) in places.iter().zip(found) {
        x[i] = *value;
    }
    if x.iter().all(|x| x.is_finite()) { Ok(()) } else { Err(Trouble::failed()) }
}

/// What is said of a solve that took `iterations`; without a solution `x` is zero.
pub(super) fn report(solved: Result<u32, Trouble>, n_active: usize, x: &mut DVector<f64>) -> QpInfo {
    match solved {
        Ok(iterations) => QpInfo { status: QpStatus::Solved, iterations, n_active, row: None },
        Err(Trouble { status, row }) => {
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

    fn pull(&self, normal: &[f64], at: Range<usize>, row: &mut [f64]) -> Range<usize> {
        row.copy_from_slice(&normal[..row.len()]);
        self.forward(at, row)
    }

    fn place(&self, v: &[f64], x: &mut [f64]) {
        x[..v.len()].copy_from_slice(v);
        self.backward(&mut x[..v.len()]);
    }
}

/// Whether a variable stands in a row or has a product with another.
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
