//! How the robot gets up and sits down.

use serde::{Deserialize, Serialize};

/// Getting up from the ground and sitting down: joint-space moves with the joint loop of the drives. Beyond Raiola.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StandParams {
    /// Stiffness of a joint over its effort, 1/rad.
    pub stiffness: f64,
    /// Damping of a joint over its effort, s/rad.
    pub damping: f64,
    /// Peak speed of a joint while legs fold, rad/s.
    pub joint_speed: f64,
    /// Peak speed of the base while it rises or is lowered, m/s.
    pub rise_speed: f64,
    /// Height of the base over the feet where legs are folded, as a part of that of standing; more where the joints' limits ask for it.
    pub fold: f64,
    /// Error of a joint at which its reference waits for it, rad. From half of that on it slows down.
    pub max_error: f64,
    /// A move that has waited this long is given up, s.
    pub patience: f64,
}

impl Default for StandParams {
    fn default() -> Self {
        StandParams {
            stiffness: 3.0,
            damping: 0.1,
            joint_speed: 1.0,
            rise_speed: 0.2,
            fold: 0.45,
            max_error: 0.4,
            patience: 2.0,
        }
    }
}
