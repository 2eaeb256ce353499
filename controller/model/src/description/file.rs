//! The table `[robot]` of a TOML file as it is written. Unknown keys are errors; other tables of the file belong to the controllers, which check them.

use super::error::DescriptionError;
use super::{ContactGeometry, GroupKind, JointRole, VirtualFrame};
use crate::drive::DriveLimits;
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize)]
struct WholeFile {
    robot: RobotTable,
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
    /// Link -> links with which it needs no check for collisions.
    #[serde(default)]
    pub(super) disabled_collisions: BTreeMap<String, Vec<String>>,
    pub(super) virtual_frame: Option<VirtualFrame>,

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
    let parsed: Result<WholeFile, _> = toml::from_str(text);
    let failed = |error: toml::de::Error| DescriptionError::Parse { file: file.to_owned(), reason: error.to_string() };
    Ok(parsed.map_err(failed)?.robot)
}
