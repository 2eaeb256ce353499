//! A dual active-set solver for small, dense, strictly convex programs: the real-time back-end.
//!
//! ```text
//! H = L Lᵀ,   v = Lᵀ x = -L⁻¹ g - Σ λ_i L⁻¹ n_i          n_i: rows that hold with equality
//! ```
//! From the minimizer under the equality rows alone it goes, violated row after violated row, to the minimizer under all, and every stop
//! on the way is optimal for the rows in the working set. Source: D. Goldfarb, A. Idnani, *A numerically stable dual method for solving
//! strictly convex quadratic programs*, Mathematical Programming 27 (1983), departing from it in what it keeps: instead of a whole orthogonal
//! factor, all of which every row rotates, an orthonormal basis of the working set alone ([`WorkingSet`]).
//!
//! Every solve starts cold: nothing is remembered, so a solution is a function of the program alone. Ties go to the lowest index, sums run in
//! a fixed order, and nothing is allocated. Variables are taken last first, since a base, which couples with every joint, stands
//! first and costs least at the end of the factor ([`Envelope`]). A variable that stands in no row and couples with no
//! other, such as the force of a foot in the air, is set by itself.

use super::constraints::Constraints;
use super::dense::axpy;
use super::envelope::Envelope;
use super::working_set::WorkingSet;
use super::{Qp, QpInfo, QpRow, QpSolver, QpStatus};
use nalgebra::DVector;

/// Violation of a row that counts as none, per length of the row and size of the numbers in `x`.
const FEASIBLE: f64 = 1e-10;
/// The same of an equality row that depends on others: what rounding leaves of it.
const CONSISTENT: f64 = 1e-8;
/// Part of the largest change of a multiplier below which one does not change.
const UNCHANGED: f64 = 1e-13;

/// A solver of programs up to a size.
pub struct ActiveSetSolver {
    max_iterations: u32,
    /// Variables that couple with others, last first; the place of each is its index here.
    places: Vec<usize>,
    factor: Envelope,
    constraints: Constraints,
    set: WorkingSet,
    /// Constraints in the set, in its order; first those of equality, whose multipliers nothing limits and nobody asks for.
    members: Vec<usize>,
    n_eq: usize,
    /// Variables that stand alone, at a bound.
    clamped: usize,
    multipliers: Vec<f64>,
    /// The iterate by places, as x and as Lᵀ x.
    x: Vec<f64>,
    v: Vec<f64>,
    /// `L⁻¹ n` of a row.
    row: Vec<f64>,
    products: Vec<f64>,
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
        let n = pattern.n();
        let nan = || vec![f64::NAN; n];
        ActiveSetSolver {
            max_iterations,
            places: Vec::with_capacity(n),
            factor: Envelope::new(n),
            constraints: Constraints::new(pattern),
            set: WorkingSet::new(n),
            members: Vec::with_capacity(n),
            n_eq: 0,
            clamped: 0,
            multipliers: nan(),
            x: nan(),
            v: nan(),
            row: nan(),
            products: nan(),
        }
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
            if couples(qp, i) {
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
        self.constraints.take(qp, places)
    }

    /// The minimizer under the equality rows alone.
    fn start(&mut self, qp: &Qp) -> Result<(), Trouble> {
        let n = self.places.len();
        self.members.clear();
        self.set.clear(n);
        for (v, &i) in self.v.iter_mut().zip(&self.places) {
            *v = -qp.g[i];
        }
        self.factor.forward(0..n, &mut self.v[..n]);
        self.place_x();
        for i in 0..self.constraints.n_eq() {
            let at = self.constraints.load(i, &mut self.row[..n]);
            let at = self.factor.forward(at, &mut self.row[..n]);
            let left = self.set.split(&self.row[..n], at);
            if left > 0.0 {
                self.set.push(left);
                self.members.push(i);
            }
        }
        self.n_eq = self.members.len();
        // The second time takes the rounding errors of the first away.
        self.onto_members();
        self.onto_members();
        let tolerance = CONSISTENT * self.scale();
        let broken = (0..self.constraints.n_eq()).find(|&i| self.constraints.excess(i, &self.x).abs() > tolerance);
        broken.map_or(Ok(()), |i| Err(Trouble::infeasible(self.constraints.name(i, &self.places))))
    }

