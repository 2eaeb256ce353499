//! Geometry of the ground plane `z = c + g_x x + g_y y`, given by its gradient `g`.

use crate::math::{Rx, Ry, Rz, atan2};
use nalgebra::{Matrix3, Vector3};

/// Upward unit normal of the plane, `(-g_x, -g_y, 1)/|.|`.
pub fn normal(gradient: [f64; 2]) -> Vector3<f64> {
    Vector3::new(-gradient[0], -gradient[1], 1.0).normalize()
}

/// Height of the plane below `p`, relative to its height below the origin, m.
pub fn rise(gradient: [f64; 2], p: &Vector3<f64>) -> f64 {
    gradient[0] * p.x + gradient[1] * p.y
}

/// The gradient in axes rotated by `yaw` (rad) about z.
pub fn turned(gradient: [f64; 2], yaw: f64) -> [f64; 2] {
    let g = Rz(-yaw) * Vector3::new(gradient[0], gradient[1], 0.0);
    [g.x, g.y]
}

/// Orientation of the ground's axes T in the horizontal axes H: `R_HT = Ry(θ) Rx(φ)`, whose z axis is the normal.
pub fn inclination(gradient_H: [f64; 2]) -> Matrix3<f64> {
    let n = normal(gradient_H);
    let theta = atan2(n.x, n.z);
    let phi = -atan2(n.y, (n.x * n.x + n.z * n.z).sqrt());
    Ry(theta) * Rx(phi)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_z_axis_of_the_inclination_is_the_normal() {
        for gradient in [[0.2, 0.0], [0.0, -0.15], [-0.1, 0.25]] {
            let R_HT = inclination(gradient);
            let error = R_HT * Vector3::z() - normal(gradient);
            assert!(error.norm() < 1e-12, "{gradient:?}: {error}");
        }
        // Ground that rises ahead pitches the nose up, which is negative about y.
        assert!((crate::math::rpy_of(&inclination([0.2, 0.0]))[1] + libm::atan(0.2)).abs() < 1e-12);
    }
}
