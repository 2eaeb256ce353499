//! The model: one array of movable bodies; links behind fixed joints are merged into them and stay available as frames.

use super::drive::DriveLimits;
use nalgebra::{Matrix3, Vector3};

use super::error::{ModelError, ModelWarning};
use super::inertia::SpatialInertia;
use super::link_groups::LinkGroups;
use super::names::near_names;
use super::pose::Pose;
use super::tree::{JointKind, Limits, UrdfTree};
use crate::math::z_onto;

/// Gravitational acceleration along -z of W, m/s².
pub const GRAVITY: f64 = 9.81;

/// Whether the root link can move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Base {
    /// Six degrees of freedom, not actuated.
    Floating,
    /// Fixed to W.
    Fixed,
}

/// Identifies a movable joint: its index in `q`, `qd` and `tau`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct JointId(usize);

impl JointId {
    /// Index in `q`, `qd`, `tau`, `0..nj`.
    #[inline]
    pub fn index(self) -> usize {
        self.0
    }
}

/// Identifies a frame fixed to a body; every link has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct FrameId(usize);

impl FrameId {
    /// Index among the links of the tree, `0..nf`.
    #[inline]
    pub fn index(self) -> usize {
        self.0
    }
}

/// Name, kind and limits of a movable joint.
#[derive(Debug, Clone, PartialEq)]
pub struct JointInfo {
    /// Name in the URDF.
    pub name: String,
    /// Never [`JointKind::Fixed`].
    pub kind: JointKind,
    /// Smallest position, rad or m; -infinity for a continuous joint.
    pub lower: f64,
    /// Largest position, rad or m; infinity for a continuous joint.
    pub upper: f64,
    /// Largest torque or force, N m or N.
    pub effort: f64,
    /// Largest speed, rad/s or m/s.
    pub velocity: f64,
    /// Limits of the drive that depend on the speed; a URDF has none. See [`JointInfo::torque_range`].
    pub drive: DriveLimits,
    /// Viscous friction, N m s/rad or N s/m. Not part of `h`: the robot's drives compensate it, and the simulator applies it.
    pub damping: f64,
}

/// Motion of a body relative to its parent: about or along z of its own frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Motion {
    Rotation,
    Translation,
}

/// Links that are fixed to each other, and the joint that moves them.
///
/// The z axis of the body frame is the axis of the joint. A rotation then changes only two columns of the rotation matrix, and the
/// third column is the joint axis in W. The frame of the link differs by a constant rotation (see [`FrameOnBody`]).
#[derive(Debug, Clone)]
pub(super) struct Body {
    /// Index of the parent body; 0 for the root itself.
    pub(super) parent: usize,
    pub(super) motion: Motion,
    /// Index of the joint in `q` and `qd`.
    pub(super) i_q: usize,
    /// Index of the joint in `v`.
    pub(super) i_v: usize,
    /// Pose of this body in its parent at position zero.
    pub(super) X_PB: Pose,
    pub(super) m: f64,
    /// Centre of mass in the body, m.
    pub(super) c: Vector3<f64>,
    /// About the centre of mass, in body axes, kg m².
    pub(super) I_C: Matrix3<f64>,
}

/// Frame of a link: its body, and its constant pose there.
#[derive(Debug, Clone)]
pub(super) struct FrameOnBody {
    pub(super) name: String,
    pub(super) body: usize,
    /// Pose of the link in the body.
    pub(super) X_BL: Pose,
}

/// Rigid-body model of a robot.
#[derive(Debug, Clone)]
pub struct Model {
    /// Name of the robot in the URDF.
    pub name: String,
    /// Movable joints, in the order of the file text.
    pub joints: Vec<JointInfo>,
    /// Unusual properties of the description that are not errors.
    pub warnings: Vec<ModelWarning>,
    base: Base,
    total_mass: f64,
    /// Parents before children, each subtree contiguous; 0 is the root.
    pub(super) bodies: Vec<Body>,
    pub(super) frames: Vec<FrameOnBody>,
}

