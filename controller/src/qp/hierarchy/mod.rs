//! Hierarchies of least-squares problems under common constraints: the solver of inverse kinematics.
//!
//! ```text
//! level k:   min_x  Σ w_i (a_i x - b_i)² + λ |x|²      subject to   l ≤ x ≤ u,   c_lower ≤ C x ≤ c_upper,   A_j x = A_j x*_j  for all levels j above
//! ```
//! [`Hierarchy`] is the problem, written again in every tick. Two solvers:
//!
//! - [`NullSpaceCascade`]: null-space bases from an orthogonal factorization that all levels share, and the active-set search within each level. For the
//!   robot: it allocates nothing.
//! - [`ByPrograms`]: each level as a quadratic program for any back-end, by one of the three strategies of the source. The reference.
//!
//! The levels of a stack of accelerations and forces are solved by [`crate::stack::Cascade`], where the first level has a structure of its own.
//!
//! Source: Laurenzi 2020, sections 4.3 and 5.2, eqs. (4.2), (5.12), (5.18), (5.20), (5.21).

mod by_programs;
mod cascade;
mod free;
mod rows;
mod selective;

pub use by_programs::{ByPrograms, Strategy};
pub use cascade::NullSpaceCascade;
pub use selective::{Law, Selective};

use super::program::{QpRow, QpStatus};

/// A row with one non-zero number: `factor x[column] = b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Variable.
    pub column: usize,
    /// Its factor.
    pub factor: f64,
    /// Right side.
    pub b: f64,
    /// Weight of the squared error, positive.
    pub weight: f64,
}

/// The rows of a level, `a x = b` with a weight each: dense rows, then rows with one non-zero number.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    n: usize,
    a: Vec<f64>,
    b: Vec<f64>,
    weights: Vec<f64>,
    picks: Vec<Pick>,
    /// Damping of small singular values; without it only λ damps them.
    pub selective: Option<Selective>,
}

impl Level {
    /// A level without rows, in `n` variables, with memory for `rows` dense rows and one pick for each variable.
    pub fn with_capacity(n: usize, rows: usize) -> Self {
        Level {
            n,
            a: Vec::with_capacity(n * rows),
            b: Vec::with_capacity(rows),
            weights: Vec::with_capacity(rows),
            picks: Vec::with_capacity(n),
            selective: None,
        }
    }

    /// Removes all rows.
    pub fn clear(&mut self) {
        self.a.clear();
        self.b.clear();
        self.weights.clear();
        self.picks.clear();
    }

    /// Adds a row `a x = b` with a positive weight. Returns `a`, n zeros, for the caller to fill.
    pub fn push(&mut self, b: f64, weight: f64) -> &mut [f64] {
        self.b.push(b);
        self.weights.push(weight);
        let at = self.a.len();
        self.a.resize(at + self.n, 0.0);
        &mut self.a[at..]
    }

    /// Adds a row with one non-zero number.
    pub fn push_pick(&mut self, pick: Pick) {
        self.picks.push(pick);
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.b.len() + self.picks.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Dense rows: `a`, right side, weight.
    pub fn dense(&self) -> impl ExactSizeIterator<Item = (&[f64], f64, f64)> {
        self.a
            .chunks_exact(self.n.max(1))
            .zip(self.b.iter().zip(&self.weights))
            .map(|(a, (b, weight))| (a, *b, *weight))
    }

    /// All rows: numbers, right side, weight.
    fn rows(&self) -> impl Iterator<Item = (Entries<'_>, f64, f64)> {
        let dense = self.dense().map(|(a, b, weight)| (Entries::Dense(a), b, weight));
        dense.chain(self.picks.iter().map(|pick| (Entries::One(pick.column, pick.factor), pick.b, pick.weight)))
    }

    /// Number of rows for which memory is allocated.
    fn capacity(&self) -> usize {
        self.b.capacity() + self.picks.capacity()
    }

    /// Takes the rows of another level, without allocation if there is memory for them.
    pub fn copy_from(&mut self, other: &Level) {
        self.clear();
        self.a.extend_from_slice(&other.a);
        self.b.extend_from_slice(&other.b);
        self.weights.extend_from_slice(&other.weights);
        self.picks.extend_from_slice(&other.picks);
        self.selective = other.selective;
    }

    /// Rows with one non-zero number.
    pub fn picks(&self) -> &[Pick] {
        &self.picks
    }

    /// `√(Σ w (a x - b)²)`.
    pub fn residual(&self, x: &[f64]) -> f64 {
        let dense = self.dense().map(|(a, b, weight)| weight * square(product(a, x) - b));
        let picks = self.picks.iter().map(|pick| pick.weight * square(pick.factor * x[pick.column] - pick.b));
        dense.chain(picks).fold(0.0, |sum, term| sum + term).sqrt()
    }
}

/// The non-zero numbers of a row.
#[derive(Clone, Copy)]
enum Entries<'a> {
    /// All numbers.
    Dense(&'a [f64]),
    /// One number and its variable.
    One(usize, f64),
}

fn square(x: f64) -> f64 {
    x * x
}

fn product(a: &[f64], x: &[f64]) -> f64 {
    a.iter().zip(x).fold(0.0, |sum, (a, x)| sum + a * x)
}

/// General constraints `lower ≤ c x ≤ upper`, each from one level downwards. Equal sides make an equality.
#[derive(Clone, Debug, PartialEq)]
pub struct GeneralRows {
    n: usize,
    c: Vec<f64>,
    sides: Vec<Sides>,
}

/// The sides of a general constraint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sides {
    /// Lower side, -∞ without one.
    pub lower: f64,
    /// Upper side, +∞ without one.
    pub upper: f64,
    /// First level at which the row holds.
    pub from: usize,
}

