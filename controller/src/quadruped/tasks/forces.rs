//! Contact forces as variables of the quadratic programs.

use crate::quadruped::leg::Leg;

/// Unit of the force variables, N: `F = FORCE_UNIT f`. It gives forces and accelerations similar magnitudes.
pub const FORCE_UNIT: f64 = 100.0;

/// Variable of the component `k` of a foot's force, in W.
pub fn force_column(nv: usize, leg: Leg, k: usize) -> usize {
    nv + 3 * leg as usize + k
}
