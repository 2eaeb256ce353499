//! Constraints on contact forces and joint torques.

mod force_bounds;
mod friction;
mod torque_limits;

pub use force_bounds::ForceBounds;
pub use friction::Friction;
pub use torque_limits::TorqueLimits;
