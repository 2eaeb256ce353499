//! An orthonormal basis of rows, grown row by row: which directions the levels above have decided.
//!
//! The rows of a level may depend on each other and on those above: a foot twice, a stretched leg, a task that repeats another. As equality
//! constraints such rows make a program without a solution out of rounding errors. So what is handed down is not `A_j x = A_j x_j*` itself
//! but the same set of points in an orthonormal basis, `Q x = Q x_j*`, of the row space alone: perfectly conditioned whatever the tasks are, and
//! never more rows than there is memory for, since a row that depends on those before it leaves its place zero. Eliminating the null
//! space instead would give the solver fewer variables, but a number of them that changes with the rank, while a solver that allocates
//! nothing in a tick needs constant sizes.

use crate::dense::{axpy, dot};
use nalgebra::{DMatrix, DVector};

/// A row counts as dependent when less than this part of its norm lies outside the span of those before it.
///
/// The part that lies outside is known to about 1e-16, so a kept direction is good to 1e-9 at worst, below what a level is solved to;
/// a direction that is dropped is left to lower levels, who then may violate the row by a millionth of its norm.
pub const DEPENDENT: f64 = 1e-7;

/// Part of a row's norm below which what a pass of Gram-Schmidt leaves is cleaned by a second one.
const CANCELLED: f64 = 0.5;

/// Orthonormal rows, in preallocated memory. A place whose row depended on those before it is zero.
#[derive(Clone, Debug)]
pub struct Basis {
    /// The rows, as columns: n x capacity.
    Qt: DMatrix<f64>,
    row: DVector<f64>,
    used: usize,
    rank: usize,
}

impl Basis {
    /// Memory for rows of `n` numbers.
    pub fn new(n: usize, capacity: usize) -> Self {
        let nan = f64::NAN;
        Basis { Qt: DMatrix::from_element(n, capacity, nan), row: DVector::from_element(n, nan), used: 0, rank: 0 }
    }

    /// Forgets all rows.
    pub fn clear(&mut self) {
        (self.used, self.rank) = (0, 0);
    }

    /// Number of rows that were pushed.
    pub fn len(&self) -> usize {
        self.used
    }

    /// Whether none was pushed.
    pub fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// Number of rows that did not depend on those before them.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Adds a row, `entry(i)` its numbers; says whether it brought a new direction.
    ///
    /// Gram-Schmidt, with a second pass where the first has cancelled digits: then the rows are orthogonal to rounding. Source: G. H. Golub,
    /// C. F. Van Loan, *Matrix Computations* (2013), section 5.2.
    ///
    /// # Panics
    /// If there is no memory left.
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

    /// Entry of a row that was pushed.
    pub fn at(&self, row: usize, col: usize) -> f64 {
        self.Qt[(col, row)]
    }

    /// Writes the entries in `col` of the rows that were pushed from row `from` on, as many as `to` has places for.
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
    fn dependent_rows_leave_their_place_zero() {
        let (basis, fresh) =
            of(&[[3.0, 4.0, 0.0], [0.0; 3], [-6.0, -8.0, 0.0], [1e6, 0.0, 0.0], [1.0, 1.0, 1e-9], [0.0, 0.0, 1e-3]]);
        assert_eq!(fresh, [true, false, false, true, false, true]);
        assert_eq!((basis.rank(), basis.len()), (3, 6));
        assert_eq!([basis.at(0, 0), basis.at(0, 1), basis.at(0, 2)], [0.6, 0.8, 0.0]);
        assert!((0..3).all(|i| basis.at(1, i) == 0.0 && basis.at(2, i) == 0.0 && basis.at(4, i) == 0.0));
    }

    #[test]
    fn rows_that_are_nearly_parallel_come_out_orthogonal() {
        let (basis, fresh) = of(&[[1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + 1e-6], [1.0, 1.0 + 1e-6, 1.0]]);
        assert_eq!(fresh, [true; 3]);
        for (a, b, expected) in [(0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0), (0, 1, 0.0), (0, 2, 0.0), (1, 2, 0.0)] {
            let found = (0..3).fold(0.0, |sum, i| sum + basis.at(a, i) * basis.at(b, i));
            assert!((found - expected).abs() < 1e-15, "{a} {b}: {found}");
        }
    }
}
