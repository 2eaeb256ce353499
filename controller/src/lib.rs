//! controller
pub mod model;
