//! Finds legs, feet and IMU of a quadruped in the tree of its URDF, without relying on names of links and joints.

use super::RobotInitError;
use crate::model::{BaseState, JointKind, Kinematics, Model, ModelError, ShapeKind, UrdfTree};
use nalgebra::Vector3;

/// Radius of a foot link without a sphere, m.
const FOOT_RADIUS: f64 = 0.02;

/// A leg: three joints from the base outward, and its foot.
#[derive(Clone, Debug)]
pub struct FoundLeg {
    /// Joints, as indices in [`Model::joints`].
    pub joints: [usize; 3],
    /// Child links of these joints, as indices in [`UrdfTree::links`]; their origins are on the joint axes.
    pub links: [usize; 3],
    /// Link of the foot.
    pub foot: usize,
}

/// Legs, feet and IMU of a quadruped.
#[derive(Clone, Debug)]
pub struct FoundLegs {
    /// LF RF LH RH.
    pub legs: [FoundLeg; 4],
    /// Radius of the feet, m.
    pub foot_radius: f64,
    /// Link of the IMU.
    pub imu: usize,
    /// How the IMU was found.
    pub imu_because: &'static str,
    /// How the radius was found.
    pub radius_because: &'static str,
    /// Remarks that a person should check.
    pub look_at: Vec<String>,
}

/// Finds the legs.
///
/// # Errors
/// Anything but four chains of three revolute joints from the base to a foot, one in each corner of the body; other movable joints.
pub(super) fn find(tree: &UrdfTree, model: &Model) -> Result<FoundLegs, RobotInitError> {
    let mut look_at = Vec::new();
    let mut chains = Vec::new();
    for end in (0..tree.joints.len()).filter(|&j| movable(tree, j) && !movable_behind(tree, tree.joints[j].child)) {
        chains.push((chain(tree, tree.joints[end].child), end));
    }
    let name = |joint: usize| tree.joints[joint].name.clone();
    let names = |joints: &[usize]| joints.iter().map(|&j| name(j)).collect::<Vec<_>>();
    if chains.len() < 4 {
        return Err(RobotInitError::TooFewLegs { chains: chains.iter().map(|(joints, _)| names(joints)).collect() });
    }
    let kin = at_zero(model);
    let position = |link: usize| model.frame(&tree.links[link].name).map(|frame| kin.p_WF(model, frame));
    if chains.len() > 4 {
        // The four lowest chains are the legs; the controller commands no other joints, such as those of an arm.
        let mut by_height = Vec::new();
        for (joints, end) in chains {
            by_height.push((position(foot_of(tree, tree.joints[end].child, &position)?)?.z, joints));
        }
        by_height.sort_by(|a, b| a.0.total_cmp(&b.0));
        let rest: Vec<usize> = by_height.iter().skip(4).flat_map(|(_, joints)| joints.clone()).collect();
        return Err(RobotInitError::OtherJoints { joints: names(&rest) });
    }
    let mut found = Vec::with_capacity(4);
    for (joints, end) in &chains {
        let Ok(three) = <[usize; 3]>::try_from(joints.as_slice()) else {
            return Err(RobotInitError::JointsOfLeg { joints: names(joints) });
        };
        if let Some(&joint) = three.iter().find(|&&j| tree.joints[j].kind == JointKind::Prismatic) {
            return Err(RobotInitError::Prismatic { joint: name(joint) });
        }
        let foot = foot_of(tree, tree.joints[*end].child, &position)?;
        let links = three.map(|j| tree.joints[j].child);
        if (position(foot)? - position(links[2])?).norm() < 1e-3 {
            return Err(RobotInitError::NoFoot { joint: name(*end), link: tree.links[foot].name.clone() });
        }
        let mut indices = [0; 3];
        for (index, j) in indices.iter_mut().zip(three) {
            *index = model.joint(&tree.joints[j].name)?.index();
        }
        found.push(FoundLeg { joints: indices, links, foot });
    }
    let legs = ordered(tree, found, &position)?;
    let (foot_radius, radius_because) = radius(tree, &legs, &mut look_at);
    let (imu, imu_because) = imu(tree, &mut look_at);
    Ok(FoundLegs { legs, foot_radius, imu, imu_because, radius_because, look_at })
}

/// Position of a link's origin with all joints at zero, m, by index of the link.
type Position<'a> = dyn Fn(usize) -> Result<Vector3<f64>, ModelError> + 'a;

/// Kinematics with all joints at zero and the base at the origin.
fn at_zero(model: &Model) -> Kinematics {
    let mut kin = Kinematics::new(model);
    kin.update(model, &BaseState::identity(), &vec![0.0; model.nj()], &vec![0.0; model.nj()]);
    kin
}

fn movable(tree: &UrdfTree, joint: usize) -> bool {
    tree.joints[joint].kind != JointKind::Fixed
}

