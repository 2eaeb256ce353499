//! Constraints on generalized velocities.

mod joint_limits;
mod self_collision;

pub use joint_limits::JointLimits;
pub use self_collision::{NearPair, SelfCollision, SelfCollisionParams};
