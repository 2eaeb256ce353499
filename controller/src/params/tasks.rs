//! Gains of the tasks: trunk and posture.

use serde::{Deserialize, Serialize};

/// Trunk orientation task and height. Source: Raiola, eqs. (8), (16)-(17), (31)-(32), section 5.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrunkParams {
    /// Stiffness about the x, y, z axes of W, 1/s².
    pub kp: [f64; 3],
    /// Damping, 1/s.
    pub kd: [f64; 3],
    /// Gain of the height integrator, 1/s. The source has 10, at which the base begins to bounce where feet land at different heights.
    pub height_gain: f64,
    /// Limit of the height integral, m.
    pub max_height_correction: f64,
    /// Fastest change of the roll and pitch references, rad/s.
    pub max_orientation_rate: f64,
    /// Largest roll and pitch reference, rad.
    pub max_orientation: f64,
    /// Fastest change of the height reference, m/s.
    pub max_height_rate: f64,
    /// Largest offset of the height reference, m.
    pub max_height_offset: f64,
}

impl Default for TrunkParams {
    fn default() -> Self {
        TrunkParams {
            kp: [1000.0; 3],
            kd: [100.0; 3],
            height_gain: 2.0,
            max_height_correction: 0.1,
            max_orientation_rate: 0.5,
            max_orientation: 0.35,
            max_height_rate: 0.1,
            max_height_offset: 0.12,
        }
    }
}

/// Postural task. Source: Raiola, eq. (9), section 5; gains per leg joint HAA HFE KFE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PostureParams {
    /// Swing stiffness: 1/s², or N m/rad with [`PostureParams::swing_inertia`].
    pub swing_kp: [f64; 3],
    /// Swing damping: 1/s, or N m s/rad.
    pub swing_kd: [f64; 3],
    /// Swing gains are torques: premultiply them by the inverse of the leg's inertia (Raiola, appendix).
    pub swing_inertia: bool,
    /// Stance stiffness: 1/s², or N m/rad with [`PostureParams::stance_inertia`].
    pub stance_kp: [f64; 3],
    /// Stance damping: 1/s, or N m s/rad. Critical at the source's stiffness; its own 20 lets the base bounce with the trot's half stride.
    pub stance_kd: [f64; 3],
    /// Stance gains are torques, as [`PostureParams::swing_inertia`].
    pub stance_inertia: bool,
    /// Largest lead of a standing leg's joint reference over the joint, rad.
    pub max_stance_lead: f64,
    /// Time constant with which the reference of a landed leg goes from its touchdown value to the nominal posture, s.
    pub blend_time_constant: f64,
}

impl Default for PostureParams {
    fn default() -> Self {
        PostureParams {
            swing_kp: [300.0; 3],
            swing_kd: [8.0, 12.0, 5.0],
            swing_inertia: true,
            stance_kp: [500.0; 3],
            stance_kd: [45.0; 3],
            stance_inertia: false,
            max_stance_lead: 0.15,
            blend_time_constant: 0.25,
        }
    }
}
