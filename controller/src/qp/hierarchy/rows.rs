//! The rows of a level in coordinates, and their factorization.

use super::free::Free;
use super::{Entries, Level, Selective};
use crate::dense::{axpy, dot};
use crate::qp::program::Unsolved;
use crate::qp::search::Coordinates;
use std::ops::Range;

/// A row is linearly dependent if less than this fraction of its norm is outside the span of the rows above and before it.
const DEPENDENT: f64 = 1e-6;
/// The same as a fraction of the largest norm of the level's rows: a row of rounding errors.
const NOISE: f64 = 1e-12;
/// What a solution may leave of a linearly dependent equality constraint, relative to the norm of the row and the size of the solution.
const CONSISTENT: f64 = 1e-8;
/// Smallest λ of the search, relative to the largest element of a level's Hessian: below it rounding errors would decide.
const LEAST: f64 = 1e-13;
/// The norm of a row's rest is computed again if updates left less than this fraction of its square.
const CANCELLED: f64 = 1e-3;

/// The rows of a level, multiplied by the roots of their weights.
pub(super) struct Rows {
    /// Numbers by row, n apart.
    a: Vec<f64>,
    info: Vec<Row>,
    /// Rows with reflections, in their order.
    pivots: Vec<usize>,
    /// Hessian of the level, lower triangle, n apart.
    H: Vec<f64>,
    n: usize,
}

struct Row {
    /// Right side, without the part of the fixed coordinates.
    right: f64,
    weight: f64,
    /// Squared norm; and that of the part outside the span of the rows above and before it, as updated and as computed last.
    size: f64,
    left: f64,
    computed: f64,
    /// Whether the row has a reflection.
    is_pivot: bool,
}

impl Rows {
    pub fn with_capacity(n: usize, rows: usize) -> Self {
        Rows {
            a: Vec::with_capacity(n * rows.max(1)),
            info: Vec::with_capacity(rows),
            pivots: Vec::with_capacity(n),
            H: vec![f64::NAN; n * n],
            n,
        }
    }

    pub fn poison(&mut self) {
        self.H.fill(f64::NAN);
    }

    /// Loads rows (numbers, right side, weight) in coordinates.
    ///
    /// # Errors
    /// A number is not finite.
    pub fn load<'a>(
        &mut self,
        rows: impl Iterator<Item = (Entries<'a>, f64, f64)>,
        free: &Free,
    ) -> Result<(), Unsolved> {
        let fixed = free.fixed();
        self.a.clear();
        self.info.clear();
        self.pivots.clear();
        for (entries, b, weight) in rows {
            let root = weight.sqrt();
            let at = self.a.len();
            self.a.resize(at + self.n, 0.0);
            let row = &mut self.a[at..];
            match entries {
                Entries::Dense(a) => row.iter_mut().zip(a).for_each(|(to, a)| *to = root * a),
                Entries::One(column, factor) => row[column] = root * factor,
            }
            let size = dot(row, row);
            if !(size.is_finite() && b.is_finite() && root.is_finite()) {
                return Err(Unsolved::failed());
            }
            free.coordinates_of(row);
            let left = dot(&row[fixed..], &row[fixed..]);
            let right = root * b - dot(&row[..fixed], &free.y()[..fixed]);
            self.info.push(Row { right, weight, size, left, computed: left, is_pivot: false });
        }
        Ok(())
    }

    /// Adds the reflections of the rows, in the order of the largest rest.
    pub fn reflect(&mut self, free: &mut Free) {
        let n = self.n;
        let largest = self.info.iter().map(|row| row.size / row.weight).fold(0.0, f64::max);
        for column in free.fixed()..n {
            let (mut most, mut pivot) = (1.0, None);
            for (i, row) in self.info.iter().enumerate().filter(|(_, row)| !row.is_pivot) {
                let least = (DEPENDENT * DEPENDENT * row.size).max(NOISE * NOISE * largest * row.weight);
                if row.left > most * least {
                    (most, pivot) = (row.left / least, Some(i));
                }
            }
            let Some(pivot) = pivot else { break };
            let rest = &self.a[pivot * n + column..(pivot + 1) * n];
            free.reflect(rest, dot(rest, rest).sqrt());
            for (i, row) in self.info.iter_mut().enumerate().filter(|(_, row)| !row.is_pivot) {
                let rest = &mut self.a[i * n + column..(i + 1) * n];
                free.reflect_last(rest);
                row.left -= rest[0] * rest[0];
                if row.left <= CANCELLED * row.computed {
                    row.left = dot(&rest[1..], &rest[1..]);
                    row.computed = row.left;
                }
            }
            self.info[pivot].is_pivot = true;
            self.pivots.push(pivot);
        }
    }

