//! The constraints that hold with equality: an orthonormal basis of their rows, to which rows are added and removed.
//!
//! ```text
//! Mᵀ = Qᵀ R          rows of M: constraints, rows of Q: orthonormal, R upper triangular
//! ```
//! A row is added by Gram-Schmidt, with a second pass if the first one cancelled digits. This is as accurate as Householder reflections and
//! uses only the rows in the set. A row is removed by Givens rotations. Source: G. H. Golub, C. F. Van Loan, *Matrix
//! Computations* (2013), sections 5.2 and 6.5.

use crate::dense::{axpy, dot};
use std::ops::Range;

/// A row is linearly independent if more than this fraction of its norm is outside the span of the set.
const DEPENDENT: f64 = 1e-10;
/// Gram-Schmidt makes a second pass if the first leaves less than this fraction of a row's norm.
const CANCELLED: f64 = 0.5;

/// A basis of at most as many rows as a row has numbers.
#[derive(Clone, Debug)]
pub(super) struct WorkingSet {
    /// Rows of Q, `stride` apart.
    q: Vec<f64>,
    /// Columns of R, `stride` apart.
    r: Vec<f64>,
    stride: usize,
    n: usize,
    len: usize,
    /// Part in the span of the row split last, in terms of Q.
    pub inside: Vec<f64>,
    /// Part outside the span of the row split last.
    pub outside: Vec<f64>,
}

impl WorkingSet {
    /// Allocates memory for rows of up to `capacity` numbers.
    pub fn new(capacity: usize) -> Self {
        let nan = f64::NAN;
        WorkingSet {
            q: vec![nan; capacity * capacity],
            r: vec![nan; capacity * capacity],
            stride: capacity,
            n: 0,
            len: 0,
            inside: vec![nan; capacity],
            outside: vec![nan; capacity],
        }
    }

    /// Removes all rows. Rows that are pushed next have `n` numbers.
    pub fn clear(&mut self, n: usize) {
        (self.n, self.len) = (n, 0);
    }

    fn q(&self, k: usize) -> &[f64] {
        &self.q[k * self.stride..][..self.n]
    }

    fn r(&self, k: usize) -> &[f64] {
        &self.r[k * self.stride..][..=k]
    }

    /// Splits a row, which is 0 outside the range `at`, into `inside` and `outside`. Returns the squared norm of `outside`, or 0 if the row is
    /// linearly dependent on the set.
    pub fn split(&mut self, row: &[f64], at: Range<usize>) -> f64 {
        let WorkingSet { q, stride, n, len, inside, outside, .. } = self;
        let (outside, inside) = (&mut outside[..*n], &mut inside[..*len]);
        let row = &row[at.clone()];
        outside.fill(0.0);
        outside[at.clone()].copy_from_slice(row);
        let size = dot(row, row);
        for (q, w) in q.chunks_exact(*stride).zip(inside.iter_mut()) {
            *w = dot(&q[at.clone()], row);
        }
        for (q, w) in q.chunks_exact(*stride).zip(inside.iter()) {
            axpy(-*w, &q[..*n], outside);
        }
        let mut left = dot(outside, outside);
        if left < CANCELLED * CANCELLED * size {
            for (q, w) in q.chunks_exact(*stride).zip(inside.iter_mut()) {
                let again = dot(&q[..*n], outside);
                axpy(-again, &q[..*n], outside);
                *w += again;
            }
            left = dot(outside, outside);
        }
        if left > DEPENDENT * DEPENDENT * size && *len < *n { left } else { 0.0 }
    }

    /// Adds the row split last to the set; `left` is the result of [`WorkingSet::split`], not 0.
    pub fn push(&mut self, left: f64) {
        let (n, len, stride) = (self.n, self.len, self.stride);
        let size = left.sqrt();
        let inverse = 1.0 / size;
        for (q, outside) in self.q[len * stride..][..n].iter_mut().zip(&self.outside) {
            *q = outside * inverse;
        }
        let column = &mut self.r[len * stride..][..=len];
        column[..len].copy_from_slice(&self.inside[..len]);
        column[len] = size;
        self.len += 1;
    }

    /// Removes row `k` from the set.
    pub fn remove(&mut self, k: usize) {
        let (n, stride) = (self.n, self.stride);
        self.len -= 1;
        for j in k..self.len {
            // Column j becomes column j + 1. The rotation of rows j and j + 1 removes its last number.
            self.r.copy_within((j + 1) * stride..(j + 1) * stride + j + 2, j * stride);
        }
        for j in k..self.len {
            let (a, b) = (self.r[j * stride + j], self.r[j * stride + j + 1]);
            let size = (a * a + b * b).sqrt();
            let (c, s) = (a / size, b / size);
            self.r[j * stride + j] = size;
            for column in self.r.chunks_exact_mut(stride).take(self.len).skip(j + 1) {
                (column[j], column[j + 1]) = (c * column[j] + s * column[j + 1], c * column[j + 1] - s * column[j]);
            }
            let (upper, lower) = self.q[j * stride..].split_at_mut(stride);
            for (x, y) in upper[..n].iter_mut().zip(&mut lower[..n]) {
                (*x, *y) = (c * *x + s * *y, c * *y - s * *x);
            }
        }
    }

    /// Replaces `y`, from index `from` on, by `R⁻¹ y`: the coefficients of the set's rows in the vector `Qᵀ y`.
    pub fn combination(&self, from: usize, y: &mut [f64]) {
        for k in (from..self.len).rev() {
            let column = self.r(k);
            y[k] /= column[k];
            axpy(-y[k], &column[from..k], &mut y[from..k]);
        }
    }

    /// Subtracts from `v` the smallest vector whose products with the rows of the set are `y`. Overwrites `y`.
    pub fn correct(&self, y: &mut [f64], v: &mut [f64]) {
        for k in 0..self.len {
            let column = self.r(k);
            y[k] = (y[k] - dot(&column[..k], &y[..k])) / column[k];
            axpy(-y[k], self.q(k), v);
        }
    }
}
