//! What a leg reaches: joint positions for a position of its foot, and how far they are from the limits of the leg.
//!
//! The foot is computed from the axes of the three joints at position zero (product of exponentials), which is a small part of the cost of
//! [`crate::model::Kinematics`].

use crate::math::{norm, sin_cos};
use crate::model::{FrameId, Kinematics, Model, frame_jacobian};
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Distance of a joint from its limit below which the foot is out of reach, rad.
const JOINT_MARGIN: f64 = 0.03;
/// Distance of the foot from its target at which the target counts as reached, m.
const REACHED: f64 = 1e-4;
/// Largest number of iterations towards a target.
const MAX_ITERATIONS: usize = 12;
/// Largest change of a joint in an iteration, rad.
const MAX_STEP: f64 = 0.5;

/// Kinematics of a leg with three revolute joints.
#[derive(Clone, Copy, Debug)]
pub struct LegReach {
    /// Axes of the joints at position zero, in B.
    axes: [Vector3<f64>; 3],
    /// A point on each axis at position zero, in B, m.
    points: [Vector3<f64>; 3],
    /// Centre of the foot at position zero, in B, m.
    p_foot: Vector3<f64>,
    /// Limits of the joints, rad.
    limits: [(f64, f64); 3],
    /// Effort limits of the joints, N m.
    efforts: [f64; 3],
    /// Cross-product matrix of each axis, and its square.
    turns: [(Matrix3<f64>, Matrix3<f64>); 3],
    /// Joint positions where the search starts, rad, with the foot and its Jacobian there.
    start: ([f64; 3], Foot),
    /// The nominal posture, with the trunk level.
    nominal: Posture,
}

/// Position of the foot's centre in B, m, and its Jacobian.
type Foot = (Vector3<f64>, Matrix3<f64>);

/// A posture of a leg, relative to the limits of the leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posture {
    /// Volume of the box between the normalized columns of the leg's Jacobian: 0 for a stretched or folded leg, at most 1.
    pub volume: f64,
    /// Largest ratio of a joint torque to its effort limit, per N of vertical force on the foot, 1/N.
    pub torque: f64,
}

impl LegReach {
    /// The kinematics of the leg that ends at the frame `foot`.
    ///
    /// - `joints`: its joints from the trunk outward.
    /// - `q_nominal`: nominal posture of the robot, nj, rad.
    pub fn new(model: &Model, foot: FrameId, joints: [usize; 3], q_nominal: &[f64]) -> Self {
        let kin = Kinematics::new(model);
        let mut J = DMatrix::zeros(6, model.nv());
        frame_jacobian(model, &kin, foot, &mut J);
        let p_foot = kin.p_BF_W(model, foot);
        let column = |joint: usize, row: usize| Vector3::from_fn(|k, _| J[(row + k, 6 + joint)]);
        let axes = joints.map(|joint| column(joint, 3));
        let points = joints.map(|joint| p_foot - column(joint, 0).cross(&column(joint, 3)));
        let limits = joints.map(|joint| (model.joints[joint].lower, model.joints[joint].upper));
        let efforts = joints.map(|joint| model.joints[joint].effort);
        let turns = axes.map(|axis| axis.cross_matrix()).map(|K| (K, K * K));
        let start = (joints.map(|joint| q_nominal[joint]), (p_foot, Matrix3::zeros()));
        let nominal = Posture { volume: f64::NAN, torque: f64::NAN };
        let mut leg = LegReach { axes, points, p_foot, limits, efforts, turns, start, nominal };
        leg.start.1 = leg.at(&leg.start.0);
        leg.nominal = leg.posture(&leg.start.1.1, &Vector3::z());
        leg
    }

    /// The posture in which the centre of the foot is at `p_B`, m in B; `None` if a joint would exceed its limit, or the leg is too short.
    ///
    /// - `up_B`: direction against gravity, in B.
    pub fn reach(&self, p_B: &Vector3<f64>, up_B: &Vector3<f64>) -> Option<Posture> {
        let (q, J) = self.solve(p_B)?;
        let inside = q
            .iter()
            .zip(&self.limits)
            .all(|(q, (lower, upper))| *q >= lower + JOINT_MARGIN && *q <= upper - JOINT_MARGIN);
        inside.then(|| self.posture(&J, up_B))
    }

    /// Determinant of the leg's Jacobian with the centre of the foot at `p_B`, m in B, relative to that in the nominal posture, whatever the limits of the
    /// joints are: 0 for a stretched or folded leg, and for a foot on the first axis. 0 if the leg is too short.
    pub fn extent(&self, p_B: &Vector3<f64>) -> f64 {
        let (_, nominal) = self.start.1;
        self.solve(p_B).map_or(0.0, |(_, J)| (J.determinant() / nominal.determinant()).abs())
    }

    /// Joint positions and Jacobian with the centre of the foot at `p_B`.
    fn solve(&self, p_B: &Vector3<f64>) -> Option<([f64; 3], Matrix3<f64>)> {
        let (mut q, (mut p, mut J)) = self.start;
        for _ in 0..MAX_ITERATIONS {
            let off = p_B - p;
            if off.dot(&off) < REACHED * REACHED {
                return Some((q, J));
            }
            let damped = J * J.transpose() + Matrix3::identity() * 1e-6;
            let step = J.transpose() * (damped.try_inverse()? * off);
            for (q, step) in q.iter_mut().zip(step.iter()) {
                *q += step.clamp(-MAX_STEP, MAX_STEP);
            }
            (p, J) = self.at(&q);
        }
        None
    }

