//! Constraints on generalized velocities.

mod joint_limits;

pub use joint_limits::JointLimits;
