//! Initial pose of the robot.

use crate::DriverError;
use crate::checks::{BadKey, check_range};
use robot_model::math::{Rx, Ry, quaternion};
use robot_model::{NOMINAL, RobotDescription};
use serde::Deserialize;
use std::collections::BTreeMap;

/// Name of the posture in which a robot lies on the ground.
const LYING: &str = "lying";

/// Initial posture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartPosture {
    /// On its feet, in the nominal posture.
    #[default]
    Standing,
    /// On the ground, in `robot.lying`.
    Lying,
}

/// Initial pose of the robot: the `[start]` table of a scenario.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StartParams {
    /// The posture.
    pub posture: StartPosture,
    /// Roll of the base, rad.
    pub roll: f64,
    /// Pitch of the base, rad.
    pub pitch: f64,
    /// Positions of joints that differ from the posture, rad.
    pub joints: BTreeMap<String, f64>,
}

impl StartParams {
    pub(crate) fn check(&self) -> Result<(), BadKey> {
        check_range("roll", &[self.roll], -3.2..=3.2)?;
        check_range("pitch", &[self.pitch], -1.6..=1.6)?;
        self.joints.values().try_for_each(|q| check_range("joints", &[*q], -10.0..=10.0))
    }

    /// Whether all values are defaults: standing, with a level base.
    pub(crate) fn is_plain(&self) -> bool {
        *self == StartParams::default()
    }

    /// Initial joint positions of a robot, rad.
    ///
    /// # Errors
    /// [`DriverError::NoLyingPosture`] if the robot has no posture for lying; [`DriverError::Unknown`] for a joint that it does not have.
    pub(crate) fn posture_of(&self, robot: &RobotDescription) -> Result<BTreeMap<String, f64>, DriverError> {
        let known = || robot.joints.iter().map(|joint| &joint.name);
        if let Some(name) = self.joints.keys().find(|name| !known().any(|known| known == *name)) {
            return Err(DriverError::Unknown {
                wanted_by: "start.joints".to_owned(),
                what: "joint",
                name: name.clone(),
                known: known().cloned().collect(),
            });
        }
        let mut posture = match self.posture {
            StartPosture::Standing => robot.postures.get(NOMINAL).cloned().unwrap_or_default(),
            StartPosture::Lying => {
                let lying = robot.postures.get(LYING).cloned();
                lying.ok_or_else(|| DriverError::NoLyingPosture { robot: robot.name.clone() })?
            }
        };
        posture.extend(self.joints.clone());
        Ok(posture)
    }

    /// Initial orientation of the base, yaw 0.
    pub(crate) fn quaternion_wxyz(&self) -> [f64; 4] {
        quaternion::from_rotation(&(Ry(self.pitch) * Rx(self.roll)))
    }
}
