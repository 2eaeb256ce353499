//! Tasks of the velocity level.

mod angular_momentum;
mod center_of_mass;
mod contacts_at_rest;
mod gaze;
mod joint_positions;
mod manipulability;
mod minimum_effort;
mod minimum_velocity;
mod relative_pose;

pub use angular_momentum::AngularMomentum;
pub use center_of_mass::CenterOfMass;
pub use contacts_at_rest::ContactsAtRest;
pub use gaze::Gaze;
pub use joint_positions::JointPositions;
pub use manipulability::{Manipulability, Motion};
pub use minimum_effort::MinimumEffort;
pub use minimum_velocity::MinimumVelocity;
pub use relative_pose::{RelativePose, RelativePoseReference};
