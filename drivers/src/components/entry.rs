//! The `[[component]]` table of a run file.

use super::slot::Slot;
use crate::DriverError;
use crate::robot_files::RobotFiles;
use crate::teleop::is_channel_name;
use controller::params::Params;
use lcmtypes::{ComponentInfo, EXTERNAL, channels};
use robot_model::{JointKind, RobotDescription, UrdfTree};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Largest period, phase and latency, base ticks: a minute at 1 kHz.
const MAX_TICKS: i32 = 60_000;
/// Largest number of components of a run.
const MAX_COMPONENTS: usize = 32;

/// Where a component runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Runs {
    /// In sequence on the real-time thread.
    #[default]
    Rt,
    /// On a thread of its own.
    Worker,
    /// In a process of its own.
    Process,
}

impl Runs {
    /// Its name in run files and in RUN_INFO.
    pub fn name(self) -> &'static str {
        match self {
            Runs::Rt => "rt",
            Runs::Worker => "worker",
            Runs::Process => "process",
        }
    }
}

/// A `[[component]]` table.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComponentEntry {
    /// Name of the instance: the prefix of its channels.
    pub name: String,
    /// Kind of controller, such as `posture`, or [`EXTERNAL`].
    pub kind: String,
    /// Preset of the robot's parameters.
    pub preset: Option<String>,
    /// Parameters to change, each `KEY=VALUE`; after those of the run file.
    #[serde(default)]
    pub set: Vec<String>,
    /// Base ticks from one of its ticks to the next.
    #[serde(default = "one")]
    pub period_ticks: i32,
    /// Base tick of its first tick.
    #[serde(default)]
    pub phase_ticks: i32,
    /// Base ticks from its input to the delivery of what it computed.
    #[serde(default)]
    pub latency_ticks: i32,
    /// Where it runs.
    #[serde(default)]
    pub runs: Runs,
    /// Wait before each tick of a worker or process, ms, to try out late results.
    #[serde(default)]
    pub pause_ms: u64,
    /// Joints that it commands: names of joints, or of groups of the robot.
    #[serde(default)]
    pub joints: Vec<String>,
    /// Channels that it listens to, such as `planner/JOINT_REFERENCE`.
    #[serde(default)]
    pub receives: Vec<String>,
}

fn one() -> i32 {
    1
}

impl ComponentEntry {
    fn wrong(&self, what: impl Into<String>) -> DriverError {
        DriverError::Component { name: self.name.clone(), what: what.into() }
    }

    /// Checks all keys that do not depend on the robot.
    fn check(&self) -> Result<(), DriverError> {
        let is_name = !self.name.is_empty() && self.name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !is_name || self.name.len() > 32 {
            return Err(self.wrong("name: expected 1 to 32 letters, digits and _"));
        }
        if self.kind.starts_with(controller::sequence::NAME) {
            return Err(self.wrong("kind: a sequence can only be the first component ([[controller]] entries)"));
        }
        for (key, value, least) in [
            ("period_ticks", self.period_ticks, 1),
            ("phase_ticks", self.phase_ticks, 0),
            ("latency_ticks", self.latency_ticks, 0),
        ] {
            if !(least..=MAX_TICKS).contains(&value) {
                return Err(self.wrong(format!("{key} is {value}, expected {least} to {MAX_TICKS}")));
            }
        }
        if self.pause_ms > 10_000 {
            return Err(self.wrong(format!("pause_ms is {}, expected at most 10000", self.pause_ms)));
        }
        if self.runs != Runs::Rt && self.latency_ticks == 0 && self.kind != EXTERNAL {
            let runs = self.runs.name();
            return Err(self.wrong(format!("latency_ticks is 0, expected at least 1 with runs = \"{runs}\"")));
        }
        for channel in &self.receives {
            let (component, name) = channels::split(channel);
            if !is_channel_name(name) || !component.is_empty() && !is_channel_name(component) {
                return Err(self.wrong(format!("receives {channel:?}: expected the name of a channel")));
            }
            if component.is_empty() && channels::find(name).is_some() {
                return Err(self.wrong(format!("receives {channel:?}: expected a channel COMPONENT/NAME, or another one that is not of the run itself")));
            }
        }
        Ok(())
    }

