//! Position and orientation of one frame in another.

use crate::math::rotation_of_rpy;
use nalgebra::{Matrix3, Vector3};

/// Pose `X_AB` of a frame B in a frame A: `x_A = p + R x_B`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Origin of B from the origin of A, in A, m.
    pub p: Vector3<f64>,
    /// Rotates B coordinates into A coordinates.
    pub R: Matrix3<f64>,
}

impl Pose {
    /// The pose of a frame in itself.
    #[inline]
    pub fn identity() -> Self {
        Self { p: Vector3::zeros(), R: Matrix3::identity() }
    }

    /// Pose of a URDF `<origin>`: `R = Rz(yaw) Ry(pitch) Rx(roll)`; m and rad.
    pub fn from_xyz_rpy(xyz: [f64; 3], rpy: [f64; 3]) -> Self {
        Self { p: Vector3::from(xyz), R: rotation_of_rpy(rpy) }
    }

    /// Composition: for `self = X_AB` and `inner = X_BC`, the pose `X_AC`.
    #[inline]
    pub fn then(&self, inner: &Pose) -> Self {
        Self { p: self.p + self.R * inner.p, R: self.R * inner.R }
    }
}
