//! Parameters of the quadruped controller: one struct for each table of the parameters file, with its defaults and the range of each value.
//!
//! Defaults are those of Raiola et al. 2020 (cited as "Raiola"), or the comment on the field says why not.

mod contact;
mod gait;
mod recovery;
mod stand;
mod swing;
mod tasks;
mod wbc;

pub use contact::{ContactParams, TerrainParams};
pub use gait::{DUTY, Gait, GaitParams, GaitTiming, MOST_SWINGING, NEVER, SWING_FREQUENCY};
pub use recovery::RecoveryParams;
pub use stand::StandParams;
pub use swing::{FootholdParams, STEP_HEIGHT, StepRule, SwingParams};
pub use tasks::{PostureParams, RelativeFeetParams, TrunkParams};
pub use wbc::WbcParams;
