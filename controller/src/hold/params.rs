//! Parameters of the hold controller.

use crate::params::error::ParamsError;
use crate::params::range::positive;
use serde::{Deserialize, Serialize};

/// The `[hold]` table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HoldParams {
    /// Stiffness of every joint, N m/rad.
    pub kp: f64,
    /// Damping of every joint, N m s/rad.
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
    /// Checks the range of each parameter.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn check(&self) -> Result<(), ParamsError> {
        let HoldParams { kp, kd, duration } = self;
        positive("hold.kp", *kp)?;
        positive("hold.kd", *kd)?;
        positive("hold.duration", *duration)
    }
}
