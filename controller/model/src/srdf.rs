//! SRDF: what a robot has besides its URDF in the files of ROS and Pinocchio: groups of joints, named postures, pairs of links that are not checked for
//! collisions, virtual and passive joints, end effectors.
//!
//! A group is the union of its elements, as in MoveIt: a `<joint>` is itself, a `<link>` is the joint above it, a `<chain>` is every joint between two
//! links, a `<group>` is all joints of another group. Only movable joints are kept.
//!
//! Public SRDFs name joints and links that the URDF beside them does not have, because several variants of a robot share one file. Such a name is a
//! [`SrdfWarning`], and what names it is left out. The joint between the world and the base is no joint of a model; it may be named, declared by a
//! `<virtual_joint>` or not.

mod content;
mod error;
mod groups;
mod lookup;
mod read;
mod resolve;

pub use content::{DisabledCollision, EndEffector, GroupState, Srdf, SrdfGroup, VirtualJoint, VirtualKind};
pub use error::{SrdfError, SrdfWarning};

use crate::tree::UrdfTree;

impl Srdf {
    /// Reads an SRDF.
    ///
    /// - `file`: name of the file, used in messages only.
    /// - `tree`: the URDF of the robot.
    ///
    /// Time and memory are bounded by limits on size, nesting, groups and their elements.
    ///
    /// # Errors
    /// A text that is not an SRDF or exceeds a limit, an element without an attribute or with one of another form, two groups of one name, groups that
    /// contain each other; see [`SrdfError`].
    pub fn parse(text: &str, file: &str, tree: &UrdfTree) -> Result<Self, SrdfError> {
        resolve::resolve(&read::read(text, file)?, file, tree)
    }
}
