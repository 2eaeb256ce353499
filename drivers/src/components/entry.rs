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
/// Largest number of channels that a component listens to: with the commands of 31 others, the messages of a tick have room for them.
const MAX_RECEIVES: usize = 24;
/// Names that `hoof run` gives to its own processes and results.
const RESERVED_NAMES: [&str; 4] = ["controller", "driver", "recorder", "log"];

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

    /// Checks all keys that depend neither on the robot nor on the other components.
    ///
    /// # Errors
    /// [`DriverError::Component`]
    pub fn check(&self) -> Result<(), DriverError> {
        let is_name = !self.name.is_empty() && self.name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !is_name || self.name.len() > 32 {
            return Err(self.wrong("name: expected 1 to 32 letters, digits and _"));
        }
        if RESERVED_NAMES.contains(&&*self.name) {
            return Err(self.wrong("name: used by hoof run for its own processes and results"));
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
        if self.pause_ms > 0 && (self.runs == Runs::Rt || self.kind == EXTERNAL) {
            let what = "expected 0: only a worker or a process of this project can wait before a tick";
            return Err(self.wrong(format!("pause_ms is {}, {what}", self.pause_ms)));
        }
        if self.runs != Runs::Rt && self.latency_ticks == 0 && self.kind != EXTERNAL {
            let runs = self.runs.name();
            return Err(self.wrong(format!("latency_ticks is 0, expected at least 1 with runs = \"{runs}\"")));
        }
        if self.receives.len() > MAX_RECEIVES {
            let count = self.receives.len();
            return Err(self.wrong(format!("receives has {count} channels, expected at most {MAX_RECEIVES}")));
        }
        for (place, channel) in self.receives.iter().enumerate() {
            let (component, name) = channels::split(channel);
            if self.receives[..place].contains(channel) {
                return Err(self.wrong(format!("receives {channel:?}: listed twice")));
            }
            if !is_channel_name(name) || !component.is_empty() && !is_channel_name(component) {
                return Err(self.wrong(format!("receives {channel:?}: expected the name of a channel")));
            }
            if component.is_empty() && channels::find(name).is_some() {
                return Err(self.wrong(format!("receives {channel:?}: expected a channel COMPONENT/NAME, or another one that is not of the run itself")));
            }
        }
        Ok(())
    }

    /// Its parameters, and the robot as they describe it.
    fn read_params(&self, common: CommonParams) -> Result<(String, RobotDescription, UrdfTree), DriverError> {
        let CommonParams { robot, preset, gaits, set } = common;
        let changes: Vec<String> = set.iter().chain(&self.set).cloned().collect();
        let (files, params) = RobotFiles::find_changed(robot, self.preset.as_deref().or(preset), gaits, &changes)?;
        let tree = files.tree()?;
        let description = Params::from_toml(&params, robot)?.robot.description(&tree)?;
        Ok((params, description, tree))
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

/// What the components of a run have in common.
#[derive(Clone, Copy, Debug)]
pub struct CommonParams<'a> {
    /// Name of the robot, or its TOML file.
    pub robot: &'a str,
    /// Preset of the robot's parameters, for a component without one of its own.
    pub preset: Option<&'a str>,
    /// Gait files.
    pub gaits: &'a [PathBuf],
    /// Parameters to change, each `KEY=VALUE`; before those of a component.
    pub set: &'a [String],
}

/// Checks the components of a run beside the first one, and reads their parameters.
///
/// - `first`, `receives`: name of the first component, and the channels that it listens to.
///
/// # Errors
/// [`DriverError::Component`] with the name of the component; errors of its parameters.
pub fn resolve(
    entries: &[ComponentEntry],
    (first, receives): (&str, &[String]),
    common: CommonParams,
) -> Result<Vec<ComponentInfo>, DriverError> {
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
        let read = entry.read_params(common);
        let (params, description, tree) = read.map_err(|error| entry.wrong(error.to_string()))?;
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
    let listeners = std::iter::once((first, receives)).chain(entries.iter().map(|one| (&*one.name, &*one.receives)));
    for (listener, channel) in listeners.flat_map(|(name, list)| list.iter().map(move |channel| (name, channel))) {
        let (component, _) = channels::split(channel);
        let what = match component {
            "" => continue,
            _ if component == first => "the first component has no listeners",
            _ if names.contains(component) => continue,
            _ => "the run has no such component",
        };
        let what = format!("receives {channel:?}: {what}");
        return Err(DriverError::Component { name: listener.to_owned(), what });
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
    let mut of_first: Vec<String> = info
        .components
        .iter()
        .skip(1)
        .filter(|component| !component.joints.is_empty())
        .map(|component| format!("{}/{}", component.name, channels::ROBOT_COMMAND))
        .collect();
    let further: Vec<String> = receives.iter().filter(|channel| !of_first.contains(channel)).cloned().collect();
    of_first.extend(further);
    let lists = std::iter::once(of_first).chain(entries.iter().map(|entry| entry.receives.clone()));
    let unnamed = [ComponentInfo::default()];
    let components = if info.components.is_empty() { &unnamed[..] } else { &info.components[..] };
    let slot = |(component, mut receives): (&ComponentInfo, Vec<String>)| {
        let of_kind = controller::listens_to(&component.kind).iter().map(ToString::to_string);
        for channel in of_kind {
            if !receives.contains(&channel) {
                receives.push(channel);
            }
        }
        Slot::new(component, info.run_id, receives)
    };
    components.iter().zip(lists).map(slot).collect()
}
