//! The robot: rigid-body model, legs, nominal posture, and the quantities derived from them once.

use super::leg::{Leg, PerLeg};
use super::leg_reach::LegReach;
use crate::contact::Contact;
use crate::error::LoadError;
use crate::model::description::ContactGeometry;
use crate::model::{
    Base, BaseState, FrameId, GRAVITY, JointKind, Kinematics, Model, UrdfTree, check_runnable, com,
    point_jacobian_linear,
};
use crate::params::RobotConfig;
use nalgebra::{DMatrix, Matrix3, Vector3};

/// A leg with three joints, from the trunk outward HAA, HFE, KFE, and its foot.
#[derive(Clone, Copy, Debug)]
pub struct LegModel {
    /// Frame at the centre of the foot sphere.
    pub foot: FrameId,
    /// Frame of the child link of the HAA joint. Its origin is at the joint.
    pub hip: FrameId,
    /// Indices of the three joints in `q`.
    pub joints: [usize; 3],
    /// Virtual foothold: foot contact point relative to the base origin, in H, while the robot stands with level trunk, m. It is that of the nominal
    /// posture, shifted equally for all legs so that the centre of the four feet is below the centre of mass. Gravity then causes no moment about
    /// either support diagonal; without the shift, a robot with an off-centre mass drifts in a trot.
    pub p_nominal_H: Vector3<f64>,
    /// What the leg reaches.
    pub reach: LegReach,
}

/// The rigid-body model and what is derived from it.
pub struct Robot {
    /// Rigid-body model, floating base.
    pub model: Model,
    /// Weight, N.
    pub weight: f64,
    /// Rotational inertia of the trunk about its centre of mass, in B, kg m².
    pub trunk_inertia: Matrix3<f64>,
    /// The four legs.
    pub legs: PerLeg<LegModel>,
    /// Contacts of the feet: spheres.
    pub contacts: PerLeg<Contact>,
    /// Nominal posture, nj.
    pub q_nominal: Vec<f64>,
    /// Height of the base above the feet in the nominal posture, m.
    pub nominal_height: f64,
    /// Ratio of the backward speed of a standing foot's contact point under the base to the speed of the base, along x and y. It is below 1, because a
    /// spherical foot rolls forward under its leg.
    pub sweep: [f64; 2],
    /// Orientation of the base in the axes of the IMU.
    pub R_IB: Matrix3<f64>,
    /// Radius of the foot sphere, m.
    pub foot_radius: f64,
}

