//! Parameters of the quadratic programs.

use crate::params::range::{Bound, range};
use serde::{Deserialize, Serialize};

/// The `[wbc]` table: constraints and solver settings of the quadratic programs. Source: Raiola, eqs. (10)-(15), Table 2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WbcParams {
    /// Regularization λ of accelerations and forces.
    pub regularization: f64,
    /// Friction coefficient μ. Raiola has 0.8, the coefficient of its ground. With 0.8 ANYmal B falls on 2 of 20 rough tracks, whose stones are
    /// steeper than the plane through the feet; with the margin of this default it falls on none.
    pub friction: f64,
    /// Largest tangential force of a foot, N.
    pub f_xy_max: f64,
    /// Largest vertical force of a foot, N.
    pub f_z_max: f64,
    /// Smallest vertical force of a stance foot, N. The bound in use is at most four fifths of `contact.release_load`.
    pub f_z_min: f64,
    /// Largest joint acceleration, rad/s².
    pub qdd_max: f64,
    /// Largest number of iterations of the solver.
    pub max_iterations: u32,
    /// Tolerance of the solver on feasibility and duality gap.
    pub tolerance: f64,
}

impl Default for WbcParams {
    fn default() -> Self {
        WbcParams {
            regularization: 1e-6,
            friction: 0.6,
            f_xy_max: 1000.0,
            f_z_max: 1000.0,
            f_z_min: 20.0,
            qdd_max: 500.0,
            max_iterations: 200,
            tolerance: 1e-8,
        }
    }
}

impl WbcParams {
    /// Allowed range of each number.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("wbc.regularization", range!(1e-12, 1), ""),
        Bound::new("wbc.friction", range!(0.05, 2), ""),
        Bound::new("wbc.f_xy_max", range!(1, 100000), "N"),
        Bound::new("wbc.f_z_max", range!(1, 100000), "N"),
        Bound::new("wbc.f_z_min", range!(0.001, 10000), "N"),
        Bound::new("wbc.qdd_max", range!(1, 100000), "rad/s²"),
        Bound::new("wbc.max_iterations", range!(1, 10000), ""),
        Bound::new("wbc.tolerance", range!(1e-14, 0.01), ""),
    ];
}
