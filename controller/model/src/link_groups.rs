//! Groups the links of a tree into bodies: links that are connected by fixed joints.

use nalgebra::{Matrix3, Vector3};

use super::pose::Pose;
use super::tree::{Joint, JointKind, UrdfTree};

/// The links of a tree, grouped into bodies. Used by [`Model`](super::Model) and by the simulator's model.
#[derive(Debug, Clone)]
pub struct LinkGroups {
    /// For each body, its first link: the root of the tree, or the child link of a movable joint. Parents before children.
    pub first_links: Vec<usize>,
    /// For each link, its body.
    pub body_of_link: Vec<usize>,
    /// For each link, its pose in its body.
    pub X_BL: Vec<Pose>,
}

impl LinkGroups {
    /// Groups the links.
    ///
    /// - `R_LB`: for the movable joint of a body, the orientation of the body frame in the body's first link. Both have the same
    ///   origin. The body frame of the root is the root link's.
    pub fn new(tree: &UrdfTree, R_LB: impl Fn(&Joint) -> Matrix3<f64>) -> Self {
        let n = tree.links.len();
        let mut groups = LinkGroups {
            first_links: Vec::with_capacity(n),
            body_of_link: Vec::with_capacity(n),
            X_BL: Vec::with_capacity(n),
        };
        for (i, link) in tree.links.iter().enumerate() {
            let (body, X_BL) = match link.parent_joint.map(|joint| &tree.joints[joint]) {
                Some(joint) if joint.kind == JointKind::Fixed => {
                    (groups.body_of_link[joint.parent], groups.X_BL[joint.parent].then(&joint.X_PC))
                }
                joint => {
                    groups.first_links.push(i);
                    let R_LB = joint.map_or(Matrix3::identity(), &R_LB);
                    (groups.first_links.len() - 1, Pose { p: Vector3::zeros(), R: R_LB.transpose() })
                }
            };
            groups.body_of_link.push(body);
            groups.X_BL.push(X_BL);
        }
        groups
    }
}
