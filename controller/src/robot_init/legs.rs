//! Finds legs, feet and IMU of a quadruped in the tree of its URDF, without relying on names of links and joints.

use super::RobotInitError;
use crate::model::{BaseState, JointKind, Kinematics, Model, ShapeKind, UrdfTree};
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

/// The movable joints that are not part of a leg, as indices in [`UrdfTree::joints`]. A leg is the first three joints of one of the four
/// lowest chains, not counting those of the body. The joints below the third one, such as that of a wheel, all other chains, such as an arm, and
/// the joints of the body, such as a waist, are outside.
///
/// # Errors
/// Fewer than four chains.
pub(super) fn outside(tree: &UrdfTree, model: &Model) -> Result<Vec<usize>, RobotInitError> {
    let p_WL = positions_at_zero(model);
    let links = Links::new(tree);
    let mut chains: Vec<(bool, f64, Vec<usize>)> = Vec::new();
    let mut is_known = vec![false; tree.joints.len()];
    for joints in without_body(&links.chains(tree)) {
        let third = joints[joints.len().min(3) - 1];
        // Chains that fork below the third joint are one leg.
        if std::mem::replace(&mut is_known[third], true) {
            continue;
        }
        let subtree = links.subtree(tree.joints[third].child);
        let lowest = subtree.into_iter().map(|link| p_WL[link].z).fold(f64::INFINITY, f64::min);
        // A chain too short for a leg counts as one only if there are no others.
        chains.push((joints.len() < 3, lowest, joints));
    }
    if chains.len() < 4 {
        let names =
            |(.., joints): (bool, f64, Vec<usize>)| joints.iter().map(|&j| tree.joints[j].name.clone()).collect();
        return Err(RobotInitError::TooFewLegs { chains: chains.into_iter().map(names).collect() });
    }
    chains.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut is_leg = vec![false; tree.joints.len()];
    for (.., joints) in chains.iter().take(4) {
        joints.iter().take(3).for_each(|&joint| is_leg[joint] = true);
    }
    Ok((0..tree.joints.len()).filter(|&joint| movable(tree, joint) && !is_leg[joint]).collect())
}

/// Finds the legs of a tree whose movable joints are those of the legs.
///
/// # Errors
/// Anything but four chains of three revolute joints from the base to a foot, one in each corner of the body.
pub(super) fn find(tree: &UrdfTree, model: &Model) -> Result<FoundLegs, RobotInitError> {
    let mut look_at = Vec::new();
    let links = Links::new(tree);
    let chains = links.chains(tree);
    let name = |joint: usize| tree.joints[joint].name.clone();
    let names = |joints: &[usize]| joints.iter().map(|&j| name(j)).collect::<Vec<_>>();
    let p_WL = positions_at_zero(model);
    let mut found = Vec::with_capacity(4);
    for joints in &chains {
        let Ok(three) = <[usize; 3]>::try_from(joints.as_slice()) else {
            return Err(RobotInitError::JointsOfLeg { joints: names(joints) });
        };
        if let Some(&joint) = three.iter().find(|&&j| tree.joints[j].kind == JointKind::Prismatic) {
            return Err(RobotInitError::Prismatic { joint: name(joint) });
        }
        let children = three.map(|j| tree.joints[j].child);
        let foot = foot_of(tree, &links, children[2], &p_WL);
        let offset = sphere(tree, foot).map_or(0.0, |(_, offset)| offset.norm());
        if (p_WL[foot] - p_WL[children[2]]).norm() < 1e-3 && offset < 1e-3 {
            return Err(RobotInitError::NoFoot { joint: name(three[2]), link: tree.links[foot].name.clone() });
        }
        let mut indices = [0; 3];
        for (index, j) in indices.iter_mut().zip(three) {
            *index = model.joint(&tree.joints[j].name)?.index();
        }
        found.push(FoundLeg { joints: indices, links: children, foot });
    }
    if found.len() != 4 {
        return Err(RobotInitError::TooFewLegs { chains: chains.iter().map(|joints| names(joints)).collect() });
    }
    let legs = ordered(tree, found, &p_WL)?;
    let (foot_radius, radius_because) = radius(tree, &legs, &mut look_at);
    let (imu, imu_because) = imu(tree, &mut look_at);
    Ok(FoundLegs { legs, foot_radius, imu, imu_because, radius_because, look_at })
}

/// The chains without the joints of the body: those that two chains share before each goes on with the three joints of a leg.
fn without_body(chains: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let body_of = |chain: &[usize]| {
        let shared = chains.iter().map(|other| chain.iter().zip(other).take_while(|(a, b)| a == b).count());
        let goes_on = |(n, other): (usize, &Vec<usize>)| (chain.len().min(other.len()) >= n + 3).then_some(n);
        shared.zip(chains).filter_map(goes_on).max().unwrap_or(0)
    };
    chains.iter().map(|chain| chain[body_of(chain)..].to_vec()).collect()
}

/// The joints below each link, and whether a movable joint is among all joints below it.
struct Links {
    joints: Vec<Vec<usize>>,
    children: Vec<Vec<usize>>,
    movable_below: Vec<bool>,
}

impl Links {
    fn new(tree: &UrdfTree) -> Self {
        let n = tree.links.len();
        let mut links =
            Links { joints: vec![Vec::new(); n], children: vec![Vec::new(); n], movable_below: vec![false; n] };
        for (j, joint) in tree.joints.iter().enumerate() {
            links.joints[joint.parent].push(j);
            links.children[joint.parent].push(joint.child);
        }
        // Parents come before their children.
        for link in (0..n).rev() {
            links.movable_below[link] =
                links.joints[link].iter().any(|&j| movable(tree, j) || links.movable_below[tree.joints[j].child]);
        }
        links
    }

