//! Parameters that change while a controller runs.
//!
//! No controller sees a parameter of its own change. Another one is built with the new parameters, away from the thread that runs the first, and
//! takes over its state between two ticks: what a replay does too when it comes to the `parameter_change_t` of the log, so a run with
//! changes on the way repeats to the bit. Parameters are checked whole, as at the beginning of a run; what is refused changes nothing.

use crate::params::{ParamsError, apply_overrides};
use crate::{Controller, LoadError, RestoreError};
use lcmtypes::RunInfo;

/// Why a parameter stays as it is.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChangeError {
    /// It describes the machine.
    #[error("parameter {key} cannot be changed while running: [robot] is what the run was begun with")]
    Fixed {
        /// The key.
        key: String,
    },
    /// No such key, no such value.
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// The controller cannot be built with it.
    #[error(transparent)]
    Load(#[from] LoadError),
}

/// The parameters of a run as they are by now.
#[derive(Clone, Debug)]
pub struct Parameters {
    info: RunInfo,
}

impl Parameters {
    /// Those that a run begins with.
    pub fn new(info: &RunInfo) -> Self {
        // The texts that explain messages are of no use to a controller, and large.
        Parameters { info: RunInfo { lcm_types: Vec::new(), num_lcm_types: 0, ..info.clone() } }
    }

    /// These with one of them set.
    ///
    /// - `key`, `value`: dotted key and TOML value, as in `--set`.
    ///
    /// # Errors
    /// [`ChangeError::Fixed`] for a key of the robot; [`ChangeError::Params`].
    pub fn with(&self, key: &str, value: &str) -> Result<Self, ChangeError> {
        if key == "robot" || key.starts_with("robot.") {
            return Err(ChangeError::Fixed { key: key.to_owned() });
        }
        let params = apply_overrides(&self.info.params, &[(key.to_owned(), value.to_owned())])?;
        Ok(Parameters { info: RunInfo { params, ..self.info.clone() } })
    }

    /// Builds the controller that they describe; takes milliseconds.
    ///
    /// # Errors
    /// What [`crate::load`] says of parameters that fit no controller.
    pub fn build(&self) -> Result<Box<dyn Controller>, ChangeError> {
        Ok(crate::load(&self.info)?)
    }
}

/// Hands the state of one controller to another, between two ticks.
///
/// - `state`: memory for it. Nothing is allocated here once `state` has the capacity.
///
/// # Errors
/// The other one does not take the state; it is not fit for use then.
pub fn take_over(from: &dyn Controller, to: &mut dyn Controller, state: &mut Vec<u8>) -> Result<(), RestoreError> {
    state.clear();
    from.snapshot(state);
    to.restore(state)
}
