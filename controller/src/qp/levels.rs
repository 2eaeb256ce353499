//! Hierarchical least squares under common constraints: each level is solved in the null space of the levels above.
//!
//! ```text
//! level k:   min  Σ w_i (a_i x - b_i)² + Σ λ_i x_i²     subject to   A x = b,   C x ≤ d,   l ≤ x ≤ u,   and the residuals of the levels above stay as they are
//!            x = x*_(k-1) + Z y,   A Z = 0,   a_i Z = 0 for all rows above,   Zᵀ Λ Z = E
//! ```
//! The first level is a general program. A lower level has no equality rows, its regularization is the identity, and its Hessian is
//! `E + Bᵀ B` with the rows `B = √w a Z`. The levels share the basis `Z`, which gets fewer columns from level to level. The solution of the
//! level above satisfies every constraint, so a lower level is always feasible.
//!
//! Source: A. Escande, N. Mansard, P.-B. Wieber, *Hierarchical quadratic programming: fast online humanoid-robot motion generation*, IJRR 33
//! (2014), for the basis that is passed from level to level. The search within a level is not from this source.

use super::active_set::{ActiveSetSolver, finish, report};
use super::envelope::Envelope;
use super::null_space::NullSpace;
use super::program::{Qp, QpInfo, QpSolver, Unsolved};
use super::search::Coordinates;
use crate::dense::{axpy, dot};
use nalgebra::DVector;
use std::ops::Range;

/// A row of least squares: `weight (Σ a_i x_i - b)²`.
pub struct SquareRow<'a> {
    /// Weight of the squared error, positive.
    pub weight: f64,
    /// Non-zero entries: variable and number.
    pub entries: &'a mut dyn Iterator<Item = (usize, f64)>,
    /// Right side.
    pub b: f64,
}

