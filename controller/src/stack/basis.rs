//! Orthonormal basis of rows, built row by row: the directions that the levels above determine.
//!
//! The rows of a level may be linearly dependent on each other and on rows above: a foot in two tasks, a stretched leg, a task that repeats
//! another. As equality constraints, such rows can make a program infeasible by rounding errors alone. A lower level therefore does not get
//! `A_j x = A_j x_j*`, but the same set of points in an orthonormal basis of the row space, `Q x = Q x_j*`. It is well conditioned for all
//! tasks, and its number of rows is bounded: a dependent row leaves a row of zeros. Elimination of the null space would give the
//! solver fewer variables, but their number would change with the rank; a solver without allocation in a tick needs constant sizes.

use crate::dense::{axpy, dot};
use nalgebra::{DMatrix, DVector};

/// A row is linearly dependent if less than this fraction of its norm is outside the span of the rows before it.
///
/// The part outside is known to about 1e-16 of the norm, so a kept direction is accurate to 1e-9 or better, below the accuracy of a level's
/// solution. A dropped direction is left to lower levels, which may then violate the row by a millionth of its norm.
pub const DEPENDENT: f64 = 1e-7;

/// Gram-Schmidt makes a second pass if the first leaves less than this fraction of a row's norm.
const CANCELLED: f64 = 0.5;

/// Orthonormal rows in preallocated memory. A linearly dependent row is stored as zeros.
#[derive(Clone, Debug)]
pub struct Basis {
    /// The rows, as columns: n x capacity.
    Qt: DMatrix<f64>,
    row: DVector<f64>,
    used: usize,
    rank: usize,
}

impl Basis {
    /// Allocates memory for `capacity` rows of `n` numbers.
    pub fn new(n: usize, capacity: usize) -> Self {
        let nan = f64::NAN;
        Basis { Qt: DMatrix::from_element(n, capacity, nan), row: DVector::from_element(n, nan), used: 0, rank: 0 }
    }

    /// Removes all rows.
    pub fn clear(&mut self) {
        (self.used, self.rank) = (0, 0);
    }

    /// Number of pushed rows, including dependent ones.
    pub fn len(&self) -> usize {
        self.used
    }

    /// Whether no row was pushed.
    pub fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// Number of linearly independent rows.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Adds the row with the numbers `entry(i)`. Returns whether it is linearly independent of the rows before it.
    ///
    /// Gram-Schmidt, with a second pass if the first one cancelled digits; the rows are then orthogonal up to rounding. Source: G. H. Golub,
    /// C. F. Van Loan, *Matrix Computations* (2013), section 5.2.
    ///
    /// # Panics
    /// If `capacity` rows were already pushed.
    pub fn push(&mut self, entry: impl Fn(usize) -> f64) -> bool {
        let n = self.row.len();
        for i in 0..n {
            self.row[i] = entry(i);
        }
        let row = self.row.as_mut_slice();
        let size = dot(row, row).sqrt();
        let mut left = size;
        for _ in 0..2 {
            if left == 0.0 {
                break;
            }
            let before = left;
            for q in self.Qt.as_slice().chunks_exact(n).take(self.used) {
                axpy(-dot(q, row), q, row);
            }
            left = dot(row, row).sqrt();
            if left > CANCELLED * before {
                break;
            }
        }
        let fresh = left > DEPENDENT * size;
        let place = &mut self.Qt.as_mut_slice()[self.used * n..(self.used + 1) * n];
        for (q, x) in place.iter_mut().zip(self.row.iter()) {
            *q = if fresh { x / left } else { 0.0 };
        }
        self.used += 1;
        self.rank += usize::from(fresh);
        fresh
    }

    /// Entry of a stored row.
    pub fn at(&self, row: usize, col: usize) -> f64 {
        self.Qt[(col, row)]
    }

    /// Writes the entries in column `col` of the stored rows from row `from` on, until `to` is full.
    pub fn column(&self, from: usize, col: usize, to: &mut [f64]) {
        let n = self.row.len();
        for (to, row) in to.iter_mut().zip(self.Qt.as_slice()[from * n..].chunks_exact(n)) {
            *to = row[col];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(rows: &[[f64; 3]]) -> (Basis, Vec<bool>) {
        let mut basis = Basis::new(3, rows.len());
        let fresh = rows.iter().map(|row| basis.push(|i| row[i])).collect();
        (basis, fresh)
    }

    #[test]
    fn dependent_rows_are_stored_as_zeros() {
        let (basis, fresh) =
            of(&[[3.0, 4.0, 0.0], [0.0; 3], [-6.0, -8.0, 0.0], [1e6, 0.0, 0.0], [1.0, 1.0, 1e-9], [0.0, 0.0, 1e-3]]);
        assert_eq!(fresh, [true, false, false, true, false, true]);
        assert_eq!((basis.rank(), basis.len()), (3, 6));
        assert_eq!([basis.at(0, 0), basis.at(0, 1), basis.at(0, 2)], [0.6, 0.8, 0.0]);
        assert!((0..3).all(|i| basis.at(1, i) == 0.0 && basis.at(2, i) == 0.0 && basis.at(4, i) == 0.0));
    }

    #[test]
    fn nearly_parallel_rows_become_orthogonal() {
        let (basis, fresh) = of(&[[1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + 1e-6], [1.0, 1.0 + 1e-6, 1.0]]);
        assert_eq!(fresh, [true; 3]);
        for (a, b, expected) in [(0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0), (0, 1, 0.0), (0, 2, 0.0), (1, 2, 0.0)] {
            let found = (0..3).fold(0.0, |sum, i| sum + basis.at(a, i) * basis.at(b, i));
            assert!((found - expected).abs() < 1e-15, "{a} {b}: {found}");
        }
    }
}
