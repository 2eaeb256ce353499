//! Null space of a set of rows, by Householder reflections.

use crate::dense::{axpy, dot};

/// A row is linearly dependent if less than this fraction of its norm is outside the span of the rows before it.
const DEPENDENT: f64 = 1e-7;

/// Reflections that map the pushed rows to the span of the first axes; they map the other axes to the null space.
///
/// Source: G. H. Golub, C. F. Van Loan, *Matrix Computations* (2013), section 5.2; a linearly dependent row is skipped.
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
    /// Allocates memory for rows of up to `capacity` numbers.
    pub fn new(capacity: usize) -> Self {
        let nan = f64::NAN;
        NullSpace { mirrors: vec![nan; capacity * capacity], row: vec![nan; capacity], stride: capacity, n: 0, rank: 0 }
    }

    /// Removes all rows. Rows that are pushed next have `n` numbers.
    pub fn clear(&mut self, n: usize) {
        (self.n, self.rank) = (n, 0);
    }

    /// Dimension of the null space.
    pub fn free(&self) -> usize {
        self.n - self.rank
    }

    /// Adds a row, unless it is linearly dependent on the rows before it.
    pub fn push(&mut self, row: impl Iterator<Item = f64>) {
        let n = self.n;
        let mut y = std::mem::take(&mut self.row);
        for (y, x) in y[..n].iter_mut().zip(row) {
            *y = x;
        }
        let size = dot(&y[..n], &y[..n]).sqrt();
        self.coordinates_of(&mut y[..n]);
        if self.rank < n {
            let left = dot(&y[self.rank..n], &y[self.rank..n]).sqrt();
            // The comparison is false for NaN too, and for a row of zeros.
            if left > DEPENDENT * size {
                self.add(&y[self.rank..n], left);
            }
        }
        self.row = y;
    }

    /// Number of rows that were added.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Adds the reflection that maps the vector `outside`, the part of a row outside the first [`NullSpace::rank`] axes, to the next axis.
    ///
    /// - `left`: norm of `outside`, not 0. The image is `-left` with the sign of the first number.
    pub fn add(&mut self, outside: &[f64], left: f64) {
        let mirror = &mut self.mirrors[self.rank * self.stride + self.rank..self.rank * self.stride + self.n];
        mirror.copy_from_slice(outside);
        mirror[0] += left.copysign(mirror[0]);
        let inverse = 1.0 / dot(mirror, mirror).sqrt();
        mirror.iter_mut().for_each(|x| *x *= inverse);
        self.rank += 1;
    }

    /// Applies the reflection that was added last to a vector without its first `rank - 1` numbers.
    pub fn reflect_last(&self, outside: &mut [f64]) {
        let last = self.rank - 1;
        reflect(&self.mirrors[last * self.stride + last..last * self.stride + self.n], outside);
    }

    /// Applies all reflections, in the order in which they were added: replaces a row by its coordinates.
    pub fn coordinates_of(&self, y: &mut [f64]) {
        for (k, mirror) in self.mirrors.chunks_exact(self.stride).take(self.rank).enumerate() {
            reflect(&mirror[k..self.n], &mut y[k..self.n]);
        }
    }

    /// Applies all reflections in the reverse order: replaces coordinates by the vector.
    pub fn vector_of(&self, y: &mut [f64]) {
        for (k, mirror) in self.mirrors.chunks_exact(self.stride).take(self.rank).enumerate().rev() {
            reflect(&mirror[k..self.n], &mut y[k..self.n]);
        }
    }

    /// Writes the k-th vector of an orthonormal basis of the null space.
    pub fn direction(&self, k: usize, to: &mut [f64]) {
        let to = &mut to[..self.n];
        to.fill(0.0);
        to[self.rank + k] = 1.0;
        self.vector_of(to);
    }
}

fn reflect(mirror: &[f64], y: &mut [f64]) {
    axpy(-2.0 * dot(mirror, y), mirror, y);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn null_space_is_orthonormal_and_orthogonal_to_every_row() {
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
        // Two more rows make the null space empty; a third is dependent.
        for row in [a, b, [1.0, 0.0, 0.0, 0.0]] {
            space.push(row.iter().copied());
        }
        assert_eq!(space.free(), 0);
    }
}
