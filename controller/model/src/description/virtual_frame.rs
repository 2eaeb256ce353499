//! A virtual frame: six joints without mass and without limits between a link and a frame that nothing is attached to. It belongs to the models of
//! controllers; neither simulator nor robot has it.

use super::RobotDescription;
use crate::bodies::Model;
use crate::error::ModelError;
use crate::pose::Pose;
use crate::tree::{Inertial, Joint, JointKind, Limits, Link, UrdfTree};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// A frame with six virtual joints to a link.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VirtualFrame {
    /// Name of the link of the frame. Its joints are this name with `_tx`, `_ty`, `_tz`, `_rx`, `_ry`, `_rz`, from the robot outward.
    pub name: String,
    /// Link of the robot to which the first joint is attached.
    pub link: String,
}

impl RobotDescription {
    /// The model with the joints of the virtual frame, after those of the robot; without a virtual frame, that of [`RobotDescription::model`].
    ///
    /// # Errors
    /// See [`RobotDescription::model`]; a link of the URDF that has the name of one of the frame.
    pub fn virtual_model(&self, tree: &UrdfTree) -> Result<Model, ModelError> {
        let Some(frame) = &self.virtual_frame else { return self.model(tree) };
        let mut tree = tree.clone();
        let mut parent = tree.links.iter().position(|link| link.name == frame.link).unwrap_or(0);
        for (suffix, kind, axis) in [
            ("tx", JointKind::Prismatic, Vector3::x()),
            ("ty", JointKind::Prismatic, Vector3::y()),
            ("tz", JointKind::Prismatic, Vector3::z()),
            ("rx", JointKind::Continuous, Vector3::x()),
            ("ry", JointKind::Continuous, Vector3::y()),
            ("rz", JointKind::Continuous, Vector3::z()),
        ] {
            let name = format!("{}_{suffix}", frame.name);
            let link = if suffix == "rz" { frame.name.clone() } else { name.clone() };
            let child = tree.links.len();
            tree.joints.push(Joint {
                name,
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
        self.model(&tree)
    }
}
