//! The little geometry that metrics need; frames as in ARCHITECTURE.md.

/// A vector of three, in the frame that the name of its variable says.
pub type Vec3 = [f64; 3];

/// A rotation, row by row.
pub type Mat3 = [Vec3; 3];

/// Sum of two vectors.
pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|k| a[k] + b[k])
}

/// `R x`.
pub fn rotate(r: &Mat3, x: Vec3) -> Vec3 {
    std::array::from_fn(|k| r[k][0] * x[0] + r[k][1] * x[1] + r[k][2] * x[2])
}

/// `A B`.
pub fn mul(a: &Mat3, b: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// `Rz(yaw) Ry(pitch) Rx(roll)`.
pub fn rotation_of_rpy([roll, pitch, yaw]: Vec3) -> Mat3 {
    let about = |axis, angle| rotation_about(axis, angle);
    let (x, y, z) = (about([1.0, 0.0, 0.0], roll), about([0.0, 1.0, 0.0], pitch), about([0.0, 0.0, 1.0], yaw));
    mul(&mul(&z, &y), &x)
}

/// Rotation about an axis, which need not have length one (one of length zero gives the identity): Rodrigues' formula.
pub fn rotation_about(axis: Vec3, angle: f64) -> Mat3 {
    let length = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
    let [x, y, z] = axis.map(|a| if length > 0.0 { a / length } else { 0.0 });
    let (s, c) = if length > 0.0 { angle.sin_cos() } else { (0.0, 1.0) };
    let v = 1.0 - c;
    [
        [c + x * x * v, x * y * v - z * s, x * z * v + y * s],
        [x * y * v + z * s, c + y * y * v, y * z * v - x * s],
        [x * z * v - y * s, y * z * v + x * s, c + z * z * v],
    ]
}

/// The same vector, from W axes to H axes: turned back by the heading.
pub fn from_w_to_h(yaw: f64, [x, y, z]: Vec3) -> Vec3 {
    let (sin, cos) = yaw.sin_cos();
    [cos * x + sin * y, -sin * x + cos * y, z]
}

/// The same angle in (-π, π].
pub fn wrap(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    let turned = angle.rem_euclid(TAU);
    if turned > PI { turned - TAU } else { turned }
}

/// Angles made continuous: a step of more than half a turn is taken as the shorter way round. NaN passes through.
pub fn unwrap_angles(angles: &mut [f64]) {
    let mut last = f64::NAN;
    for angle in angles {
        if !last.is_nan() && !angle.is_nan() {
            *angle = last + wrap(*angle - last);
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
    fn a_point_ahead_of_a_robot_that_faces_left_is_to_its_right() {
        // Heading +y; the point lies in +x of the world, hence to the robot's right: -y of H.
        let p_H = from_w_to_h(FRAC_PI_2, [1.0, 0.0, 3.0]);
        assert!((p_H[0]).abs() < 1e-15 && (p_H[1] + 1.0).abs() < 1e-15 && p_H[2] == 3.0, "{p_H:?}");
    }

    #[test]
    fn angles_wrap_and_unwrap() {
        assert_eq!(wrap(PI), PI);
        assert!((wrap(3.0 * PI - 0.1) - (PI - 0.1)).abs() < 1e-14);
        assert!((wrap(-PI - 0.1) - (PI - 0.1)).abs() < 1e-14);
        let mut angles = [3.1, -3.1, f64::NAN, -3.0];
        unwrap_angles(&mut angles);
        assert!((angles[1] - (2.0 * PI - 3.1)).abs() < 1e-14);
        assert!(angles[2].is_nan());
        assert!((angles[3] - (2.0 * PI - 3.0)).abs() < 1e-14);
    }
}
