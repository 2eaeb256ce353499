//! Unit quaternions as arrays `[w, x, y, z]`: conversions and the product. The only quaternion algebra of the workspace.

use super::{asin, atan2, cos, sin};
use nalgebra::Matrix3;

/// Unit quaternion of a rotation, with `w >= 0`.
///
/// Source: S. W. Shepperd, *Quaternion from rotation matrix* (1978). The component with the largest square is computed first: no
/// cancellation and no trigonometric function.
#[inline]
pub fn from_rotation(R: &Matrix3<f64>) -> [f64; 4] {
    let trace = R[(0, 0)] + R[(1, 1)] + R[(2, 2)];
    let squares =
        [1.0 + trace, 1.0 + 2.0 * R[(0, 0)] - trace, 1.0 + 2.0 * R[(1, 1)] - trace, 1.0 + 2.0 * R[(2, 2)] - trace];
    let mut largest = 0;
    for i in 1..4 {
        if squares[i] > squares[largest] {
            largest = i;
        }
    }
    let (wx, wy, wz) = (R[(2, 1)] - R[(1, 2)], R[(0, 2)] - R[(2, 0)], R[(1, 0)] - R[(0, 1)]);
    let (xy, xz, yz) = (R[(0, 1)] + R[(1, 0)], R[(0, 2)] + R[(2, 0)], R[(1, 2)] + R[(2, 1)]);
    let s = squares[largest];
    let q = match largest {
        0 => [s, wx, wy, wz],
        1 => [wx, s, xy, xz],
        2 => [wy, xy, s, yz],
        _ => [wz, xz, yz, s],
    };
    let norm = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    let scale = if q[0] < 0.0 { -1.0 / norm } else { 1.0 / norm };
    [q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale]
}

/// Unit quaternion of a rotation vector (axis times angle, rad).
#[inline]
pub fn from_rotation_vector(v: [f64; 3]) -> [f64; 4] {
    let angle = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    let scale = if angle > 0.0 { sin(angle / 2.0) / angle } else { 0.5 };
    [cos(angle / 2.0), scale * v[0], scale * v[1], scale * v[2]]
}

/// Rotation vector (axis times angle, rad) of a unit quaternion, with an angle from 0 to π. At π one of the two axes is returned, always the same.
///
/// ```text
/// log(q) = 2 atan2(|ε|, |η|) sign(η) ε/|ε|      q = (η, ε)
/// ```
#[inline]
pub fn to_rotation_vector([w, x, y, z]: [f64; 4]) -> [f64; 3] {
    let sign = if w < 0.0 { -1.0 } else { 1.0 };
    let eps = [sign * x, sign * y, sign * z];
    let norm = (eps[0] * eps[0] + eps[1] * eps[1] + eps[2] * eps[2]).sqrt();
    let scale = if norm > 1e-8 { 2.0 * atan2(norm, w.abs()) / norm } else { 2.0 };
    eps.map(|x| x * scale)
}

/// Rotation matrix of a quaternion of any length above zero.
#[inline]
pub fn to_rotation([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
    let s = 2.0 / (w * w + x * x + y * y + z * z);
    #[rustfmt::skip]
    let R = Matrix3::new(
        1.0 - s * (y * y + z * z), s * (x * y - w * z),       s * (x * z + w * y),
        s * (x * y + w * z),       1.0 - s * (x * x + z * z), s * (y * z - w * x),
        s * (x * z - w * y),       s * (y * z + w * x),       1.0 - s * (x * x + y * y),
    );
    R
}

/// Roll, pitch, yaw of a unit quaternion: `R = Rz(yaw) Ry(pitch) Rx(roll)`, rad.
#[inline]
pub fn to_rpy([w, x, y, z]: [f64; 4]) -> [f64; 3] {
    let roll = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y));
    let pitch = asin(2.0 * (w * y - z * x));
    let yaw = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
    [roll, pitch, yaw]
}

