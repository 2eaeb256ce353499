//! Where feet go: footholds and the velocity command behind them, the swing.

use serde::{Deserialize, Serialize};

/// Foothold planner and the ramp of the velocity command. Source: Raiola, eqs. (19)-(25).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FootholdParams {
    /// Longest step, m.
    pub max_step_length: f64,
    /// Time constant of the velocity command's filter, s.
    pub command_time_constant: f64,
    /// Fastest change of the commanded velocity, m/s².
    pub max_acceleration: f64,
    /// Largest commanded speed, m/s.
    pub max_speed: f64,
    /// Largest commanded yaw rate, rad/s.
    pub max_yaw_rate: f64,
    /// Gain of the integral that trims the commanded velocity until the base goes as commanded, 1/s; 0 = none.
    pub speed_trim_gain: f64,
    /// Largest trim, m/s.
    pub max_speed_trim: f64,
    /// Part of the swing, at its end, in which step length and heading are kept.
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

/// Swing ellipse and closed-loop inverse kinematics. Source: Raiola, eqs. (26)-(30), Table 2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SwingParams {
    /// Step height `H_s`, m.
    pub height: f64,
    /// CLIK gain P, 1/s.
    pub clik_gain: f64,
    /// Time after `T_sw`, in swing times, that a foot may search for the ground.
    pub reach_time: f64,
}

impl Default for SwingParams {
    fn default() -> Self {
        SwingParams { height: 0.1, clik_gain: 10.0, reach_time: 0.5 }
    }
}
