//! From the elements of a URDF to its tree: order of the links, and the floating base.

use super::error::{ModelError, ModelWarning};
use super::read::{RawJoint, RawKind, RawLink, RawRobot, read};
use super::topology::Topology;
use super::tree::{Joint, JointKind, Link, UrdfTree};

impl UrdfTree {
    /// Reads a URDF. `source_name` is used in messages only.
    ///
    /// A floating joint between the world and the robot is the floating base: its child becomes the root. The world is the root link with what is
    /// fixed to it.
    ///
    /// Time and memory are bounded by limits on size, nesting, links and movable joints.
    ///
    /// # Errors
    /// If the text is not a URDF, exceeds a limit, its links do not form one tree, or a number is out of range; see [`ModelError`].
    pub fn parse(text: &str, source_name: &str) -> Result<Self, ModelError> {
        let mut robot = read(text, source_name)?;
        let mut topology = Topology::of(&robot, source_name)?;
        if drop_world(&mut robot, &topology, source_name)? {
            topology = Topology::of(&robot, source_name)?;
        }
        let RawRobot { name, links: raw_links, joints: raw_joints, mut warnings } = robot;

        let mut raw_links: Vec<Option<RawLink>> = raw_links.into_iter().map(Some).collect();
        let mut links = Vec::with_capacity(raw_links.len());
        let mut place = vec![0; raw_links.len()];
        for (to, &from) in topology.order.iter().enumerate() {
            place[from] = to;
            if let Some(RawLink { name, line: _, inertial, visuals, collisions }) = raw_links[from].take() {
                let parent_joint = topology.joint_above[from];
                links.push(Link { name, parent_joint, inertial, visuals, collisions });
            }
        }
        let mut joints = Vec::with_capacity(raw_joints.len());
        for (raw, &(parent, child)) in raw_joints.into_iter().zip(&topology.ends) {
            // `drop_world` leaves no floating joint.
            let RawKind::Tree(kind) = raw.kind else { continue };
            if let Some(leader) = raw.mimics {
                warnings.push(ModelWarning::MimicIgnored { joint: raw.name.clone(), leader });
            }
            joints.push(Joint {
                name: raw.name,
                kind,
                parent: place[parent],
                child: place[child],
                X_PC: raw.X_PC,
                axis: raw.axis,
                limits: raw.limits,
                damping: raw.damping,
                friction: raw.friction,
            });
        }
        Ok(Self { name, source: source_name.to_owned(), links, joints, warnings })
    }
}

/// Removes the floating joint above the base, its parent link and all links fixed to that: they represent the world. Returns whether there is one.
///
/// # Errors
/// [`ModelError::FloatingInside`] if another joint moves and is not below the floating joint, or a second joint is floating.
fn drop_world(robot: &mut RawRobot, topology: &Topology, file: &str) -> Result<bool, ModelError> {
    let is_floating = |joint: &RawJoint| joint.kind == RawKind::Floating;
    let above = |&link: &usize| topology.joint_above[link].filter(|&joint| is_floating(&robot.joints[joint]));
    let Some(base) = topology.order.iter().find_map(above) else { return Ok(false) };
    let inside = |joint: usize, other: usize| {
        let RawJoint { name, line, .. } = &robot.joints[joint];
        let (file, other) = (file.to_owned(), robot.joints[other].name.clone());
        Err(ModelError::FloatingInside { file, line: *line, joint: name.clone(), other })
    };
    // Whether a link is below the joint `base`.
    let mut keep = vec![false; robot.links.len()];
    for &link in &topology.order {
        let above = topology.joint_above[link];
        keep[link] = above == Some(base) || above.is_some_and(|joint| keep[topology.ends[joint].0]);
    }
    for (i, joint) in robot.joints.iter().enumerate() {
        if i != base && is_floating(joint) {
            return inside(i, base);
        }
        if i != base && joint.kind != RawKind::Tree(JointKind::Fixed) && !keep[topology.ends[i].1] {
            return inside(base, i);
        }
    }
    let world = robot.links.iter().zip(&keep).filter(|(_, keep)| !**keep);
    let (links, mass) = world.fold((0, 0.0), |(links, mass), (link, _)| (links + 1, mass + link.inertial.mass));
    let RawJoint { name, parent, .. } = &robot.joints[base];
    robot.warnings.push(ModelWarning::WorldIgnored { link: parent.clone(), joint: name.clone(), links, mass });
    let mut kept = keep.iter();
    robot.links.retain(|_| kept.next() == Some(&true));
    // A joint stays if its parent link does.
    let mut kept = topology.ends.iter().map(|&(parent, _)| keep[parent]);
    robot.joints.retain(|_| kept.next() == Some(true));
    Ok(true)
}
