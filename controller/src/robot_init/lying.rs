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
/// Step of a leg that is turned outward, rad, and the number of steps.
const TURN: f64 = 0.02;
const TURNS: u32 = 60;
/// Radius that is assumed for a knee, m.
const KNEE: f64 = 0.02;

/// The posture, in the order of the model, rad. The feet are vertically above their standing positions if the trunk then touches the ground. If the
/// knees reach their limits before, the folded legs are turned outward. If the trunk is still not near the ground, the legs are folded and spread within
/// their limits until it is as low as possible. The robot keeps each of these postures without torque.
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

/// The leg with its foot lifted until it is level with the bottom of the trunk. If the knee reaches its limit before, the leg is turned outward too. `None`
/// if the trunk is then not even near the ground, or if another limit is reached.
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
            let (gap, q) = turned_outward(body, plan, q, level, ranges[0]);
            return (gap <= -NEARLY * standing).then_some(q);
        }
        goal.z = (goal.z + STEP).min(level);
        q = plan.descend(body, &goal, q, &ranges)?;
    }
    Some(q)
}

/// The leg turned outward by its first joint until its foot is at `level` in the base, or as near as the limits of the joint allow; and the distance
/// that remains, m. Without torque a robot on folded legs sinks in this way.
fn turned_outward(body: &mut Body, plan: &Plan, from: [f64; 3], level: f64, range: (f64, f64)) -> (f64, [f64; 3]) {
    let mut best = (f64::INFINITY, from);
    let mut width = 0.0;
    for i in 0..=TURNS {
        // The present angle comes first, then the nearest ones.
        for side in [-1.0, 1.0] {
            let q = [from[0] + side * TURN * f64::from(i), from[1], from[2]];
            body.at_leg(plan.leg, &q);
            let [foot, knee] = [plan.foot, plan.knee].map(|frame| body.kin.p_WF(body.model, frame));
            let outward = foot.y * plan.p_hip.y.signum();
            if i == 0 {
                width = outward;
            }
            let gap = (level - foot.z).max(0.0);
            if (range.0..=range.1).contains(&q[0]) && outward >= width && knee.z >= foot.z && gap < best.0 {
                best = (gap, q);
            }
        }
    }
    best
}

/// The leg with its foot as level with the bottom of the trunk as the limits allow, and no knee below the foot; of similar postures, the one with
/// small abduction and near `from`: the legs of a robot with equal front and hind legs then turn to opposite sides. `from` if every posture has the knee
/// below the foot.
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
                let moved = (0..3).map(|k| (q[k] - from[k]).abs()).fold(0.0, f64::max);
                let cost = (foot - bottom).abs() + 1e-3 * (q[0].abs() + moved);
                if cost < best.0 {
                    best = (cost, q);
                }
            }
        }
    }
    best.1
}
