//! Timing of a gait: stride, swing and lift-off times.

use super::leg::{Leg, PerLeg};
use super::params::{Gait, GaitTiming, NEVER};
use super::state::{Cadence, State};
use crate::params::Params;

/// Time in which the base goes from rest into the sway of a gait, s.
const SWAY_LEAD_IN: f64 = 0.8;

/// Timing of a gait, derived from its parameters, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Swing time.
    pub T_sw: f64,
    /// Stance time.
    pub T_st: f64,
    /// Stride time.
    pub T: f64,
    /// Duration of the ramps of the force bounds: a fraction of the time in which all four legs stand, at least two ticks.
    pub T_ramp: f64,
    /// Time in the stride at which each leg lifts off; infinite for a leg that never does.
    pub lift_off: PerLeg<f64>,
    /// Sway of the gait: `GaitTiming::sway`.
    pub sway: f64,
    /// Time between the start of the clock and the first lift-off. In it legs unload and the sway of the base begins.
    pub lead_in: f64,
}

impl Timing {
    /// Timing in use: the stride begins with the phase at which the gait has started.
    pub fn of(state: &State, params: &Params) -> Self {
        let mut timing = Self::at(state.gait, state.cadence(), params);
        for at in &mut timing.lift_off.0 {
            if at.is_finite() {
                *at = cyclic(*at - state.first_phase * timing.T, timing.T);
            }
        }
        timing
    }

    /// Whether a leg steps in this gait.
    pub fn steps(&self, leg: Leg) -> bool {
        self.lift_off[leg].is_finite()
    }

    /// Timing of `gait` with the operator's cadence.
    pub fn at(gait: Gait, cadence: Cadence, params: &Params) -> Self {
        let row = gait_params(gait, params);
        let chosen = |commanded: f64, default: f64| if commanded > 0.0 { commanded } else { default };
        let T_sw = 1.0 / chosen(cadence.swing_frequency, row.swing_frequency);
        let T = T_sw / (1.0 - chosen(cadence.duty, row.duty));
        let lift_off = PerLeg(row.lift_off_phase.map(|phase| if phase == NEVER { f64::INFINITY } else { phase * T }));
        let T_ramp = (row.ramp * all_stance_time(&lift_off, T, T_sw)).max(0.002);
        let lead_in = if row.sway > 0.0 { SWAY_LEAD_IN } else { T_ramp };
        Timing { T_sw, T_st: T - T_sw, T, T_ramp, lift_off, sway: row.sway, lead_in }
    }
}

/// Parameters of a gait.
pub fn gait_params(gait: Gait, params: &Params) -> &GaitTiming {
    params.gait.timing(gait)
}

/// Shortest time between a planned touchdown and the next lift-off of a leg that does not lift off together with it, s.
fn all_stance_time(lift_off: &PerLeg<f64>, T: f64, T_sw: f64) -> f64 {
    // A leg that steps alone has this time.
    let mut shortest = T - T_sw;
    for a in lift_off.0 {
        for b in lift_off.0 {
            // Not true of a leg that never lifts off.
            let gap = cyclic(b - a, T);
            if gap > 1e-9 {
                shortest = shortest.min(gap - T_sw);
            }
        }
    }
    shortest
}

/// `x` modulo `T`, in `[0, T)`.
///
/// The remainder is exact. Within a stride of `[0, T)` a subtraction is exact too, and much faster than `fmod`.
pub fn cyclic(x: f64, T: f64) -> f64 {
    let r = if x.abs() < T {
        x
    } else if T <= x && x < 2.0 * T {
        x - T
    } else {
        libm::fmod(x, T)
    };
    if r < 0.0 { r + T } else { r }
}

/// Time until the next lift-off of a leg, s. After the first lift-off it is in `(0, T]`, and it is `T` just after a lift-off. It is infinite for a leg
/// that never lifts off.
pub fn time_to_lift_off(state: &State, timing: &Timing, leg: Leg) -> f64 {
    if state.gait_clock < 0.0 || !timing.steps(leg) {
        return timing.lift_off[leg] - state.gait_clock;
    }
    timing.T - cyclic(state.gait_clock - timing.lift_off[leg], timing.T)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remainder_is_that_of_fmod_to_the_bit() {
        let T: f64 = 1.0 / 0.9;
        for k in -400..=400 {
            for x in [
                f64::from(k) * 0.01,
                f64::from(k) * 0.01 * T,
                (f64::from(k) * T).next_up(),
                (f64::from(k) * T).next_down(),
            ] {
                let r = libm::fmod(x, T);
                let expected = if r < 0.0 { r + T } else { r };
                assert_eq!(cyclic(x, T).to_bits(), expected.to_bits(), "{x}");
            }
        }
        assert!(cyclic(f64::NAN, T).is_nan() && cyclic(f64::INFINITY, T).is_nan());
    }

    #[test]
    fn timing_is_that_of_the_source() {
        let text = "[robot]\nname=\"r\"\nurdf=\"r\"\nfeet=[\"a\",\"b\",\"c\",\"d\"]\nfoot_radius=0.02\nimu_link=\"i\"\nposture={}";
        let params = Params::from_toml(text, "test").unwrap();
        let trot = Timing::at(Gait::TROT, Cadence::default(), &params);
        assert!((trot.T - 1.111).abs() < 1e-3 && (trot.T_ramp - 0.0278).abs() < 1e-4, "{trot:?}");
        let crawl = Timing::at(Gait::CRAWL, Cadence { swing_frequency: 2.0, duty: 0.8 }, &params);
        assert!((crawl.T - 2.5).abs() < 1e-9 && (crawl.T_ramp - 0.0625).abs() < 1e-9, "{crawl:?}");
    }
}