    /// The chains of movable joints from the root to each movable joint that has no movable joint below it, in the order of the file.
    fn chains(&self, tree: &UrdfTree) -> Vec<Vec<usize>> {
        let is_end = |&j: &usize| movable(tree, j) && !self.movable_below[tree.joints[j].child];
        (0..tree.joints.len()).filter(is_end).map(|end| chain(tree, tree.joints[end].child)).collect()
    }

    /// A link and its descendants, parents first.
    fn subtree(&self, link: usize) -> Vec<usize> {
        let (mut found, mut open) = (Vec::new(), vec![link]);
        while let Some(link) = open.pop() {
            found.push(link);
            open.extend(&self.children[link]);
        }
        found
    }
}

/// Position of the origin of each link with all joints at zero and the base at the origin, m.
fn positions_at_zero(model: &Model) -> Vec<Vector3<f64>> {
    let mut kin = Kinematics::new(model);
    kin.update(model, &BaseState::identity(), &vec![0.0; model.nj()], &vec![0.0; model.nj()]);
    model.frames().map(|(frame, _)| kin.p_WF(model, frame)).collect()
}

fn movable(tree: &UrdfTree, joint: usize) -> bool {
    tree.joints[joint].kind != JointKind::Fixed
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

/// The foot of a leg, among the links without children below its last joint: a link with a sphere is preferred, then the farthest from the joint.
fn foot_of(tree: &UrdfTree, links: &Links, last: usize, p_WL: &[Vector3<f64>]) -> usize {
    let mut best = (false, -1.0, last);
    for link in links.subtree(last).into_iter().filter(|&link| links.children[link].is_empty()) {
        let candidate = (sphere(tree, link).is_some(), (p_WL[link] - p_WL[last]).norm(), link);
        if (candidate.0, candidate.1) > (best.0, best.1) {
            best = candidate;
        }
    }
    best.2
}

/// Radius and offset of a link's first sphere, or of its first flat cylinder, a wheel; collision shapes are searched before visual ones.
pub(super) fn sphere(tree: &UrdfTree, link: usize) -> Option<(f64, Vector3<f64>)> {
    let link = &tree.links[link];
    link.collisions.iter().chain(&link.visuals).find_map(|shape| match shape.kind {
        ShapeKind::Sphere { radius } => Some((radius, shape.X_LS.p)),
        ShapeKind::Cylinder { radius, length } if length < 2.0 * radius => Some((radius, shape.X_LS.p)),
        _ => None,
    })
}

/// Orders legs as LF RF LH RH by the positions of their second joints; the first joints may all lie in the middle of the body.
fn ordered(tree: &UrdfTree, legs: Vec<FoundLeg>, p_WL: &[Vector3<f64>]) -> Result<[FoundLeg; 4], RobotInitError> {
    let name = |leg: &FoundLeg| tree.links[leg.foot].name.clone();
    let hips: Vec<_> = legs.iter().map(|leg| p_WL[leg.links[1]]).collect();
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
    let Some((radius, _)) = spheres[0] else {
        look_at.push(format!("robot.foot_radius: {} has no sphere", tree.links[legs[0].foot].name));
        return (FOOT_RADIUS, "a guess: the foot links have no sphere");
    };
    if spheres.iter().any(|sphere| sphere.is_none_or(|(r, _)| (r - radius).abs() > 1e-9)) {
        look_at.push("robot.foot_radius: the radii of the feet differ; this is the left front one".to_owned());
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Base;

    const ROBOT: &str = "<robot name=\"hyq\">";

    /// A gripper of two joints on a foot, first in the file: each leg keeps its three joints, and only the gripper is outside.
    #[test]
    fn a_chain_that_forks_below_its_third_joint_is_one_leg() {
        let finger = |name: &str| {
            format!(
                "<link name=\"{name}\"/><joint name=\"{name}_joint\" type=\"continuous\"><parent link=\"lf_foot\"/><child link=\"{name}\"/></joint>"
            )
        };
        let hyq = include_str!("../../../robots/hyq/hyq.urdf");
        let text = hyq.replace(ROBOT, &format!("{ROBOT}{}{}", finger("left"), finger("right")));
        let tree = UrdfTree::parse(&text, "forked.urdf").unwrap();
        let outside = outside(&tree, &Model::new(&tree, Base::Floating).unwrap()).unwrap();
        let names: Vec<_> = outside.into_iter().map(|j| tree.joints[j].name.as_str()).collect();
        assert_eq!(names, ["left_joint", "right_joint"]);
    }

    /// The front legs are behind a waist: it is outside, and they keep their first joints.
    #[test]
    fn a_joint_that_two_legs_share_is_part_of_the_body() {
        let hyq = include_str!("../../../robots/hyq/hyq.urdf");
        let waist = "<link name=\"front\"/><joint name=\"waist\" type=\"continuous\"><parent link=\"trunk\"/><child link=\"front\"/></joint>";
        let mut text = hyq.replace(ROBOT, &format!("{ROBOT}{waist}"));
        for leg in ["lf", "rf"] {
            let joint = format!("<joint name=\"{leg}_haa_joint\"");
            let (before, after) = text.split_once(&joint).unwrap();
            text = format!("{before}{joint}{}", after.replacen("parent link=\"trunk\"", "parent link=\"front\"", 1));
        }
        let tree = UrdfTree::parse(&text, "waist.urdf").unwrap();
        let outside = outside(&tree, &Model::new(&tree, Base::Floating).unwrap()).unwrap();
        assert_eq!(outside.into_iter().map(|j| tree.joints[j].name.as_str()).collect::<Vec<_>>(), ["waist"]);
    }
}
