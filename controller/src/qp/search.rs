//! The search of the dual active-set method: from a minimizer under some rows to the one under all.
//!
//! It knows the program's curvature only through [`Coordinates`] in which it is the identity, so that a whole program and one on
//! the directions that levels above have left free ([`super::Levels`]) are searched alike.

use super::active_set::Trouble;
use super::constraints::Constraints;
use super::working_set::WorkingSet;
use crate::dense::axpy;
use std::ops::Range;

/// Violation of a row that counts as none, per length of the row and size of the numbers in `x`.
const FEASIBLE: f64 = 1e-10;
/// The same of an equality row that depends on others: what rounding leaves of it.
const CONSISTENT: f64 = 1e-8;
/// Part of the largest change of a multiplier below which one does not change.
const UNCHANGED: f64 = 1e-13;

/// Coordinates `v` of the points `x` in which the cost is `½ |v|²` and a linear term.
pub(super) trait Coordinates {
    /// Number of coordinates.
    fn len(&self) -> usize;
    /// Writes to `row` what the row `normal`, whose numbers other than 0 stand in `at`, is in coordinates; gives where its numbers stand.
    fn pull(&self, normal: &[f64], at: Range<usize>, row: &mut [f64]) -> Range<usize>;
    /// Writes the point with the coordinates `v`.
    fn place(&self, v: &[f64], x: &mut [f64]);
}

/// The iterate, and which rows hold it.
pub(super) struct Search {
    pub constraints: Constraints,
    /// The iterate in coordinates: to be set to the minimizer of the cost alone before a search.
    pub v: Vec<f64>,
    /// The iterate by places.
    pub x: Vec<f64>,
    set: WorkingSet,
    /// Constraints in the set, in its order; first those of equality, whose multipliers nothing limits and nobody asks for.
    members: Vec<usize>,
    n_eq: usize,
    multipliers: Vec<f64>,
    normal: Vec<f64>,
    row: Vec<f64>,
    products: Vec<f64>,
}

impl Search {
    /// Memory for `n` variables under these constraints.
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

    /// Rows that hold with equality, those of equality left out.
    pub fn n_active(&self) -> usize {
        self.members.len() - self.n_eq
    }

    /// Empties the set, and stands at `v`.
    pub fn start(&mut self, at: &impl Coordinates) {
        self.constraints.let_all_go();
        self.members.clear();
        self.n_eq = 0;
        self.set.clear(at.len());
        at.place(&self.v[..at.len()], &mut self.x);
    }

    /// The minimizer under the equality rows alone.
    pub fn equalities(&mut self, at: &impl Coordinates) -> Result<(), Trouble> {
        for i in 0..self.constraints.n_eq() {
            let (left, _) = self.split(i, at);
            if left > 0.0 {
                self.set.push(left);
                self.members.push(i);
            }
        }
        self.n_eq = self.members.len();
        // The second time takes the rounding errors of the first away.
        self.onto_members(at);
        self.onto_members(at);
        let tolerance = CONSISTENT * self.scale();
        let broken = (0..self.constraints.n_eq()).find(|&i| self.constraints.excess(i, &self.x).abs() > tolerance);
        broken.map_or(Ok(()), |i| Err(Trouble::infeasible(self.constraints.name(i))))
    }

    /// Takes in the most violated row until none is violated. Gives the number of iterations.
    pub fn inequalities(&mut self, at: &impl Coordinates, max_iterations: u32) -> Result<u32, Trouble> {
        let mut iterations = 0;
        while let Some(worst) = self.constraints.worst(&self.x, FEASIBLE * self.scale()) {
            let mut multiplier = 0.0;
            let (mut left, range) = self.split(worst, at);
            loop {
                if iterations == max_iterations {
                    return Err(Trouble::failed());
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
                        self.constraints.take_in(worst);
                        break;
                    }
                }
            }
        }
        self.onto_members(at);
        Ok(iterations)
    }

    /// Splits a row by the set; gives the squared norm of what lies outside its span, and where the row's numbers stand.
    fn split(&mut self, i: usize, at: &impl Coordinates) -> (f64, Range<usize>) {
        let range = self.constraints.load(i, &mut self.normal);
        let range = at.pull(&self.normal, range, &mut self.row[..at.len()]);
        (self.set.split(&self.row[..at.len()], range.clone()), range)
    }

    /// The shortest way in v to a point at which every row in the set holds with equality.
    fn onto_members(&mut self, at: &impl Coordinates) {
        for (product, &i) in self.products.iter_mut().zip(&self.members) {
            *product = self.constraints.excess(i, &self.x);
        }
        self.set.correct(&mut self.products, &mut self.v[..at.len()]);
        at.place(&self.v[..at.len()], &mut self.x);
    }

    fn scale(&self) -> f64 {
        self.x[..self.constraints.n()].iter().fold(1.0, |largest: f64, x| largest.max(x.abs()))
    }

    /// Goes towards equality of the row that was split last, as far as the multipliers stay positive. Gives the length of the step, and the place in
    /// the set of the row whose multiplier has come to zero before equality was reached.
    fn step(&mut self, entering: usize, left: f64, at: &impl Coordinates) -> Result<(f64, Option<usize>), Trouble> {
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
            return Err(Trouble::infeasible(self.constraints.name(entering)));
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
        self.constraints.let_go(i);
        self.multipliers.copy_within(k + 1..self.members.len() + 1, k);
    }
}
