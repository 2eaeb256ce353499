//! Constraints on generalized accelerations.

mod base_dynamics;
mod joint_acceleration;

pub use base_dynamics::BaseDynamics;
pub use joint_acceleration::JointAcceleration;
