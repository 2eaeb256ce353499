//! Content of a URDF: links, joints and shapes, checked and in topological order.

use nalgebra::{Matrix3, Vector3};

use super::error::{ModelError, ModelWarning};
use super::pose::Pose;
use super::read::{RawJoint, RawKind, RawLink, RawRobot, read};
use super::topology::Topology;

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
