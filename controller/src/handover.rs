//! Parameter changes while a controller runs.
//!
//! The parameters of a controller never change. For a change a second controller is built with the new parameters, outside the real-time thread,
//! and takes over the state of the first between two ticks. A replay does the same at each `parameter_change_t` of the log, so a
//! run with parameter changes replays bit for bit. The complete parameters are checked as at the start of a run; a rejected change has no effect.

use crate::error::{LoadError, RestoreError};
use crate::load::load;
use crate::params::{ParamsError, apply_changes};
use crate::runtime::Component;
use lcmtypes::RunInfo;

/// A rejected parameter change.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChangeError {
    /// The key describes the robot.
    #[error("parameter {key} cannot be changed while running: keys of [robot] are fixed at the start of a run")]
    Fixed {
        /// The key.
        key: String,
    },
    /// The key or the value is invalid.
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// No controller can be built with the new parameters.
    #[error(transparent)]
    Load(#[from] LoadError),
}

/// The present parameters of a run.
#[derive(Clone, Debug)]
pub struct Parameters {
    info: RunInfo,
}

impl Parameters {
    /// The parameters at the start of a run.
    pub fn new(info: &RunInfo) -> Self {
        // Building a controller does not need the texts of the message types, and they are large.
        Parameters { info: RunInfo { lcm_types: Vec::new(), num_lcm_types: 0, ..info.clone() } }
    }

    /// A copy with one parameter changed.
    ///
    /// - `key`, `value`: dotted key and TOML value, as in `--set`.
    ///
    /// # Errors
    /// [`ChangeError::Fixed`] for a key of `[robot]`; [`ChangeError::Params`] for an unknown key or an invalid value.
    pub fn with(&self, key: &str, value: &str) -> Result<Self, ChangeError> {
        if key == "robot" || key.starts_with("robot.") {
            return Err(ChangeError::Fixed { key: key.to_owned() });
        }
        let params = apply_changes(self.info.params(), &[(key.to_owned(), value.to_owned())])?;
        Ok(Parameters { info: self.info.clone().with_params(params) })
    }

    /// Builds the run's controller with these parameters. Takes milliseconds.
    ///
    /// # Errors
    /// [`ChangeError::Load`] if no controller can be built.
    pub fn build(&self) -> Result<Component, ChangeError> {
        Ok(load(&self.info)?)
    }
}

/// Copies the state of one component to another, between two ticks.
///
/// - `state`: buffer for the state. If its capacity is sufficient, nothing is allocated.
///
/// # Errors
/// `to` rejects the state; it must not be used then.
pub fn take_over(from: &Component, to: &mut Component, state: &mut Vec<u8>) -> Result<(), RestoreError> {
    state.clear();
    from.snapshot(state);
    to.restore(state)
}
