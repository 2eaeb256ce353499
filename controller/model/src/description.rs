//! What a robot is besides its URDF: base, sensors, contacts, groups of joints, postures, roles and drives of its joints.
//!
//! A description is the table `[robot]` of the TOML file beside the URDF. It has one of two forms, which give the same [`RobotDescription`]:
//!
//! - any robot: `base`, `[[robot.imu]]`, `[[robot.force_torque]]`, `[[robot.contact]]`, `[[robot.group]]`, `[robot.postures.NAME]`,
//!   `[robot.joints.NAME]`, `[robot.disabled_collisions]`, `[robot.virtual_frame]`;
//! - a quadruped: `feet`, `foot_radius`, `imu_link`, `posture`, `lying`, `drives`. It is described as four point contacts and four legs, named LF RF
//!   LH RH, one IMU `imu`, and the postures `nominal` and `lying`. It may have further groups and postures.
//!
//! Names are checked against the URDF when a description is read, so a name that it contains can be used without a further check.

mod error;
mod file;
mod resolve;
mod virtual_frame;

pub use error::DescriptionError;

use crate::bodies::{Base, JointId, Model};
use crate::drive::DriveLimits;
use crate::error::ModelError;
use crate::names::near_names;
use crate::tree::UrdfTree;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Name of the posture in which a robot stands, and to which controllers for any robot move it.
pub const NOMINAL: &str = "nominal";

/// Description of a robot. All names are those of the URDF, or of the description itself.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotDescription {
    /// Name of the robot.
    pub name: String,
    /// Name of the TOML file, used in messages.
    pub file: String,
    /// File name of the URDF, in the folder of the TOML file.
    pub urdf: String,
    /// Whether the root link can move.
    pub base: Base,
    /// IMUs, in the order of the file.
    pub imus: Vec<Sensor>,
    /// Sensors of force and torque, in the order of the file.
    pub force_torque: Vec<Sensor>,
    /// Contacts, in the order of the file.
    pub contacts: Vec<Contact>,
    /// Groups, in the order of the file.
    pub groups: Vec<Group>,
    /// Named postures: joint -> position, rad or m. A posture may leave joints out.
    pub postures: BTreeMap<String, BTreeMap<String, f64>>,
    /// Role and drive of each movable joint, in the order of `q`.
    pub joints: Vec<JointDescription>,
    /// Pairs of links that need no check for collisions, such as neighbours: each pair once, the name that comes first in the alphabet first.
    pub disabled_collisions: BTreeSet<[String; 2]>,
    /// A frame with virtual joints, for models of controllers.
    pub virtual_frame: Option<VirtualFrame>,
}

/// An IMU or a sensor of force and torque: it measures at the origin and in the axes of a link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sensor {
    /// Unique name among the sensors of its kind.
    pub name: String,
    /// Link.
    pub link: String,
}

/// A part of a link that touches the environment.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// Unique name.
    pub name: String,
    /// Link. Its origin and axes are those of [`Contact::geometry`].
    pub link: String,
    /// Shape.
    pub geometry: ContactGeometry,
}

/// Shape of a contact in the axes of its link; lengths in m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum ContactGeometry {
    /// A sphere around the origin, such as a foot.
    Point {
        /// Radius; 0 for a point.
        radius: f64,
    },
    /// A wheel around the origin that rolls.
    Wheel {
        /// Radius.
        radius: f64,
        /// Axis of the wheel; a unit vector once it is read.
        axis: [f64; 3],
    },
    /// A rectangle in the plane z = 0 of the link, with the robot above it.
    Sole {
        /// Smallest and largest x.
        x: [f64; 2],
        /// Smallest and largest y.
        y: [f64; 2],
    },
    /// A sphere around the origin at the end of an arm. It may touch in any direction.
    Hand {
        /// Radius; 0 for a point.
        radius: f64,
    },
}

impl ContactGeometry {
    /// Number of force variables of the contact: 3, or 6 with moments for a sole.
    pub fn force_size(&self) -> usize {
        match self {
            Self::Point { .. } | Self::Wheel { .. } | Self::Hand { .. } => 3,
            Self::Sole { .. } => 6,
        }
    }
}

/// A named list of joints.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Unique name.
    pub name: String,
    /// Kind.
    pub kind: GroupKind,
    /// Movable joints; those of a chain from the root outward.
    pub joints: Vec<JointId>,
    /// Last link, for a group that is a chain to it.
    pub tip: Option<String>,
}

/// Kind of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GroupKind {
    /// A leg.
    Leg,
    /// An arm.
    Arm,
    /// Any other joints, such as a torso or a head.
    Chain,
}

/// A frame that travels with the robot, and six virtual joints between it and a link, for the models of controllers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VirtualFrame {
    /// Name of the link of the frame. Its joints are this name with `_tx`, `_ty`, `_tz`, `_rx`, `_ry`, `_rz`, from the robot outward.
    pub name: String,
    /// Link of the robot to which the first joint is attached.
    pub link: String,
}

/// Whether a joint has a drive and an encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointRole {
    /// A drive with an encoder.
    #[default]
    Actuated,
    /// An encoder without a drive.
    Passive,
    /// Neither: a joint of a model only, such as those of a virtual frame.
    Virtual,
}

