//! Search of the dual active-set method: from the minimizer under some rows to the minimizer under all rows.
//!
//! The search uses [`Coordinates`] in which the Hessian is the identity. The same code therefore solves a complete program and a program in
//! the null space of the levels above ([`super::Levels`]).

use super::constraints::Constraints;
use super::program::{QpRow, Unsolved};
use super::working_set::WorkingSet;
use crate::dense::axpy;
use std::ops::Range;

/// Tolerance of a row's violation, relative to the norm of the row and the size of `x`.
const FEASIBLE: f64 = 1e-10;
/// The same for an equality row that is linearly dependent on others, which keeps a rounding error.
const CONSISTENT: f64 = 1e-8;
/// A multiplier counts as constant if its change is below this fraction of the largest change.
const UNCHANGED: f64 = 1e-13;

/// Coordinates `v` of the points `x` in which the cost is `½ |v|²` plus a linear term.
pub(super) trait Coordinates {
    /// Number of coordinates.
    fn len(&self) -> usize;
    /// Transforms the row `normal`, which is 0 outside the range `at`, to coordinates. Returns the range outside which `row` is 0.
    fn pull(&mut self, normal: &[f64], at: Range<usize>, row: &mut [f64]) -> Range<usize>;
    /// Writes the point `x` that has the coordinates `v`.
    fn place(&mut self, v: &[f64], x: &mut [f64]);
}

/// The iterate and its working set.
pub(super) struct Search {
    pub constraints: Constraints,
    /// The iterate in coordinates. Before a search, the caller sets it to the minimizer of the cost without constraints.
    pub v: Vec<f64>,
    /// The iterate by places.
    pub x: Vec<f64>,
    set: WorkingSet,
    /// Constraints in the set, in its order. Equality rows come first; their multipliers have no sign and are not computed.
    members: Vec<usize>,
    n_eq: usize,
    multipliers: Vec<f64>,
    normal: Vec<f64>,
    row: Vec<f64>,
    products: Vec<f64>,
}

impl Search {
    /// Allocates memory for `n` variables under these constraints.
    pub fn new(n: usize, constraints: Constraints) -> Self {
        let nan = || vec![f64::NAN; n];
        Search {
            constraints,
            v: nan(),
            x: nan(),
            set: WorkingSet::new(n),
            members: Vec::with_capacity(n),
            n_eq: 0,
            multipliers: nan(),
            normal: nan(),
            row: nan(),
            products: nan(),
        }
    }

    /// Number of inequalities that hold with equality.
    pub fn n_active(&self) -> usize {
        self.members.len() - self.n_eq
    }

    /// The constraints that hold with equality, without the equality rows.
    pub fn active(&self) -> impl Iterator<Item = QpRow> {
        self.members[self.n_eq..].iter().map(|&i| self.constraints.name(i))
    }

    /// Empties the working set and starts at `v`.
    pub fn start(&mut self, at: &mut impl Coordinates) {
        self.constraints.clear_active();
        self.members.clear();
        self.n_eq = 0;
        self.set.clear(at.len());
        at.place(&self.v[..at.len()], &mut self.x);
    }

    /// Moves to the minimizer under the equality rows.
    pub fn equalities(&mut self, at: &mut impl Coordinates) -> Result<(), Unsolved> {
        for i in 0..self.constraints.n_eq() {
            let (left, _) = self.split(i, at);
            if left > 0.0 {
                self.set.push(left);
                self.members.push(i);
            }
        }
        self.n_eq = self.members.len();
        // The second call removes rounding errors of the first.
        self.onto_members(at);
        self.onto_members(at);
        let tolerance = CONSISTENT * self.scale();
        let broken = (0..self.constraints.n_eq()).find(|&i| self.constraints.excess(i, &self.x).abs() > tolerance);
        broken.map_or(Ok(()), |i| Err(Unsolved::infeasible(self.constraints.name(i))))
    }

    /// Adds the most violated row to the working set until no row is violated. Returns the number of iterations.
    pub fn inequalities(&mut self, at: &mut impl Coordinates, max_iterations: u32) -> Result<u32, Unsolved> {
        let mut iterations = 0;
        while let Some(worst) = self.constraints.worst(&self.x, FEASIBLE * self.scale()) {
            let mut multiplier = 0.0;
            let (mut left, range) = self.split(worst, at);
            loop {
                if iterations == max_iterations {
                    return Err(Unsolved::failed());
                }
                iterations += 1;
                let (step, leaves) = self.step(worst, left, at)?;
                multiplier += step;
                match leaves {
                    Some(k) => {
                        self.release(k);
                        left = self.set.split(&self.row[..at.len()], range.clone());
                    }
                    None => {
                        self.set.push(left);
                        self.multipliers[self.members.len()] = multiplier;
                        self.members.push(worst);
                        self.constraints.set_active(worst);
                        break;
                    }
                }
            }
        }
        self.onto_members(at);
        Ok(iterations)
    }

    /// Splits a row into its part in the span of the set and the rest. Returns the squared norm of the rest, and the range outside which the
    /// row is 0.
    fn split(&mut self, i: usize, at: &mut impl Coordinates) -> (f64, Range<usize>) {
        let range = self.constraints.load(i, &mut self.normal);
        let range = at.pull(&self.normal, range, &mut self.row[..at.len()]);
        (self.set.split(&self.row[..at.len()], range.clone()), range)
    }

    /// Moves to the nearest point, in `v`, at which every row in the set holds with equality.
    fn onto_members(&mut self, at: &mut impl Coordinates) {
        for (product, &i) in self.products.iter_mut().zip(&self.members) {
            *product = self.constraints.excess(i, &self.x);
        }
        self.set.correct(&mut self.products, &mut self.v[..at.len()]);
        at.place(&self.v[..at.len()], &mut self.x);
    }

    fn scale(&self) -> f64 {
        self.x[..self.constraints.n()].iter().fold(1.0, |largest: f64, x| largest.max(x.abs()))
    }

    /// Moves towards equality of the row that was split last, as far as the multipliers stay non-negative. Returns the length of the step and,
    /// if a multiplier became zero before equality was reached, the index of its row in the set.
    fn step(
        &mut self,
        entering: usize,
        left: f64,
        at: &mut impl Coordinates,
    ) -> Result<(f64, Option<usize>), Unsolved> {
        let (n_eq, len) = (self.n_eq, self.members.len());
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
            return Err(Unsolved::infeasible(self.constraints.name(entering)));
        }
        axpy(-step, change, multipliers);
        if left > 0.0 {
            let v = &mut self.v[..at.len()];
            axpy(-step, &self.set.outside[..at.len()], v);
            at.place(v, &mut self.x);
        }
        Ok((step, leaves))
    }

    fn release(&mut self, k: usize) {
        self.set.remove(k);
        let i = self.members.remove(k);
        self.constraints.set_inactive(i);
        self.multipliers.copy_within(k + 1..self.members.len() + 1, k);
    }
}
