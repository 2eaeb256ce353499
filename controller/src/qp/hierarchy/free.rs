//! The coordinates that the levels above leave free, and the coordinates of the search in them.

use super::Selective;
use super::selective::jacobi;
use crate::dense::{axpy, dot};
use crate::qp::envelope::Envelope;
use crate::qp::null_space::NullSpace;
use crate::qp::search::Coordinates;
use std::ops::Range;

/// λ of the directions that a damped level does not decide, where its singular vectors have the weight 1.
const WEAK: f64 = 1e-8;

/// How the free coordinates become those of the search.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    /// `y_free = [L⁻ᵀ v_u ; v_w / √λ]`.
    Factor,
    /// `y_free = [V v_u ; v_w / √λ]`, V: right-singular vectors.
    Rotation,
    /// `x = x0 + N L⁻ᵀ v`, N: a basis of the null space.
    Basis,
}

/// `x = Q y`, `y = [y_fixed; u; w]`.
pub(super) struct Free {
    space: NullSpace,
    y: Vec<f64>,
    n: usize,
    /// Number of fixed coordinates.
    fixed: usize,
    form: Form,
    factor: Envelope,
    /// `1/√λ`.
    weak: f64,
    /// Basis N, row by row, n apart; and x0.
    basis: Vec<f64>,
    base: Vec<f64>,
    /// T by columns, `rows` apart, which become those of `U S`; its right sides; V by columns, n apart.
    t: Vec<f64>,
    right: Vec<f64>,
    rows: usize,
    v: Vec<f64>,
    scratch: Vec<f64>,
}

impl Free {
    pub fn new(n: usize, rows: usize) -> Self {
        let nan = |n: usize| vec![f64::NAN; n];
        Free {
            space: NullSpace::new(n),
            y: vec![0.0; n],
            n,
            fixed: 0,
            form: Form::Factor,
            factor: Envelope::new(n),
            weak: f64::NAN,
            basis: nan(n * n),
            base: nan(n),
            t: nan(n * rows),
            right: nan(rows),
            rows: 0,
            v: nan(n * n),
            scratch: nan(n),
        }
    }

    pub fn poison(&mut self) {
        for numbers in [&mut self.basis, &mut self.base, &mut self.t, &mut self.right, &mut self.v, &mut self.scratch] {
            numbers.fill(f64::NAN);
        }
    }

    /// Makes all coordinates free.
    pub fn clear(&mut self) {
        self.space.clear(self.n);
        self.y.fill(0.0);
        self.fixed = 0;
        self.form = Form::Factor;
    }

    /// Number of fixed coordinates, the first ones.
    pub fn fixed(&self) -> usize {
        self.fixed
    }

    /// Number of directions that the present level decides.
    pub fn rank(&self) -> usize {
        if self.form == Form::Basis { self.n - self.fixed } else { self.space.rank() - self.fixed }
    }

    /// The coordinates that the present level decides.
    pub fn decided(&self) -> Range<usize> {
        self.fixed..self.fixed + self.rank()
    }

    pub fn y(&self) -> &[f64] {
        &self.y
    }

    pub fn y_mut(&mut self) -> &mut [f64] {
        &mut self.y
    }

    /// Replaces a row by its coordinates.
    pub fn coordinates_of(&self, row: &mut [f64]) {
        self.space.coordinates_of(row);
    }

    /// Adds the reflection of a row's rest, of norm `size`.
    pub fn reflect(&mut self, rest: &[f64], size: f64) {
        self.space.add(rest, size);
    }

    /// Applies the last reflection to a row's rest.
    pub fn reflect_last(&self, rest: &mut [f64]) {
        self.space.reflect_last(rest);
    }

    /// Fixes the coordinates that the present level decides; the others become 0.
    pub fn fix(&mut self) {
        self.fixed += self.rank();
        self.y[self.fixed..].fill(0.0);
        self.form = Form::Factor;
    }

    /// Prepares a basis of the null space and the point that the fixed coordinates define.
    pub fn take_basis(&mut self) {
        self.form = Form::Basis;
        let Free { space, y, n, fixed, basis, base, scratch, .. } = self;
        base.copy_from_slice(y);
        space.vector_of(base);
        for k in 0..*n - *fixed {
            space.direction(k, scratch);
            for (to, x) in basis.iter_mut().skip(k).step_by(*n).zip(scratch.iter()) {
                *to = *x;
            }
        }
    }

    /// A row of the basis.
    pub fn basis(&self, variable: usize) -> &[f64] {
        &self.basis[variable * self.n..][..self.n - self.fixed]
    }

    /// The point that the fixed coordinates define.
    pub fn base(&self) -> &[f64] {
        &self.base
    }

