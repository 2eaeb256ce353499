//! Reference of the trunk's orientation.

use super::ground;
use super::state::State;
use crate::math::{Rx, Ry, Rz};
use nalgebra::{Matrix3, Vector3};

/// Orientation reference of the trunk.
#[derive(Clone, Copy, Debug)]
pub struct TrunkReference {
    /// Orientation.
    pub R_WB: Matrix3<f64>,
    /// Angular velocity, rad/s.
    pub w_WB_W: Vector3<f64>,
}

/// Computes the reference from heading, roll, pitch and the estimated ground.
///
/// ```text
/// R_WB = Rz(yaw_des) R_HT Ry(pitch_des) Rx(roll_des)          R_HT: inclination of the ground
/// ```
/// The angular velocity is the sum of the commanded yaw rate, the rates of roll and pitch, and the rate of the ground's normal.
///
/// - `rp_rate`: rate of `State::rp_des`, rad/s.
/// - `gradient_rate`: rate of `State::gradient_W`, 1/s.
pub fn trunk_reference(state: &State, rp_rate: [f64; 2], gradient_rate: [f64; 2]) -> TrunkReference {
    let [roll, pitch] = state.rp_des;
    let R_ground = Rz(state.yaw_des) * ground::inclination(ground::turned(state.gradient_W, state.yaw_des));
    let R_pitch = R_ground * Ry(pitch);
    let n_W = ground::normal(state.gradient_W);
    // Rate of the normal, without its component along the normal, which causes no rotation.
    let nd_W = Vector3::new(-gradient_rate[0], -gradient_rate[1], 0.0) * n_W.z;
    TrunkReference {
        R_WB: R_pitch * Rx(roll),
        w_WB_W: R_pitch * Vector3::x() * rp_rate[0]
            + R_ground * Vector3::y() * rp_rate[1]
            + n_W.cross(&nd_W)
            + Vector3::z() * state.yaw_rate_des,
    }
}
