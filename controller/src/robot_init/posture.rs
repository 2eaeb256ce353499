//! A standing posture for legs of three joints: feet level and below the hips, knees bent as the joint limits allow.

use super::{FoundLeg, RobotInitError};
use crate::model::{BaseState, FrameId, JointInfo, Kinematics, Model, UrdfTree, point_jacobian_linear};
use nalgebra::{DMatrix, Matrix3, Vector3};
use std::f64::consts::PI;

/// Distance from hip to foot, as a fraction of the length of the stretched leg.
const STRETCH: f64 = 0.85;
/// Smallest lateral distance of a foot from the middle of the body, as a fraction of the height of the hips.
const HALF_WIDTH: f64 = 0.4;
/// Smallest distance of a joint from its limits, rad.
const MARGIN: f64 = 0.05;
/// Position error at which the solver stops, m.
const TOLERANCE: f64 = 1e-9;

/// A standing posture and its dimensions.
#[derive(Clone, Debug)]
pub struct Posture {
    /// Joint positions, in the order of the model, rad.
    pub q: Vec<f64>,
    /// Height of the base above the centres of the feet, m.
    pub height: f64,
    /// Height of the hips, the second joints of the legs, above the centres of the feet, m. Steps and speeds scale with it: the origin of the
    /// base may be anywhere.
    pub hip_height: f64,
    /// Length of the shortest stretched leg from its second joint, m.
    pub leg_length: f64,
    /// Each knee can bend both ways within its limits.
    pub either_way: bool,
}

/// Finds a posture.
///
/// # Errors
/// [`RobotInitError::OutOfReach`]: a leg cannot reach the ground below its hip within its joint limits.
pub(super) fn stand(tree: &UrdfTree, model: &Model, plans: &[Plan]) -> Result<Posture, RobotInitError> {
    let mut body = Body::new(model);
    let leg_length = plans.iter().map(|plan| plan.length).fold(f64::INFINITY, f64::min);
    let drop = STRETCH * leg_length;
    let ground = plans.iter().map(|plan| plan.p_hip.z).sum::<f64>() / 4.0 - drop;

    let (mut q, mut either_way) = (vec![0.0; model.nj()], true);
    for plan in plans {
        let mut solutions = Vec::new();
        // A wide stance if the limits allow it; otherwise as wide as at zero.
        for half_width in [HALF_WIDTH * drop, 0.0] {
            solutions = plan.solutions(&mut body, &plan.goal(ground, half_width));
            if !solutions.is_empty() {
                break;
            }
        }
        let best = plan.best(&mut body, &solutions).ok_or_else(|| RobotInitError::OutOfReach {
            foot: tree.links[plan.leg.foot].name.clone(),
            joints: plan.leg.joints.map(|j| model.joints[j].name.clone()).to_vec(),
            depth: drop,
        })?;
        either_way &= plan.both_ways(&mut body, &solutions);
        for (joint, value) in plan.leg.joints.into_iter().zip(best) {
            q[joint] = round(value);
        }
    }
    Ok(Posture { q, height: -ground, hip_height: drop, leg_length, either_way })
}

/// The legs with their dimensions.
///
/// # Errors
/// [`RobotInitError::Model`] if the tree and the model differ.
pub(super) fn plans<'l>(
    tree: &UrdfTree,
    model: &Model,
    legs: &'l [FoundLeg; 4],
) -> Result<Vec<Plan<'l>>, RobotInitError> {
    let mut body = Body::new(model);
    let zero = vec![0.0; model.nj()];
    let frame = |link: usize| model.frame(&tree.links[link].name);
    let mut plans = Vec::with_capacity(4);
    for leg in legs {
        let [hip, knee] = [frame(leg.links[1])?, frame(leg.links[2])?];
        let foot = frame(leg.foot)?;
        body.at(&zero);
        let (p_hip, p_foot) = (body.kin.p_WF(model, hip), body.kin.p_WF(model, foot));
        let length = stretched(&mut body, leg, hip, foot);
        plans.push(Plan { leg, hip, knee, foot, p_hip, p_foot, length });
    }
    Ok(plans)
}

/// Rounds to 0.1 mrad, for a readable file.
pub(super) fn round(x: f64) -> f64 {
    (x * 1e4).round() / 1e4 + 0.0
}

/// The robot in a posture, base at the origin.
pub(super) struct Body<'m> {
    pub(super) model: &'m Model,
    pub(super) kin: Kinematics,
    J: DMatrix<f64>,
    q: Vec<f64>,
    rest: Vec<f64>,
}

impl<'m> Body<'m> {
    pub(super) fn new(model: &'m Model) -> Self {
        let (nv, nj) = (model.nv(), model.nj());
        Body { model, kin: Kinematics::new(model), J: DMatrix::zeros(3, nv), q: vec![0.0; nj], rest: vec![0.0; nj] }
    }

    fn at(&mut self, q: &[f64]) {
        self.kin.update(self.model, &BaseState::identity(), q, &self.rest);
    }

    /// Sets the joints of one leg, and all others to zero.
    pub(super) fn at_leg(&mut self, leg: &FoundLeg, q: &[f64; 3]) {
        self.q.fill(0.0);
        for (joint, value) in leg.joints.into_iter().zip(q) {
            self.q[joint] = *value;
        }
        self.kin.update(self.model, &BaseState::identity(), &self.q, &self.rest);
    }

    /// Range of a joint without the margin at its limits, rad. Limits that leave no room for the margin, or lie beyond a half turn, are used as far as
    /// they go.
    pub(super) fn range(&self, joint: usize) -> (f64, f64) {
        let JointInfo { lower, upper, .. } = self.model.joints[joint];
        let (low, high) = (lower.max(-PI), upper.min(PI));
        let (low, high) = if low <= high { (low, high) } else { (lower, upper) };
        let margin = MARGIN.min((high - low) / 4.0);
        (low + margin, high - margin)
    }
}

