//! Builds controllers by name.

use crate::cartesian::{self, Cartesian};
use crate::error::LoadError;
use crate::hold::{self, Hold};
use crate::interface::Controller;
use crate::model::UrdfTree;
use crate::params::{Params, parameters_digest};
use crate::posture::{self, Posture};
use crate::quadruped::{self, Quadruped};
use crate::runtime::Component;
use crate::sequence::{self, Sequence};
use crate::shared::Shared;
use crate::time::snapshot_ticks;
use crate::tour::{self, Tour};
use lcmtypes::{RobotCommand, RunInfo};

/// Builds the first component that a run describes. Reads the first component and the URDF text from `info`, and which joints other components
/// command. Use [`RunInfo::of_component`] for another component.
///
/// # Errors
/// The name is unknown, or the URDF or the parameters are invalid.
pub fn load(info: &RunInfo) -> Result<Component, LoadError> {
    let period_ticks = info.components.first().map_or(1, |component| component.period_ticks);
    Ok(Component::new(load_controller(info)?).with_snapshots(snapshot_ticks(period_ticks), 0))
}

/// Builds the controller of the first component, without what the component adds to it; see [`load`].
///
/// # Errors
/// As [`load`].
pub fn load_controller(info: &RunInfo) -> Result<Box<dyn Controller>, LoadError> {
    let own = load_own(info)?;
    Ok(match info.components.get(1..) {
        Some(others) if others.iter().any(|other| !other.joints.is_empty()) => Box::new(Shared::new(own, info)?),
        _ => own,
    })
}

/// The controller of the first component, which commands all joints.
fn load_own(info: &RunInfo) -> Loaded {
    let list =
        info.controller().strip_prefix(sequence::NAME).and_then(|rest| rest.strip_prefix('(')?.strip_suffix(')'));
    let Some(list) = list else { return load_one(info.controller(), info) };
    let controllers = list.split(',').map(|name| load_one(name.trim(), info)).collect::<Result<_, _>>()?;
    let params = Params::from_toml(info.params(), "parameters")?;
    let tree = UrdfTree::parse(&info.urdf, &params.robot.urdf)?;
    let damping = RobotCommand::damping(params.safety.damping_of(&params.robot.description(&tree)?));
    Ok(Box::new(Sequence::new(controllers, damping, parameters_digest(info.params()))?))
}

/// A controller of a run.
type Loaded = Result<Box<dyn Controller>, LoadError>;

/// Builds a controller of a run.
type Build = fn(&RunInfo) -> Loaded;

/// The kinds of controllers: name, and how one is built.
const KINDS: &[(&str, Build)] = &[
    (quadruped::NAME, |info| Ok(Box::new(Quadruped::new(&info.urdf, info.params())?))),
    (hold::NAME, |info| Ok(Box::new(Hold::new(info)?))),
    (cartesian::NAME, |info| Ok(Box::new(Cartesian::new(info)?))),
    (tour::NAME, |info| Ok(Box::new(Tour::new(info)?))),
    (posture::NAME, |info| Ok(Box::new(Posture::new(info)?))),
];

/// Channels of other programs that a kind of controller listens to, besides those that its run names.
pub fn listens_to(kind: &str) -> &'static [&'static str] {
    let kinds = kind.strip_prefix(sequence::NAME).unwrap_or(kind);
    let has = |name: &str| kinds.trim_matches(['(', ')']).split(',').any(|kind| kind.trim() == name);
    if has(cartesian::NAME) { &[lcmtypes::channels::TASK_REQUEST] } else { &[] }
}

fn load_one(name: &str, info: &RunInfo) -> Loaded {
    let kind = KINDS.iter().find(|(known, _)| *known == name);
    kind.map_or_else(|| Err(LoadError::UnknownController { found: name.to_owned() }), |(_, build)| build(info))
}
