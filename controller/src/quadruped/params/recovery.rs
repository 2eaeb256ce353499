//! Parameters of the reactions to disturbances.

use crate::params::range::{Bound, range};
use serde::{Deserialize, Serialize};

/// The `[recovery]` table: reactions to pushes, to obstacles that a swinging foot hits, and to ground that gives way. Not part of Raiola.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RecoveryParams {
    /// Shift footholds by the capture point, `√(h/g) (v - v_cmd)`.
    pub capture_point: bool,
    /// Factor on that shift.
    pub capture_gain: f64,
    /// Difference of velocity that causes no shift, m/s; only the part above it does. Keeps a base that sways in every stride of a trot from moving each
    /// foothold.
    pub capture_threshold: f64,
    /// Largest shift of a foothold by it, m.
    pub max_capture: f64,
    /// Time constant of the velocity estimate's filter, s.
    pub velocity_time_constant: f64,
    /// Restart the swing of a foot that hits an obstacle in the first half of its swing. Off by default: on stairs of 0.10 m it caused more falls
    /// than it prevented.
    pub step_reflex: bool,
    /// Force against the direction of the step that counts as a collision, as a fraction of the weight.
    pub reflex_load: f64,
    /// Distance by which the foot is drawn back after a collision, m.
    pub reflex_retraction: f64,
    /// Time without load after which a standing foot starts to search for the ground, s; 0 = never.
    pub lost_contact_time: f64,
}

impl Default for RecoveryParams {
    fn default() -> Self {
        RecoveryParams {
            capture_point: true,
            capture_gain: 1.0,
            capture_threshold: 0.0,
            max_capture: 0.15,
            velocity_time_constant: 0.05,
            step_reflex: false,
            reflex_load: 0.0587,
            reflex_retraction: 0.03,
            lost_contact_time: 0.05,
        }
    }
}

impl RecoveryParams {
    /// Allowed range of each number.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("recovery.capture_gain", range!(0, 5), ""),
        Bound::new("recovery.capture_threshold", range!(0, 1), "m/s"),
        Bound::new("recovery.max_capture", range!(0, 1), "m"),
        Bound::new("recovery.velocity_time_constant", range!(0.001, 10), "s"),
        Bound::new("recovery.reflex_load", range!(1e-9, 1), "weights"),
        Bound::new("recovery.reflex_retraction", range!(0, 0.3), "m"),
        Bound::new("recovery.lost_contact_time", range!(0, 10), "s"),
    ];
}