/// The longest distance from hip to foot within the range of the knee, m.
fn stretched(body: &mut Body, leg: &FoundLeg, hip: FrameId, foot: FrameId) -> f64 {
    let (lower, upper) = body.range(leg.joints[2]);
    let mut longest = 0.0_f64;
    for k in 0..=200 {
        body.at_leg(leg, &[0.0, 0.0, lower + (upper - lower) * f64::from(k) / 200.0]);
        let p = body.kin.p_WF(body.model, foot) - body.kin.p_WF(body.model, hip);
        longest = longest.max(p.norm());
    }
    longest
}

/// A leg, and the positions of its hip and foot with all joints at zero.
pub(super) struct Plan<'l> {
    pub(super) leg: &'l FoundLeg,
    hip: FrameId,
    pub(super) knee: FrameId,
    pub(super) foot: FrameId,
    pub(super) p_hip: Vector3<f64>,
    p_foot: Vector3<f64>,
    length: f64,
}

impl Plan<'_> {
    /// Goal of the foot: below the hip; laterally where it is at zero, or farther out.
    fn goal(&self, ground: f64, half_width: f64) -> Vector3<f64> {
        let Plan { p_hip, p_foot, length, .. } = self;
        let hangs = if (p_foot.y - p_hip.y).abs() < 0.5 * length { p_foot.y } else { p_hip.y };
        Vector3::new(p_hip.x, hangs.abs().max(half_width).copysign(p_hip.y), ground)
    }

    /// All postures of the leg that put its foot at `goal`, found from a grid of start values.
    fn solutions(&self, body: &mut Body, goal: &Vector3<f64>) -> Vec<[f64; 3]> {
        let ranges = self.leg.joints.map(|joint| body.range(joint));
        let grid = |k: usize, n: u32| {
            let (lower, upper) = ranges[k];
            (0..=n).map(move |i| lower + (upper - lower) * f64::from(i) / f64::from(n))
        };
        let mut found: Vec<[f64; 3]> = Vec::new();
        for q0 in grid(0, 6) {
            for q1 in grid(1, 8) {
                for q2 in grid(2, 8) {
                    let Some(q) = self.descend(body, goal, [q0, q1, q2], &ranges) else { continue };
                    let known = |other: &[f64; 3]| q.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-4);
                    if !found.iter().any(known) {
                        found.push(q);
                    }
                }
            }
        }
        found
    }

    /// Damped Gauss-Newton steps, clamped to the joint ranges; `None` if they do not converge.
    pub(super) fn descend(
        &self,
        body: &mut Body,
        goal: &Vector3<f64>,
        from: [f64; 3],
        ranges: &[(f64, f64); 3],
    ) -> Option<[f64; 3]> {
        let mut q = from;
        for _ in 0..60 {
            body.at_leg(self.leg, &q);
            let e = goal - body.kin.p_WF(body.model, self.foot);
            if e.norm() < TOLERANCE {
                return Some(q);
            }
            point_jacobian_linear(body.model, &body.kin, self.foot, &Vector3::zeros(), body.J.as_view_mut());
            let J = Matrix3::from_fn(|row, k| body.J[(row, 6 + self.leg.joints[k])]);
            let damping = 1e-2 * e.norm() * e.norm();
            let step = (J.transpose() * J + Matrix3::identity() * damping).try_inverse()? * J.transpose() * e;
            let step = step * (0.5 / step.norm().max(0.5));
            for k in 0..3 {
                q[k] = (q[k] + step[k]).clamp(ranges[k].0, ranges[k].1);
            }
        }
        None
    }

    /// The best posture: knee below the hip and towards the middle of the body if possible, then the smallest angles.
    fn best(&self, body: &mut Body, solutions: &[[f64; 3]]) -> Option<[f64; 3]> {
        let mut rated: Vec<_> = solutions.iter().map(|q| (self.rate(body, q), *q)).collect();
        rated.sort_by(|(a, _), (b, _)| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
        rated.first().map(|(_, q)| *q)
    }

    /// Cost of a posture, compared lexicographically: knee above the hip or leg folded sideways, knee outward, sum of squared angles.
    fn rate(&self, body: &mut Body, q: &[f64; 3]) -> (bool, bool, f64) {
        body.at_leg(self.leg, q);
        let [hip, knee, foot] = [self.hip, self.knee, self.foot].map(|frame| body.kin.p_WF(body.model, frame));
        let folded = knee.z > hip.z || foot.z > knee.z || q[0].abs() > 1.0;
        (folded, self.bend(&hip, &knee, &foot) > 0.0, q.iter().map(|x| x * x).sum())
    }

    /// Distance of the knee from the line between hip and foot along x, positive away from the middle of the body, m.
    fn bend(&self, hip: &Vector3<f64>, knee: &Vector3<f64>, foot: &Vector3<f64>) -> f64 {
        let share = (knee.z - hip.z) / (foot.z - hip.z);
        (knee.x - (hip.x + share * (foot.x - hip.x))) * self.p_hip.x.signum()
    }

    /// Whether some unfolded posture bends the knee outward and another one inward.
    fn both_ways(&self, body: &mut Body, solutions: &[[f64; 3]]) -> bool {
        let outward: Vec<bool> =
            solutions.iter().map(|q| self.rate(body, q)).filter(|rate| !rate.0).map(|rate| rate.1).collect();
        outward.contains(&true) && outward.contains(&false)
    }
}