    /// Factorizes the Hessian of the coupled coordinates, λ included, and transforms its negative gradient `v` to coordinates of the search. False if
    /// a number is not finite.
    pub fn factorize(&mut self, lambda: f64, entry: impl Fn(usize, usize) -> f64, v: &mut [f64]) -> bool {
        self.weak = 1.0 / lambda.sqrt();
        let count = self.rank();
        if !self.factor.factor(count, entry) {
            return false;
        }
        self.factor.forward(0..count, &mut v[..count]);
        v[..count].iter().all(|x| x.is_finite())
    }

    /// Makes room for the rows of T.
    pub fn clear_rotation(&mut self, rows: usize) {
        self.rows = rows;
    }

    /// Takes a row of T and its right side.
    pub fn take_row(&mut self, i: usize, t: &[f64], right: f64) {
        self.right[i] = right;
        for (to, t) in self.t.iter_mut().skip(i).step_by(self.rows).zip(t) {
            *to = *t;
        }
    }

    /// Takes the right-singular vectors of T as coordinates, and writes their targets.
    pub fn decompose(&mut self, selective: Selective, targets: &mut [f64]) {
        let rank = self.rank();
        self.form = Form::Rotation;
        self.weak = 1.0 / WEAK.sqrt();
        let Free { t, right, rows, v, n, .. } = self;
        jacobi(t, *rows, v, *n, rank);
        let columns = || t.chunks_exact((*rows).max(1)).take(rank);
        let largest = columns().map(|us| dot(us, us)).fold(0.0, f64::max).sqrt();
        for (target, us) in targets.iter_mut().zip(columns()) {
            let s = dot(us, us).sqrt();
            // A column of U S, so its product with the right side is divided by s once more.
            *target = if s > 0.0 { selective.inverse(s, largest) * dot(us, &right[..*rows]) / s } else { 0.0 };
        }
    }

    /// Keeps the coordinates `v` of the search as the solution of the level.
    pub fn keep(&mut self, v: &[f64]) {
        let (fixed, len) = (self.fixed, self.len());
        if self.form != Form::Basis {
            let mut y = std::mem::take(&mut self.y);
            self.expand(&v[..len], &mut y[fixed..]);
            self.y = y;
        }
    }

    /// Keeps the coordinates of a point as the solution of the level.
    pub fn keep_point(&mut self, x: &[f64]) {
        self.y.copy_from_slice(x);
        self.space.coordinates_of(&mut self.y);
    }

    /// Free coordinates of the coordinates of the search.
    fn expand(&self, v: &[f64], y: &mut [f64]) {
        let rank = self.rank();
        if self.form == Form::Rotation {
            y[..rank].fill(0.0);
            for (column, c) in self.v.chunks_exact(self.n).zip(&v[..rank]) {
                axpy(*c, &column[..rank], &mut y[..rank]);
            }
        } else {
            y[..rank].copy_from_slice(&v[..rank]);
            self.factor.backward(&mut y[..rank]);
        }
        for (y, v) in y[rank..].iter_mut().zip(&v[rank..]) {
            *y = v * self.weak;
        }
    }
}

impl Coordinates for Free {
    fn len(&self) -> usize {
        self.n - self.fixed
    }

    fn pull(&mut self, normal: &[f64], at: Range<usize>, row: &mut [f64]) -> Range<usize> {
        let (n, fixed, rank, len) = (self.n, self.fixed, self.rank(), row.len());
        if self.form == Form::Basis {
            row.fill(0.0);
            for i in at.filter(|&i| normal[i] != 0.0) {
                axpy(normal[i], &self.basis[i * n..][..len], row);
            }
            self.factor.forward(0..len, row);
            return 0..len;
        }
        self.scratch.copy_from_slice(&normal[..n]);
        self.space.coordinates_of(&mut self.scratch);
        let free = &self.scratch[fixed..];
        if self.form == Form::Rotation {
            for (to, column) in row.iter_mut().zip(self.v.chunks_exact(n)).take(rank) {
                *to = dot(&column[..rank], &free[..rank]);
            }
        } else {
            row[..rank].copy_from_slice(&free[..rank]);
            self.factor.forward(0..rank, &mut row[..rank]);
        }
        for (to, free) in row[rank..].iter_mut().zip(&free[rank..]) {
            *to = free * self.weak;
        }
        0..len
    }

    fn place(&mut self, v: &[f64], x: &mut [f64]) {
        let (n, fixed) = (self.n, self.fixed);
        if self.form == Form::Basis {
            let step = &mut self.scratch[..v.len()];
            step.copy_from_slice(v);
            self.factor.backward(step);
            for ((x, base), row) in x.iter_mut().zip(&self.base).zip(self.basis.chunks_exact(n)) {
                *x = base + dot(&row[..v.len()], step);
            }
            return;
        }
        x[..fixed].copy_from_slice(&self.y[..fixed]);
        self.expand(v, &mut x[fixed..n]);
        self.space.vector_of(&mut x[..n]);
    }
}
