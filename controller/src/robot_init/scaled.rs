//! Forces and steps of HyQ, scaled by mass and size.

use crate::quadruped::params::{FootholdParams, RecoveryParams, SwingParams, WbcParams};

/// Mass of HyQ, kg. The default parameters are made for HyQ.
const HYQ_MASS: f64 = 86.8;
/// Height of HyQ's hips above the ground, m.
const HYQ_HEIGHT: f64 = 0.6;
/// Swing frequency of HyQ's trot, Hz.
const HYQ_TROT: f64 = 4.0;
/// Difference of velocity that moves no foothold, m/s, for a robot of HyQ's size. HyQ's file has 0: its base sways less in a trot than that of robots with
/// nearly straight legs, of which ANYmal C trots at 75 % of the command without it.
const CAPTURE_THRESHOLD: f64 = 0.1;

/// Parameters of HyQ, scaled by mass and size, within their allowed ranges.
pub(super) struct Scaled {
    /// N.
    pub(super) f_z_min: f64,
    /// N.
    pub(super) f_max: f64,
    /// Largest joint acceleration, rad/s².
    pub(super) qdd_max: f64,
    /// m.
    pub(super) step_height: f64,
    /// m.
    pub(super) step_length: f64,
    /// Swing frequency, Hz.
    pub(super) trot: f64,
    /// Largest shift of a foothold by the capture point, m.
    pub(super) capture: f64,
    /// Difference of velocity that causes no such shift, m/s.
    pub(super) capture_threshold: f64,
}

impl Scaled {
    /// - `mass`: kg.
    /// - `height`: of the hips above the ground, m.
    pub(super) fn new(mass: f64, height: f64) -> Self {
        let wbc = WbcParams::default();
        let (force, size) = (mass / HYQ_MASS, height / HYQ_HEIGHT);
        Scaled {
            f_z_min: two_digits(wbc.f_z_min * force),
            // Not below HyQ's: a light robot needs the same margin above its weight.
            f_max: two_digits(wbc.f_z_max * force.max(1.0)),
            // At equal speeds of the feet, accelerations of the joints grow as legs become shorter. With HyQ's limit the torques of a leg that lands do
            // not push its foot to the ground: mini cheetah falls on stones in 3 of 4 runs, with this one in 0 of 6.
            qdd_max: two_digits(wbc.qdd_max / size.min(1.0)),
            step_height: two_digits(SwingParams::default().height * size).clamp(0.01, 0.25),
            step_length: two_digits(FootholdParams::default().max_step_length * size).min(1.0),
            // The time constant of an inverted pendulum grows with the square root of its height.
            trot: two_digits(HYQ_TROT / size.sqrt()).min(10.0),
            capture: two_digits(RecoveryParams::default().max_capture * size.min(1.0)),
            // Velocities grow with the square root of the height.
            capture_threshold: two_digits(CAPTURE_THRESHOLD * size.min(1.0).sqrt()),
        }
    }
}

/// Rounds to two significant digits.
pub(super) fn two_digits(x: f64) -> f64 {
    let text = format!("{x:.1e}");
    text.parse().expect("a formatted number parses")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_two_significant_digits() {
        assert_eq!([7.1744, 0.0537, 1000.0, 123.4, 4.0].map(two_digits), [7.2, 0.054, 1000.0, 120.0, 4.0]);
    }

    #[test]
    fn scaling_by_one_gives_the_values_of_hyq() {
        let scaled = Scaled::new(HYQ_MASS, HYQ_HEIGHT);
        let found = [scaled.f_z_min, scaled.f_max, scaled.qdd_max, scaled.step_height, scaled.trot];
        assert_eq!(found, [20.0, 1000.0, 500.0, 0.1, 4.0]);
        assert_eq!([0.3, 1.2].map(|height| Scaled::new(20.0, height).qdd_max), [1000.0, 500.0]);
    }
}
