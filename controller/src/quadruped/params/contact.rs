//! Parameters of contact and terrain estimation.

use crate::params::error::ParamsError;
use crate::params::range::{not_negative, positive, weight_fraction, within};
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
    /// Checks the range of each parameter.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn check(&self) -> Result<(), ParamsError> {
        let ContactParams { touch_load, release_load, inertia_compensation: _, debounce, min_jacobian_det } = self;
        weight_fraction("contact.touch_load", *touch_load)?;
        weight_fraction("contact.release_load", *release_load)?;
        within("contact.release_load", &[*release_load], "at most contact.touch_load", |x| x <= *touch_load)?;
        within("contact.debounce", &[f64::from(*debounce)], "at least 1", |x| x >= 1.0)?;
        not_negative("contact.min_jacobian_det", &[*min_jacobian_det])
    }
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

impl TerrainParams {
    /// Checks the range of each parameter.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn check(&self) -> Result<(), ParamsError> {
        let TerrainParams { estimator: _, time_constant, max_gradient } = self;
        positive("terrain.time_constant", *time_constant)?;
        within("terrain.max_gradient", &[*max_gradient], "0 to 0.6", |x| (0.0..=0.6).contains(&x))
    }
}
