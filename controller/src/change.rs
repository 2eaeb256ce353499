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

    /// The run's description with them.
    pub fn info(&self) -> &RunInfo {
        &self.info
    }

    /// Sets one of them.
    ///
    /// - `key`, `value`: dotted key and TOML value, as in `--set`.
    ///
    /// # Errors
    /// [`ChangeError::Fixed`] for a key of the robot; [`ChangeError::Params`]. Nothing has changed then.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), ChangeError> {
        if key == "robot" || key.starts_with("robot.") {
            return Err(ChangeError::Fixed { key: key.to_owned() });
        }
        self.info.params = apply_overrides(&self.info.params, &[(key.to_owned(), value.to_owned())])?;
        Ok(())
    }

    /// Sets one of them, and builds the controller that is to take over; takes milliseconds.
    ///
    /// # Errors
    /// As [`Parameters::set`], and what [`crate::load`] says of parameters that fit no controller. Nothing has changed then.
    pub fn change(&mut self, key: &str, value: &str) -> Result<Box<dyn Controller>, ChangeError> {
        let mut changed = self.clone();
        changed.set(key, value)?;
        let controller = crate::load(&changed.info)?;
        *self = changed;
        Ok(controller)
    }
}

/// Hands the state of one controller to another, between two ticks.
///
/// - `state`: memory for it. The quadruped allocates nothing here once `state` has the capacity.
///
/// # Errors
/// The other one does not take the state; it is not fit for use then.
pub fn take_over(from: &dyn Controller, to: &mut dyn Controller, state: &mut Vec<u8>) -> Result<(), RestoreError> {
    state.clear();
    from.snapshot(state);
    to.restore(state)
}
