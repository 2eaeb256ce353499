//! Parameters of standing up and sitting down.

use crate::params::error::ParamsError;
use crate::params::range::{not_negative, positive, within};
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
    /// Checks the range of each parameter.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn check(&self) -> Result<(), ParamsError> {
        let StandParams { stiffness, damping, joint_speed, rise_speed, fold, max_error, timeout } = self;
        positive("stand.stiffness", *stiffness)?;
        not_negative("stand.damping", &[*damping])?;
        positive("stand.joint_speed", *joint_speed)?;
        positive("stand.rise_speed", *rise_speed)?;
        within("stand.fold", &[*fold], "above 0 and at most 0.9", |x| x > 0.0 && x <= 0.9)?;
        positive("stand.max_error", *max_error)?;
        positive("stand.patience", *timeout)
    }
}
