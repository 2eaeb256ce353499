//! The signal that errors are computed against.

use serde::Serialize;

use crate::run::Run;

/// Signal that errors are computed against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// GROUND_TRUTH of the simulator.
    GroundTruth,
    /// Estimates of the controller, in a log without ground truth. Errors of the estimator are not visible then.
    Estimate,
}

impl Reference {
    /// Ground truth if the log has it.
    pub fn of(run: &Run) -> Self {
        if run.has("GROUND_TRUTH") { Self::GroundTruth } else { Self::Estimate }
    }
}