fn children(tree: &UrdfTree, link: usize) -> impl Iterator<Item = usize> {
    (0..tree.joints.len()).filter(move |&j| tree.joints[j].parent == link)
}

fn movable_behind(tree: &UrdfTree, link: usize) -> bool {
    children(tree, link).any(|j| movable(tree, j) || movable_behind(tree, tree.joints[j].child))
}

/// Movable joints from the root to a link, root first.
fn chain(tree: &UrdfTree, link: usize) -> Vec<usize> {
    let (mut joints, mut at) = (Vec::new(), link);
    while let Some(joint) = tree.links[at].parent_joint {
        if movable(tree, joint) {
            joints.push(joint);
        }
        at = tree.joints[joint].parent;
    }
    joints.reverse();
    joints
}

/// The foot among the end links fixed behind a leg's last joint: a link with a sphere is preferred, then the farthest from the joint.
fn foot_of(tree: &UrdfTree, last: usize, position: &Position<'_>) -> Result<usize, ModelError> {
    let mut best = (false, -1.0, last);
    let mut open = vec![last];
    while let Some(link) = open.pop() {
        let behind: Vec<usize> = children(tree, link).map(|j| tree.joints[j].child).collect();
        if behind.is_empty() {
            let candidate = (sphere(tree, link).is_some(), (position(link)? - position(last)?).norm(), link);
            if (candidate.0, candidate.1) > (best.0, best.1) {
                best = candidate;
            }
        }
        open.extend(behind);
    }
    Ok(best.2)
}

/// Radius and offset of a link's first sphere; collision shapes are searched before visual ones.
fn sphere(tree: &UrdfTree, link: usize) -> Option<(f64, Vector3<f64>)> {
    let link = &tree.links[link];
    link.collisions.iter().chain(&link.visuals).find_map(|shape| match shape.kind {
        ShapeKind::Sphere { radius } => Some((radius, shape.X_LS.p)),
        _ => None,
    })
}

/// Orders legs as LF RF LH RH by the positions of their second joints; the first joints may all lie in the middle of the body.
fn ordered(tree: &UrdfTree, legs: Vec<FoundLeg>, position: &Position<'_>) -> Result<[FoundLeg; 4], RobotInitError> {
    let name = |leg: &FoundLeg| tree.links[leg.foot].name.clone();
    let hips = legs.iter().map(|leg| position(leg.links[1])).collect::<Result<Vec<_>, _>>()?;
    let middle = hips.iter().sum::<Vector3<f64>>() / 4.0;
    let mut corners: [Option<FoundLeg>; 4] = [const { None }; 4];
    for (leg, hip) in legs.into_iter().zip(&hips) {
        let corner = usize::from(hip.y < middle.y) + 2 * usize::from(hip.x < middle.x);
        if let Some(other) = &corners[corner] {
            return Err(RobotInitError::SameCorner {
                first: name(other),
                second: name(&leg),
                corner: ["left front", "right front", "left hind", "right hind"][corner],
            });
        }
        corners[corner] = Some(leg);
    }
    Ok(corners.map(|leg| leg.expect("four legs in four different corners")))
}

fn radius(tree: &UrdfTree, legs: &[FoundLeg; 4], look_at: &mut Vec<String>) -> (f64, &'static str) {
    let spheres: Vec<_> = legs.iter().map(|leg| sphere(tree, leg.foot)).collect();
    let Some((radius, offset)) = spheres[0] else {
        look_at.push(format!("robot.foot_radius: {} has no sphere", tree.links[legs[0].foot].name));
        return (FOOT_RADIUS, "a guess: the foot links have no sphere");
    };
    if spheres.iter().any(|sphere| sphere.is_none_or(|(r, _)| (r - radius).abs() > 1e-9)) {
        look_at.push("robot.foot_radius: the radii of the feet differ; this is the left front one".to_owned());
    }
    if offset.norm() > 1e-6 {
        let (name, distance) = (&tree.links[legs[0].foot].name, offset.norm());
        look_at.push(format!(
            "robot.feet: the centre of the sphere of {name} is {distance:.4} m from the link's origin; the controller assumes it at the origin"
        ));
    }
    (radius, "sphere of the foot link")
}

/// The first link that is fixed to the base and has `imu` in its name; otherwise the root link.
fn imu(tree: &UrdfTree, look_at: &mut Vec<String>) -> (usize, &'static str) {
    let named = |&link: &usize| tree.links[link].name.to_lowercase().contains("imu") && chain(tree, link).is_empty();
    match (0..tree.links.len()).find(named) {
        Some(link) => (link, "fixed to the base, with imu in its name"),
        None => {
            look_at.push(format!(
                "robot.imu_link: no link fixed to the base has `imu` in its name; the IMU is assumed to measure in the axes of {}",
                tree.links[0].name
            ));
            (0, "a guess: no link has imu in its name")
        }
    }
}
