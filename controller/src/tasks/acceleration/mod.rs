//! Tasks of the acceleration level.

mod base_orientation;
mod cartesian;
mod contacts_at_rest;
mod posture;

pub use base_orientation::{BaseOrientation, OrientationReference};
pub use cartesian::{Cartesian, CartesianConfig, PoseReference};
pub use contacts_at_rest::ContactsAtRest;
pub use posture::{Posture, PostureReference};
