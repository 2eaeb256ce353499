//! Builds controllers by name.

use crate::error::LoadError;
use crate::hold::{self, Hold};
use crate::interface::Controller;
use crate::params::{Params, parameters_digest};
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
    let damping = RobotCommand::damping(params.robot.posture.len(), params.safety.damping);
    Ok(Box::new(Sequence::new(controllers, damping, parameters_digest(info.params()))?))
}

fn load_one(name: &str, info: &RunInfo) -> Result<Box<dyn Controller>, LoadError> {
    match name {
        quadruped::NAME => Ok(Box::new(Quadruped::new(&info.urdf, info.params())?)),
        hold::NAME => Ok(Box::new(Hold::new(&info.urdf, info.params())?)),
        other => Err(LoadError::UnknownController { found: other.to_owned() }),
    }
}
