//! Content of a URDF: links, joints and shapes, checked and in topological order.

use nalgebra::{Matrix3, Vector3};

use super::error::ModelWarning;
use super::pose::Pose;

/// A URDF as a tree: one root; every other link has one parent.
#[derive(Debug, Clone, PartialEq)]
pub struct UrdfTree {
    /// Name of the robot.
    pub name: String,
    /// Name of the source, used in messages.
    pub source: String,
    /// Links in depth-first order from the root; children in the order of their joints in the file.
    pub links: Vec<Link>,
    /// Joints in the order of the file text.
    pub joints: Vec<Joint>,
    /// Elements of the file that are ignored.
    pub warnings: Vec<ModelWarning>,
}

/// One link: a rigid part with its own frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Unique name.
    pub name: String,
    /// Index in [`UrdfTree::joints`] of the joint to the parent link, `None` for the root.
    pub parent_joint: Option<usize>,
    /// Mass and inertia; zero if the file gives none.
    pub inertial: Inertial,
    /// Visual shapes.
    pub visuals: Vec<Shape>,
    /// Collision shapes.
    pub collisions: Vec<Shape>,
}

/// Mass, centre of mass and inertia of a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    /// Pose of the inertia axes in the link frame; the origin is the centre of mass.
    pub X_LC: Pose,
    /// Mass, kg.
    pub mass: f64,
    /// Rotational inertia about the centre of mass, in the inertia axes, kg m².
    pub I_C: Matrix3<f64>,
}

/// A geometric shape fixed to a link.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Pose of the shape in the link frame. The axis of a cylinder or capsule is z; its origin is the middle.
    pub X_LS: Pose,
    /// Kind and size.
    pub kind: ShapeKind,
}

/// Shapes of URDF; lengths in m.
#[derive(Debug, Clone, PartialEq)]
pub enum ShapeKind {
    /// Box, by its full edge lengths.
    Box {
        /// Along x, y, z.
        size: [f64; 3],
    },
    /// Cylinder.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Full length.
        length: f64,
    },
    /// Cylinder with a half sphere at each end.
    Capsule {
        /// Radius.
        radius: f64,
        /// Length of the cylindrical part.
        length: f64,
    },
    /// Sphere.
    Sphere {
        /// Radius.
        radius: f64,
    },
    /// Mesh file; only its name and scale are kept.
    Mesh {
        /// Name in the URDF.
        filename: String,
        /// Factors along x, y, z.
        scale: [f64; 3],
    },
}

/// Kind of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// No motion.
    Fixed,
    /// Rotation with position limits.
    Revolute,
    /// Rotation without position limits.
    Continuous,
    /// Translation with position limits.
    Prismatic,
}

impl JointKind {
    /// Name in the URDF.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fixed => "fixed",
            Self::Revolute => "revolute",
            Self::Continuous => "continuous",
            Self::Prismatic => "prismatic",
        }
    }
}

/// Limits of a movable joint, in rad, N m, rad/s (m, N, m/s for a prismatic joint); infinite if the file gives none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Smallest position.
    pub lower: f64,
    /// Largest position.
    pub upper: f64,
    /// Largest torque or force.
    pub effort: f64,
    /// Largest speed.
    pub velocity: f64,
}

impl Limits {
    /// No limits.
    pub const NONE: Self =
        Self { lower: f64::NEG_INFINITY, upper: f64::INFINITY, effort: f64::INFINITY, velocity: f64::INFINITY };
}

/// One joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Unique name.
    pub name: String,
    /// Kind.
    pub kind: JointKind,
    /// Index in [`UrdfTree::links`] of the parent link.
    pub parent: usize,
    /// Index in [`UrdfTree::links`] of the child link.
    pub child: usize,
    /// Pose of the child link in the parent link at position zero.
    pub X_PC: Pose,
    /// Axis: unit vector in the child link.
    pub axis: Vector3<f64>,
    /// Limits; [infinite](f64::INFINITY) for a fixed joint.
    pub limits: Limits,
    /// Viscous friction, N m s/rad or N s/m.
    pub damping: f64,
    /// Dry friction, N m or N.
    pub friction: f64,
}