impl Robot {
    /// Parses the URDF text and finds the legs that `config` names.
    ///
    /// # Errors
    /// The URDF is invalid; it lacks a link or joint of `config`; a leg does not have exactly three revolute joints of its own; a joint belongs to
    /// no leg; `robot.posture` lacks a joint, violates a joint limit, or has feet at different heights.
    pub fn new(urdf: &str, config: &RobotConfig) -> Result<Self, LoadError> {
        let wrong = |what: String| LoadError::Robot { robot: config.name.clone(), what };
        if !config.is_quadruped() {
            return Err(wrong("robot.feet is missing, expected the four feet of a quadruped".into()));
        }
        let tree = UrdfTree::parse(urdf, &config.urdf)?;
        let mut model = Model::new(&tree, Base::Floating)?;
        config.limit_drives(&mut model)?;

        let mut q_nominal = vec![f64::NAN; model.nj()];
        for (name, &q) in &config.posture {
            q_nominal[model.joint(name)?.index()] = q;
        }
        for (joint, &q) in model.joints.iter().zip(&q_nominal) {
            if q.is_nan() {
                return Err(wrong(format!("joint {} is missing in robot.posture", joint.name)));
            }
            if q < joint.lower || q > joint.upper {
                let (name, lower, upper) = (&joint.name, joint.lower, joint.upper);
                return Err(wrong(format!("robot.posture.{name} is {q}, expected {lower} to {upper}")));
            }
        }

        check_runnable(&model, &q_nominal)?;
        let base = model.base_frame();
        let mut kin = Kinematics::new(&model);
        let level = BaseState {
            p_WB: Vector3::zeros(),
            R_WB: Matrix3::identity(),
            v_WB: Vector3::zeros(),
            w_WB_W: Vector3::zeros(),
        };
        kin.update(&model, &level, &q_nominal, &vec![0.0; model.nj()]);

        let mut legs = Vec::with_capacity(4);
        let mut owner: Vec<Option<Leg>> = vec![None; model.nj()];
        for leg in Leg::ALL {
            let foot_link = &config.feet[leg as usize];
            let foot = model.frame(foot_link)?;
            let (joints, hip_link) = chain(&tree, &model, foot.index())?;
            let Ok(joints) = <[usize; 3]>::try_from(joints.as_slice()) else {
                let n = joints.len();
                return Err(wrong(format!("leg {} ({foot_link}) has {n} joints, expected 3", leg.name())));
            };
            for j in joints {
                let joint = &model.joints[j];
                if joint.kind == JointKind::Prismatic {
                    let name = &joint.name;
                    return Err(wrong(format!("leg joint {name} is prismatic, expected revolute")));
                }
                if let Some(other) = owner[j].replace(leg) {
                    let (a, b) = (other.name(), leg.name());
                    return Err(wrong(format!("joint {} belongs to legs {a} and {b}", joint.name)));
                }
            }
            let mut p_nominal_H = kin.p_WF(&model, foot);
            p_nominal_H.z -= config.foot_radius;
            let reach = LegReach::new(&model, foot, joints, &q_nominal);
            legs.push(LegModel { foot, hip: model.frame(&hip_link)?, joints, p_nominal_H, reach });
        }
        if let Some(j) = owner.iter().position(Option::is_none) {
            return Err(wrong(format!("joint {} belongs to no leg", model.joints[j].name)));
        }
        let mut legs = PerLeg(<[LegModel; 4]>::try_from(legs).expect("one is pushed for each of the four legs"));

        let center_H = legs.0.iter().fold(Vector3::zeros(), |sum, leg| sum + leg.p_nominal_H) / 4.0;
        let to_com_H = com(&kin) - center_H;
        for leg in &mut legs.0 {
            leg.p_nominal_H += Vector3::new(to_com_H.x, to_com_H.y, 0.0);
        }

        let nominal_height = legs.0.iter().fold(0.0, |sum, leg| sum - leg.p_nominal_H.z) / 4.0;
        for (leg, LegModel { p_nominal_H, .. }) in legs.iter() {
            let off = (-p_nominal_H.z - nominal_height).abs();
            if nominal_height <= 0.0 || off > 0.02 {
                let (name, below) = (leg.name(), -p_nominal_H.z);
                return Err(wrong(format!(
                    "in robot.posture foot {name} is {below:.3} m below the base, expected the mean of the feet, {nominal_height:.3} m, within 0.02 m"
                )));
            }
        }
        let sweep = sweep(&model, &kin, &legs, config.foot_radius);
        let imu = model.frame(&config.imu_link)?;
        if tree_parent_body(&tree, imu.index()) != base.index() {
            return Err(wrong(format!("robot.imu_link {} is not fixed to the base", config.imu_link)));
        }
        let R_IB = kin.R_WF(&model, imu).transpose();
        let weight = model.total_mass() * GRAVITY;
        let sphere = ContactGeometry::Point { radius: config.foot_radius };
        let contacts = PerLeg(Leg::ALL.map(|leg| Contact::new(leg.name(), &model, legs[leg].foot, &sphere)));
        let trunk_inertia = model.base_inertia();
        Ok(Robot {
            model,
            weight,
            trunk_inertia,
            legs,
            contacts,
            q_nominal,
            nominal_height,
            sweep,
            R_IB,
            foot_radius: config.foot_radius,
        })
    }

    /// Number of joints.
    pub fn nj(&self) -> usize {
        self.model.nj()
    }

    /// Total mass, kg.
    pub fn mass(&self) -> f64 {
        self.model.total_mass()
    }
}

/// Computes [`Robot::sweep`] in the nominal posture, as the mean of the legs.
///
/// The point of the sphere that touches the ground is at rest, so the base moves with `v = -J_touch qd`. The contact point stays below the centre of the
/// sphere, so it moves with `u = J_center qd` relative to the base.
fn sweep(model: &Model, kin: &Kinematics, legs: &PerLeg<LegModel>, foot_radius: f64) -> [f64; 2] {
    let mut sum = [0.0; 2];
    let mut J = DMatrix::zeros(3, model.nv());
    for leg in &legs.0 {
        let mut of_leg = |p: Vector3<f64>| {
            point_jacobian_linear(model, kin, leg.foot, &p, J.as_view_mut());
            Matrix3::from_fn(|row, k| J[(row, 6 + leg.joints[k])])
        };
        let (center, touch) = (of_leg(Vector3::zeros()), of_leg(Vector3::z() * -foot_radius));
        let ratio = touch.try_inverse().map_or(Matrix3::identity(), |inverse| center * inverse);
        sum = [sum[0] + 0.25 * ratio[(0, 0)], sum[1] + 0.25 * ratio[(1, 1)]];
    }
    sum
}

/// Movable joints from the base to a link, and the child link of the first of them.
fn chain(tree: &UrdfTree, model: &Model, link: usize) -> Result<(Vec<usize>, String), LoadError> {
    let (mut joints, mut hip, mut at) = (Vec::new(), String::new(), link);
    while let Some(parent) = tree.links[at].parent_joint {
        let joint = &tree.joints[parent];
        if joint.kind != JointKind::Fixed {
            joints.push(model.joint(&joint.name)?.index());
            hip.clone_from(&tree.links[joint.child].name);
        }
        at = joint.parent;
    }
    joints.reverse();
    Ok((joints, hip))
}

/// The first link from `link` towards the root that is the child of a movable joint, or the root.
fn tree_parent_body(tree: &UrdfTree, link: usize) -> usize {
    let mut at = link;
    while let Some(parent) = tree.links[at].parent_joint {
        if tree.joints[parent].kind != JointKind::Fixed {
            return at;
        }
        at = tree.joints[parent].parent;
    }
    at
}
