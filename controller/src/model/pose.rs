//! Position and orientation of one frame in another.

use nalgebra::{Matrix3, Vector3};

/// Pose `X_AB` of a frame B in a frame A: `x_A = p + R x_B`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Origin of B from the origin of A, in A, m.
    pub p: Vector3<f64>,
    /// Turns B coordinates into A coordinates.
    pub R: Matrix3<f64>,
}

impl Pose {
    /// Both frames are the same.
    pub fn identity() -> Self {
        Self { p: Vector3::zeros(), R: Matrix3::identity() }
    }

    /// Pose of a URDF `<origin>`: `R = Rz(yaw) Ry(pitch) Rx(roll)`, angles in rad.
    pub fn from_xyz_rpy(xyz: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Self {
        let (sr, cr) = libm::sincos(roll);
        let (sp, cp) = libm::sincos(pitch);
        let (sy, cy) = libm::sincos(yaw);
        #[rustfmt::skip]
        let R = Matrix3::new(
            cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr,
            sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr,
            -sp,     cp * sr,                cp * cr,
        );
        Self { p: Vector3::from(xyz), R }
    }

    /// Pose of the frame `inner`, given in this frame, in the frame in which this one is given.
    pub fn then(&self, inner: &Pose) -> Self {
        Self { p: self.p + self.R * inner.p, R: self.R * inner.R }
    }

    /// Unit quaternion `w x y z` of `R`, with `w >= 0`.
    ///
    /// Source: S. W. Shepperd, *Quaternion from rotation matrix* (1978): the largest of the four squares is taken first,
    /// so no cancellation and no trigonometric function.
    pub fn quaternion_wxyz(&self) -> [f64; 4] {
        let R = &self.R;
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

    /// Rotation matrix of a quaternion `w x y z` of any length above zero.
    pub fn rotation_of_quaternion([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
        let s = 2.0 / (w * w + x * x + y * y + z * z);
        #[rustfmt::skip]
        let R = Matrix3::new(
            1.0 - s * (y * y + z * z), s * (x * y - w * z),       s * (x * z + w * y),
            s * (x * y + w * z),       1.0 - s * (x * x + z * z), s * (y * z - w * x),
            s * (x * z - w * y),       s * (y * z + w * x),       1.0 - s * (x * x + y * y),
        );
        R
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quaternion_and_rotation_are_inverse_for_every_largest_component() {
        for q in [
            [0.5, -0.5, 0.5, 0.5],
            [0.1, 0.9, -0.3, 0.2],
            [0.1, 0.2, 0.9, -0.3],
            [0.0, -0.1, 0.3, 0.9],
            [1.0, 0.0, 0.0, 0.0],
        ] {
            let R = Pose::rotation_of_quaternion(q);
            let back = Pose { p: Vector3::zeros(), R }.quaternion_wxyz();
            let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
            for i in 0..4 {
                assert!((back[i] - q[i] / norm).abs() < 1e-15, "{q:?} came back as {back:?}");
            }
        }
    }

    #[test]
    fn rpy_is_yaw_pitch_roll_from_the_left() {
        let X = Pose::from_xyz_rpy([0.0; 3], [0.3, -0.4, 0.5]);
        let alone = |rpy| Pose::from_xyz_rpy([0.0; 3], rpy).R;
        let product = alone([0.0, 0.0, 0.5]) * alone([0.0, -0.4, 0.0]) * alone([0.3, 0.0, 0.0]);
        assert!((X.R - product).abs().max() < 1e-15);
        // A positive pitch turns the nose down: x of B points to -z of A.
        assert!(alone([0.0, 0.1, 0.0])[(2, 0)] < 0.0);
    }
}
