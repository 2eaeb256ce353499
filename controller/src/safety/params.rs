//! Parameters of the safety checks.

use crate::params::error::ParamsError;
use crate::params::range::{not_negative, positive, within};
use serde::{Deserialize, Serialize};

/// The `[safety]` table: limits that lead to the safe state, and the damping in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SafetyParams {
    /// Largest roll or pitch of the base, rad.
    pub max_tilt: f64,
    /// Largest age of the joint state that a tick uses, s.
    pub max_state_age: f64,
    /// Largest age of an operator command, s. An older one counts as no command: the robot stops walking and stands.
    pub max_operator_age: f64,
    /// How far a joint position may exceed its limits in the URDF, rad.
    pub position_margin: f64,
    /// Largest joint velocity, as a multiple of the limit in the URDF.
    pub velocity_factor: f64,
    /// Largest measured joint torque, as a multiple of the effort in the URDF.
    pub torque_factor: f64,
    /// Smallest height of the base above the feet while standing or walking, as a fraction of the nominal height.
    pub min_height: f64,
    /// Longest time without a foot on the ground while standing or walking, s.
    pub max_flight_time: f64,
    /// Number of consecutive ticks that may repeat the last torque after the quadratic program failed.
    pub max_qp_failures: i32,
    /// Damping of the joints in the safe state, N m s/rad.
    pub damping: f64,
}

impl Default for SafetyParams {
    fn default() -> Self {
        SafetyParams {
            max_tilt: 0.6,
            max_state_age: 0.01,
            max_operator_age: 0.5,
            position_margin: 0.2,
            velocity_factor: 3.0,
            torque_factor: 1.5,
            min_height: 0.5,
            max_flight_time: 0.5,
            max_qp_failures: 5,
            damping: 8.0,
        }
    }
}

impl SafetyParams {
    /// Checks the range of each parameter.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn check(&self) -> Result<(), ParamsError> {
        let SafetyParams {
            max_tilt,
            max_state_age,
            max_operator_age,
            position_margin,
            velocity_factor,
            torque_factor,
            min_height,
            max_flight_time,
            max_qp_failures,
            damping,
        } = self;
        positive("safety.max_tilt", *max_tilt)?;
        positive("safety.max_state_age", *max_state_age)?;
        positive("safety.max_operator_age", *max_operator_age)?;
        not_negative("safety.position_margin", &[*position_margin])?;
        positive("safety.velocity_factor", *velocity_factor)?;
        positive("safety.torque_factor", *torque_factor)?;
        within("safety.min_height", &[*min_height], "at least 0 and below 1", |x| (0.0..1.0).contains(&x))?;
        positive("safety.max_flight_time", *max_flight_time)?;
        within("safety.max_qp_failures", &[f64::from(*max_qp_failures)], "at least 0", |x| x >= 0.0)?;
        positive("safety.damping", *damping)
    }
}
