//! Parameters of contact and terrain estimation.

use crate::params::range::{Bound, range};
use serde::{Deserialize, Serialize};

/// The `[contact]` table: contact estimation. Source: Raiola, eq. (18) and section 4.3.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ContactParams {
    /// Normal force above which a contact begins, as a fraction of the robot's weight. Raiola has 50 N, for the 851 N of HyQ.
    pub touch_load: f64,
    /// Normal force below which a contact ends, as a fraction of the weight.
    pub release_load: f64,
    /// Subtract the torque for the acceleration of the swing reference. Raiola neglects it, and then swinging feet of a light robot seem to be in
    /// contact.
    pub inertia_compensation: bool,
    /// Number of consecutive samples above the threshold after which a contact begins.
    pub debounce: i32,
    /// Smallest |det J_leg| at which the force is computed, m³. Below it the last force is kept.
    pub min_jacobian_det: f64,
}

impl Default for ContactParams {
    fn default() -> Self {
        ContactParams {
            touch_load: 0.0587,
            release_load: 0.0294,
            inertia_compensation: true,
            debounce: 3,
            min_jacobian_det: 1e-4,
        }
    }
}

impl ContactParams {
    /// Allowed range of each number of this file.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("contact.touch_load", range!(1e-6, 1), "weights"),
        Bound::new("contact.release_load", range!(1e-6, 1), "weights"),
        Bound::new("contact.debounce", range!(1, 100), "ticks"),
        Bound::new("contact.min_jacobian_det", range!(0, 1), "m³"),
        Bound::new("terrain.time_constant", range!(0.001, 100), "s"),
        Bound::new("terrain.max_gradient", range!(0, 0.6), ""),
    ];
}

/// The `[terrain]` table: terrain estimation. Source: Raiola, section 3.4, which refers to other work for the estimator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TerrainParams {
    /// Estimate the ground as the plane through the last contact points; the plane gives the tilt of the base, the swing plane and the friction
    /// cones. If false, the ground counts as level, and the height of the feet under a tilted base follows the base: a stack without roll and
    /// pitch of the trunk (`trunk[2]`) then lets the posture task bring the base parallel to the ground.
    pub estimator: bool,
    /// Time constant of the plane's filter, s.
    pub time_constant: f64,
    /// Largest gradient of the estimated plane, rise over run.
    pub max_gradient: f64,
}

impl Default for TerrainParams {
    fn default() -> Self {
        TerrainParams { estimator: true, time_constant: 0.5, max_gradient: 0.4 }
    }
}
