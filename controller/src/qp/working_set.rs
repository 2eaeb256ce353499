//! The constraints that hold with equality, as an orthonormal basis of their rows that grows and shrinks.
//!
//! ```text
//! Mᵀ = Qᵀ R          rows of M: constraints, rows of Q: orthonormal, R upper triangular
//! ```
//! Gram-Schmidt with a second pass where the first has cancelled digits is as good as Householder's reflections, and touches only
//! what is in the set; a row that leaves is turned out by Givens rotations. Source: G. H. Golub, C. F. Van Loan, *Matrix
//! Computations* (2013), sections 5.2 and 6.5.

use super::dense::{axpy, dot};
use std::ops::Range;

/// Part of a row's norm that must lie outside the span of the set for the row to count as independent of it.
const DEPENDENT: f64 = 1e-10;
/// Part of a row's norm below which what a pass of Gram-Schmidt leaves is cleaned by a second one.
const CANCELLED: f64 = 0.5;

/// A basis of at most as many rows as it has numbers in a row.
#[derive(Clone, Debug)]
pub(super) struct WorkingSet {
    /// Rows of Q, `stride` apart.
    q: Vec<f64>,
    /// Columns of R, `stride` apart.
    r: Vec<f64>,
    stride: usize,
    n: usize,
    len: usize,
    /// Of the row last looked at: its part in the span, in terms of Q.
    pub inside: Vec<f64>,
    /// Of the row last looked at: its part outside the span.
    pub outside: Vec<f64>,
}

impl WorkingSet {
    /// Memory for rows of up to `capacity` numbers.
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

    /// Forgets all rows; those that come have `n` numbers.
    pub fn clear(&mut self, n: usize) {
        (self.n, self.len) = (n, 0);
    }

    fn q(&self, k: usize) -> &[f64] {
        &self.q[k * self.stride..][..self.n]
    }

    fn r(&self, k: usize) -> &[f64] {
        &self.r[k * self.stride..][..=k]
    }

    /// Splits a row, whose numbers other than 0 stand in `at`, into `inside` and `outside`; gives the squared norm of the latter, 0 if the row
    /// depends on the set.
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

    /// Takes the row last split into the set; `left` is what [`WorkingSet::split`] gave for it, not 0.
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

    /// Takes row `k` out of the set.
    pub fn remove(&mut self, k: usize) {
        let (n, stride) = (self.n, self.stride);
        self.len -= 1;
        for j in k..self.len {
            // Column j becomes column j + 1 without its last number, which the rotation of rows j and j + 1 takes away.
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

    /// Writes `R⁻¹ y` over `y` from place `from` on: what the rows of the set from there on have in the combination that Q combines by `y`.
    pub fn combination(&self, from: usize, y: &mut [f64]) {
        for k in (from..self.len).rev() {
            let column = self.r(k);
            y[k] /= column[k];
            axpy(-y[k], &column[from..k], &mut y[from..k]);
        }
    }

    /// Subtracts from `v` the smallest vector that has the products `y` with the rows of the set. `y` is overwritten.
    pub fn correct(&self, y: &mut [f64], v: &mut [f64]) {
        for k in 0..self.len {
            let column = self.r(k);
            y[k] = (y[k] - dot(&column[..k], &y[..k])) / column[k];
            axpy(-y[k], self.q(k), v);
        }
    }
}
