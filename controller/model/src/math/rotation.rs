//! Rotation matrices: elementary rotations, roll-pitch-yaw angles, rotation vectors.

use super::{asin, atan2, cos, quaternion, sin};
use nalgebra::{Matrix3, Vector3};

/// Rotation about x by `angle`, rad.
#[inline]
pub fn Rx(angle: f64) -> Matrix3<f64> {
    let (s, c) = (sin(angle), cos(angle));
    Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c)
}

/// Rotation about y by `angle`, rad.
#[inline]
pub fn Ry(angle: f64) -> Matrix3<f64> {
    let (s, c) = (sin(angle), cos(angle));
    Matrix3::new(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c)
}

/// Rotation about z by `angle`, rad.
#[inline]
pub fn Rz(angle: f64) -> Matrix3<f64> {
    let (s, c) = (sin(angle), cos(angle));
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

/// `Rz(yaw) Ry(pitch) Rx(roll)`, angles in rad: the convention of a URDF `<origin rpy>`.
#[inline]
pub fn rotation_of_rpy([roll, pitch, yaw]: [f64; 3]) -> Matrix3<f64> {
    let (sr, cr) = libm::sincos(roll);
    let (sp, cp) = libm::sincos(pitch);
    let (sy, cy) = libm::sincos(yaw);
    #[rustfmt::skip]
    let R = Matrix3::new(
        cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr,
        sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr,
        -sp,     cp * sr,                cp * cr,
    );
    R
}

/// Roll, pitch, yaw of `R = Rz(yaw) Ry(pitch) Rx(roll)`, rad. At pitch = ±π/2, where roll and yaw are not unique, roll is 0.
#[inline]
pub fn rpy_of(R: &Matrix3<f64>) -> [f64; 3] {
    let pitch = asin(-R[(2, 0)]);
    if R[(2, 1)].abs() + R[(2, 2)].abs() < 1e-12 {
        return [0.0, pitch, atan2(-R[(0, 1)], R[(1, 1)])];
    }
    [atan2(R[(2, 1)], R[(2, 2)]), pitch, atan2(R[(1, 0)], R[(0, 0)])]
}

/// A rotation whose third column is the unit vector `axis`; the identity for z.
#[inline]
pub fn z_onto(axis: &Vector3<f64>) -> Matrix3<f64> {
    let mut least = 0;
    for k in 1..3 {
        if axis[k].abs() < axis[least].abs() {
            least = k;
        }
    }
    let mut x = -axis[least] * axis;
    x[least] += 1.0;
    x /= x.norm();
    Matrix3::from_columns(&[x, axis.cross(&x), *axis])
}

/// Wraps an angle, such as the difference of two headings, to (-π, π].
#[inline]
pub fn wrap_angle(angle: f64) -> f64 {
    atan2(sin(angle), cos(angle))
}

/// Rotation vector (axis times angle, rad) of `R`: for `R = R_AB`, in the axes of A.
///
/// ```text
/// log(R) = 2 atan2(|ε|, η) ε/|ε|      (η, ε): unit quaternion of R with η ≥ 0
/// ```
/// Source: Raiola et al. 2020, eq. (8). The sign of its cross product is changed so that the error is reduced, not increased.
#[inline]
pub fn log(R: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::from(quaternion::to_rotation_vector(quaternion::from_rotation(R)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log_inverts_elementary_rotations_at_any_angle() {
        for angle in [-3.1, -2.0, -0.3, -1e-9, 0.0, 1e-5, 0.7, 1.6, 3.1] {
            assert!((log(&Rx(angle)) - Vector3::x() * angle).norm() < 1e-12);
            assert!((log(&Ry(angle)) - Vector3::y() * angle).norm() < 1e-12);
            assert!((log(&Rz(angle)) - Vector3::z() * angle).norm() < 1e-12);
        }
    }

    #[test]
    fn log_of_a_product_is_expressed_in_the_left_frame() {
        // A body at yaw 2 rad, tilted by 0.05 rad about its own x axis: in W, the tilt is about Rz(2) e_x.
        let error = log(&(Rz(2.0) * Rx(0.05) * Rz(-2.0)));
        assert!((error - Rz(2.0) * Vector3::x() * 0.05).norm() < 1e-12);
    }

    #[test]
    fn z_is_turned_onto_the_axis() {
        for axis in [Vector3::x(), -Vector3::y(), -Vector3::z(), Vector3::new(0.6, 0.0, -0.8)] {
            let R = z_onto(&axis);
            assert!((R * Vector3::z() - axis).norm() < 1e-15);
            assert!((R.transpose() * R - Matrix3::identity()).abs().max() < 1e-15 && R.determinant() > 0.0);
        }
        assert_eq!(z_onto(&Vector3::z()), Matrix3::identity());
    }

    #[test]
    fn roll_pitch_yaw_round_trip() {
        for rpy in [[0.1, -0.2, 0.3], [-1.0, 1.2, -3.0], [0.0, 0.0, 3.1]] {
            for (found, expected) in rpy_of(&rotation_of_rpy(rpy)).iter().zip(rpy) {
                assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            }
        }
    }

    #[test]
    fn rotation_of_rpy_is_the_product_of_the_elementary_rotations() {
        for [roll, pitch, yaw] in [[0.3, -0.4, 0.5], [-1.0, 1.2, -3.0], [0.0, 0.0, 3.1]] {
            let product = Rz(yaw) * Ry(pitch) * Rx(roll);
            assert!((rotation_of_rpy([roll, pitch, yaw]) - product).abs().max() < 1e-15);
        }
        // A positive pitch turns the nose down: x of B points to -z of A.
        assert!(rotation_of_rpy([0.0, 0.1, 0.0])[(2, 0)] < 0.0);
    }
}
