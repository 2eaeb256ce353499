//! A posture in which the robot lies on the ground without torque.

use super::posture::{Body, Plan, round};
use crate::model::{FrameId, LinkGroups, Model, Shape, ShapeKind, UrdfTree};
use nalgebra::{Matrix3, Vector3};

/// Distance between two heights of the feet, m.
const STEP: f64 = 0.01;
/// Distance of a knee from its limit at which it is folded, rad.
const AT_LIMIT: f64 = 0.25;
/// Distance of the trunk from the ground, as a fraction of the height of the base, at which the robot sinks down without tipping.
const NEARLY: f64 = 0.33;
/// Number of positions of each joint in the search for a folded leg.
const GRID: [u32; 3] = [10, 16, 16];
/// Radius that is assumed for a knee, m.
const KNEE: f64 = 0.02;

/// The posture, in the order of the model, rad. The feet are vertically above their standing positions if the trunk then touches the ground, or if
/// the knees are at their limits and the trunk is near the ground. Otherwise the legs are folded and spread within their limits until the trunk is as
/// low as possible. The robot keeps either posture without torque.
///
/// - `stand`: the standing posture.
pub(super) fn lie(tree: &UrdfTree, model: &Model, plans: &[Plan], stand: &[f64], foot_radius: f64) -> Vec<f64> {
    let mut body = Body::new(model);
    let bottom = bottom(tree);
    let mut q = stand.to_vec();
    for plan in plans {
        let leg = plan.leg;
        let from = leg.joints.map(|joint| stand[joint]);
        let folded = lifted(&mut body, plan, from, bottom, foot_radius)
            .unwrap_or_else(|| spread(&mut body, plan, from, bottom, foot_radius));
        for (joint, value) in leg.joints.into_iter().zip(folded) {
            q[joint] = round(value);
        }
    }
    q
}

/// Depth of the lowest point of the trunk's shapes below the base, m; 0 if there is none.
fn bottom(tree: &UrdfTree) -> f64 {
    let groups = LinkGroups::new(tree, |_| Matrix3::identity());
    let mut lowest: f64 = 0.0;
    for (i, link) in tree.links.iter().enumerate().filter(|(i, _)| groups.body_of_link[*i] == 0) {
        for Shape { X_LS, kind } in &link.collisions {
            let X = groups.X_BL[i].then(X_LS);
            let half = match *kind {
                ShapeKind::Box { size: [x, y, z] } => Vector3::new(x, y, z) / 2.0,
                ShapeKind::Cylinder { radius, length } => Vector3::new(radius, radius, length / 2.0),
                ShapeKind::Capsule { radius, length } => Vector3::new(radius, radius, length / 2.0 + radius),
                ShapeKind::Sphere { radius } => Vector3::new(radius, radius, radius),
                ShapeKind::Mesh { .. } => continue,
            };
            let extent = (0..3).map(|k| X.R[(2, k)].abs() * half[k]).sum::<f64>();
            lowest = lowest.min(X.p.z - extent);
        }
    }
    -lowest
}

/// The leg with its foot lifted until it is level with the bottom of the trunk, or nearly; `None` if a limit is reached before.
fn lifted(body: &mut Body, plan: &Plan, from: [f64; 3], bottom: f64, foot_radius: f64) -> Option<[f64; 3]> {
    let ranges = plan.leg.joints.map(|joint| body.range(joint));
    body.at_leg(plan.leg, &from);
    let mut goal = body.kin.p_WF(body.model, plan.foot);
    let (level, standing) = (foot_radius - bottom, goal.z - foot_radius);
    let knee = &body.model.joints[plan.leg.joints[2]];
    let mut q = from;
    while goal.z < level {
        let folded = (q[2] - knee.lower).abs().min((q[2] - knee.upper).abs()) < AT_LIMIT;
        if folded {
            // What remains is the distance of the trunk from the ground.
            return (level - goal.z <= -NEARLY * standing).then_some(q);
        }
        goal.z = (goal.z + STEP).min(level);
        q = plan.descend(body, &goal, q, &ranges)?;
    }
    Some(q)
}

/// The leg with its foot as level with the bottom of the trunk as the limits allow, and no knee below the foot; of similar postures, the one with
/// the smallest abduction. `from` if every posture has the knee below the foot.
fn spread(body: &mut Body, plan: &Plan, from: [f64; 3], bottom: f64, foot_radius: f64) -> [f64; 3] {
    let ranges = plan.leg.joints.map(|joint| body.range(joint));
    let mut best = (f64::INFINITY, from);
    let value = |k: usize, i: u32| ranges[k].0 + (ranges[k].1 - ranges[k].0) * f64::from(i) / f64::from(GRID[k]);
    for i in 0..=GRID[0] {
        for j in 0..=GRID[1] {
            for k in 0..=GRID[2] {
                let q = [value(0, i), value(1, j), value(2, k)];
                body.at_leg(plan.leg, &q);
                let depth = |frame: FrameId, radius: f64| radius - body.kin.p_WF(body.model, frame).z;
                let foot = depth(plan.foot, foot_radius);
                let knee = depth(plan.knee, KNEE);
                // The foot is the lowest point, so that the robot can push itself up.
                if knee > foot {
                    continue;
                }
                let cost = (foot - bottom).abs() + 1e-3 * q[0].abs();
                if cost < best.0 {
                    best = (cost, q);
                }
            }
        }
    }
    best.1
}
