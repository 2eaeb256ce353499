//! Imperfect drives: a first-order lag and a gain error of each torque.

use crate::DriverError;
use crate::checks::{BadKey, check_range};
use serde::Deserialize;
use std::collections::BTreeMap;

/// The `[drives]` table of a scenario. By default drives give the commanded torque without lag.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DriveParams {
    /// Time constant of the first-order lag of every torque, s; 0 = none.
    pub lag_s: f64,
    /// Ratio of given to commanded torque, by joint; 1 for joints that are not listed.
    pub gain: BTreeMap<String, f64>,
    /// The gains apply only while the foot of the joint's leg has no contact, as with a load cell that reads too little in swing.
    pub gain_in_air: bool,
}

impl DriveParams {
    pub(crate) fn check(&self) -> Result<(), BadKey> {
        check_range("lag_s", &[self.lag_s], 0.0..=1.0)?;
        let gains: Vec<f64> = self.gain.values().copied().collect();
        check_range("gain", &gains, 0.0..=2.0)?;
        if self.gain_in_air && self.gain.is_empty() {
            let (found, expected) = ("true".to_owned(), "`gain` with at least one joint".to_owned());
            return Err(BadKey { key: "gain_in_air", found, expected });
        }
        Ok(())
    }
}

/// The drives of one robot.
#[derive(Clone, Debug)]
pub(crate) struct Drives {
    /// Fraction of the difference to the commanded torque that remains after a step.
    decay: f64,
    gain: Vec<f64>,
    in_air: bool,
    tau: Vec<f64>,
}

impl Drives {
    /// Binds the parameters to a robot.
    ///
    /// - `joints`: names of the actuated joints.
    /// - `step_s`: time step, s.
    ///
    /// # Errors
    /// [`DriverError::Unknown`] for a joint that the robot does not have.
    pub fn new(params: &DriveParams, joints: &[String], step_s: f64) -> Result<Self, DriverError> {
        if let Some(name) = params.gain.keys().find(|name| !joints.contains(name)) {
            return Err(DriverError::Unknown {
                wanted_by: "drives.gain".to_owned(),
                what: "joint",
                name: name.clone(),
                known: joints.to_vec(),
            });
        }
        let decay = if params.lag_s > 0.0 { libm::exp(-step_s / params.lag_s) } else { 0.0 };
        let gain = joints.iter().map(|joint| params.gain.get(joint).copied().unwrap_or(1.0)).collect();
        Ok(Drives { decay, gain, in_air: params.gain_in_air, tau: vec![0.0; joints.len()] })
    }

    /// Sets all torques to zero.
    pub fn reset(&mut self) {
        self.tau.fill(0.0);
    }

    /// The torque of a joint in the next step, N m.
    ///
    /// - `commanded`: N m.
    /// - `airborne`: the foot of the leg has no contact.
    pub fn torque(&mut self, joint: usize, commanded: f64, airborne: bool) -> f64 {
        let goal = if airborne || !self.in_air { self.gain[joint] * commanded } else { commanded };
        self.tau[joint] = goal + self.decay * (self.tau[joint] - goal);
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
    fn by_default_the_torque_is_unchanged_to_the_bit() {
        let mut drives = drives(0.0, &[], false);
        for tau in [0.1, -0.7, 1e-300, 123.456] {
            assert_eq!(drives.torque(0, tau, true).to_bits(), tau.to_bits());
        }
    }

    #[test]
    fn a_step_reaches_63_percent_after_the_time_constant() {
        let mut drives = drives(0.005, &[], false);
        let answers: Vec<f64> = (0..5).map(|_| drives.torque(1, 100.0, false)).collect();
        assert!((answers[4] - 63.212_055_88).abs() < 1e-6, "{answers:?}");
        assert!(drives.torque(0, 0.0, false).abs() < 1e-300, "the other joint is unchanged");
        drives.reset();
        assert!((drives.torque(1, 100.0, false) - answers[0]).abs() < 1e-12);
    }

    #[test]
    fn a_gain_can_be_limited_to_the_swing() {
        let mut always = drives(0.0, &[("knee", 0.8)], false);
        assert_eq!(
            (always.torque(1, 10.0, false), always.torque(1, 10.0, true), always.torque(0, 10.0, true)),
            (8.0, 8.0, 10.0)
        );
        let mut in_air = drives(0.0, &[("knee", 0.8)], true);
        assert_eq!((in_air.torque(1, 10.0, false), in_air.torque(1, 10.0, true)), (10.0, 8.0));
    }
}
