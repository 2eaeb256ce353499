//! A virtual frame: six joints without mass and without limits between a link and a frame that nothing is attached to. It belongs to the models of
//! controllers; neither simulator nor robot has it.

use crate::pose::Pose;
use crate::tree::{Inertial, Joint, JointKind, Limits, Link, UrdfTree};
use nalgebra::{Matrix3, Vector3};

/// Adds the six joints to a tree.
///
/// - `name`: link of the frame, and the beginning of the joints' names.
/// - `link`: link to which the first joint is attached.
pub(super) fn extended(tree: &UrdfTree, name: &str, link: &str) -> UrdfTree {
    let mut tree = tree.clone();
    let mut parent = tree.links.iter().position(|other| other.name == link).unwrap_or(0);
    for (suffix, kind, axis) in [
        ("tx", JointKind::Prismatic, Vector3::x()),
        ("ty", JointKind::Prismatic, Vector3::y()),
        ("tz", JointKind::Prismatic, Vector3::z()),
        ("rx", JointKind::Continuous, Vector3::x()),
        ("ry", JointKind::Continuous, Vector3::y()),
        ("rz", JointKind::Continuous, Vector3::z()),
    ] {
        let joint = format!("{name}_{suffix}");
        let link = if suffix == "rz" { name.to_owned() } else { joint.clone() };
        let child = tree.links.len();
        tree.joints.push(Joint {
            name: joint,
            kind,
            parent,
            child,
            X_PC: Pose::identity(),
            axis,
            limits: Limits::NONE,
            damping: 0.0,
            friction: 0.0,
        });
        tree.links.push(Link {
            name: link,
            parent_joint: Some(tree.joints.len() - 1),
            inertial: Inertial { X_LC: Pose::identity(), mass: 0.0, I_C: Matrix3::zeros() },
            visuals: Vec::new(),
            collisions: Vec::new(),
        });
        parent = child;
    }
    tree
}