    /// The rows of T, and their right sides.
    fn triangle(&self, columns: Range<usize>) -> impl Iterator<Item = (&[f64], f64)> {
        let rows = self.a.chunks_exact(self.n.max(1)).map(move |row| &row[columns.clone()]);
        rows.zip(self.info.iter().map(|row| row.right))
    }

    /// Solves the rows exactly: `T u = r`. Returns a linearly dependent row that the solution does not fulfil.
    pub fn hold(&self, free: &mut Free) -> Option<usize> {
        let (n, fixed) = (self.n, free.fixed());
        for (k, &i) in self.pivots.iter().enumerate() {
            let row = &self.a[i * n + fixed..(i + 1) * n];
            let y = &mut free.y_mut()[fixed..];
            y[k] = (self.info[i].right - dot(&row[..k], &y[..k])) / row[k];
        }
        let u = &free.y()[free.decided()];
        let size = free.y().iter().fold(1.0, |largest: f64, y| largest.max(y.abs()));
        let mut rows = self.triangle(free.decided()).zip(&self.info);
        rows.position(|((t, right), row)| {
            !row.is_pivot && (right - dot(t, u)).abs() > CONSISTENT * row.size.sqrt().max(1.0) * size
        })
    }

    /// Writes `TᵀT`, and `Tᵀr` to the first numbers of `v`.
    pub fn squares(&mut self, free: &Free, v: &mut [f64]) {
        let (rank, n) = (free.rank(), self.n);
        let mut H = std::mem::take(&mut self.H);
        v[..free.len()].fill(0.0);
        for h in H.chunks_exact_mut(n).take(rank) {
            h[..rank].fill(0.0);
        }
        for (t, right) in self.triangle(free.decided()) {
            axpy(right, t, &mut v[..rank]);
            for (i, h) in H.chunks_exact_mut(n).take(rank).enumerate() {
                axpy(t[i], &t[..=i], &mut h[..=i]);
            }
        }
        self.H = H;
    }

    /// Takes the right-singular vectors of T as coordinates. Their targets, with damped inverses, go to the first numbers of `v`.
    pub fn damp(&self, selective: Selective, free: &mut Free, v: &mut [f64]) {
        v[..free.len()].fill(0.0);
        free.clear_rotation(self.info.len());
        for (i, (t, right)) in self.triangle(free.decided()).enumerate() {
            free.take_row(i, t, right);
        }
        free.decompose(selective, v);
    }

    /// Writes `BᵀB`, and `Bᵀr` to `v`, of a level in a basis N of the null space: `B = √w A N`.
    pub fn normal_equations(&mut self, level: &Level, free: &Free, v: &mut [f64]) {
        let (count, n) = (free.len(), self.n);
        let Rows { a: row, H, .. } = self;
        v[..count].fill(0.0);
        for h in H.chunks_exact_mut(n).take(count) {
            h[..count].fill(0.0);
        }
        let mut add = |row: &[f64], weight: f64, right: f64| {
            axpy(weight * right, row, &mut v[..count]);
            for (i, h) in H.chunks_exact_mut(n).take(count).enumerate() {
                axpy(weight * row[i], &row[..=i], &mut h[..=i]);
            }
        };
        row.clear();
        row.resize(count, 0.0);
        for (a, b, weight) in level.dense() {
            row.fill(0.0);
            for (j, a) in a.iter().enumerate().filter(|(_, a)| **a != 0.0) {
                axpy(*a, free.basis(j), row);
            }
            add(row, weight, b - dot(a, free.base()));
        }
        for pick in level.picks() {
            let weight = pick.weight * pick.factor * pick.factor;
            add(free.basis(pick.column), weight, pick.b / pick.factor - free.base()[pick.column]);
        }
    }

    /// Adds λ to the Hessian, factorizes it, and transforms `v` to the coordinates of the search.
    ///
    /// # Errors
    /// A number is not finite.
    pub fn factorize(&mut self, regularization: f64, free: &mut Free, v: &mut [f64]) -> Result<(), Unsolved> {
        let (count, n) = (free.rank(), self.n);
        let largest = (0..count).map(|i| self.H[i * n + i]).fold(1e-9, f64::max);
        let lambda = regularization.max(LEAST * largest);
        for i in 0..count {
            self.H[i * n + i] += lambda;
        }
        if free.factorize(lambda, |i, j| self.H[i * n + j], v) { Ok(()) } else { Err(Unsolved::failed()) }
    }
}
