//! What forces, accelerations and the robot itself may not go beyond.

use serde::{Deserialize, Serialize};

/// Quadratic programs of the stack. Source: Raiola, eqs. (10)-(15), Table 2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WbcParams {
    /// Regularization λ of accelerations and forces.
    pub regularization: f64,
    /// Friction coefficient μ. The source has 0.8, that of its ground: with it ANYmal B falls on 2 of 20 rough tracks, whose stones are steeper
    /// than the plane through the feet; with a margin on none.
    pub friction: f64,
    /// Largest tangential force of a foot, N.
    pub f_xy_max: f64,
    /// Largest vertical force of a foot, N.
    pub f_z_max: f64,
    /// Smallest vertical force of a stance foot, N; at most four fifths of `contact.release_load`.
    pub f_z_min: f64,
    /// Largest joint acceleration, rad/s².
    pub qdd_max: f64,
    /// Iterations of the solver.
    pub max_iterations: u32,
    /// Tolerance of the solver on feasibility and gap.
    pub tolerance: f64,
}

impl Default for WbcParams {
    fn default() -> Self {
        WbcParams {
            regularization: 1e-6,
            friction: 0.6,
            f_xy_max: 1000.0,
            f_z_max: 1000.0,
            f_z_min: 20.0,
            qdd_max: 500.0,
            max_iterations: 200,
            tolerance: 1e-8,
        }
    }
}

/// When to give up, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SafetyParams {
    /// Largest roll or pitch of the base, rad.
    pub max_tilt: f64,
    /// Oldest joint state that a tick may act on, s.
    pub max_state_age: f64,
    /// Oldest operator command that is followed, s; an older one counts as the wish to stand.
    pub max_operator_age: f64,
    /// How far a joint may be beyond its limits in the URDF, rad.
    pub position_margin: f64,
    /// Largest speed of a joint over its limit in the URDF.
    pub velocity_factor: f64,
    /// Largest measured torque of a joint over its effort in the URDF.
    pub torque_factor: f64,
    /// Least height of the base over the feet while standing or walking, as a part of the nominal one.
    pub min_height: f64,
    /// Longest time without a foot on the ground while standing or walking, s.
    pub max_flight_time: f64,
    /// Ticks in a row that may repeat the last torque when the quadratic program fails.
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
