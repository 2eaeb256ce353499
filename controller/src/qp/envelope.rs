//! Cholesky factor with an envelope: in each row, entries before the first non-zero entry of the matrix are skipped.
//!
//! The Hessian of a legged robot is an arrow matrix: forces are uncoupled, each leg couples with itself and with the base. With the base
//! last, the factor has no fill outside the arrow. No pattern has to be given: the envelope is computed from the numbers in every
//! solve.

use crate::dense::{axpy, dot};
use std::ops::Range;

/// `H = L Lᵀ`, L lower triangular, in memory for a maximum size.
#[derive(Clone, Debug)]
pub(super) struct Envelope {
    /// Rows of L, `stride` apart.
    l: Vec<f64>,
    stride: usize,
    /// First column of each row that may be non-zero.
    first: Vec<usize>,
    /// End of the diagonal block of each row: no entry couples a row before it with a row at or after it.
    end: Vec<usize>,
    /// Inverse of L's diagonal.
    inverse: Vec<f64>,
    n: usize,
}

impl Envelope {
    /// Allocates memory for matrices up to `capacity` x `capacity`.
    pub fn new(capacity: usize) -> Self {
        Envelope {
            l: vec![f64::NAN; capacity * capacity],
            stride: capacity,
            first: vec![0; capacity],
            end: vec![0; capacity],
            inverse: vec![f64::NAN; capacity],
            n: 0,
        }
    }

    /// Factorizes the n x n matrix whose lower triangle `entry(row, column)` gives; false if it is not positive definite.
    pub fn factor(&mut self, n: usize, entry: impl Fn(usize, usize) -> f64) -> bool {
        self.n = n;
        let stride = self.stride;
        for i in 0..n {
            let (above, from_here) = self.l.split_at_mut(i * stride);
            let row = &mut from_here[..=i];
            let first = (0..i).find(|&j| entry(i, j) != 0.0).unwrap_or(i);
            self.first[i] = first;
            for (j, l) in row.iter_mut().enumerate().skip(first) {
                *l = entry(i, j);
            }
            for j in first..i {
                let start = first.max(self.first[j]);
                let other = &above[j * stride + start..j * stride + j];
                row[j] = (row[j] - dot(&row[start..j], other)) * self.inverse[j];
            }
            let pivot = row[i] - dot(&row[first..i], &row[first..i]);
            // The comparison is false for NaN too.
            if !(pivot > 0.0 && pivot < f64::INFINITY) {
                return false;
            }
            row[i] = pivot.sqrt();
            self.inverse[i] = 1.0 / row[i];
        }
        let (mut end, mut reach) = (n, n);
        for i in (0..n).rev() {
            self.end[i] = end;
            reach = reach.min(self.first[i]);
            if reach == i {
                end = i;
            }
        }
        true
    }

    /// Size of the matrix.
    pub fn n(&self) -> usize {
        self.n
    }

    fn row(&self, i: usize) -> &[f64] {
        &self.l[i * self.stride + self.first[i]..i * self.stride + i]
    }

    /// Replaces `y` by `L⁻¹ y`. `y` must be 0 outside the range `at`. Returns the range outside which the result is 0.
    pub fn forward(&self, at: Range<usize>, y: &mut [f64]) -> Range<usize> {
        let Range { start, end } = at;
        if start >= end {
            return at;
        }
        let end = self.end[end - 1];
        for i in start..end {
            let first = self.first[i].max(start);
            let (before, here) = y.split_at_mut(i);
            let row = &self.l[i * self.stride + first..i * self.stride + i];
            here[0] = (here[0] - dot(row, &before[first..])) * self.inverse[i];
        }
        start..end
    }

    /// Replaces `y` by `L⁻ᵀ y`.
    pub fn backward(&self, y: &mut [f64]) {
        for i in (0..self.n).rev() {
            let (before, here) = y.split_at_mut(i);
            here[0] *= self.inverse[i];
            axpy(-here[0], self.row(i), &mut before[self.first[i]..]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two blocks: rows 0..2, and rows 2..5 as an arrow.
    const H: [[f64; 5]; 5] = [
        [4.0, 2.0, 0.0, 0.0, 0.0],
        [2.0, 10.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 9.0, 0.0, 3.0],
        [0.0, 0.0, 0.0, 16.0, 8.0],
        [0.0, 0.0, 3.0, 8.0, 14.0],
    ];

    #[test]
    fn factor_of_an_arrow_matrix_computed_by_hand() {
        let mut factor = Envelope::new(6);
        assert!(factor.factor(5, |i, j| H[i][j]));
        // L = [2], [1 3], [3], [0 4], [1 2 3].
        let mut y = [2.0, 7.0, 3.0, 8.0, 11.0];
        assert_eq!(factor.forward(0..5, &mut y), 0..5);
        assert_eq!(y, [1.0, 2.0, 1.0, 2.0, 2.0]);
        factor.backward(&mut y);
        let product = H.map(|row| row.iter().zip(y).fold(0.0, |sum, (a, b)| sum + a * b));
        for (found, expected) in product.iter().zip([2.0, 7.0, 3.0, 8.0, 11.0]) {
            assert!((found - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn zeros_outside_the_range_are_not_read() {
        let mut factor = Envelope::new(5);
        assert!(factor.factor(5, |i, j| H[i][j]));
        let mut y = [0.0, 3.0, f64::NAN, f64::NAN, f64::NAN];
        assert_eq!(factor.forward(1..2, &mut y), 1..2);
        assert_eq!(y[..2], [0.0, 1.0]);
        let mut y = [f64::NAN, f64::NAN, 0.0, 4.0, 0.0];
        assert_eq!(factor.forward(3..4, &mut y), 3..5);
        assert_eq!(y[2..], [0.0, 1.0, -2.0 / 3.0]);
    }

    #[test]
    fn matrix_that_is_not_positive_definite_is_rejected() {
        let mut factor = Envelope::new(2);
        for matrix in [[[1.0, 2.0], [2.0, 4.0]], [[1.0, f64::NAN], [f64::NAN, 4.0]], [[f64::INFINITY, 0.0], [0.0, 1.0]]]
        {
            assert!(!factor.factor(2, |i, j| matrix[i][j]), "{matrix:?}");
        }
    }
}
