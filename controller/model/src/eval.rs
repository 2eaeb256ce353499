//! Evaluation of a model with plain data in and out: what `hoof robot info` and `hoof robot eval` read and print.
//!
//! The field names are the JSON keys. Checks against other libraries depend on them.

use std::collections::BTreeMap;

use crate::math::quaternion;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::bodies::{Base, Model};
use super::centroidal::com;
use super::description::DriveDifference;
use super::dynamics::{bias_force, gravity_force, mass_matrix};
use super::error::ModelError;
use super::jacobian::frame_jacobian;
use super::kinematics::{BaseState, Kinematics};
use super::pose::Pose;
use super::runnable::check_size;
use super::tree::{ShapeKind, UrdfTree};

/// Summary of a robot description.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotInfo {
    /// Name of the robot in the URDF.
    pub name: String,
    /// Mass of all links, kg.
    pub mass_kg: f64,
    /// Number of movable joints, without the six degrees of freedom of a floating base.
    pub dof: usize,
    /// Movable joints, in the order of `q`.
    pub joints: Vec<JointSummary>,
    /// All links, root first.
    pub links: Vec<LinkSummary>,
    /// Links at the end of a chain with a sphere as collision shape: probably the feet.
    pub feet: Vec<String>,
    /// Names of the contacts of the TOML file.
    #[serde(default)]
    pub contacts: Vec<String>,
    /// Names of its groups.
    #[serde(default)]
    pub groups: Vec<String>,
    /// Names of its postures.
    #[serde(default)]
    pub postures: Vec<String>,
    /// Its pairs of links that need no check for collisions.
    #[serde(default)]
    pub disabled_collisions: Vec<[String; 2]>,
    /// Limits that the TOML file beside the URDF changes.
    #[serde(default)]
    pub differences: Vec<DriveDifference>,
    /// Warnings about the description.
    pub warnings: Vec<String>,
}

/// One movable joint; a missing limit is `null`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointSummary {
    /// Name in the URDF.
    pub name: String,
    /// `revolute`, `continuous` or `prismatic`.
    pub kind: String,
    /// Smallest position, rad or m.
    pub lower: Option<f64>,
    /// Largest position, rad or m.
    pub upper: Option<f64>,
    /// Largest torque or force, N m or N.
    pub effort: Option<f64>,
    /// Largest speed, rad/s or m/s.
    pub velocity: Option<f64>,
    /// Viscous friction, N m s/rad or N s/m.
    pub damping: f64,
}

/// One link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LinkSummary {
    /// Name in the URDF.
    pub name: String,
    /// Parent link, `null` for the root.
    pub parent: Option<String>,
    /// Mass, kg.
    pub mass_kg: f64,
}

impl RobotInfo {
    /// Summarizes a description.
    ///
    /// # Errors
    /// See [`Model::new`].
    pub fn new(tree: &UrdfTree) -> Result<Self, ModelError> {
        let model = Model::new(tree, Base::Fixed)?;
        let finite = |limit: f64| limit.is_finite().then_some(limit);
        let joints = model.joints.iter().map(|joint| JointSummary {
            name: joint.name.clone(),
            kind: joint.kind.name().to_owned(),
            lower: finite(joint.lower),
            upper: finite(joint.upper),
            effort: finite(joint.effort),
            velocity: finite(joint.velocity),
            damping: joint.damping,
        });
        let links = tree.links.iter().map(|link| LinkSummary {
            name: link.name.clone(),
            parent: link.parent_joint.map(|j| tree.links[tree.joints[j].parent].name.clone()),
            mass_kg: link.inertial.mass,
        });
        let mut ends = vec![true; tree.links.len()];
        tree.joints.iter().for_each(|joint| ends[joint.parent] = false);
        let is_foot = |&i: &usize| {
            ends[i] && tree.links[i].collisions.iter().any(|shape| matches!(shape.kind, ShapeKind::Sphere { .. }))
        };
        Ok(Self {
            name: model.name.clone(),
            mass_kg: model.total_mass(),
            dof: model.nj(),
            joints: joints.collect(),
            links: links.collect(),
            feet: (0..tree.links.len()).filter(is_foot).map(|i| tree.links[i].name.clone()).collect(),
            contacts: Vec::new(),
            groups: Vec::new(),
            postures: Vec::new(),
            disabled_collisions: Vec::new(),
            differences: Vec::new(),
            warnings: model.warnings.iter().map(ToString::to_string).collect(),
        })
    }
}

/// State at which a model is evaluated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvalRequest {
    /// Pose and velocity of the root link; `null` for a base fixed to W.
    pub base: Option<EvalBase>,
    /// Position of every movable joint, rad or m.
    pub q: BTreeMap<String, f64>,
    /// Velocity of every movable joint, rad/s or m/s; all zero if missing.
    pub qd: Option<BTreeMap<String, f64>>,
}

/// Pose and velocity of the root link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvalBase {
    /// Origin of B, in W, m.
    pub position_m: [f64; 3],
    /// Orientation of B in W. Its norm must be 1 within 0.001; it is normalized.
    pub quaternion_wxyz: [f64; 4],
    /// Velocity of the origin of B, **in B**, m/s.
    #[serde(default)]
    pub linear_velocity: [f64; 3],
    /// Angular velocity of B, **in B**, rad/s.
    #[serde(default)]
    pub angular_velocity: [f64; 3],
}

