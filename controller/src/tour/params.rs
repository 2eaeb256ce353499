//! Parameters of the controller `tour`.

use crate::params::range::{Bound, range};
use serde::{Deserialize, Serialize};

/// The `[tour]` table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TourParams {
    /// Names of the postures, in the order in which they are visited.
    pub postures: Vec<String>,
    /// Time for each of them, s.
    pub dwell: f64,
}

impl Default for TourParams {
    fn default() -> Self {
        TourParams { postures: vec![crate::model::NOMINAL.to_owned()], dwell: 3.0 }
    }
}

impl TourParams {
    /// Allowed range of each number.
    pub const BOUNDS: &[Bound] = &[Bound::new("tour.dwell", range!(0.01, 3600), "s")];
}
