//! Tasks of the velocity level.

mod contacts_at_rest;
mod joint_positions;
mod relative_pose;

pub use contacts_at_rest::ContactsAtRest;
pub use joint_positions::JointPositions;
pub use relative_pose::{RelativePose, RelativePoseReference};
