//! Parameters of footholds and swing trajectories.

use crate::params::exact::array;
use crate::params::range::{Bound, Range, range};
use serde::{Deserialize, Serialize};

/// Range of a step height, m.
pub const STEP_HEIGHT: Range = range!(0.01, 0.25);

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
    /// Distance by which the velocity command shifts a foothold. Raiola, eq. (19), has `swing_time`.
    pub step_rule: StepRule,
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
            step_rule: StepRule::HalfStance,
        }
    }
}

/// Rule by which the velocity command shifts a foothold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StepRule {
    /// `ΔL = v/f_sw`, as printed in Raiola, eq. (19): the distance of the base in the swing time. The robot then walks faster or slower than
    /// commanded, depending on the duty factor.
    SwingTime,
    /// `ΔL = v T_st/2`: the distance of the base until mid-stance. The foot passes its virtual foothold at mid-stance, and the robot walks at the
    /// commanded speed.
    HalfStance,
}

impl FootholdParams {
    /// Allowed range of each number of this file.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("foothold.max_step_length", range!(0.001, 1), "m"),
        Bound::new("foothold.command_time_constant", range!(0.001, 10), "s"),
        Bound::new("foothold.max_acceleration", range!(0.001, 20), "m/s²"),
        Bound::new("foothold.max_speed", range!(0, 3), "m/s"),
        Bound::new("foothold.max_yaw_rate", range!(0, 5), "rad/s"),
        Bound::new("foothold.speed_trim_gain", range!(0, 10), "1/s"),
        Bound::new("foothold.max_speed_trim", range!(0, 1), "m/s"),
        Bound::new("foothold.freeze_fraction", range!(0, 1), ""),
        Bound::new("swing.height", STEP_HEIGHT, "m"),
        Bound::new("swing.clik_gain", range!(0.01, 1000), "1/s"),
        Bound::new("swing.reach_time", range!(0, 0.5), "swing times"),
        Bound::new("swing.kp", range!(0, 100000), ""),
        Bound::new("swing.kd", range!(0, 10000), ""),
    ];
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
    /// Start the swing from rest. In Raiola, eqs. (26) and (29), the vertical velocity reference jumps from 0 to `π f_sw H_s` at the lift-off, and
    /// the foot is 5 to 10 mm off its reference in the first tenth of a swing (4 Hz, 10 cm).
    pub start_from_rest: bool,
    /// Stiffness of the task `swing` along the x, y, z axes of W: N/m with [`SwingParams::inertia`], else 1/s². The task acts if the formula of the stack
    /// contains it (Raiola, section 4.1); without it the posture task moves the legs in swing.
    #[serde(deserialize_with = "array")]
    pub kp: [f64; 3],
    /// Damping of the task `swing`: N s/m with [`SwingParams::inertia`], else 1/s.
    #[serde(deserialize_with = "array")]
    pub kd: [f64; 3],
    /// The gains of the task `swing` are forces: they are premultiplied by the inverse of the leg's inertia at the foot (Raiola, appendix, eq. (A9)).
    pub inertia: bool,
}

impl Default for SwingParams {
    fn default() -> Self {
        SwingParams {
            height: 0.1,
            clik_gain: 10.0,
            reach_time: 0.5,
            start_from_rest: true,
            kp: [2000.0; 3],
            kd: [160.0; 3],
            inertia: true,
        }
    }
}