impl Model {
    /// Builds the model of a URDF; merges links that are fixed to each other.
    ///
    /// # Errors
    /// [`ModelError::BadMass`] if the total mass is not finite, or zero with a floating base.
    pub fn new(tree: &UrdfTree, base: Base) -> Result<Self, ModelError> {
        let nb = match base {
            Base::Floating => 6,
            Base::Fixed => 0,
        };
        let mut place_in_q = vec![usize::MAX; tree.joints.len()];
        let mut joints = Vec::new();
        for (place, joint) in place_in_q.iter_mut().zip(&tree.joints) {
            if joint.kind == JointKind::Fixed {
                continue;
            }
            *place = joints.len();
            let Limits { lower, upper, effort, velocity } = joint.limits;
            joints.push(JointInfo {
                name: joint.name.clone(),
                kind: joint.kind,
                lower,
                upper,
                effort,
                velocity,
                drive: DriveLimits::default(),
                damping: joint.damping,
            });
        }

        let groups = LinkGroups::new(tree, |joint| z_onto(&joint.axis));
        let mut bodies = Vec::with_capacity(groups.first_links.len());
        for &first_link in &groups.first_links {
            let (parent, X_PB, motion, i_q, i_v) = match tree.links[first_link].parent_joint {
                None => (0, Pose::identity(), Motion::Translation, usize::MAX, usize::MAX),
                Some(j) => {
                    let joint = &tree.joints[j];
                    let X_LB = Pose { p: Vector3::zeros(), R: z_onto(&joint.axis) };
                    let X_PB = groups.X_BL[joint.parent].then(&joint.X_PC).then(&X_LB);
                    let motion =
                        if joint.kind == JointKind::Prismatic { Motion::Translation } else { Motion::Rotation };
                    (groups.body_of_link[joint.parent], X_PB, motion, place_in_q[j], nb + place_in_q[j])
                }
            };
            bodies.push(Body { parent, motion, i_q, i_v, X_PB, m: 0.0, c: Vector3::zeros(), I_C: Matrix3::zeros() });
        }
        let mut inertias = vec![SpatialInertia::zero(); bodies.len()];
        let mut frames: Vec<FrameOnBody> = Vec::with_capacity(tree.links.len());
        let mut total_mass = 0.0;
        for (link, (&body, X_BL)) in tree.links.iter().zip(groups.body_of_link.iter().zip(&groups.X_BL)) {
            let X_BC = X_BL.then(&link.inertial.X_LC);
            let I_C = X_BC.R * link.inertial.I_C * X_BC.R.transpose();
            inertias[body] += SpatialInertia::from_com(link.inertial.mass, X_BC.p, &I_C);
            total_mass += link.inertial.mass;
            frames.push(FrameOnBody { name: link.name.clone(), body, X_BL: *X_BL });
        }

        if !total_mass.is_finite() || (base == Base::Floating && total_mass == 0.0) {
            let (file, robot) = (tree.source.clone(), tree.name.clone());
            return Err(ModelError::BadMass { file, robot, found: total_mass });
        }
        let mut warnings = tree.warnings.clone();
        for (i, (body, inertia)) in bodies.iter_mut().zip(&inertias).enumerate() {
            (body.c, body.I_C) = inertia.about_com();
            body.m = inertia.m;
            let link = &tree.links[groups.first_links[i]];
            if let (Some(joint), true) = (link.parent_joint, body.m == 0.0) {
                warnings.push(ModelWarning::MasslessBody {
                    link: link.name.clone(),
                    joint: tree.joints[joint].name.clone(),
                });
            }
            let impossible = impossible_moments(&body.I_C);
            warnings.extend(
                impossible.map(|moments| ModelWarning::ImplausibleInertia { link: link.name.clone(), moments }),
            );
        }
        for joint in &joints {
            for (quantity, value) in [("effort", joint.effort), ("velocity", joint.velocity)] {
                if value == 0.0 {
                    warnings.push(ModelWarning::ZeroLimit { joint: joint.name.clone(), quantity });
                }
            }
        }
        Ok(Self { name: tree.name.clone(), joints, warnings, base, total_mass, bodies, frames })
    }

