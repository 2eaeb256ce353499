//! Tasks of a stack for any robot and any contacts, by physical level. Each is a file with a [`Task`](crate::stack::Task), whatever fills its reference; a
//! controller names those that its formula may contain in a [`Registry`](crate::stack::Registry).
//!
//! | task | level | rows |
//! |---|---|---|
//! | [`velocity::ContactsAtRest`] | velocity | velocities of the contacts that carry load are 0: no slip, pure rolling |
//! | [`velocity::RelativePose`] | velocity | pose of a link relative to the world or another link, 6 |
//! | [`velocity::CenterOfMass`] | velocity | position of the centre of mass in the world or relative to a link, 3 |
//! | [`velocity::Gaze`] | velocity | an axis of a link points to a target, 2 |
//! | [`velocity::AngularMomentum`] | velocity | angular momentum about the centre of mass, 3 |
//! | [`velocity::JointPositions`] | velocity | velocities of the joints, nj |
//! | [`velocity::MinimumEffort`] | velocity | towards smaller gravity torques, nj |
//! | [`velocity::Manipulability`] | velocity | towards a larger manipulability, one for each joint of a chain |
//! | [`velocity::MinimumVelocity`] | velocity | no motion, nv |
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
