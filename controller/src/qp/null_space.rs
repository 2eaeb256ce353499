//! The directions that rows leave free, by Householder's reflections.

use crate::dense::{axpy, dot};

/// A row counts as dependent when less than this part of its norm lies outside the span of those before it.
const DEPENDENT: f64 = 1e-7;

/// Reflections that turn the rows that were pushed onto the first axes, so that they turn the other axes onto what is free of them.
///
/// Source: G. H. Golub, C. F. Van Loan, *Matrix Computations* (2013), section 5.2; a row that depends on others is passed over.
#[derive(Clone, Debug)]
pub(super) struct NullSpace {
    /// Unit vectors `h` of the reflections `E - 2 h hᵀ`, `stride` apart; the k-th has zeros before k.
    mirrors: Vec<f64>,
    row: Vec<f64>,
    stride: usize,
    n: usize,
    rank: usize,
}

impl NullSpace {
    /// Memory for rows of up to `capacity` numbers.
    pub fn new(capacity: usize) -> Self {
        let nan = f64::NAN;
        NullSpace { mirrors: vec![nan; capacity * capacity], row: vec![nan; capacity], stride: capacity, n: 0, rank: 0 }
    }

    /// Forgets all rows; those that come have `n` numbers.
    pub fn clear(&mut self, n: usize) {
        (self.n, self.rank) = (n, 0);
    }

    /// Number of free directions.
    pub fn free(&self) -> usize {
        self.n - self.rank
    }

    /// Adds a row, unless it depends on those before it.
    pub fn push(&mut self, row: impl Iterator<Item = f64>) {
        let NullSpace { mirrors, row: y, stride, n, rank } = self;
        let y = &mut y[..*n];
        for (y, x) in y.iter_mut().zip(row) {
            *y = x;
        }
        let size = dot(y, y).sqrt();
        for (k, mirror) in mirrors.chunks_exact(*stride).take(*rank).enumerate() {
            reflect(&mirror[k..*n], &mut y[k..]);
        }
        if *rank == *n {
            return;
        }
        let outside = &mut y[*rank..];
        let left = dot(outside, outside).sqrt();
        // The comparison is false for NaN too, and for a row of zeros.
        if left > DEPENDENT * size {
            outside[0] += left.copysign(outside[0]);
            let inverse = 1.0 / dot(outside, outside).sqrt();
            let mirror = &mut mirrors[*rank * *stride + *rank..*rank * *stride + *n];
            for (h, x) in mirror.iter_mut().zip(outside) {
                *h = *x * inverse;
            }
            *rank += 1;
        }
    }

    /// Writes the k-th of the free directions, orthonormal among each other and to the rows.
    pub fn direction(&self, k: usize, to: &mut [f64]) {
        let to = &mut to[..self.n];
        to.fill(0.0);
        to[self.rank + k] = 1.0;
        for (k, mirror) in self.mirrors.chunks_exact(self.stride).take(self.rank).enumerate().rev() {
            reflect(&mirror[k..self.n], &mut to[k..]);
        }
    }
}

fn reflect(mirror: &[f64], y: &mut [f64]) {
    axpy(-2.0 * dot(mirror, y), mirror, y);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_directions_are_orthonormal_and_free_of_every_row() {
        let rows =
            [[3.0, 4.0, 0.0, 0.0], [0.0; 4], [-6.0, -8.0, 0.0, 0.0], [1.0, 1.0, 1.0, 1e-9], [4.0, 5.0, 1.0, 0.0]];
        let mut space = NullSpace::new(5);
        space.clear(4);
        rows.iter().for_each(|row| space.push(row.iter().copied()));
        assert_eq!(space.free(), 2);
        let mut directions = [[0.0; 4]; 2];
        for (k, direction) in directions.iter_mut().enumerate() {
            space.direction(k, direction);
        }
        let [a, b] = directions;
        for (x, y, expected) in [(a, a, 1.0), (b, b, 1.0), (a, b, 0.0)] {
            assert!((dot(&x, &y) - expected).abs() < 1e-15);
        }
        for row in [rows[0], rows[2], rows[3]] {
            assert!(dot(&row, &a).abs() < 1e-14 && dot(&row, &b).abs() < 1e-14);
        }
        // Two more leave nothing, a third says nothing.
        for row in [a, b, [1.0, 0.0, 0.0, 0.0]] {
            space.push(row.iter().copied());
        }
        assert_eq!(space.free(), 0);
    }
}
