//! Parameters of the trunk and posture tasks.

use crate::params::exact::array;
use crate::params::range::{Bound, range};
use serde::{Deserialize, Serialize};

/// The `[trunk]` table: trunk orientation task and height of the base. Source: Raiola, eqs. (8), (16)-(17), (31)-(32), section 5.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrunkParams {
    /// Stiffness about the x, y, z axes of W, 1/s².
    #[serde(deserialize_with = "array")]
    pub kp: [f64; 3],
    /// Damping about the same axes, 1/s.
    #[serde(deserialize_with = "array")]
    pub kd: [f64; 3],
    /// Largest damping as a torque, N m s/rad: the damping about an axis is at most this divided by the trunk's inertia about the axis. Raiola, section 4.4,
    /// has 400 on the real robot, against instabilities of its torque loop; the default limits no robot.
    pub max_damping: f64,
    /// Gain of the height integrator, 1/s. Raiola has 10; with it the base oscillates vertically where feet land at different heights.
    pub height_gain: f64,
    /// Limit of the height integral, m.
    pub max_height_correction: f64,
    /// Largest rate of change of the roll and pitch references, rad/s.
    pub max_orientation_rate: f64,
    /// Largest roll and pitch reference, rad.
    pub max_orientation: f64,
    /// Largest rate of change of the height reference, m/s.
    pub max_height_rate: f64,
    /// Largest offset of the height reference, m.
    pub max_height_offset: f64,
}

impl Default for TrunkParams {
    fn default() -> Self {
        TrunkParams {
            kp: [1000.0; 3],
            kd: [100.0; 3],
            max_damping: 1e6,
            height_gain: 2.0,
            max_height_correction: 0.1,
            max_orientation_rate: 0.5,
            max_orientation: 0.35,
            max_height_rate: 0.1,
            max_height_offset: 0.12,
        }
    }
}

impl TrunkParams {
    /// Allowed range of each number of this file.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("trunk.kp", range!(0, 10000), "1/s²"),
        Bound::new("trunk.kd", range!(0, 1000), "1/s"),
        Bound::new("trunk.max_damping", range!(1, 1000000), "N m s/rad"),
        Bound::new("trunk.height_gain", range!(0, 100), "1/s"),
        Bound::new("trunk.max_height_correction", range!(0, 0.5), "m"),
        Bound::new("trunk.max_orientation_rate", range!(0, 5), "rad/s"),
        Bound::new("trunk.max_orientation", range!(0, 0.8), "rad"),
        Bound::new("trunk.max_height_rate", range!(0, 2), "m/s"),
        Bound::new("trunk.max_height_offset", range!(0, 0.5), "m"),
        Bound::new("relative_feet.kp", range!(0, 10000), "1/s²"),
        Bound::new("relative_feet.kd", range!(0, 1000), "1/s"),
        Bound::new("posture.swing_kp", range!(0, 10000), ""),
        Bound::new("posture.swing_kd", range!(0, 1000), ""),
        Bound::new("posture.stance_kp", range!(0, 10000), ""),
        Bound::new("posture.stance_kd", range!(0, 1000), ""),
        Bound::new("posture.max_stance_lead", range!(0.001, 10), "rad"),
        Bound::new("posture.blend_time_constant", range!(0.001, 100), "s"),
    ];
}

/// The `[relative_feet]` table: gains of the task `relative_feet`, which replaces the task `contact` in a formula. Source: Raiola, section 6.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RelativeFeetParams {
    /// Stiffness on the distances between the standing feet, 1/s².
    pub kp: f64,
    /// Damping of their rates, 1/s.
    pub kd: f64,
}

impl Default for RelativeFeetParams {
    fn default() -> Self {
        RelativeFeetParams { kp: 100.0, kd: 20.0 }
    }
}

/// The `[posture]` table: posture task. Source: Raiola, eq. (9), section 5; gains of the leg joints HAA HFE KFE.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PostureParams {
    /// Swing stiffness: 1/s², or N m/rad with [`PostureParams::swing_inertia`].
    #[serde(deserialize_with = "array")]
    pub swing_kp: [f64; 3],
    /// Swing damping: 1/s, or N m s/rad with [`PostureParams::swing_inertia`].
    #[serde(deserialize_with = "array")]
    pub swing_kd: [f64; 3],
    /// The swing gains are torques: they are premultiplied by the inverse of the leg's inertia (Raiola, appendix).
    pub swing_inertia: bool,
    /// Stance stiffness: 1/s², or N m/rad with [`PostureParams::stance_inertia`].
    #[serde(deserialize_with = "array")]
    pub stance_kp: [f64; 3],
    /// Stance damping: 1/s, or N m s/rad with [`PostureParams::stance_inertia`]. The default is critical for Raiola's stiffness; with Raiola's
    /// damping of 20 the base oscillates vertically at half the stride of a trot.
    #[serde(deserialize_with = "array")]
    pub stance_kd: [f64; 3],
    /// The stance gains are torques, as with [`PostureParams::swing_inertia`].
    pub stance_inertia: bool,
    /// Largest difference between the joint reference of a standing leg and the joint position, rad.
    pub max_stance_lead: f64,
    /// Time constant with which the reference of a landed leg moves from its touchdown value to the stance reference, s. With
    /// [`PostureParams::stance_sweep`] it is at least a quarter of the stance time.
    pub blend_time_constant: f64,
    /// The reference of a standing foot moves backward under the base at the commanded velocity. Raiola, eqs. (31)-(32), defines its height only;
    /// without the sweep the reference is the virtual foothold, and the posture task draws the base over the feet, jerkily and slower than commanded.
    pub stance_sweep: bool,
    /// Add the acceleration of the swing reference to the posture task. Raiola, eq. (9), has none; with it the foot error is 1 mm instead of 3.5 mm.
    pub feed_forward: bool,
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
            stance_sweep: true,
            feed_forward: true,
        }
    }
}
