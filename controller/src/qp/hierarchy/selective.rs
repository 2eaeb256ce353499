//! Selective damping of small singular values.
//!
//! ```text
//! law "smooth":   inv(s) = s / (s² + (s0/2)²)          peak 1/s0 at s0/2            eq. (2.45)
//! law "exact":    inv(s) = min(s / s0², 1/s)           exact from s0 on             eq. (2.46)
//! ```
//! on singular values divided by the largest one. Source: Laurenzi 2020, section 2.5.

use crate::dense::dot;
use serde::{Deserialize, Serialize};

/// How the inverse of a small singular value is limited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// `s / (s² + (s0/2)²)`.
    Smooth,
    /// `min(s / s0², 1/s)`.
    Exact,
}

/// Damping of a level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Selective {
    /// Law.
    pub law: Law,
    /// Threshold `s0`, relative to the largest singular value; positive.
    pub threshold: f64,
}

impl Selective {
    /// The damped inverse of a singular value; `largest` is positive.
    pub fn inverse(self, s: f64, largest: f64) -> f64 {
        let (s, s0) = (s / largest, self.threshold);
        let inverse = match self.law {
            Law::Smooth => s / (s * s + 0.25 * s0 * s0),
            Law::Exact if s >= s0 => 1.0 / s,
            Law::Exact => s / (s0 * s0),
        };
        inverse / largest
    }
}

/// Rotations end when all products of two columns are below this fraction of the product of their norms.
const ORTHOGONAL: f64 = 1e-15;
/// Largest number of sweeps over all pairs of columns.
const SWEEPS: usize = 30;

/// Singular value decomposition `T = U S Vᵀ` by one-sided Jacobi rotations. Source: G. H. Golub, C. F. Van Loan, *Matrix Computations* (2013), section 8.6.3.
///
/// - `t`: columns of T, m x r, `m` apart; they become the columns of `U S`.
/// - `v`: overwritten by the columns of V, r x r, `stride` apart.
pub(super) fn jacobi(t: &mut [f64], m: usize, v: &mut [f64], stride: usize, r: usize) {
    for (k, column) in v.chunks_exact_mut(stride).take(r).enumerate() {
        column[..r].fill(0.0);
        column[k] = 1.0;
    }
    for _ in 0..SWEEPS {
        let mut rotated = false;
        for i in 0..r {
            for j in i + 1..r {
                let (left, right) = t.split_at_mut(j * m);
                let (x, y) = (&mut left[i * m..(i + 1) * m], &mut right[..m]);
                let (xx, yy, xy) = (dot(x, x), dot(y, y), dot(x, y));
                if xy.abs() <= ORTHOGONAL * (xx * yy).sqrt() {
                    continue;
                }
                rotated = true;
                let zeta = (yy - xx) / (2.0 * xy);
                let tangent = 1.0_f64.copysign(zeta) / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let c = 1.0 / (1.0 + tangent * tangent).sqrt();
                let s = c * tangent;
                rotate(x, y, c, s);
                let (left, right) = v.split_at_mut(j * stride);
                rotate(&mut left[i * stride..i * stride + r], &mut right[..r], c, s);
            }
        }
        if !rotated {
            return;
        }
    }
}

fn rotate(x: &mut [f64], y: &mut [f64], c: f64, s: f64) {
    for (x, y) in x.iter_mut().zip(y) {
        (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The published example `[[0, 1], [e, 1]]`: the largest damped inverse is 1/s0 of the largest singular value, whatever e.
    #[test]
    fn both_laws_are_bounded_continuous_and_zero_at_zero() {
        for law in [Law::Smooth, Law::Exact] {
            let selective = Selective { law, threshold: 0.1 };
            assert_eq!(selective.inverse(0.0, 2.0), 0.0);
            let largest = (0..=2000).map(|k| selective.inverse(f64::from(k) * 1e-3, 2.0)).fold(0.0, f64::max);
            assert!((largest - 5.0).abs() < 1e-3, "{largest}");
            let step = |s: f64| (selective.inverse(s + 1e-9, 2.0) - selective.inverse(s, 2.0)).abs();
            assert!(step(0.2 - 5e-10) < 1e-6);
        }
        let inverse = |law, s| Selective { law, threshold: 0.1 }.inverse(s, 2.0);
        assert!((inverse(Law::Exact, 0.5) - 2.0).abs() < 1e-14 && (inverse(Law::Smooth, 0.1) - 5.0).abs() < 1e-14);
    }

    /// T = [[3, 0], [4, 5]]: singular values √45 and √5, in closed form.
    #[test]
    fn singular_values_of_a_matrix_computed_by_hand() {
        let (mut t, mut v) = ([3.0, 4.0, 0.0, 5.0], [f64::NAN; 4]);
        jacobi(&mut t, 2, &mut v, 2, 2);
        let mut s = [dot(&t[..2], &t[..2]), dot(&t[2..], &t[2..])];
        s.sort_by(f64::total_cmp);
        assert!((s[0] - 5.0).abs() < 1e-13 && (s[1] - 45.0).abs() < 1e-13, "{s:?}");
        // T = (U S) Vᵀ.
        for (row, column, expected) in [(0, 0, 3.0), (1, 0, 4.0), (0, 1, 0.0), (1, 1, 5.0)] {
            let found = (0..2).fold(0.0, |sum, k| sum + t[k * 2 + row] * v[k * 2 + column]);
            assert!((found - expected).abs() < 1e-14, "{row} {column}: {found}");
        }
    }
}
