//! Parameters of standing up and sitting down.

use crate::params::range::{Bound, range};
use serde::{Deserialize, Serialize};

/// The `[stand]` table: standing up from the ground and sitting down, in joint space with the joint loop of the drives. Not part of Raiola.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StandParams {
    /// Stiffness of a joint divided by its effort, 1/rad.
    pub stiffness: f64,
    /// Damping of a joint divided by its effort, s/rad.
    pub damping: f64,
    /// Peak speed of a joint while the legs fold, rad/s.
    pub joint_speed: f64,
    /// Peak speed of the base while it moves up or down, m/s.
    pub rise_speed: f64,
    /// Height of the base above the feet when the legs are folded, as a fraction of the standing height. The height is larger where joint limits
    /// require it.
    pub fold: f64,
    /// Joint error at which the reference stops and waits, rad. It slows down from half of this error on.
    pub max_error: f64,
    /// Time of waiting after which a motion is aborted, s. The key is `stand.patience`.
    #[serde(rename = "patience")]
    pub timeout: f64,
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
            timeout: 2.0,
        }
    }
}

impl StandParams {
    /// Allowed range of each number.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("stand.stiffness", range!(0.01, 100), "1/rad"),
        Bound::new("stand.damping", range!(0, 10), "s/rad"),
        Bound::new("stand.joint_speed", range!(0.01, 10), "rad/s"),
        Bound::new("stand.rise_speed", range!(0.005, 2), "m/s"),
        Bound::new("stand.fold", range!(0.05, 0.9), ""),
        Bound::new("stand.max_error", range!(1e-9, 3), "rad"),
        Bound::new("stand.patience", range!(0.01, 60), "s"),
    ];
}
