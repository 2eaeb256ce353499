//! Transcendental functions and rotations, all over `libm`, so that every machine and build gives the same bits.

use nalgebra::{Matrix3, Vector3};

/// Sine, x in rad.
pub fn sin(x: f64) -> f64 {
    libm::sin(x)
}

/// Cosine, x in rad.
pub fn cos(x: f64) -> f64 {
    libm::cos(x)
}

/// Hyperbolic sine.
pub fn sinh(x: f64) -> f64 {
    libm::sinh(x)
}

/// Angle of the point (x, y), rad, in (-π, π].
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// Arc sine of `x`, which is first limited to [-1, 1].
pub fn asin(x: f64) -> f64 {
    libm::asin(x.clamp(-1.0, 1.0))
}

/// Rotation about x.
pub fn Rx(angle: f64) -> Matrix3<f64> {
    let (s, c) = (sin(angle), cos(angle));
    Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c)
}

/// Rotation about y.
pub fn Ry(angle: f64) -> Matrix3<f64> {
    let (s, c) = (sin(angle), cos(angle));
    Matrix3::new(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c)
}

/// Rotation about z.
pub fn Rz(angle: f64) -> Matrix3<f64> {
    let (s, c) = (sin(angle), cos(angle));
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

/// Roll, pitch, yaw of `R = Rz(yaw) Ry(pitch) Rx(roll)`, rad; roll is 0 where pitch is ±π/2.
pub fn rpy_of(R: &Matrix3<f64>) -> [f64; 3] {
    let pitch = asin(-R[(2, 0)]);
    if R[(2, 1)].abs() + R[(2, 2)].abs() < 1e-12 {
        return [0.0, pitch, atan2(-R[(0, 1)], R[(1, 1)])];
    }
    [atan2(R[(2, 1)], R[(2, 2)]), pitch, atan2(R[(1, 0)], R[(0, 0)])]
}

/// The difference of two headings, wrapped to (-π, π].
pub fn wrap_angle(angle: f64) -> f64 {
    atan2(sin(angle), cos(angle))
}

/// Rotation vector (angle times axis) of `R`, in the axes of its left frame.
///
/// ```text
/// log(R) = 2 atan2(|ε|, η) ε/|ε|      (η, ε): unit quaternion of R with η ≥ 0
/// ```
/// Source: Raiola et al. 2020, eq. (8), with the sign of the cross product that makes it attract.
pub fn log(R: &Matrix3<f64>) -> Vector3<f64> {
    let [eta, x, y, z] = crate::model::Pose { p: Vector3::zeros(), R: *R }.quaternion_wxyz();
    let eps = if eta < 0.0 { -Vector3::new(x, y, z) } else { Vector3::new(x, y, z) };
    let norm = norm(&eps);
    if norm > 1e-8 { eps * (2.0 * atan2(norm, eta.abs()) / norm) } else { eps * 2.0 }
}

/// Euclidean length.
pub fn norm(v: &Vector3<f64>) -> f64 {
    (v.x * v.x + v.y * v.y + v.z * v.z).sqrt()
}

/// `x` moved towards `target` by at most `max_change`.
pub fn ramp(x: f64, target: f64, max_change: f64) -> f64 {
    x + (target - x).clamp(-max_change, max_change)
}

/// One step of a first-order low-pass filter: implicit Euler, so it is stable at any `dt`.
pub fn low_pass(x: f64, target: f64, time_constant: f64, dt: f64) -> f64 {
    x + (target - x) * (dt / (time_constant + dt))
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
        // A body at yaw 2 rad, tilted by 0.05 rad about its own x axis: seen from W, the tilt is about Rz(2) e_x.
        let error = log(&(Rz(2.0) * Rx(0.05) * Rz(-2.0)));
        assert!((error - Rz(2.0) * Vector3::x() * 0.05).norm() < 1e-12);
    }

    #[test]
    fn roll_pitch_yaw_round_trip() {
        for rpy in [[0.1, -0.2, 0.3], [-1.0, 1.2, -3.0], [0.0, 0.0, 3.1]] {
            let R = Rz(rpy[2]) * Ry(rpy[1]) * Rx(rpy[0]);
            for (found, expected) in rpy_of(&R).iter().zip(rpy) {
                assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            }
        }
    }

    #[test]
    fn ramp_and_filter_do_not_overshoot() {
        assert_eq!(ramp(0.0, 1.0, 0.25), 0.25);
        assert_eq!(ramp(0.9, 1.0, 0.25), 1.0);
        assert!(low_pass(0.0, 1.0, 0.1, 1e3) < 1.0);
    }
}