    /// The nominal posture, with the trunk level.
    pub fn nominal(&self) -> Posture {
        self.nominal
    }

    fn posture(&self, J: &Matrix3<f64>, up_B: &Vector3<f64>) -> Posture {
        let torque = (0..3).fold(0.0, |most: f64, k| most.max(J.column(k).dot(up_B).abs() / self.efforts[k]));
        Posture { volume: volume(J), torque }
    }

    fn at(&self, q: &[f64; 3]) -> Foot {
        let mut R = Matrix3::identity();
        let (mut from, mut at) = (Vector3::zeros(), Vector3::zeros());
        let (mut axes, mut points) = ([Vector3::zeros(); 3], [Vector3::zeros(); 3]);
        for k in 0..3 {
            at += R * (self.points[k] - from);
            from = self.points[k];
            (axes[k], points[k]) = (R * self.axes[k], at);
            let ((sin, cos), (K, K2)) = (sin_cos(q[k]), &self.turns[k]);
            R *= Matrix3::identity() + K * sin + K2 * (1.0 - cos);
        }
        let p = at + R * (self.p_foot - from);
        let column = |k: usize| axes[k].cross(&(p - points[k]));
        (p, Matrix3::from_columns(&[column(0), column(1), column(2)]))
    }
}

/// Volume of the box between the normalized columns of a Jacobian: see [`Posture::volume`].
pub fn volume(J: &Matrix3<f64>) -> f64 {
    let sizes = (0..3).fold(1.0, |product, k| product * norm(&J.column(k).clone_owned()));
    if sizes > 0.0 { J.determinant().abs() / sizes } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Base, UrdfTree};

    /// A leg with thigh and shank of 0.3 m, hip axis x, other axes y.
    const LEG: &str = r#"<robot name="leg"><link name="base"><inertial><mass value="10"/>
        <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="hip"/><link name="thigh"/><link name="shank"/>
        <link name="foot"/>
        <joint name="haa" type="revolute"><parent link="base"/><child link="hip"/><axis xyz="1 0 0"/><origin xyz="0.4 0.2 0"/>
        <limit lower="-1" upper="1" effort="100" velocity="10"/></joint>
        <joint name="hfe" type="revolute"><parent link="hip"/><child link="thigh"/><axis xyz="0 1 0"/><origin xyz="0 0.1 0"/>
        <limit lower="-2" upper="2" effort="100" velocity="10"/></joint>
        <joint name="kfe" type="revolute"><parent link="thigh"/><child link="shank"/><axis xyz="0 1 0"/><origin xyz="0 0 -0.3"/>
        <limit lower="-2.4" upper="-0.1" effort="100" velocity="10"/></joint>
        <joint name="end" type="fixed"><parent link="shank"/><child link="foot"/><origin xyz="0 0 -0.3"/></joint></robot>"#;

    fn leg() -> LegReach {
        let model = Model::new(&UrdfTree::parse(LEG, "leg").unwrap(), Base::Floating).unwrap();
        LegReach::new(&model, model.frame("foot").unwrap(), [0, 1, 2], &[0.0, 0.5, -1.0])
    }

    #[test]
    fn a_foot_within_reach_is_found_and_one_beyond_the_stretched_leg_is_not() {
        let (leg, up) = (leg(), Vector3::z());
        let below = |height: f64| leg.reach(&Vector3::new(0.4, 0.3, -height), &up);
        // Isosceles triangle: the angle at the foot is acos(0.25/0.3), and the hip column is perpendicular to it.
        let posture = below(0.5).unwrap();
        assert!(
            (posture.volume - (1.0f64 - 0.25 * 0.25 / 0.09).sqrt() * 0.5 / 0.26f64.sqrt()).abs() < 1e-3,
            "{posture:?}"
        );
        // The knee stays at least 0.13 rad from the stretched leg: 0.6 m cos(0.065).
        assert!(below(0.598).is_some() && below(0.5995).is_none() && below(0.7).is_none());
        assert!(below(0.59).unwrap().volume < 0.2);
    }

    #[test]
    fn the_extent_is_the_product_of_both_levers_and_the_distance_from_the_hip_axis() {
        let leg = leg();
        // det J = l² sin(knee) d: hip axis along x, d the height of the foot below it; nominal: knee 1 rad, d = 0.6 cos(0.5).
        let nominal = libm::sin(1.0) * 0.6 * libm::cos(0.5);
        for height in [0.2, 0.35, 0.5] {
            let half = libm::acos(height / 0.6);
            let expected = libm::sin(2.0 * half) * height / nominal;
            let found = leg.extent(&Vector3::new(0.4, 0.3, -height));
            assert!((found - expected).abs() < 1e-3 * expected, "{height}: {found}, expected {expected}");
        }
        assert_eq!(leg.extent(&Vector3::new(0.4, 0.3, -0.7)), 0.0);
    }

    #[test]
    fn the_torque_of_a_vertical_force_is_force_times_lever_over_effort() {
        let leg = leg();
        // In the nominal posture the foot is below the hip joint at 0.1 m from the hip axis; the knee is 0.3 sin(0.5) ahead of the foot.
        let expected = 0.3 * libm::sin(0.5) / 100.0;
        assert!((leg.nominal().torque - expected).abs() < 1e-9, "{:?}", leg.nominal());
    }
}
