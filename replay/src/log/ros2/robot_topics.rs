//! The robot of a run as viewers want it: transforms of all links, joint states, the IMU, forces at the feet.

// ChannelNames of quantities carry frames, such as p_WF: see ARCHITECTURE.md.
#![allow(non_snake_case)]

use super::cdr::Cdr;
use controller::math::quaternion;
use controller::model::{Base, BaseState, Kinematics, Model, Pose, UrdfTree};
use lcmtypes::channels::{BASE_TRACKING, CONTACT_ESTIMATE, CONTROLLER_INPUT, GROUND_TRUTH, ROBOT_STATE};
use lcmtypes::{BaseTracking, ContactEstimate, ControllerInput, GroundTruth, Message, RobotState, RunInfo};

/// Frame of the world.
const WORLD: &str = "world";

/// Time between two transforms, ns: a viewer draws 60 times a second.
const TRANSFORM_NS: i64 = 10_000_000;

/// Where the base is known from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BaseSource {
    /// The simulator's truth.
    GroundTruth,
    /// Orientation and height of the controller's estimator; nobody knows where over the ground.
    Estimate,
    /// The IMU's orientation alone.
    Imu,
}

/// What a viewer is to be given, and on which topic.
pub(super) enum Shown {
    Transforms(Cdr),
    JointState(Cdr),
    Imu(Cdr),
    /// Topic, message.
    Wrench(String, Cdr),
}

pub(super) struct Robot {
    tree: UrdfTree,
    model: Model,
    kinematics: Kinematics,
    imu: String,
    feet: Vec<String>,
    pub source: BaseSource,
    state: RobotState,
    base: BaseState,
    last_transform: Option<i64>,
}

impl Robot {
    /// The robot of a run; `None` if its URDF cannot be read.
    pub fn new(info: &RunInfo, source: BaseSource) -> Option<Self> {
        let tree = UrdfTree::parse(&info.urdf, &info.robot).ok()?;
        let model = Model::new(&tree, Base::Floating).ok()?;
        let params: toml::Table = info.params.parse().unwrap_or_default();
        let robot = params.get("robot").and_then(toml::Value::as_table);
        let text = |key| robot.and_then(|robot| robot.get(key)).and_then(toml::Value::as_str).unwrap_or_default();
        let feet = robot.and_then(|robot| robot.get("feet")).and_then(toml::Value::as_array);
        Some(Robot {
            kinematics: Kinematics::new(&model),
            imu: text("imu_link").to_owned(),
            feet: feet.into_iter().flatten().filter_map(|foot| foot.as_str().map(str::to_owned)).collect(),
            tree,
            model,
            source,
            state: RobotState::default(),
            base: BaseState::identity(),
            last_transform: None,
        })
    }

    /// What there is to show of a message.
    pub fn show(&mut self, channel: &str, data: &[u8], out: &mut Vec<Shown>) {
        match channel {
            ROBOT_STATE => {
                let Ok(state) = RobotState::decode(data) else { return };
                out.push(self.joint_state(&state));
                out.push(self.imu(&state));
                self.state = state;
            }
            GROUND_TRUTH => {
                let Ok(truth) = GroundTruth::decode(data) else { return };
                self.base.p_WB = truth.p_WB.into();
                self.base.R_WB = quaternion::to_rotation(truth.q_WB_wxyz);
                self.transforms(truth.t_ns, out);
                self.wrenches(truth.t_ns, "contact_truth", &truth.f_F_W, out);
            }
            CONTROLLER_INPUT if self.source == BaseSource::Imu || self.state.nj == 0 => {
                let Ok(input) = ControllerInput::decode(data) else { return };
                self.state = input.state;
                if self.source == BaseSource::Imu {
                    self.base.R_WB = self.base_by_imu();
                    self.transforms(input.t_ns, out);
                }
            }
            BASE_TRACKING if self.source == BaseSource::Estimate => {
                let Ok(tracking) = BaseTracking::decode(data) else { return };
                let pose = Pose::from_xyz_rpy([0.0, 0.0, tracking.height_est], tracking.rpy_est);
                (self.base.p_WB, self.base.R_WB) = (pose.p, pose.R);
                self.transforms(tracking.t_ns, out);
            }
            CONTACT_ESTIMATE => {
                let Ok(estimate) = ContactEstimate::decode(data) else { return };
                self.wrenches(estimate.t_ns, "contact", &estimate.f_F_W, out);
            }
            _ => {}
        }
    }

