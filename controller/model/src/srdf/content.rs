//! Content of an SRDF.

use super::error::SrdfWarning;
use std::collections::BTreeMap;

/// Content of an SRDF. All joints and links exist in the URDF with which it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Srdf {
    /// Name of the robot.
    pub name: String,
    /// Groups with at least one movable joint, in the order of the file.
    pub groups: Vec<SrdfGroup>,
    /// Named states, in the order of the file.
    pub states: Vec<GroupState>,
    /// Pairs of links that are not checked for collisions, in the order of the file; each pair once.
    pub disabled_collisions: Vec<DisabledCollision>,
    /// Joints between the base and the world.
    pub virtual_joints: Vec<VirtualJoint>,
    /// End effectors.
    pub end_effectors: Vec<EndEffector>,
    /// Movable joints without a drive, in the order of the file.
    pub passive_joints: Vec<String>,
    /// Elements of the file that are left out or unusual.
    pub warnings: Vec<SrdfWarning>,
}

/// A group of joints.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SrdfGroup {
    /// Unique name.
    pub name: String,
    /// Movable joints, in the order of the URDF.
    pub joints: Vec<String>,
    /// First and last link, if the joints are those between a link and a link below it.
    pub chain: Option<[String; 2]>,
}

/// Positions of some joints.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupState {
    /// Name; states of different groups may share it.
    pub name: String,
    /// Name of the group, empty if the file gives none.
    pub group: String,
    /// Movable joint -> position, rad or m. A position may be outside the limits of the joint.
    pub joints: BTreeMap<String, f64>,
}

/// A pair of links that is not checked for collisions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DisabledCollision {
    /// The two links.
    pub links: [String; 2],
    /// For example `Adjacent` or `Never`; empty if the file gives none.
    pub reason: String,
}

/// A joint between the base and the world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VirtualJoint {
    /// Name.
    pub name: String,
    /// Kind.
    pub kind: VirtualKind,
    /// Link of the robot.
    pub child_link: String,
}

/// How a virtual joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VirtualKind {
    /// Not at all.
    Fixed,
    /// In a plane.
    Planar,
    /// In six directions.
    Floating,
}

/// A group that is attached to a link, such as a gripper, or the link at the end of a limb.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EndEffector {
    /// Name.
    pub name: String,
    /// Link.
    pub parent_link: String,
    /// Name of the group, empty if the file gives none.
    pub group: String,
}