/// Quaternion of the inverse rotation, for a unit quaternion.
#[inline]
pub fn conjugate([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [w, -x, -y, -z]
}

/// Unit quaternion in the direction of `q`, which is not zero.
#[inline]
pub fn normalized(q: [f64; 4]) -> [f64; 4] {
    let norm = (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    q.map(|x| x / norm)
}

/// Product `a b`: the quaternion of the rotation matrix `R(a) R(b)`.
#[inline]
pub fn product([aw, ax, ay, az]: [f64; 4], [bw, bx, by, bz]: [f64; 4]) -> [f64; 4] {
    [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Rx, Ry, Rz, rpy_of};
    use nalgebra::Vector3;
    use std::f64::consts::FRAC_PI_2;

    const SAMPLES: [[f64; 4]; 5] = [
        [0.5, -0.5, 0.5, 0.5],
        [0.1, 0.9, -0.3, 0.2],
        [0.1, 0.2, 0.9, -0.3],
        [0.0, -0.1, 0.3, 0.9],
        [1.0, 0.0, 0.0, 0.0],
    ];

    #[test]
    fn rotation_round_trip_for_every_largest_component() {
        for q in SAMPLES {
            let back = from_rotation(&to_rotation(q));
            for (found, expected) in back.into_iter().zip(normalized(q)) {
                assert!((found - expected).abs() < 1e-15, "{q:?} came back as {back:?}");
            }
        }
    }

    #[test]
    fn product_is_the_product_of_the_rotations() {
        for (a, b) in SAMPLES.into_iter().zip(SAMPLES.into_iter().rev()) {
            let difference = to_rotation(product(a, b)) - to_rotation(a) * to_rotation(b);
            assert!(difference.abs().max() < 1e-14, "{a:?} {b:?}");
        }
    }

    #[test]
    fn rotation_vector_turns_about_its_axis_by_its_length() {
        for (v, R) in [([0.7, 0.0, 0.0], Rx(0.7)), ([0.0, -2.0, 0.0], Ry(-2.0)), ([0.0, 0.0, 3.0], Rz(3.0))] {
            assert!((to_rotation(from_rotation_vector(v)) - R).abs().max() < 1e-15);
        }
        assert_eq!(from_rotation_vector([0.0; 3]), [1.0, 0.0, 0.0, 0.0]);
        let q = from_rotation_vector([0.1, 0.2, -0.3]);
        let log = crate::math::log(&to_rotation(q));
        assert!((log - Vector3::new(0.1, 0.2, -0.3)).norm() < 1e-15);
    }

    /// Angles up to π, both signs of the quaternion, and the inverse.
    #[test]
    fn rotation_vector_round_trip() {
        for v in [[0.1, 0.2, -0.3], [0.0, 3.13, 0.0], [2.0, -2.0, 1.0], [1e-9, 0.0, 2e-9], [0.0; 3]] {
            let q = from_rotation_vector(v);
            let (back, negated, inverse) = (to_rotation_vector(q), q.map(|x| -x), product(conjugate(q), q));
            for i in 0..3 {
                assert!((back[i] - v[i]).abs() < 1e-15 * 4.0, "{v:?} came back as {back:?}");
                assert!((to_rotation_vector(negated)[i] - v[i]).abs() < 1e-15 * 4.0, "{v:?}");
                assert!(inverse[1 + i].abs() < 1e-15, "{inverse:?}");
            }
        }
        assert_eq!(to_rotation_vector([0.0, 0.0, 0.0, -1.0]), [0.0, 0.0, -std::f64::consts::PI]);
    }

    #[test]
    fn rpy_of_quarter_turns() {
        let h = 0.5_f64.sqrt();
        for (q, rpy) in [
            ([1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
            ([h, h, 0.0, 0.0], [FRAC_PI_2, 0.0, 0.0]),
            ([h, 0.0, 0.0, h], [0.0, 0.0, FRAC_PI_2]),
        ] {
            for (found, expected) in to_rpy(q).into_iter().zip(rpy) {
                assert!((found - expected).abs() < 1e-15, "{q:?}: {found}, expected {expected}");
            }
        }
    }

    #[test]
    fn rpy_agrees_with_that_of_the_rotation() {
        // The first sample has pitch π/2, where roll and yaw are not unique.
        for q in SAMPLES[1..].iter().map(|q| normalized(*q)) {
            for (found, expected) in to_rpy(q).into_iter().zip(rpy_of(&to_rotation(q))) {
                assert!((found - expected).abs() < 1e-7, "{q:?}: {found}, expected {expected}");
            }
        }
    }
}
