//! Gains for the inertia of a robot's legs: HyQ's, and not more than a tick of 1 ms allows.

use super::legs::FoundLeg;
use super::scaled::two_digits;
use crate::model::{BaseState, Kinematics, Model, mass_matrix};
use crate::quadruped::params::{PostureParams, StandParams};
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Period of a control tick, s.
const TICK: f64 = 0.001;
/// Largest product of a drive's damping and the tick, as a fraction of the smallest inertia of a leg: at 2 the damping itself is unstable. HyQ has
/// 0.9 in the safe state, ANYmal B 0.8 while it stands up.
const LARGEST_STEP: f64 = 0.8;
/// The same for the damping of a swinging leg: for each joint alone, where ANYmal B has 0.4, and for the leg as a whole, where it has 0.5. The torque
/// of a tick acts one tick later, so the damping of the leg is unstable from 1 on. Mini cheetah with 2.7 falls at its first touchdown.
const LARGEST_SWING_STEP: f64 = 0.5;
const LARGEST_LEG_STEP: f64 = 0.9;
/// Damping of a limp robot as a fraction of its weight times leg length, s: HyQ's is 0.034.
const LIMP: f64 = 0.04;

/// Gains of a robot.
#[derive(Clone, Debug)]
pub(super) struct Gains {
    /// `posture.swing_kp`, N m/rad.
    pub(super) swing_kp: [f64; 3],
    /// `posture.swing_kd`, N m s/rad.
    pub(super) swing_kd: [f64; 3],
    /// `stand.stiffness`, 1/rad.
    pub(super) stand_stiffness: f64,
    /// `stand.damping`, s/rad.
    pub(super) stand_damping: f64,
    /// `safety.damping`, N m s/rad.
    pub(super) limp_damping: f64,
}

impl Gains {
    /// - `q`: standing posture, nj.
    /// - `size`: weight times leg length, N m.
    pub(super) fn new(model: &Model, legs: &[FoundLeg; 4], q: &[f64], size: f64) -> Self {
        let mut kin = Kinematics::new(model);
        kin.update(model, &BaseState::identity(), q, &vec![0.0; model.nj()]);
        let mut M = DMatrix::zeros(model.nv(), model.nv());
        mass_matrix(model, &kin, &mut M);
        let (mut mean, mut least, mut effort) = ([0.0; 3], f64::INFINITY, 0.0_f64);
        let of_leg = |leg: &FoundLeg| {
            let row = |k: usize| model.nv_base() + leg.joints[k];
            Matrix3::from_fn(|i, k| M[(row(i), row(k))])
        };
        for leg in legs {
            let M_leg = of_leg(leg);
            least = least.min(M_leg.symmetric_eigenvalues().min());
            (0..3).for_each(|k| mean[k] += M_leg[(k, k)] / 4.0);
            effort = leg
                .joints
                .iter()
                .map(|&j| model.joints[j].effort)
                .filter(|effort| effort.is_finite())
                .fold(effort, f64::max);
        }
        let PostureParams { swing_kp, swing_kd, .. } = PostureParams::default();
        let StandParams { stiffness, damping, .. } = StandParams::default();
        let by_joint: [f64; 3] =
            std::array::from_fn(|k| (LARGEST_SWING_STEP * mean[k] / (TICK * swing_kd[k])).min(1.0));
        // Eigenvalues of `TICK M⁻¹ D`, D = diag(d): those of the symmetric `TICK D^½ M⁻¹ D^½`.
        let root = Matrix3::from_diagonal(&Vector3::from_fn(|k, _| (swing_kd[k] * by_joint[k]).sqrt()));
        let step = |leg| {
            of_leg(leg).try_inverse().map_or(0.0, |inverse| (root * inverse * root).symmetric_eigenvalues().max())
        };
        let largest_step = TICK * legs.iter().map(step).fold(0.0, f64::max);
        let by_leg = if largest_step > LARGEST_LEG_STEP { LARGEST_LEG_STEP / largest_step } else { 1.0 };
        let scale = |k: usize| by_joint[k] * by_leg;
        let largest = LARGEST_STEP * least.max(0.0) / TICK;
        let by_step = (largest / (damping * effort)).min(1.0);
        Gains {
            swing_kp: std::array::from_fn(|k| two_digits(swing_kp[k] * scale(k))),
            swing_kd: std::array::from_fn(|k| two_digits(swing_kd[k] * scale(k))),
            stand_stiffness: two_digits(stiffness * by_step),
            stand_damping: two_digits(damping * by_step),
            limp_damping: two_digits((LIMP * size).min(largest)).clamp(0.001, 200.0),
        }
    }
}
