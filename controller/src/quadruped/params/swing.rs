//! Parameters of footholds and swing trajectories.

use crate::params::error::ParamsError;
use crate::params::range::{Range, in_range, not_negative, positive, within};
use serde::{Deserialize, Serialize};

/// Range of a step height, m.
pub const STEP_HEIGHT: Range = Range { contains: |x| (0.01..=0.25).contains(&x), expected: "0.01 to 0.25" };

/// The `[foothold]` table: foothold planner, filter and limits of the velocity command. Source: Raiola, eqs. (19)-(25).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FootholdParams {
    /// Longest step, m.
    pub max_step_length: f64,
    /// Time constant of the velocity command's filter, s.
    pub command_time_constant: f64,
    /// Largest rate of change of the commanded velocity, m/s².
    pub max_acceleration: f64,
    /// Largest commanded speed, m/s.
    pub max_speed: f64,
    /// Largest commanded yaw rate, rad/s.
    pub max_yaw_rate: f64,
    /// Gain of the integrator that corrects the commanded velocity by the difference between commanded and estimated velocity, 1/s; 0 = off.
    pub speed_trim_gain: f64,
    /// Largest correction by that integrator, m/s.
    pub max_speed_trim: f64,
    /// Fraction of the swing, at its end, in which step length and heading stay constant.
    pub freeze_fraction: f64,
}

impl Default for FootholdParams {
    fn default() -> Self {
        FootholdParams {
            max_step_length: 0.3,
            command_time_constant: 0.1,
            max_acceleration: 0.5,
            max_speed: 0.6,
            max_yaw_rate: 0.8,
            speed_trim_gain: 0.4,
            max_speed_trim: 0.1,
            freeze_fraction: 0.2,
        }
    }
}

impl FootholdParams {
    /// Checks the range of each parameter.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn check(&self) -> Result<(), ParamsError> {
        let FootholdParams {
            max_step_length,
            command_time_constant,
            max_acceleration,
            max_speed,
            max_yaw_rate,
            speed_trim_gain,
            max_speed_trim,
            freeze_fraction,
        } = self;
        positive("foothold.max_step_length", *max_step_length)?;
        positive("foothold.command_time_constant", *command_time_constant)?;
        positive("foothold.max_acceleration", *max_acceleration)?;
        not_negative("foothold.max_speed", &[*max_speed])?;
        not_negative("foothold.max_yaw_rate", &[*max_yaw_rate])?;
        not_negative("foothold.speed_trim_gain", &[*speed_trim_gain])?;
        not_negative("foothold.max_speed_trim", &[*max_speed_trim])?;
        within("foothold.freeze_fraction", &[*freeze_fraction], "0 to 1", |x| (0.0..=1.0).contains(&x))
    }
}

/// The `[swing]` table: swing ellipse and closed-loop inverse kinematics. Source: Raiola, eqs. (26)-(30), Table 2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SwingParams {
    /// Step height `H_s`, m.
    pub height: f64,
    /// CLIK gain P, 1/s.
    pub clik_gain: f64,
    /// Time after `T_sw` in which a foot searches for the ground, as a multiple of `T_sw`.
    pub reach_time: f64,
}

impl Default for SwingParams {
    fn default() -> Self {
        SwingParams { height: 0.1, clik_gain: 10.0, reach_time: 0.5 }
    }
}

impl SwingParams {
    /// Checks the range of each parameter.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn check(&self) -> Result<(), ParamsError> {
        let SwingParams { height, clik_gain, reach_time } = self;
        in_range("swing.height", &[*height], STEP_HEIGHT)?;
        positive("swing.clik_gain", *clik_gain)?;
        within("swing.reach_time", &[*reach_time], "0 to 0.5", |x| (0.0..=0.5).contains(&x))
    }
}