/// Calls a function for each row of a level, in order.
pub type FeedRows<'a> = &'a dyn Fn(&mut dyn FnMut(SquareRow<'_>));

/// Solver of a hierarchy, with preallocated memory for all levels.
pub struct Levels {
    max_iterations: u32,
    first: ActiveSetSolver,
    /// λ of each variable, and λ^(-1/2).
    regularization: DVector<f64>,
    scale: DVector<f64>,
    place_of: Vec<Option<usize>>,
    free: Free,
    space: NullSpace,
    /// Next `Z` while it is computed; and one row or direction.
    next: Vec<f64>,
    row: Vec<f64>,
    /// Rows `B` of the last level, and `E + Bᵀ B`.
    rows: Vec<f64>,
    H: Vec<f64>,
}

/// Coordinates `v` of the free directions: `x = x0 + K v`, `K = Z L⁻ᵀ`, `L Lᵀ = E + Bᵀ B`. Rows of the matrices are by place, `stride` apart.
struct Free {
    Z: Vec<f64>,
    K: Vec<f64>,
    x0: Vec<f64>,
    factor: Envelope,
    stride: usize,
    n: usize,
    len: usize,
}

impl Coordinates for Free {
    fn len(&self) -> usize {
        self.len
    }

    fn pull(&mut self, normal: &[f64], at: Range<usize>, row: &mut [f64]) -> Range<usize> {
        row.fill(0.0);
        for place in at {
            if normal[place] != 0.0 {
                axpy(normal[place], &self.K[place * self.stride..][..self.len], row);
            }
        }
        0..self.len
    }

    fn place(&mut self, v: &[f64], x: &mut [f64]) {
        for (x, (x0, k)) in x.iter_mut().zip(self.x0.iter().zip(self.K.chunks_exact(self.stride))).take(self.n) {
            *x = x0 + dot(&k[..v.len()], v);
        }
    }
}

impl Levels {
    /// Allocates memory for a hierarchy.
    ///
    /// - `pattern`: pattern of the first level's program, see [`ActiveSetSolver::new`].
    /// - `regularization`: λ of each variable, the same on all levels; the Hessian of the first level contains it.
    /// - `rows`: largest number of rows of a lower level. They are non-zero only in the first `columns` variables.
    /// - `max_iterations`: iteration limit of each level.
    pub fn new(pattern: &Qp, regularization: &DVector<f64>, rows: usize, columns: usize, max_iterations: u32) -> Self {
        let n = pattern.n();
        let nan = |n: usize| vec![f64::NAN; n];
        Levels {
            max_iterations,
            first: ActiveSetSolver::with_coupled(pattern, max_iterations, columns),
            regularization: regularization.clone(),
            scale: regularization.map(|lambda| 1.0 / lambda.sqrt()),
            place_of: vec![None; n],
            free: Free { Z: nan(n * n), K: nan(n * n), x0: nan(n), factor: Envelope::new(n), stride: n, n: 0, len: 0 },
            space: NullSpace::new(n),
            next: nan(n * n),
            row: nan(n),
            rows: Vec::with_capacity(rows * n),
            H: nan(n * n),
        }
    }

    /// Solves the first level.
    pub fn first(&mut self, qp: &Qp, x: &mut DVector<f64>) -> QpInfo {
        self.first.solve(qp, x)
    }

    /// Computes the null space of the equality rows and the rows of the first level, after it was solved.
    pub fn below_first(&mut self, feed: FeedRows<'_>) {
        let Levels { first, scale, place_of, free, space, row, .. } = self;
        let (places, n) = (&first.places, first.places.len());
        place_of.fill(None);
        for (place, &i) in places.iter().enumerate() {
            place_of[i] = Some(place);
        }
        space.clear(n);
        for i in 0..first.search.constraints.n_eq() {
            let equality = first.search.constraints.equality(i);
            space.push(equality.iter().zip(places).map(|(x, &i)| x * scale[i]));
        }
        feed(&mut |SquareRow { entries, .. }| {
            row[..n].fill(0.0);
            for (i, a) in entries {
                if let Some(place) = place_of[i] {
                    row[place] = a * scale[i];
                }
            }
            space.push(row[..n].iter().copied());
        });
        (free.n, free.len) = (n, space.free());
        for k in 0..free.len {
            space.direction(k, row);
            for ((to, x), &i) in free.Z.iter_mut().skip(k).step_by(free.stride).zip(row.iter()).zip(places) {
                *to = x * scale[i];
            }
        }
    }

    /// Reduces the null space by the rows of the last lower level, after it was solved.
    pub fn below(&mut self) {
        let Levels { free, space, rows, row, next, .. } = self;
        let (len, stride) = (free.len, free.stride);
        space.clear(len);
        for b in rows.chunks_exact(stride) {
            space.push(b[..len].iter().copied());
        }
        free.len = space.free();
        for k in 0..free.len {
            space.direction(k, row);
            for (to, z) in next.iter_mut().skip(k).step_by(stride).zip(free.Z.chunks_exact(stride)).take(free.n) {
                *to = dot(&z[..len], &row[..len]);
            }
        }
        std::mem::swap(&mut free.Z, next);
    }

    /// Solves a lower level, starting at the solution of the level above.
    pub fn lower(&mut self, feed: FeedRows<'_>, x: &mut DVector<f64>) -> QpInfo {
        let n = self.free.n;
        self.free.x0[..n].copy_from_slice(&self.first.search.x[..n]);
        self.cost(feed);
        let Levels { max_iterations, first, free, H, .. } = self;
        let (len, stride) = (free.len, free.stride);
        if !free.factor.factor(len, |i, j| H[i * stride + j]) {
            return report(Err(Unsolved::failed()), 0, x);
        }
        for (k, z) in free.K.chunks_exact_mut(stride).zip(free.Z.chunks_exact(stride)).take(n) {
            k[..len].copy_from_slice(&z[..len]);
            free.factor.forward(0..len, &mut k[..len]);
        }
        free.factor.forward(0..len, &mut first.search.v[..len]);
        first.search.start(free);
        let solved = first.search.inequalities(free, *max_iterations);
        let solved = solved.and_then(|n| finish(&first.places, &first.search.x, x.as_mut_slice()).map(|()| n));
        report(solved, first.clamped() + first.search.n_active(), x)
    }

    /// Writes `E + Bᵀ B` to `H`, `B` to `rows`, and the negative gradient at `x0` to `v` of the search.
    fn cost(&mut self, feed: FeedRows<'_>) {
        let Levels { first, regularization, place_of, free, rows, row, H, .. } = self;
        let (len, stride) = (free.len, free.stride);
        let v = &mut first.search.v[..len];
        v.fill(0.0);
        for ((&i, x0), z) in first.places.iter().zip(&free.x0).zip(free.Z.chunks_exact(stride)) {
            axpy(-regularization[i] * x0, &z[..len], v);
        }
        for (i, h) in H.chunks_exact_mut(stride).take(len).enumerate() {
            h[..len].fill(0.0);
            h[i] = 1.0;
        }
        rows.clear();
        feed(&mut |SquareRow { weight, entries, b }| {
            let size = weight.sqrt();
            let row = &mut row[..len];
            row.fill(0.0);
            let mut error = -b;
            for (i, a) in entries {
                if let Some(place) = place_of[i] {
                    axpy(size * a, &free.Z[place * stride..][..len], row);
                    error += a * free.x0[place];
                }
            }
            axpy(-size * error, row, v);
            for (h, b) in H.chunks_exact_mut(stride).zip(row.iter()) {
                axpy(*b, row, &mut h[..len]);
            }
            let at = rows.len();
            rows.resize(at + stride, 0.0);
            rows[at..at + len].copy_from_slice(row);
        });
    }
}
