//! Parameters of the gaits.

use crate::params::exact::array;
use crate::params::range::{Bound, Range, range};
use serde::{Deserialize, Serialize};

/// Range of a duty factor.
pub const DUTY: Range = Range { contains: |x| (0.5..1.0).contains(&x), expected: "at least 0.5 and below 1" };
/// Range of a phase.
const PHASE: Range = Range { contains: |x| (0.0..1.0).contains(&x), expected: "at least 0 and below 1" };
/// Range of a swing frequency, Hz.
pub const SWING_FREQUENCY: Range = range!(0.5, 10);

/// The `[gait]` table: timing of the gaits. Source: Raiola, Fig. 4 and Table 2, except for the crawl. With the printed duty factor of 0.80 and
/// 2 Hz the weight has to move from one support triangle to the next in 0.125 s, and the robot falls where the feet do not land as planned; with
/// the defaults here it has 0.36 s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GaitParams {
    /// Trot: diagonal pairs.
    pub trot: GaitTiming,
    /// Crawl: one leg at a time, LF RH RF LH.
    pub crawl: GaitTiming,
}

/// Timing of one gait. Swing time `T_sw = 1/f_sw`, stride `T = T_sw/(1 - δ)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaitTiming {
    /// Duty factor `δ = T_st/T`.
    pub duty: f64,
    /// Swing frequency `f_sw = 1/T_sw`, Hz.
    pub swing_frequency: f64,
    /// Phase of the stride at which each leg lifts off, LF RF LH RH.
    #[serde(deserialize_with = "array")]
    pub lift_off_phase: [f64; 4],
    /// How far the zero-moment point moves from the centre towards the foot opposite to the swinging one, as a fraction of half their distance.
    #[serde(default)]
    pub sway: f64,
    /// Smallest vertical force of the foot opposite to one that swings or unloads, as a fraction of the weight.
    #[serde(default)]
    pub residual_load: f64,
    /// Length of the ramps on which a leg is loaded and unloaded, as a fraction of the time in which all four legs stand; 0 = no ramp.
    #[serde(default = "half")]
    pub ramp: f64,
    /// Factor on the commanded velocity, for a gait in which the robot walks slower than commanded.
    #[serde(default = "one")]
    pub velocity_gain: f64,
}

fn one() -> f64 {
    1.0
}

fn half() -> f64 {
    0.5
}

impl Default for GaitParams {
    fn default() -> Self {
        GaitParams {
            trot: GaitTiming {
                duty: 0.55,
                swing_frequency: 2.0,
                lift_off_phase: [0.0, 0.5, 0.5, 0.0],
                sway: 0.0,
                residual_load: 0.0,
                ramp: 0.5,
                velocity_gain: 1.0,
            },
            crawl: GaitTiming {
                duty: 0.88,
                swing_frequency: 3.0,
                lift_off_phase: [0.0, 0.5, 0.75, 0.25],
                sway: 0.25,
                residual_load: 0.05,
                ramp: 0.5,
                velocity_gain: 1.0,
            },
        }
    }
}

impl GaitParams {
    /// Allowed range of each number.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("gait.trot.duty", DUTY, ""),
        Bound::new("gait.trot.swing_frequency", SWING_FREQUENCY, "Hz"),
        Bound::new("gait.trot.lift_off_phase", PHASE, "strides"),
        Bound::new("gait.trot.sway", range!(0, 0.5), ""),
        Bound::new("gait.trot.residual_load", range!(0, 0.2), "weights"),
        Bound::new("gait.trot.ramp", range!(0, 0.5), ""),
        Bound::new("gait.trot.velocity_gain", range!(0.1, 3), ""),
        Bound::new("gait.crawl.duty", DUTY, ""),
        Bound::new("gait.crawl.swing_frequency", SWING_FREQUENCY, "Hz"),
        Bound::new("gait.crawl.lift_off_phase", PHASE, "strides"),
        Bound::new("gait.crawl.sway", range!(0, 0.5), ""),
        Bound::new("gait.crawl.residual_load", range!(0, 0.2), "weights"),
        Bound::new("gait.crawl.ramp", range!(0, 0.5), ""),
        Bound::new("gait.crawl.velocity_gain", range!(0.1, 3), ""),
    ];
}
