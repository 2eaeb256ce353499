//! The robot, and the resolution of its sensors in simulation.

use super::exact::array;
use super::range::{Bound, range};
use crate::model::{DescriptionError, DriveLimits, Model, ModelError, RobotDescription, UrdfTree};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The `[robot]` table: the properties of the robot that its URDF does not contain. It has the keys of a quadruped or those of any robot; see
/// [`RobotDescription`], which is made from either.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotConfig {
    /// Name of the robot.
    pub name: String,
    /// File name of the URDF, in the folder of the TOML file.
    pub urdf: String,
    /// Foot links in the order LF RF LH RH. The origin of each link is the centre of the foot sphere.
    /// Empty names for a robot that has the keys for any robot.
    #[serde(default, deserialize_with = "array", skip_serializing_if = "all_empty")]
    pub feet: [String; 4],
    /// Radius of the foot sphere, m.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub foot_radius: f64,
    /// Link whose axes are the measurement axes of the IMU.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub imu_link: String,
    /// Nominal standing posture: joint name -> rad.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
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
    /// Key for any robot: `floating` or `fixed`. [`RobotConfig::description`] checks this key and the following ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
    /// Key for any robot: IMUs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub imu: Vec<toml::Table>,
    /// Key for any robot: sensors of force and torque.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub force_torque: Vec<toml::Table>,
    /// Key for any robot: contacts.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contact: Vec<toml::Table>,
    /// Groups of joints; beside the keys of a quadruped, further ones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub group: Vec<toml::Table>,
    /// Named postures, joint name -> rad or m.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub postures: BTreeMap<String, toml::Table>,
    /// Roles and drives of joints.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub joints: BTreeMap<String, toml::Table>,
    /// Pairs of links that need no check for collisions: link -> other links.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub disabled_collisions: BTreeMap<String, toml::Value>,
    /// Key for any robot: a frame with virtual joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub virtual_frame: Option<toml::Table>,
}

fn all_empty(feet: &[String; 4]) -> bool {
    feet.iter().all(String::is_empty)
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it with a reference")]
fn is_zero(x: &f64) -> bool {
    *x == 0.0
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

    /// Whether the table has the keys of a quadruped.
    pub fn is_quadruped(&self) -> bool {
        !all_empty(&self.feet)
    }

    /// The required keys that the table lacks; a table with a key for any robot needs none of a quadruped's.
    pub(super) fn missing(&self) -> Option<&'static str> {
        let is_any = self.base.is_some()
            || !(self.imu.is_empty()
                && self.force_torque.is_empty()
                && self.contact.is_empty()
                && self.group.is_empty())
            || !(self.postures.is_empty() && self.joints.is_empty());
        let required = [
            ("feet", !self.is_quadruped()),
            ("foot_radius", self.foot_radius == 0.0),
            ("imu_link", self.imu_link.is_empty()),
        ];
        if !self.is_quadruped() && is_any {
            None
        } else {
            required.iter().find(|(_, lacks)| *lacks).map(|(key, _)| *key)
        }
    }

    /// The description of the robot.
    ///
    /// # Errors
    /// A name that the URDF does not have, or an invalid value; see [`DescriptionError`].
    pub fn description(&self, tree: &UrdfTree) -> Result<RobotDescription, DescriptionError> {
        let mut table = toml::Table::new();
        let robot = toml::Table::try_from(self).expect("plain structs of numbers, strings and tables always serialize");
        table.insert("robot".to_owned(), robot.into());
        let text = toml::to_string(&table).expect("a table of plain values can be written");
        RobotDescription::from_toml(&text, &format!("parameters of {}", self.name), tree)
    }

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
