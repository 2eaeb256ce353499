//! The robot, and the resolution of its sensors in simulation.

use super::exact::array;
use super::range::{Bound, range};
use crate::model::{DriveLimits, Model, ModelError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The `[robot]` table: the properties of the robot that its URDF does not contain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotConfig {
    /// Name of the robot.
    pub name: String,
    /// File name of the URDF, in the folder of the TOML file.
    pub urdf: String,
    /// Foot links in the order LF RF LH RH. The origin of each link is the centre of the foot sphere.
    #[serde(deserialize_with = "array")]
    pub feet: [String; 4],
    /// Radius of the foot sphere, m.
    pub foot_radius: f64,
    /// Link whose axes are the measurement axes of the IMU.
    pub imu_link: String,
    /// Nominal standing posture: joint name -> rad.
    pub posture: BTreeMap<String, f64>,
    /// Posture in which the robot lies on the ground without torque: joint name -> rad. If empty, the robot lies on its folded legs.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub lying: BTreeMap<String, f64>,
    /// Limits of the drives that depend on the speed: joint name -> power, W, and velocities, rad/s. A joint that is left out has only the effort of the
    /// URDF.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub drives: BTreeMap<String, DriveLimits>,
    /// Resolution of the simulated sensors.
    #[serde(default)]
    pub sensors: SensorParams,
}

/// Resolution of the simulated sensors: each value is rounded to a multiple of it. 0 = not rounded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorParams {
    /// Joint position, rad.
    pub position: f64,
    /// Joint velocity, rad/s.
    pub velocity: f64,
    /// Joint torque, N m.
    pub torque: f64,
    /// Component of the orientation quaternion.
    pub orientation: f64,
    /// Gyro, rad/s.
    pub gyro: f64,
    /// Accelerometer, m/s².
    pub acceleration: f64,
}

impl Default for SensorParams {
    /// Powers of two near the resolution of a 19-bit encoder, a load cell and a tactical-grade IMU. The low bits of each value are zero, so logs
    /// compress well.
    fn default() -> Self {
        let fraction = |bits: i32| 1.0 / f64::from(1u32 << bits);
        SensorParams {
            position: fraction(18),
            velocity: fraction(12),
            torque: fraction(7),
            orientation: fraction(24),
            gyro: fraction(14),
            acceleration: fraction(10),
        }
    }
}

impl RobotConfig {
    /// Allowed range of each number.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("robot.foot_radius", range!(0.001, 1), "m"),
        Bound::new("robot.posture", range!(-12.6, 12.6), "rad or m"),
        Bound::new("robot.lying", range!(-12.6, 12.6), "rad or m"),
        Bound::new("robot.drives", range!(0.001, 1000000), "W, rad/s or m/s"),
        Bound::new("robot.sensors.position", range!(0, 1), "rad"),
        Bound::new("robot.sensors.velocity", range!(0, 10), "rad/s"),
        Bound::new("robot.sensors.torque", range!(0, 100), "N m"),
        Bound::new("robot.sensors.orientation", range!(0, 0.1), ""),
        Bound::new("robot.sensors.gyro", range!(0, 10), "rad/s"),
        Bound::new("robot.sensors.acceleration", range!(0, 10), "m/s²"),
    ];

    /// Gives the joints of a model the limits of [`RobotConfig::drives`].
    ///
    /// # Errors
    /// A joint that the model does not have.
    pub fn limit_drives(&self, model: &mut Model) -> Result<(), ModelError> {
        for (name, limits) in &self.drives {
            let joint = model.joint(name)?.index();
            model.joints[joint].drive = *limits;
        }
        Ok(())
    }
}
