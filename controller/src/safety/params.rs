//! Parameters of the safety checks.

use crate::model::RobotDescription;
use crate::params::range::{Bound, range};
use serde::{Deserialize, Serialize};

/// The `[safety]` table: limits that lead to the safe state, and the damping in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SafetyParams {
    /// Largest roll or pitch of the base, rad.
    pub max_tilt: f64,
    /// Largest age of the joint state that a tick uses, s.
    pub max_state_age: f64,
    /// Largest age of an operator command, s. An older one counts as no command: the robot stops walking and stands.
    pub max_operator_age: f64,
    /// How far a joint position may exceed its limits in the URDF, rad.
    pub position_margin: f64,
    /// Largest joint velocity, as a multiple of the limit in the URDF.
    pub velocity_factor: f64,
    /// Largest measured joint torque, as a multiple of the effort in the URDF.
    pub torque_factor: f64,
    /// Smallest height of the base above the feet while standing or walking, as a fraction of the nominal height.
    pub min_height: f64,
    /// Longest time without a foot on the ground while standing or walking, s.
    pub max_flight_time: f64,
    /// Number of consecutive ticks that may repeat the last torque after the quadratic program failed.
    pub max_qp_failures: i32,
    /// Damping of the joints in the safe state, N m s/rad.
    pub damping: f64,
}

impl Default for SafetyParams {
    fn default() -> Self {
        SafetyParams {
            max_tilt: 0.6,
            max_state_age: 0.01,
            max_operator_age: 0.5,
            position_margin: 0.2,
            velocity_factor: 3.0,
            torque_factor: 1.5,
            min_height: 0.5,
            max_flight_time: 0.5,
            max_qp_failures: 5,
            damping: 8.0,
        }
    }
}

impl SafetyParams {
    /// Damping of each joint in the safe state, N m s/rad or N s/m: [`SafetyParams::damping`], but not more than the joint's own damping in
    /// `[robot.joints]`, with which its drive is known to be stable: a wrist has a thousandth of the inertia of a hip.
    pub fn damping_of(&self, robot: &RobotDescription) -> Vec<f64> {
        let of_joint = |own: Option<f64>| own.map_or(self.damping, |own| own.min(self.damping));
        robot.joints.iter().map(|joint| of_joint(joint.damping)).collect()
    }

    /// Allowed range of each number.
    pub const BOUNDS: &[Bound] = &[
        Bound::new("safety.max_tilt", range!(0.05, 1.2), "rad"),
        Bound::new("safety.max_state_age", range!(0.001, 0.2), "s"),
        Bound::new("safety.max_operator_age", range!(0.02, 5), "s"),
        Bound::new("safety.position_margin", range!(0, 0.5), "rad"),
        Bound::new("safety.velocity_factor", range!(0.5, 10), ""),
        Bound::new("safety.torque_factor", range!(0.5, 3), ""),
        Bound::new("safety.min_height", range!(0.2, 0.95), ""),
        Bound::new("safety.max_flight_time", range!(0.05, 2), "s"),
        Bound::new("safety.max_qp_failures", range!(0, 50), "ticks"),
        Bound::new("safety.damping", range!(0.001, 200), "N m s/rad"),
    ];
}
