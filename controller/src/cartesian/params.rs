//! Parameters of the controller `cartesian_ik`.

use serde::{Deserialize, Serialize};

/// The `[cartesian_ik]` table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CartesianParams {
    /// Text of the stack file: tasks, levels, constraints, gains and limits. `hoof sim --stack FILE` sets it.
    pub stack: String,
}

impl Default for CartesianParams {
    fn default() -> Self {
        CartesianParams { stack: DEFAULT.to_owned() }
    }
}

/// Holds the posture `nominal`.
const DEFAULT: &str = "formula = \"posture << joint_limits\"\n\n[task.posture]\ntype = \"posture\"\ngain = 1.0\n";
