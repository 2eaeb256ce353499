//! Content of a URDF: links, joints and shapes, checked and in topological order.

use nalgebra::{Matrix3, Vector3};

use super::error::{ModelError, ModelWarning};
use super::locate::{first_bad_element, has_limit};
use super::pose::Pose;
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
    /// Mesh file; only its name is kept.
    Mesh {
        /// Name in the URDF.
        filename: String,
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
    const NONE: Self =
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
    /// # Errors
    /// If the text is not a URDF, its links do not form one tree, or a number is out of range; see [`ModelError`].
    pub fn parse(text: &str, source_name: &str) -> Result<Self, ModelError> {
        let file = || source_name.to_owned();
        let robot = urdf_rs::read_from_string(text).map_err(|error| match first_bad_element(text) {
            Some((element, reason)) => ModelError::BadElement { file: file(), element, reason },
            None => ModelError::NotUrdf { file: file(), reason: error.to_string() },
        })?;
        let topology = Topology::of(&robot, source_name)?;

        let mut links = Vec::with_capacity(robot.links.len());
        for &i in &topology.order {
            links.push(read_link(&robot.links[i], topology.joint_above[i], source_name)?);
        }
        let mut place = vec![0; links.len()];
        for (to, &from) in topology.order.iter().enumerate() {
            place[from] = to;
        }
        let mut joints = Vec::with_capacity(robot.joints.len());
        let mut warnings = Vec::new();
        for (joint, &(parent, child)) in robot.joints.iter().zip(&topology.ends) {
            let limited = joint.limit != urdf_rs::JointLimit::default() || has_limit(text, &joint.name);
            joints.push(read_joint(joint, place[parent], place[child], limited, source_name)?);
            if let Some(mimic) = &joint.mimic {
                warnings.push(ModelWarning::MimicIgnored { joint: joint.name.clone(), leader: mimic.joint.clone() });
            }
        }
        Ok(Self { name: robot.name, source: file(), links, joints, warnings })
    }
}

fn read_link(link: &urdf_rs::Link, parent_joint: Option<usize>, file: &str) -> Result<Link, ModelError> {
    let check = Check { file, element: format!("link \"{}\"", link.name) };
    let i = &link.inertial.inertia;
    check.all_finite("inertia", &[i.ixx, i.iyy, i.izz, i.ixy, i.ixz, i.iyz])?;
    let inertial = Inertial {
        X_LC: check.pose("inertial origin", &link.inertial.origin)?,
        mass: check.not_negative("mass", link.inertial.mass.value)?,
        I_C: Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz),
    };
    let visuals = link.visual.iter().map(|v| read_shape(&v.origin, &v.geometry, &check)).collect::<Result<_, _>>()?;
    let collisions =
        link.collision.iter().map(|c| read_shape(&c.origin, &c.geometry, &check)).collect::<Result<_, _>>()?;
    Ok(Link { name: link.name.clone(), parent_joint, inertial, visuals, collisions })
}

fn read_shape(origin: &urdf_rs::Pose, geometry: &urdf_rs::Geometry, check: &Check) -> Result<Shape, ModelError> {
    let length = |quantity, value| check.positive(quantity, value);
    let kind = match geometry {
        urdf_rs::Geometry::Box { size } => ShapeKind::Box {
            size: [length("box size", size[0])?, length("box size", size[1])?, length("box size", size[2])?],
        },
        urdf_rs::Geometry::Cylinder { radius, length: l } => {
            ShapeKind::Cylinder { radius: length("cylinder radius", *radius)?, length: length("cylinder length", *l)? }
        }
        urdf_rs::Geometry::Capsule { radius, length: l } => {
            ShapeKind::Capsule { radius: length("capsule radius", *radius)?, length: length("capsule length", *l)? }
        }
        urdf_rs::Geometry::Sphere { radius } => ShapeKind::Sphere { radius: length("sphere radius", *radius)? },
        urdf_rs::Geometry::Mesh { filename, .. } => ShapeKind::Mesh { filename: filename.clone() },
    };
    Ok(Shape { X_LS: check.pose("shape origin", origin)?, kind })
}

