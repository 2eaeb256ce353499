//! Parameters of the controller `posture`.

use crate::params::range::{Bound, range};
use serde::{Deserialize, Serialize};

/// The `[motion]` table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MotionParams {
    /// Name of the posture to which the robot moves. A change while the robot moves is followed from the present references.
    pub posture: String,
    /// Largest speed of a joint's reference, as a fraction of the joint's velocity limit.
    pub velocity: f64,
    /// Largest acceleration of a joint's reference, rad/s² or m/s².
    pub acceleration: f64,
}

impl Default for MotionParams {
    fn default() -> Self {
        MotionParams { posture: crate::model::NOMINAL.to_owned(), velocity: 0.2, acceleration: 2.0 }
    }
}

impl MotionParams {
    /// Allowed range of each number.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("motion.velocity", range!(0.001, 1), ""),
        Bound::new("motion.acceleration", range!(0.01, 1000), "rad/s² or m/s²"),
    ];
}
