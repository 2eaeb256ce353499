//! The robot, and the resolution of its sensors in simulation.

use super::error::ParamsError;
use super::range::{not_negative, positive, within};
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
    /// Checks the range of each number.
    ///
    /// # Errors
    /// The first number out of its range.
    pub fn check(&self) -> Result<(), ParamsError> {
        let RobotConfig { name: _, urdf: _, feet: _, foot_radius, imu_link: _, posture, lying, sensors } = self;
        positive("robot.foot_radius", *foot_radius)?;
        for &q in posture.values() {
            within("robot.posture", &[q], "a finite angle", f64::is_finite)?;
        }
        for &q in lying.values() {
            within("robot.lying", &[q], "a finite angle", f64::is_finite)?;
        }
        let SensorParams { position, velocity, torque, orientation, gyro, acceleration } = sensors;
        not_negative("robot.sensors.position", &[*position])?;
        not_negative("robot.sensors.velocity", &[*velocity])?;
        not_negative("robot.sensors.torque", &[*torque])?;
        not_negative("robot.sensors.orientation", &[*orientation])?;
        not_negative("robot.sensors.gyro", &[*gyro])?;
        not_negative("robot.sensors.acceleration", &[*acceleration])
    }
}
