//! Vectors, headings and angles of logged data. Rotations and quaternions: [`robot_model::math`]. Frames: ARCHITECTURE.md.

use nalgebra::{Matrix3, Vector3};
use robot_model::math::wrap_angle;

/// A vector in the frame that the name of its variable states.
pub type Vec3 = [f64; 3];

/// `p_AB + R_AB x_B`: a point of frame B in frame A.
pub fn transform(p_AB: Vec3, R_AB: &Matrix3<f64>, x_B: Vec3) -> Vec3 {
    (Vector3::from(p_AB) + R_AB * Vector3::from(x_B)).into()
}

/// The vector `[x, y, z]` in W, expressed in H: rotated about z by -`yaw` (rad), the heading of the base.
pub fn from_w_to_h(yaw: f64, [x, y, z]: Vec3) -> Vec3 {
    let (sin, cos) = yaw.sin_cos();
    [cos * x + sin * y, -sin * x + cos * y, z]
}

/// Makes a series of angles continuous, rad: steps of more than π are replaced by their equivalent in (-π, π]. NaN values stay.
pub fn unwrap_angles(angles: &mut [f64]) {
    let mut last = f64::NAN;
    for angle in angles {
        if !last.is_nan() && !angle.is_nan() {
            *angle = last + wrap_angle(*angle - last);
        }
        if !angle.is_nan() {
            last = *angle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn a_point_at_plus_x_of_w_is_to_the_right_of_a_robot_with_heading_plus_y() {
        let p_H = from_w_to_h(FRAC_PI_2, [1.0, 0.0, 3.0]);
        assert!((p_H[0]).abs() < 1e-15 && (p_H[1] + 1.0).abs() < 1e-15 && p_H[2] == 3.0, "{p_H:?}");
    }

    #[test]
    fn unwrapped_angles_are_continuous_across_nan() {
        let mut angles = [3.1, -3.1, f64::NAN, -3.0];
        unwrap_angles(&mut angles);
        assert!((angles[1] - (2.0 * PI - 3.1)).abs() < 1e-14);
        assert!(angles[2].is_nan());
        assert!((angles[3] - (2.0 * PI - 3.0)).abs() < 1e-14);
    }
}
