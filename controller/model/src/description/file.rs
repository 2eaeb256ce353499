//! The table `[robot]` of a TOML file as it is written. Unknown keys are errors; other tables of the file belong to the controllers.

use super::error::DescriptionError;
use super::{ContactGeometry, GroupKind, JointRole};
use crate::drive::DriveLimits;
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize)]
struct WholeFile {
    robot: RobotTable,
    #[serde(flatten)]
    others: toml::Table,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RobotTable {
    pub(super) name: String,
    pub(super) urdf: String,
    #[serde(default)]
    pub(super) base: BaseKind,
    #[serde(default)]
    pub(super) imu: Vec<SensorTable>,
    #[serde(default)]
    pub(super) force_torque: Vec<SensorTable>,
    #[serde(default)]
    pub(super) contact: Vec<ContactTable>,
    #[serde(default)]
    pub(super) group: Vec<GroupTable>,
    /// Name of a posture -> joint -> position, rad or m.
    #[serde(default)]
    pub(super) postures: BTreeMap<String, BTreeMap<String, f64>>,
    #[serde(default)]
    pub(super) joints: BTreeMap<String, JointTable>,

    /// The keys of a quadruped.
    pub(super) feet: Option<[String; 4]>,
    pub(super) foot_radius: Option<f64>,
    pub(super) imu_link: Option<String>,
    #[serde(default)]
    pub(super) posture: BTreeMap<String, f64>,
    #[serde(default)]
    pub(super) lying: BTreeMap<String, f64>,
    #[serde(default)]
    pub(super) drives: BTreeMap<String, DriveLimits>,
    /// Resolution of the simulated sensors: read by the controller's parameters, which check it.
    #[serde(rename = "sensors", default)]
    _sensors: toml::Table,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum BaseKind {
    #[default]
    Floating,
    Fixed,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SensorTable {
    pub(super) name: String,
    pub(super) link: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ContactTable {
    pub(super) name: String,
    pub(super) link: String,
    pub(super) geometry: ContactGeometry,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GroupTable {
    pub(super) name: String,
    pub(super) kind: GroupKind,
    pub(super) joints: Option<Vec<String>>,
    pub(super) root: Option<String>,
    pub(super) tip: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointTable {
    #[serde(default)]
    pub(super) role: JointRole,
    pub(super) effort: Option<f64>,
    pub(super) velocity: Option<f64>,
    pub(super) stiffness: Option<f64>,
    pub(super) damping: Option<f64>,
    pub(super) power: Option<f64>,
    pub(super) rated_velocity: Option<f64>,
    pub(super) no_load_velocity: Option<f64>,
}

/// Reads the table `[robot]`.
pub(super) fn read(text: &str, file: &str) -> Result<RobotTable, DescriptionError> {
    let failed = |reason: String| DescriptionError::Parse { file: file.to_owned(), reason };
    let parsed: WholeFile = toml::from_str(text).map_err(|error| failed(error.to_string()))?;
    // The other tables of a quadruped's file are read and checked with the controller's parameters.
    match parsed.others.keys().next() {
        Some(key) if parsed.robot.feet.is_none() => Err(failed(format!("unknown table `{key}`, expected `robot`"))),
        _ => Ok(parsed.robot),
    }
}

/// Whether a text is TOML with keys in `[robot]` that only the form for any robot has.
pub(super) fn is_for_any_robot(text: &str) -> bool {
    let Ok(whole) = toml::from_str::<toml::Table>(text) else { return false };
    let Some(robot) = whole.get("robot").and_then(toml::Value::as_table) else { return false };
    let keys = ["base", "imu", "force_torque", "contact", "group", "postures", "joints"];
    !robot.contains_key("feet") && keys.iter().any(|key| robot.contains_key(*key))
}
