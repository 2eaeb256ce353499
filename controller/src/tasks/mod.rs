//! Tasks of a stack for any robot and any contacts, by physical level. Each is a file with a [`Task`](crate::stack::Task), whatever fills its reference; a
//! controller names those that its formula may contain in a [`Registry`](crate::stack::Registry).
//!
//! | task | level | rows |
//! |---|---|---|
//! | [`velocity::ContactsAtRest`] | velocity | velocities of the contacts that carry load are 0: no slip, pure rolling |
//! | [`velocity::RelativePose`] | velocity | pose of a link relative to the world or another link, 6 |
//! | [`velocity::JointPositions`] | velocity | velocities of the joints, nj |
//! | [`acceleration::ContactsAtRest`] | acceleration | accelerations of the contacts that carry load are 0 |
//! | [`acceleration::BaseOrientation`] | acceleration | angular acceleration of the base, 3 |
//! | [`acceleration::Posture`] | acceleration | accelerations of the joints, nj |
//! | [`acceleration::Cartesian`] | acceleration | pose of a link relative to the world or another link, 6 |
//! | [`force::ConeCenter`] | force | tangential forces, 2 for each contact |
//! | [`force::InternalForces`] | force | forces and moments without net force and moment |

pub mod acceleration;
pub mod force;
mod relative_motion;
pub mod velocity;