fn read_joint(
    joint: &urdf_rs::Joint,
    parent: usize,
    child: usize,
    limited: bool,
    file: &str,
) -> Result<Joint, ModelError> {
    let check = Check { file, element: format!("joint \"{}\"", joint.name) };
    let kind = match joint.joint_type {
        urdf_rs::JointType::Fixed => JointKind::Fixed,
        urdf_rs::JointType::Revolute => JointKind::Revolute,
        urdf_rs::JointType::Continuous => JointKind::Continuous,
        urdf_rs::JointType::Prismatic => JointKind::Prismatic,
        urdf_rs::JointType::Floating => return Err(check.unsupported(&joint.name, "floating")),
        urdf_rs::JointType::Planar => return Err(check.unsupported(&joint.name, "planar")),
        urdf_rs::JointType::Spherical => return Err(check.unsupported(&joint.name, "spherical")),
    };
    let (damping, friction) = joint.dynamics.as_ref().map_or((0.0, 0.0), |d| (d.damping, d.friction));
    Ok(Joint {
        name: joint.name.clone(),
        kind,
        parent,
        child,
        X_PC: check.pose("origin", &joint.origin)?,
        axis: if kind == JointKind::Fixed { Vector3::z() } else { check.unit_axis(*joint.axis.xyz)? },
        limits: read_limits(joint, kind, limited, &check)?,
        damping: check.not_negative("damping", damping)?,
        friction: check.not_negative("friction", friction)?,
    })
}

fn read_limits(joint: &urdf_rs::Joint, kind: JointKind, limited: bool, check: &Check) -> Result<Limits, ModelError> {
    let l = &joint.limit;
    match kind {
        JointKind::Fixed => return Ok(Limits::NONE),
        JointKind::Continuous if !limited => return Ok(Limits::NONE),
        _ if !limited => {
            return Err(ModelError::MissingLimits { file: check.file.to_owned(), joint: joint.name.clone() });
        }
        _ => {}
    }
    let effort = check.limit("effort limit", l.effort)?;
    let velocity = check.limit("velocity limit", l.velocity)?;
    if kind == JointKind::Continuous {
        return Ok(Limits { effort, velocity, ..Limits::NONE });
    }
    if l.lower <= l.upper {
        return Ok(Limits { lower: l.lower, upper: l.upper, effort, velocity });
    }
    Err(check.bad("position range", format!("[{}, {}]", l.lower, l.upper), "lower <= upper"))
}

/// Checks numbers of one element; errors name the file and the element.
struct Check<'a> {
    file: &'a str,
    element: String,
}

impl Check<'_> {
    fn bad(&self, quantity: &'static str, found: String, expected: &'static str) -> ModelError {
        ModelError::BadNumber { file: self.file.to_owned(), element: self.element.clone(), quantity, found, expected }
    }

    fn unsupported(&self, joint: &str, found: &str) -> ModelError {
        ModelError::UnsupportedJoint { file: self.file.to_owned(), joint: joint.to_owned(), found: found.to_owned() }
    }

    fn all_finite(&self, quantity: &'static str, values: &[f64]) -> Result<(), ModelError> {
        match values.iter().find(|value| !value.is_finite()) {
            Some(value) => Err(self.bad(quantity, value.to_string(), "a finite number")),
            None => Ok(()),
        }
    }

    fn not_negative(&self, quantity: &'static str, value: f64) -> Result<f64, ModelError> {
        if value.is_finite() && value >= 0.0 {
            Ok(value)
        } else {
            Err(self.bad(quantity, value.to_string(), "a finite number >= 0"))
        }
    }

    fn positive(&self, quantity: &'static str, value: f64) -> Result<f64, ModelError> {
        if value.is_finite() && value > 0.0 {
            Ok(value)
        } else {
            Err(self.bad(quantity, value.to_string(), "a finite number > 0"))
        }
    }

    /// Infinity is allowed: no limit.
    fn limit(&self, quantity: &'static str, value: f64) -> Result<f64, ModelError> {
        if value >= 0.0 { Ok(value) } else { Err(self.bad(quantity, value.to_string(), "a number >= 0")) }
    }

    fn pose(&self, quantity: &'static str, origin: &urdf_rs::Pose) -> Result<Pose, ModelError> {
        self.all_finite(quantity, &*origin.xyz)?;
        self.all_finite(quantity, &*origin.rpy)?;
        Ok(Pose::from_xyz_rpy(*origin.xyz, *origin.rpy))
    }

    fn unit_axis(&self, axis: [f64; 3]) -> Result<Vector3<f64>, ModelError> {
        self.all_finite("axis", &axis)?;
        let norm = (axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]).sqrt();
        // Outside this range the squares underflow or overflow.
        if !(1e-100..1e100).contains(&norm) {
            return Err(self.bad("axis", format!("{axis:?}"), "a vector with a direction"));
        }
        Ok(Vector3::new(axis[0] / norm, axis[1] / norm, axis[2] / norm))
    }
}