    /// Its joints, groups replaced by theirs.
    fn joint_names(&self, robot: &RobotDescription, known: &[String]) -> Result<Vec<String>, DriverError> {
        let mut joints = Vec::new();
        for name in &self.joints {
            if let Some(group) = robot.groups.iter().find(|group| group.name == *name) {
                // A virtual joint is not in the URDF and has no drive.
                joints.extend(group.joints.iter().filter_map(|joint| known.get(joint.index()).cloned()));
            } else if known.contains(name) {
                joints.push(name.clone());
            } else {
                return Err(self.wrong(format!("joints: {} has no joint and no group {name:?}", robot.name)));
            }
        }
        Ok(joints)
    }
}

/// Checks the components of a run beside the first one, and reads their parameters.
///
/// - `robot`, `gaits`, `set`: robot, gait files and changed parameters of the run.
/// - `first`: name of the first component.
///
/// # Errors
/// [`DriverError::Component`] with the name of the component; errors of its parameters.
pub fn resolve(
    entries: &[ComponentEntry],
    first: &str,
    robot: &str,
    gaits: &[PathBuf],
    set: &[String],
) -> Result<Vec<ComponentInfo>, DriverError> {
    if entries.is_empty() {
        return Ok(Vec::new());
    }
    if entries.len() >= MAX_COMPONENTS {
        let what = format!("{} components, expected at most {MAX_COMPONENTS}", entries.len() + 1);
        return Err(entries[MAX_COMPONENTS - 1].wrong(what));
    }
    let (mut names, mut owned) = (BTreeSet::from([first]), BTreeSet::new());
    let mut infos = Vec::with_capacity(entries.len());
    for entry in entries {
        entry.check()?;
        if !names.insert(&entry.name) {
            return Err(entry.wrong("name: used by another component"));
        }
        let changes: Vec<String> = set.iter().chain(&entry.set).cloned().collect();
        let (files, params) = RobotFiles::find_changed(robot, entry.preset.as_deref(), gaits, &changes)?;
        let tree = files.tree()?;
        let description = Params::from_toml(&params, robot)?.robot.description(&tree)?;
        let joints = entry.joint_names(&description, &moving_joints(&tree))?;
        if let Some(joint) = joints.iter().find(|joint| !owned.insert((*joint).clone())) {
            return Err(entry.wrong(format!("joints: {joint} is commanded by another component or twice")));
        }
        infos.push(ComponentInfo {
            name: entry.name.clone(),
            kind: entry.kind.clone(),
            params: if entry.kind == EXTERNAL { String::new() } else { params },
            period_ticks: entry.period_ticks,
            phase_ticks: entry.phase_ticks,
            latency_ticks: entry.latency_ticks,
            runs: entry.runs.name().to_owned(),
            n_joints: i32::try_from(joints.len()).expect("a robot's joints"),
            joints,
            ..ComponentInfo::default()
        });
    }
    for entry in entries {
        for channel in &entry.receives {
            let (component, _) = channels::split(channel);
            if !component.is_empty() && !names.contains(component) {
                return Err(entry.wrong(format!("receives {channel:?}: the run has no component {component:?}")));
            }
        }
    }
    Ok(infos)
}

/// Names of the joints that move.
fn moving_joints(tree: &UrdfTree) -> Vec<String> {
    let joints = tree.joints.iter().filter(|joint| joint.kind != JointKind::Fixed);
    joints.map(|joint| joint.name.clone()).collect()
}

/// Slots of all components of a run: the first one, then those of `entries`.
///
/// - `info`: the run; without components in it there is one slot, that of a first component without a name.
/// - `receives`: channels that the first component listens to.
pub fn slots(info: &lcmtypes::RunInfo, entries: &[ComponentEntry], receives: &[String]) -> Vec<Slot> {
    let of_first: Vec<String> = info
        .components
        .iter()
        .skip(1)
        .filter(|component| !component.joints.is_empty())
        .map(|component| format!("{}/{}", component.name, channels::ROBOT_COMMAND))
        .chain(receives.iter().cloned())
        .collect();
    let lists = std::iter::once(of_first).chain(entries.iter().map(|entry| entry.receives.clone()));
    let unnamed = [ComponentInfo::default()];
    let components = if info.components.is_empty() { &unnamed[..] } else { &info.components[..] };
    components.iter().zip(lists).map(|(component, receives)| Slot::new(component, info.run_id, receives)).collect()
}