    /// `x = L⁻ᵀ v`.
    fn place_x(&mut self) {
        let n = self.places.len();
        self.x[..n].copy_from_slice(&self.v[..n]);
        self.factor.backward(&mut self.x[..n]);
    }

    /// The shortest way in v to a point at which every row in the set holds with equality.
    fn onto_members(&mut self) {
        let n = self.places.len();
        for (product, &i) in self.products.iter_mut().zip(&self.members) {
            *product = self.constraints.excess(i, &self.x);
        }
        self.set.correct(&mut self.products, &mut self.v[..n]);
        self.place_x();
    }

    fn scale(&self) -> f64 {
        self.x[..self.places.len()].iter().fold(1.0, |largest: f64, x| largest.max(x.abs()))
    }

    /// Takes in the most violated row until none is violated. Gives the number of iterations.
    fn iterate(&mut self) -> Result<u32, Trouble> {
        let mut iterations = 0;
        while let Some(worst) = self.constraints.worst(&self.x, FEASIBLE * self.scale()) {
            let at = self.constraints.load(worst, &mut self.row);
            let at = self.factor.forward(at, &mut self.row);
            let mut multiplier = 0.0;
            loop {
                if iterations == self.max_iterations {
                    return Err(Trouble::failed());
                }
                iterations += 1;
                let left = self.set.split(&self.row[..self.places.len()], at.clone());
                let (step, leaves) = self.step(worst, left)?;
                multiplier += step;
                match leaves {
                    Some(k) => self.release(k),
                    None => {
                        self.set.push(left);
                        self.multipliers[self.members.len()] = multiplier;
                        self.members.push(worst);
                        self.constraints.take_in(worst);
                        break;
                    }
                }
            }
        }
        Ok(iterations)
    }

    /// Goes towards equality of the row that was split last, as far as the multipliers stay positive. Gives the length of the step, and the place in
    /// the set of the row whose multiplier has come to zero before equality was reached.
    fn step(&mut self, entering: usize, left: f64) -> Result<(f64, Option<usize>), Trouble> {
        let (n, n_eq, len) = (self.places.len(), self.n_eq, self.members.len());
        let change = &mut self.products[..len];
        change.copy_from_slice(&self.set.inside[..len]);
        self.set.combination(n_eq, change);
        let (change, multipliers) = (&change[n_eq..], &mut self.multipliers[n_eq..len]);
        let least = UNCHANGED * change.iter().fold(0.0, |largest: f64, change| largest.max(change.abs()));
        let (mut step, mut leaves) = (f64::INFINITY, None);
        for (k, (change, multiplier)) in change.iter().zip(multipliers.iter()).enumerate() {
            if *change > least && multiplier / change < step {
                (step, leaves) = (multiplier / change, Some(n_eq + k));
            }
        }
        if left > 0.0 {
            let full = self.constraints.excess(entering, &self.x) / left;
            if full <= step {
                (step, leaves) = (full, None);
            }
        }
        if step == f64::INFINITY {
            return Err(Trouble::infeasible(self.constraints.name(entering, &self.places)));
        }
        axpy(-step, change, multipliers);
        if left > 0.0 {
            axpy(-step, &self.set.outside[..n], &mut self.v[..n]);
            self.place_x();
        }
        Ok((step, leaves))
    }

    fn release(&mut self, k: usize) {
        self.set.remove(k);
        let i = self.members.remove(k);
        self.constraints.let_go(i);
        self.multipliers.copy_within(k + 1..self.members.len() + 1, k);
    }

    fn run(&mut self, qp: &Qp, x: &mut [f64]) -> Result<u32, Trouble> {
        self.take(qp, x)?;
        self.start(qp)?;
        let iterations = self.iterate()?;
        self.onto_members();
        for (&i, value) in self.places.iter().zip(&self.x) {
            x[i] = *value;
        }
        if x.iter().all(|x| x.is_finite()) { Ok(iterations) } else { Err(Trouble::failed()) }
    }
}

impl QpSolver for ActiveSetSolver {
    fn solve(&mut self, qp: &Qp, x: &mut DVector<f64>) -> QpInfo {
        match self.run(qp, x.as_mut_slice()) {
            Ok(iterations) => {
                let n_active = self.clamped + self.members.len() - self.n_eq;
                QpInfo { status: QpStatus::Solved, iterations, n_active, row: None }
            }
            Err(Trouble { status, row }) => {
                x.fill(0.0);
                QpInfo { status, iterations: 0, n_active: 0, row }
            }
        }
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