/// Role and drive of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointDescription {
    /// Name in the URDF.
    pub name: String,
    /// Role.
    pub role: JointRole,
    /// Largest torque or force in the description, N m or N.
    pub effort: Option<f64>,
    /// Largest speed in the description, rad/s or m/s.
    pub velocity: Option<f64>,
    /// Stiffness of the drive's position loop, N m/rad or N/m.
    pub stiffness: Option<f64>,
    /// Damping of the drive's position loop, N m s/rad or N s/m.
    pub damping: Option<f64>,
    /// Limits that depend on the speed.
    pub drive: DriveLimits,
}

/// A limit of which description and URDF have different values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DriveDifference {
    /// The joint.
    pub joint: String,
    /// `effort` or `velocity`.
    pub quantity: String,
    /// Value of the URDF, N m, rad/s (N, m/s for a prismatic joint).
    pub urdf: f64,
    /// Value of the description, which is used.
    pub description: f64,
}

impl RobotDescription {
    /// Reads and checks the table `[robot]` of a TOML text.
    ///
    /// - `file`: name of the TOML file, used in messages only.
    /// - `tree`: the URDF of the robot.
    ///
    /// # Errors
    /// See [`DescriptionError`]; a URDF whose total mass is not finite is a [`DescriptionError::Parse`].
    pub fn from_toml(text: &str, file: &str, tree: &UrdfTree) -> Result<Self, DescriptionError> {
        resolve::resolve(file::read(text, file)?, file, tree)
    }

    /// The model of the URDF with the base and the drives of the description.
    ///
    /// # Errors
    /// See [`Model::new`]; a joint that the model does not have, if `tree` is not the URDF with which the description was read.
    pub fn model(&self, tree: &UrdfTree) -> Result<Model, ModelError> {
        let mut model = Model::new(tree, self.base)?;
        for joint in &self.joints {
            let at = model.joint(&joint.name)?.index();
            let info = &mut model.joints[at];
            info.effort = joint.effort.unwrap_or(info.effort);
            info.velocity = joint.velocity.unwrap_or(info.velocity);
            info.drive = joint.drive;
        }
        Ok(model)
    }

    /// The model with the joints of the virtual frame, after those of the robot; without a virtual frame, that of [`RobotDescription::model`].
    ///
    /// # Errors
    /// See [`RobotDescription::model`].
    pub fn virtual_model(&self, tree: &UrdfTree) -> Result<Model, ModelError> {
        match &self.virtual_frame {
            Some(VirtualFrame { name, link }) => self.model(&virtual_frame::extended(tree, name, link)),
            None => self.model(tree),
        }
    }

    /// The limits of which the URDF has another value. A limit that the URDF does not have is no difference.
    pub fn differences(&self, tree: &UrdfTree) -> Vec<DriveDifference> {
        let mut found = Vec::new();
        for joint in &self.joints {
            let Some(urdf) = tree.joints.iter().find(|other| other.name == joint.name) else { continue };
            for (quantity, urdf, description) in
                [("effort", urdf.limits.effort, joint.effort), ("velocity", urdf.limits.velocity, joint.velocity)]
            {
                if let Some(description) = description.filter(|value| urdf.is_finite() && *value != urdf) {
                    let (joint, quantity) = (joint.name.clone(), quantity.to_owned());
                    found.push(DriveDifference { joint, quantity, urdf, description });
                }
            }
        }
        found
    }

    /// Finds a contact.
    ///
    /// # Errors
    /// [`DescriptionError::Unknown`], with names close to it.
    pub fn contact(&self, name: &str) -> Result<&Contact, DescriptionError> {
        let names = self.contacts.iter().map(|contact| contact.name.as_str());
        self.contacts.iter().find(|contact| contact.name == name).ok_or_else(|| self.unknown("contact", name, names))
    }

    /// Finds a group.
    ///
    /// # Errors
    /// [`DescriptionError::Unknown`], with names close to it.
    pub fn group(&self, name: &str) -> Result<&Group, DescriptionError> {
        let names = self.groups.iter().map(|group| group.name.as_str());
        self.groups.iter().find(|group| group.name == name).ok_or_else(|| self.unknown("group", name, names))
    }

    /// Finds a posture.
    ///
    /// # Errors
    /// [`DescriptionError::Unknown`], with names close to it.
    pub fn posture(&self, name: &str) -> Result<&BTreeMap<String, f64>, DescriptionError> {
        let names = self.postures.keys().map(String::as_str);
        self.postures.get(name).ok_or_else(|| self.unknown("posture", name, names))
    }

    /// The joints of a role, in the order of `q`.
    pub fn joints_of(&self, role: JointRole) -> impl Iterator<Item = &JointDescription> {
        self.joints.iter().filter(move |joint| joint.role == role)
    }

    fn unknown<'a>(&self, what: &'static str, name: &str, names: impl Iterator<Item = &'a str>) -> DescriptionError {
        let (file, key, near) = (self.file.clone(), "robot".to_owned(), near_names(name, names));
        DescriptionError::Unknown { file, key, what, name: name.to_owned(), near }
    }
}
