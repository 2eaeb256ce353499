//! Parameters of the hold controller.

use crate::params::range::{Bound, range};
use serde::{Deserialize, Serialize};

/// The `[hold]` table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HoldParams {
    /// Stiffness of every joint that has none in `[robot.joints]`, N m/rad.
    pub kp: f64,
    /// Damping of every joint that has none in `[robot.joints]`, N m s/rad.
    pub kd: f64,
    /// Duration of the motion to the posture, s.
    pub duration: f64,
}

impl Default for HoldParams {
    fn default() -> Self {
        HoldParams { kp: 300.0, kd: 10.0, duration: 3.0 }
    }
}

impl HoldParams {
    /// Allowed range of each number.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("hold.kp", range!(0.001, 10000), "N m/rad"),
        Bound::new("hold.kd", range!(0.0001, 1000), "N m s/rad"),
        Bound::new("hold.duration", range!(0.1, 60), "s"),
    ];
}
