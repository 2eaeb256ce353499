//! When legs lift, and how load goes from one to the next.

use serde::{Deserialize, Serialize};

/// Timing of the gaits. Source: Raiola, Fig. 4 and Table 2, but for the crawl: with the 0.80 and 2 Hz printed the weight has to go from one support
/// triangle to the next in 0.125 s, and it falls where the feet do not stand as planned; here it has 0.36 s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GaitParams {
    /// Trot: diagonal pairs.
    pub trot: GaitTiming,
    /// Crawl: one leg at a time, LF RH RF LH.
    pub crawl: GaitTiming,
}

/// Timing of one gait. Swing time `1/f_sw`, stride `T = T_sw/(1 - δ)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaitTiming {
    /// Duty factor δ = T_st/T.
    pub duty: f64,
    /// Swing frequency `f_sw = 1/T_sw`, Hz.
    pub swing_frequency: f64,
    /// Phase of the stride at which each leg lifts off, LF RF LH RH.
    pub lift_off_phase: [f64; 4],
    /// How far the zero-moment point goes from the centre towards the foot opposite to a swinging one, as a part of half their distance.
    #[serde(default)]
    pub sway: f64,
    /// Least vertical force of the foot opposite to one that swings or unloads, as a part of the weight.
    #[serde(default)]
    pub residual_load: f64,
    /// Length of the ramps with which a leg takes up and gives up load, as a part of the time in which all four legs stand; 0 = none.
    #[serde(default = "half")]
    pub ramp: f64,
    /// Factor on the commanded velocity where legs are to carry it out, for a gait that goes slower than commanded.
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
