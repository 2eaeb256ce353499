//! Changes to the description of a robot so that controller and simulator can use it: no helper links above the trunk, no joints outside of
//! the legs, foot frames at the centres of the feet, and inertias and efforts that a real robot can have.

use super::legs::FoundLeg;
use super::scaled::two_digits;
use crate::math::quaternion;
use crate::model::{Inertial, Joint, JointKind, Limits, Link, Pose, ShapeKind, UrdfTree, impossible_moments};
use nalgebra::{Matrix3, Vector3};

/// Mass below which the root is a helper link, as a fraction of the robot's.
const HELPER: f64 = 1e-4;
/// An effort above this multiple of weight times leg length is not the limit of a motor.
const PLACEHOLDER: f64 = 3.0;
/// The effort that is assumed instead, as a multiple of weight times leg length: between HyQ's 0.25 and the 0.7 of small electric robots.
const USUAL_EFFORT: f64 = 0.5;
/// A speed that no motor of a leg has, rad/s, and the one assumed instead.
const PLACEHOLDER_SPEED: f64 = 100.0;
const USUAL_SPEED: f64 = 40.0;

/// Makes the trunk the root: removes roots without mass and shapes that are fixed to one link at another place, such as `base_footprint`.
/// Returns the names of the removed links.
pub(super) fn trunk_as_root(tree: &mut UrdfTree) -> Vec<String> {
    let mass: f64 = tree.links.iter().map(|link| link.inertial.mass).sum();
    let mut removed = Vec::new();
    loop {
        let root = &tree.links[0];
        let mut below = tree.joints.iter().enumerate().filter(|(_, joint)| joint.parent == 0);
        let (Some((at, joint)), None) = (below.next(), below.next()) else { return removed };
        let is_helper = root.inertial.mass <= HELPER * mass && root.visuals.is_empty() && root.collisions.is_empty();
        // A root at the same place changes nothing; it keeps its name.
        if !is_helper || joint.kind != JointKind::Fixed || joint.X_PC == Pose::identity() {
            return removed;
        }
        tree.joints.remove(at);
        removed.push(tree.links.remove(0).name);
        for joint in &mut tree.joints {
            (joint.parent, joint.child) = (joint.parent - 1, joint.child - 1);
        }
        tree.links[0].parent_joint = None;
        for link in &mut tree.links {
            link.parent_joint = link.parent_joint.map(|joint| if joint > at { joint - 1 } else { joint });
        }
    }
}

/// Fixes a joint at a position, rad or m.
pub(super) fn fix(joint: &mut Joint, q: f64) {
    let motion = match joint.kind {
        JointKind::Prismatic => Pose { p: joint.axis * q, R: Matrix3::identity() },
        _ => {
            let (sin, cos) = (crate::math::sin(q / 2.0), crate::math::cos(q / 2.0));
            let axis = joint.axis * sin;
            Pose { p: Vector3::zeros(), R: quaternion::to_rotation([cos, axis.x, axis.y, axis.z]) }
        }
    };
    joint.X_PC = joint.X_PC.then(&motion);
    (joint.kind, joint.axis, joint.limits) = (JointKind::Fixed, Vector3::z(), Limits::NONE);
    (joint.damping, joint.friction) = (0.0, 0.0);
}

/// Moves the frame of a foot link to the centre of its sphere, `offset` in the link, m. A foot that is the last moving link receives a link of
/// its own.
pub(super) fn center_foot(tree: &mut UrdfTree, foot: usize, offset: Vector3<f64>) {
    let Some(joint) = tree.links[foot].parent_joint else { return };
    if tree.joints[joint].kind != JointKind::Fixed {
        let name = format!("{}_foot", tree.links[foot].name);
        let is_sphere = |kind: &ShapeKind| matches!(kind, ShapeKind::Sphere { .. });
        tree.links[foot].collisions.retain(|shape| !is_sphere(&shape.kind));
        tree.links[foot].visuals.retain(|shape| !is_sphere(&shape.kind));
        tree.joints.push(Joint {
            name: name.clone(),
            kind: JointKind::Fixed,
            parent: foot,
            child: tree.links.len(),
            X_PC: Pose { p: offset, R: Matrix3::identity() },
            axis: Vector3::z(),
            limits: Limits::NONE,
            damping: 0.0,
            friction: 0.0,
        });
        let inertial = Inertial { X_LC: Pose::identity(), mass: 0.0, I_C: Matrix3::zeros() };
        let parent_joint = Some(tree.joints.len() - 1);
        tree.links.push(Link { name, parent_joint, inertial, visuals: Vec::new(), collisions: Vec::new() });
        return;
    }
    tree.joints[joint].X_PC = tree.joints[joint].X_PC.then(&Pose { p: offset, R: Matrix3::identity() });
    let link = &mut tree.links[foot];
    link.inertial.X_LC.p -= offset;
    link.collisions.iter_mut().chain(&mut link.visuals).for_each(|shape| shape.X_LS.p -= offset);
    tree.joints.iter_mut().filter(|joint| joint.parent == foot).for_each(|joint| joint.X_PC.p -= offset);
}

/// Replaces effort and velocity limits of leg joints that are not those of a motor; returns the names of the joints.
///
/// - `size`: weight of the robot times the length of its legs, N m.
pub(super) fn limit_efforts(tree: &mut UrdfTree, legs: &[FoundLeg; 4], size: f64) -> Vec<String> {
    let mut changed = Vec::new();
    for leg in legs {
        for link in leg.links {
            let Some(joint) = tree.links[link].parent_joint else { continue };
            let Joint { name, limits, .. } = &mut tree.joints[joint];
            let no_effort = limits.effort > PLACEHOLDER * size;
            let no_speed = limits.velocity > PLACEHOLDER_SPEED;
            if no_effort {
                limits.effort = two_digits(USUAL_EFFORT * size);
            }
            if no_speed {
                limits.velocity = USUAL_SPEED;
            }
            if no_effort || no_speed {
                changed.push(name.clone());
            }
        }
    }
    changed
}

/// Replaces inertias that no mass distribution has by those of a sphere with the same mean moment; returns the names of the links.
pub(super) fn balance(tree: &mut UrdfTree) -> Vec<String> {
    let mut changed = Vec::new();
    for Link { name, inertial, .. } in &mut tree.links {
        if impossible_moments(&inertial.I_C).is_some() {
            inertial.I_C = Matrix3::identity() * (inertial.I_C.trace() / 3.0).max(0.0);
            changed.push(name.clone());
        }
    }
    changed
}
