//! What feet meet: contact, terrain, what was not planned.

use serde::{Deserialize, Serialize};

/// Contact estimation. Source: Raiola, eq. (18) and section 4.3.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ContactParams {
    /// Normal force above which a foot touches, as a part of the robot's weight. The source's 50 N, of HyQ's 851 N.
    pub touch_load: f64,
    /// Normal force below which a foot that touches does so no more, as a part of the weight.
    pub release_load: f64,
    /// Take the acceleration of the swing reference into account. The source neglects it, and so a light robot's feet touch air.
    pub inertia_compensation: bool,
    /// Samples in a row above the threshold before it counts.
    pub debounce: i32,
    /// Smallest |det J_leg| at which a force is computed, m³; below, the last one is kept.
    pub min_jacobian_det: f64,
}

impl Default for ContactParams {
    fn default() -> Self {
        ContactParams {
            touch_load: 0.0587,
            release_load: 0.0294,
            inertia_compensation: true,
            debounce: 3,
            min_jacobian_det: 1e-4,
        }
    }
}

/// Terrain estimation. Source: Raiola, section 3.4, which leaves the estimator to other work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TerrainParams {
    /// Take the plane through the last contact points as the ground: it tilts the base, the swing plane and the friction cones. Without it the
    /// ground counts as level, and the height of the feet under a tilted base follows the base: a stack without the trunk's roll and pitch
    /// (`trunk[2]`) then lets the posture bring the base parallel to the ground.
    pub estimator: bool,
    /// Time constant of the plane's filter, s.
    pub time_constant: f64,
    /// Steepest ground that is believed, rise over run.
    pub max_gradient: f64,
}

impl Default for TerrainParams {
    fn default() -> Self {
        TerrainParams { estimator: true, time_constant: 0.5, max_gradient: 0.4 }
    }
}

/// Reactions to what was not planned: pushes, steps that the swing runs into, ground that gives way. Beyond Raiola.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RecoveryParams {
    /// Move footholds by the capture point, `√(h/g) (v - v_cmd)`.
    pub capture_point: bool,
    /// Part of it that is taken.
    pub capture_gain: f64,
    /// Largest shift of a foothold by it, m.
    pub max_capture: f64,
    /// Time constant of the velocity estimate's filter, s.
    pub velocity_time_constant: f64,
    /// Lift a foot anew from where it has run into something in the first half of its swing. Off: on stairs of 0.10 m it has cost more than it saved.
    pub step_reflex: bool,
    /// Force against the step that counts as running into something, as a part of the weight.
    pub reflex_load: f64,
    /// How far the foot is drawn back by it, m.
    pub reflex_retraction: f64,
    /// A standing foot that carries nothing for this long searches for the ground, s; 0 = it stays where it is.
    pub lost_contact_time: f64,
}

impl Default for RecoveryParams {
    fn default() -> Self {
        RecoveryParams {
            capture_point: true,
            capture_gain: 1.0,
            max_capture: 0.15,
            velocity_time_constant: 0.05,
            step_reflex: false,
            reflex_load: 0.0587,
            reflex_retraction: 0.03,
            lost_contact_time: 0.05,
        }
    }
}
