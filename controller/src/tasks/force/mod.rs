//! Tasks of the force level.

mod cone_center;
mod internal_forces;

pub use cone_center::ConeCenter;
pub use internal_forces::{InternalForces, net_wrench};
