//! The robot, and the sensors it has in simulation.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The robot: what its URDF does not say.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotConfig {
    /// Name of the robot.
    pub name: String,
    /// URDF file, beside the TOML file.
    pub urdf: String,
    /// Foot links in the order LF RF LH RH; the link's origin is the centre of the foot sphere.
    pub feet: [String; 4],
    /// Radius of the foot sphere, m.
    pub foot_radius: f64,
    /// Link whose axes the IMU measures in.
    pub imu_link: String,
    /// Nominal standing posture: joint name -> rad.
    pub posture: BTreeMap<String, f64>,
    /// Posture in which the robot lies on the ground without torque: joint name -> rad. Without it, its legs are folded under it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub lying: BTreeMap<String, f64>,
    /// Resolution of the simulated sensors.
    #[serde(default)]
    pub sensors: SensorParams,
}

/// Resolution of the simulated sensors: a value read is a whole multiple of it. 0 = as computed.
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
    /// Powers of two near what a 19-bit encoder, a load cell and a tactical IMU resolve; so many low bits are zero that a log compresses well.
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
