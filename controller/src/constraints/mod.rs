//! Constraints of a stack for any robot and any contacts, by physical level. Each is a file with a [`Constraint`](crate::stack::Constraint); a
//! controller names those that its formula may contain in a [`Registry`](crate::stack::Registry).
//!
//! | constraint | level | rows |
//! |---|---|---|
//! | [`velocity::JointLimits`] | velocity | bounds: positions, velocities, accelerations and jerks of the joints |
//! | [`velocity::SelfCollision`] | velocity | one row for each of the nearest pairs of links: they approach each other slowly |
//! | [`acceleration::BaseDynamics`] | acceleration | six equalities: dynamics of the floating base |
//! | [`acceleration::JointAcceleration`] | acceleration | bounds: accelerations of the joints |
//! | [`force::Friction`] | force | admissible forces of each contact: 5 rows, 17 for a sole |
//! | [`force::ForceBounds`] | force | bounds: force variables of each contact |
//! | [`force::TorqueLimits`] | force | two rows for each joint, softened by the slack |

pub mod acceleration;
pub mod force;
pub mod velocity;
