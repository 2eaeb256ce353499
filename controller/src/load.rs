//! Builds controllers by name.

use crate::error::LoadError;
use crate::hold::{self, Hold};
use crate::interface::Controller;
use crate::model::{JointKind, UrdfTree};
use crate::params::{Params, parameters_digest};
use crate::posture::{self, Posture};
use crate::quadruped::{self, Quadruped};
use crate::runtime::Component;
use crate::sequence::{self, Sequence};
use lcmtypes::{RobotCommand, RunInfo};

/// Builds the first component that a run describes. Reads the kind and the TOML text of the parameters of the first component and the URDF text
/// from `info`, and nothing else.
///
/// # Errors
/// The name is unknown, or the URDF or the parameters are invalid.
pub fn load(info: &RunInfo) -> Result<Component, LoadError> {
    load_controller(info).map(Component::new)
}

/// Builds the controller of the first component, without what the component adds to it; see [`load`].
///
/// # Errors
/// As [`load`].
pub fn load_controller(info: &RunInfo) -> Result<Box<dyn Controller>, LoadError> {
    let list =
        info.controller().strip_prefix(sequence::NAME).and_then(|rest| rest.strip_prefix('(')?.strip_suffix(')'));
    let Some(list) = list else { return load_one(info.controller(), info) };
    let controllers = list.split(',').map(|name| load_one(name.trim(), info)).collect::<Result<_, _>>()?;
    let params = Params::from_toml(info.params(), "parameters")?;
    let tree = UrdfTree::parse(&info.urdf, &params.robot.urdf)?;
    let nj = tree.joints.iter().filter(|joint| joint.kind != JointKind::Fixed).count();
    let damping = RobotCommand::damping(nj, params.safety.damping);
    Ok(Box::new(Sequence::new(controllers, damping, parameters_digest(info.params()))?))
}

/// A controller of a run.
type Loaded = Result<Box<dyn Controller>, LoadError>;

/// Builds a controller of a run.
type Build = fn(&RunInfo) -> Loaded;

/// The kinds of controllers: name, and how one is built.
const KINDS: &[(&str, Build)] = &[
    (quadruped::NAME, |info| Ok(Box::new(Quadruped::new(&info.urdf, info.params())?))),
    (hold::NAME, |info| Ok(Box::new(Hold::new(&info.urdf, info.params())?))),
    (posture::NAME, |info| Ok(Box::new(Posture::new(&info.urdf, info.params())?))),
];

fn load_one(name: &str, info: &RunInfo) -> Loaded {
    let kind = KINDS.iter().find(|(known, _)| *known == name);
    kind.map_or_else(|| Err(LoadError::UnknownController { found: name.to_owned() }), |(_, build)| build(info))
}