/// Quantities of a model at one state. Matrices are lists of rows; rows and columns are in `velocity_order`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EvalResult {
    /// Mass matrix, nv x nv.
    pub mass_matrix: Vec<Vec<f64>>,
    /// Coriolis, centrifugal and gravity terms, length nv.
    pub bias_force: Vec<f64>,
    /// Gravity part of the bias force, length nv.
    pub gravity: Vec<f64>,
    /// Centre of mass of all links, in W, m.
    pub com_m: [f64; 3],
    /// Mass of all links, kg.
    pub total_mass_kg: f64,
    /// Names of the entries of `v`: velocity of the origin of B and angular velocity of B, both in W axes, then the joints.
    pub velocity_order: Vec<String>,
    /// Frames of all links, by name.
    pub frames: BTreeMap<String, EvalFrame>,
}

/// Pose of a link in W, and its Jacobian.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EvalFrame {
    /// Origin of the link, in W, m.
    pub position_m: [f64; 3],
    /// Orientation of the link in W, with `w >= 0`.
    pub quaternion_wxyz: [f64; 4],
    /// Jacobian, 6 x nv, in W axes: three linear rows (of the origin), then three angular rows.
    pub jacobian: Vec<Vec<f64>>,
}

/// Evaluates a robot at a state.
///
/// # Errors
/// [`ModelError::Unknown`] for a joint that the robot does not have. [`ModelError::BadState`] for a missing joint, a value that is not finite or
/// above 1e9, or a quaternion whose norm is not 1. See also [`Model::new`].
pub fn eval(tree: &UrdfTree, request: &EvalRequest) -> Result<EvalResult, ModelError> {
    let floating = if request.base.is_some() { Base::Floating } else { Base::Fixed };
    let model = Model::new(tree, floating)?;
    check_size(&model)?;
    let base = request.base.as_ref().map_or_else(|| Ok(BaseState::identity()), base_state)?;
    let q = joint_values(&model, "q", &request.q)?;
    let qd = match &request.qd {
        Some(qd) => joint_values(&model, "qd", qd)?,
        None => vec![0.0; model.nj()],
    };
    let mut kin = Kinematics::new(&model);
    kin.update(&model, &base, &q, &qd);

    let nv = model.nv();
    let mut M = DMatrix::zeros(nv, nv);
    mass_matrix(&model, &kin, &mut M);
    let (mut h, mut g) = (DVector::zeros(nv), DVector::zeros(nv));
    bias_force(&model, &kin, &mut h);
    gravity_force(&model, &kin, &mut g);

    let mut J = DMatrix::zeros(6, nv);
    let mut frames = BTreeMap::new();
    for (frame, link) in model.frames() {
        frame_jacobian(&model, &kin, frame, &mut J);
        let X_WF = Pose { p: kin.p_WF(&model, frame), R: kin.R_WF(&model, frame) };
        let result = EvalFrame {
            position_m: X_WF.p.into(),
            quaternion_wxyz: quaternion::from_rotation(&X_WF.R),
            jacobian: rows(&J),
        };
        frames.insert(link.to_owned(), result);
    }
    Ok(EvalResult {
        mass_matrix: rows(&M),
        bias_force: h.as_slice().to_vec(),
        gravity: g.as_slice().to_vec(),
        com_m: com(&kin).into(),
        total_mass_kg: model.total_mass(),
        velocity_order: velocity_order(&model),
        frames,
    })
}

/// `v_WB.x` … `w_WB_W.z` for a floating base, then the names of the joints.
fn velocity_order(model: &Model) -> Vec<String> {
    let base = ["v_WB.x", "v_WB.y", "v_WB.z", "w_WB_W.x", "w_WB_W.y", "w_WB_W.z"];
    let joints = model.joints.iter().map(|joint| joint.name.as_str());
    base[..model.nv_base()].iter().copied().chain(joints).map(str::to_owned).collect()
}

fn base_state(base: &EvalBase) -> Result<BaseState, ModelError> {
    let EvalBase { position_m, quaternion_wxyz, linear_velocity, angular_velocity } = base;
    finite("base.position_m", position_m)?;
    finite("base.linear_velocity", linear_velocity)?;
    finite("base.angular_velocity", angular_velocity)?;
    let norm = quaternion_wxyz.iter().map(|x| x * x).sum::<f64>().sqrt();
    if !(0.999..=1.001).contains(&norm) {
        return Err(bad_state("base.quaternion_wxyz", format!("norm {norm}"), "norm 1 within 0.001"));
    }
    let R_WB: Matrix3<f64> = quaternion::to_rotation(*quaternion_wxyz);
    Ok(BaseState {
        p_WB: Vector3::from(*position_m),
        R_WB,
        v_WB: R_WB * Vector3::from(*linear_velocity),
        w_WB_W: R_WB * Vector3::from(*angular_velocity),
    })
}

/// Values of a map by joint name, in the order of the model's joints.
fn joint_values(model: &Model, key: &str, values: &BTreeMap<String, f64>) -> Result<Vec<f64>, ModelError> {
    for name in values.keys() {
        model.joint(name)?;
    }
    let value = |joint: &str| {
        let key = format!("{key}.{joint}");
        let value = values
            .get(joint)
            .ok_or_else(|| bad_state(&key, "nothing".to_owned(), "a number for every movable joint"))?;
        finite(&key, &[*value])?;
        Ok(*value)
    };
    model.joints.iter().map(|joint| value(&joint.name)).collect()
}

/// The largest magnitude of a position or velocity. With it, and with the limits of the URDF, no quantity overflows.
const MAX_STATE: f64 = 1e9;

fn finite(key: &str, values: &[f64]) -> Result<(), ModelError> {
    match values.iter().find(|value| !value.is_finite() || value.abs() > MAX_STATE) {
        Some(value) => Err(bad_state(key, format!("{value:?}"), "a finite number with a magnitude of at most 1e9")),
        None => Ok(()),
    }
}

fn bad_state(key: &str, found: String, expected: &'static str) -> ModelError {
    ModelError::BadState { key: key.to_owned(), found, expected }
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}