    fn joint_state(&self, state: &RobotState) -> Shown {
        let mut cdr = Cdr::new();
        cdr.header(state.t_ns, "");
        cdr.length(self.model.joints.len());
        for joint in &self.model.joints {
            cdr.string(&joint.name);
        }
        for values in [&state.q, &state.qd, &state.tau] {
            cdr.length(values.len());
            cdr.f64s(values);
        }
        Shown::JointState(cdr)
    }

    fn imu(&self, state: &RobotState) -> Shown {
        let mut cdr = Cdr::new();
        cdr.header(state.t_ns, &self.imu);
        cdr.quaternion(state.q_WI_wxyz);
        cdr.f64s(&[0.0; 9]);
        cdr.f64s(&state.w_WI_I);
        cdr.f64s(&[0.0; 9]);
        cdr.f64s(&state.a_I);
        cdr.f64s(&[0.0; 9]);
        Shown::Imu(cdr)
    }

    /// Brings the kinematics up to date; `false` if the joints are not those of the robot.
    fn update(&mut self) -> bool {
        let fits = self.state.q.len() == self.model.nj() && self.state.qd.len() == self.model.nj();
        if fits {
            self.kinematics.update(&self.model, &self.base, &self.state.q, &self.state.qd);
        }
        fits
    }

    fn base_by_imu(&mut self) -> nalgebra::Matrix3<f64> {
        let R_WI = quaternion::to_rotation(self.state.q_WI_wxyz);
        self.base = BaseState::identity();
        match self.model.frame(&self.imu) {
            Ok(imu) if self.update() => R_WI * self.kinematics.R_WF(&self.model, imu).transpose(),
            _ => R_WI,
        }
    }

    /// Every link in its parent, the root in the world.
    fn transforms(&mut self, t_ns: i64, out: &mut Vec<Shown>) {
        if self.last_transform.is_some_and(|last| (0..TRANSFORM_NS).contains(&t_ns.saturating_sub(last)))
            || !self.update()
        {
            return;
        }
        self.last_transform = Some(t_ns);
        let poses: Vec<Pose> = self
            .model
            .frames()
            .map(|(frame, _)| Pose {
                p: self.kinematics.p_WF(&self.model, frame),
                R: self.kinematics.R_WF(&self.model, frame),
            })
            .collect();
        let mut cdr = Cdr::new();
        cdr.length(self.tree.links.len());
        for (link, X_WC) in self.tree.links.iter().zip(&poses) {
            let parent = link.parent_joint.map(|joint| self.tree.joints[joint].parent);
            let (name, X_PC) = match parent {
                None => (WORLD, *X_WC),
                Some(parent) => {
                    let (X_WP, R_PW) = (&poses[parent], poses[parent].R.transpose());
                    let X_PC = Pose { p: R_PW * (X_WC.p - X_WP.p), R: R_PW * X_WC.R };
                    (self.tree.links[parent].name.as_str(), X_PC)
                }
            };
            cdr.header(t_ns, name);
            cdr.string(&link.name);
            cdr.f64s(X_PC.p.as_slice());
            cdr.quaternion(quaternion::from_rotation(&X_PC.R));
        }
        out.push(Shown::Transforms(cdr));
    }

    /// Forces in W as wrenches in the frames of the feet.
    fn wrenches(&mut self, t_ns: i64, topic: &str, f_F_W: &[[f64; 3]], out: &mut Vec<Shown>) {
        if !self.update() {
            return;
        }
        for (name, f_W) in self.feet.iter().zip(f_F_W) {
            let Ok(frame) = self.model.frame(name) else { continue };
            let f_F = self.kinematics.R_WF(&self.model, frame).transpose() * nalgebra::Vector3::from(*f_W);
            let mut cdr = Cdr::new();
            cdr.header(t_ns, name);
            cdr.f64s(f_F.as_slice());
            cdr.f64s(&[0.0; 3]);
            out.push(Shown::Wrench(format!("/{topic}/{name}"), cdr));
        }
    }
}