    /// Kind of the base.
    #[inline]
    pub fn base(&self) -> Base {
        self.base
    }

    /// Length of `v`.
    #[inline]
    pub fn nv(&self) -> usize {
        self.nv_base() + self.nj()
    }

    /// Length of the base part of `v`: 6 or 0.
    #[inline]
    pub fn nv_base(&self) -> usize {
        match self.base {
            Base::Floating => 6,
            Base::Fixed => 0,
        }
    }

    /// Number of movable joints: length of `q`, `qd`, `tau`.
    #[inline]
    pub fn nj(&self) -> usize {
        self.joints.len()
    }

    /// Mass of all links, kg.
    #[inline]
    pub fn total_mass(&self) -> f64 {
        self.total_mass
    }

    /// Rotational inertia of the base with the links fixed to it, about their centre of mass, in base axes, kg m².
    pub fn base_inertia(&self) -> Matrix3<f64> {
        self.bodies[0].I_C
    }

    /// Finds a movable joint.
    ///
    /// # Errors
    /// [`ModelError::Unknown`], with names close to it.
    pub fn joint(&self, name: &str) -> Result<JointId, ModelError> {
        let names = || self.joints.iter().map(|joint| joint.name.as_str());
        names().position(|n| n == name).map(JointId).ok_or_else(|| self.unknown("joint", name, names()))
    }

    /// Index of a joint in `v`: its row of `M` and its column of a Jacobian.
    #[inline]
    pub fn v_index(&self, joint: JointId) -> usize {
        self.nv_base() + joint.0
    }

    /// Finds the frame of a link.
    ///
    /// # Errors
    /// [`ModelError::Unknown`], with names close to it.
    pub fn frame(&self, link: &str) -> Result<FrameId, ModelError> {
        let names = || self.frames.iter().map(|frame| frame.name.as_str());
        names().position(|n| n == link).map(FrameId).ok_or_else(|| self.unknown("link", link, names()))
    }

    /// The frames of all links, root first, in the order of [`UrdfTree::links`].
    pub fn frames(&self) -> impl ExactSizeIterator<Item = (FrameId, &str)> {
        self.frames.iter().enumerate().map(|(i, frame)| (FrameId(i), frame.name.as_str()))
    }

    /// Name of the link of a frame.
    pub fn frame_name(&self, frame: FrameId) -> &str {
        &self.frames[frame.0].name
    }

    /// The frame of a link by its index in the order of [`UrdfTree::links`].
    pub fn frame_at(&self, index: usize) -> Option<FrameId> {
        (index < self.frames.len()).then_some(FrameId(index))
    }

    /// Whether the body of a frame is that of another frame, or one of those between it and the root: then it moves the other frame.
    pub fn moves(&self, frame: FrameId, other: FrameId) -> bool {
        let (mover, mut body) = (self.frames[frame.0].body, self.frames[other.0].body);
        while body > mover {
            body = self.bodies[body].parent;
        }
        body == mover
    }

    /// The frame of the root link, B.
    #[inline]
    pub fn base_frame(&self) -> FrameId {
        FrameId(0)
    }

    fn unknown<'a>(&self, what: &'static str, name: &str, names: impl Iterator<Item = &'a str>) -> ModelError {
        ModelError::Unknown { robot: self.name.clone(), what, name: name.to_owned(), near: near_names(name, names) }
    }
}

/// The principal moments of an inertia that no mass distribution has, ascending; `None` for a possible inertia, in which each moment is at most the
/// sum of the other two.
pub fn impossible_moments(I: &Matrix3<f64>) -> Option<[f64; 3]> {
    let mut moments: [f64; 3] = I.symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    // A thin rod has one moment of zero: the slack covers rounding.
    let slack = 1e-9 * moments[2].abs();
    let is_possible = moments[0] >= -slack && moments[2] <= moments[0] + moments[1] + slack;
    (!is_possible).then_some(moments)
}
