//! What real drives do to a torque that is asked of them: it comes late, and not all of it.

use crate::DriverError;
use crate::terrain::{BadKey, check_range};
use serde::Deserialize;
use std::collections::BTreeMap;

/// The `[drives]` table of a scenario. Left out, drives give what is asked, at once.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DriveParams {
    /// Time constant of the first-order lag of every torque, s; 0 = none.
    pub lag_s: f64,
    /// Torque given per torque asked, joint -> factor; 1 where a joint is not named.
    pub gain: BTreeMap<String, f64>,
    /// The gains hold only while the foot of the joint's leg touches nothing, as with a load cell that reads too little in swing.
    pub gain_in_air: bool,
}

impl DriveParams {
    pub(crate) fn check(&self) -> Result<(), BadKey> {
        check_range("lag_s", &[self.lag_s], 0.0..=1.0)?;
        let gains: Vec<f64> = self.gain.values().copied().collect();
        check_range("gain", &gains, 0.0..=2.0)?;
        if self.gain_in_air && self.gain.is_empty() {
            let (found, expected) = ("true".to_owned(), "`gain` to name the joints it is meant for".to_owned());
            return Err(BadKey { key: "gain_in_air", found, expected });
        }
        Ok(())
    }
}

/// The drives of one robot.
#[derive(Clone, Debug)]
pub(crate) struct Drives {
    /// Part of the way to the torque asked that is left after a step.
    left: f64,
    gain: Vec<f64>,
    in_air: bool,
    tau: Vec<f64>,
}

impl Drives {
    /// Binds the parameters to a robot whose actuated joints are `joints`.
    ///
    /// - `step_s`: time between two torques, s.
    ///
    /// # Errors
    /// [`DriverError::Unknown`] for a joint that the robot lacks.
    pub fn new(params: &DriveParams, joints: &[String], step_s: f64) -> Result<Self, DriverError> {
        if let Some(name) = params.gain.keys().find(|name| !joints.contains(name)) {
            return Err(DriverError::Unknown {
                wanted_by: "drives.gain".to_owned(),
                what: "joint",
                name: name.clone(),
                known: joints.to_vec(),
            });
        }
        let left = if params.lag_s > 0.0 { libm::exp(-step_s / params.lag_s) } else { 0.0 };
        let gain = joints.iter().map(|joint| params.gain.get(joint).copied().unwrap_or(1.0)).collect();
        Ok(Drives { left, gain, in_air: params.gain_in_air, tau: vec![0.0; joints.len()] })
    }

    /// Drives that have given no torque yet.
    pub fn reset(&mut self) {
        self.tau.fill(0.0);
    }

    /// The torque that a joint gives in the coming step, N m, for `asked`; `airborne`: the foot of its leg touches nothing.
    pub fn give(&mut self, joint: usize, asked: f64, airborne: bool) -> f64 {
        let goal = if airborne || !self.in_air { self.gain[joint] * asked } else { asked };
        self.tau[joint] = goal + self.left * (self.tau[joint] - goal);
        self.tau[joint]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drives(lag_s: f64, gain: &[(&str, f64)], gain_in_air: bool) -> Drives {
        let gain = gain.iter().map(|(joint, factor)| ((*joint).to_owned(), *factor)).collect();
        let params = DriveParams { lag_s, gain, gain_in_air };
        Drives::new(&params, &["hip".to_owned(), "knee".to_owned()], 0.001).unwrap()
    }

    #[test]
    fn without_parameters_a_torque_is_given_to_the_bit() {
        let mut drives = drives(0.0, &[], false);
        for tau in [0.1, -0.7, 1e-300, 123.456] {
            assert_eq!(drives.give(0, tau, true).to_bits(), tau.to_bits());
        }
    }

    #[test]
    fn a_step_is_answered_to_63_percent_after_the_time_constant() {
        let mut drives = drives(0.005, &[], false);
        let answers: Vec<f64> = (0..5).map(|_| drives.give(1, 100.0, false)).collect();
        assert!((answers[4] - 63.212_055_88).abs() < 1e-6, "{answers:?}");
        assert!(drives.give(0, 0.0, false).abs() < 1e-300, "the other joint stays where it was");
        drives.reset();
        assert!((drives.give(1, 100.0, false) - answers[0]).abs() < 1e-12);
    }

    #[test]
    fn a_gain_may_hold_in_the_air_alone() {
        let mut always = drives(0.0, &[("knee", 0.8)], false);
        assert_eq!(
            (always.give(1, 10.0, false), always.give(1, 10.0, true), always.give(0, 10.0, true)),
            (8.0, 8.0, 10.0)
        );
        let mut in_air = drives(0.0, &[("knee", 0.8)], true);
        assert_eq!((in_air.give(1, 10.0, false), in_air.give(1, 10.0, true)), (10.0, 8.0));
    }
}