impl Sides {
    /// Whether the row is an equality.
    pub fn is_equality(&self) -> bool {
        self.lower == self.upper
    }
}

impl GeneralRows {
    /// No rows, with memory for some.
    pub fn with_capacity(n: usize, rows: usize) -> Self {
        GeneralRows { n, c: Vec::with_capacity(n * rows), sides: Vec::with_capacity(rows) }
    }

    /// Removes all rows.
    pub fn clear(&mut self) {
        self.c.clear();
        self.sides.clear();
    }

    /// Adds a row. Returns `c`, n zeros, for the caller to fill.
    pub fn push(&mut self, sides: Sides) -> &mut [f64] {
        self.sides.push(sides);
        let at = self.c.len();
        self.c.resize(at + self.n, 0.0);
        &mut self.c[at..]
    }

    /// Number of rows for which memory is allocated.
    fn capacity(&self) -> usize {
        self.sides.capacity()
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.sides.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.sides.is_empty()
    }

    /// The rows.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (&[f64], Sides)> {
        self.c.chunks_exact(self.n.max(1)).zip(self.sides.iter().copied())
    }
}

/// A hierarchy of least-squares problems under common constraints.
#[derive(Clone, Debug, PartialEq)]
pub struct Hierarchy {
    /// λ, the weight of `|x|²` on every level; not negative.
    pub regularization: f64,
    /// Lower bounds, n; -∞ for none.
    pub lower: Vec<f64>,
    /// Upper bounds, n; +∞ for none.
    pub upper: Vec<f64>,
    /// General constraints.
    pub general: GeneralRows,
    /// Levels, the most important first.
    pub levels: Vec<Level>,
}

impl Hierarchy {
    /// Levels without rows and without bounds.
    ///
    /// - `rows`: number of dense rows of each level for which memory is allocated.
    /// - `general`: number of general constraints for which memory is allocated.
    pub fn with_capacity(n: usize, rows: &[usize], general: usize) -> Self {
        Hierarchy {
            regularization: 0.0,
            lower: vec![f64::NEG_INFINITY; n],
            upper: vec![f64::INFINITY; n],
            general: GeneralRows::with_capacity(n, general),
            levels: rows.iter().map(|&rows| Level::with_capacity(n, rows)).collect(),
        }
    }

    /// Number of variables.
    pub fn n(&self) -> usize {
        self.lower.len()
    }

    /// Largest violation of a bound or of a general constraint at `x`, each in its own unit.
    pub fn violation(&self, x: &[f64]) -> f64 {
        let bounds = self.lower.iter().zip(&self.upper).zip(x).map(|((lower, upper), x)| (lower - x).max(x - upper));
        let rows = self.general.iter().map(|(c, sides)| {
            let value = product(c, x);
            (sides.lower - value).max(value - sides.upper)
        });
        bounds.chain(rows).fold(0.0, f64::max)
    }
}

/// What became of a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelReport {
    /// Result; `None` if a level above has no solution.
    pub status: Option<QpStatus>,
    /// Number of directions that the level decides: the rank of its rows in the null space of the levels above. [`NullSpaceCascade`] reports the
    /// dimension of that null space for a last level with more rows than that, whose rank it does not need.
    pub rank: usize,
    /// Iterations of the search.
    pub iterations: u32,
    /// Number of constraints that hold with equality, without equality constraints.
    pub active: usize,
    /// For an infeasible level: a constraint that contradicts others, if known. General constraints are [`QpRow::Inequality`] and [`QpRow::Equality`] by their
    /// index.
    pub row: Option<QpRow>,
}

impl LevelReport {
    /// Of a level that was not solved yet.
    pub const OPEN: LevelReport = LevelReport { status: None, rank: 0, iterations: 0, active: 0, row: None };

    /// Whether the level has a solution.
    pub fn solved(&self) -> bool {
        matches!(self.status, Some(QpStatus::Solved | QpStatus::AlmostSolved))
    }
}

#[cfg(test)]
mod tests;
