//! Standard ROS 2 messages from which a viewer draws a robot: transforms of all links, joint states, the IMU, forces at the feet.

// Names of quantities carry frames, such as p_WF: see ARCHITECTURE.md.
#![allow(non_snake_case)]

use super::messages::{
    Header, Imu, JointState, Quaternion, StandardMessage, Text, TfMessage, TransformStamped, WrenchStamped, to_cdr,
};
use controller::Unpacked;
use controller::math::quaternion;
use controller::model::{Base, BaseState, Kinematics, Model, Pose, UrdfTree};
use controller::params::Params;
use lcmtypes::channels::{
    BASE_TRACKING, CONTACT_ESTIMATE, CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, GROUND_TRUTH, ROBOT_STATE,
};
use lcmtypes::{BaseTracking, ContactEstimate, ControllerInput, GroundTruth, Message, RobotState, RunInfo};

/// Name of the world frame.
const WORLD: &str = "world";

/// Period of `/tf`, ns: faster than the 60 Hz at which viewers draw.
const TRANSFORM_PERIOD_NS: i64 = 10_000_000;

/// Source of the base pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BaseSource {
    /// The simulator's ground truth.
    GroundTruth,
    /// Orientation and height of the controller's estimator; the horizontal position is unknown.
    Estimate,
    /// The orientation of the IMU only.
    Imu,
}

/// An encoded message for a viewer.
#[derive(Debug)]
pub struct TopicMessage {
    /// Name of the topic, with a leading slash.
    pub topic: String,
    /// Package and name of the type, such as `sensor_msgs/msg/Imu`.
    pub type_name: &'static str,
    /// Definition of the type in the language `ros2msg`.
    pub definition: &'static str,
    /// The message in CDR, little-endian, with its encapsulation header of 4 bytes.
    pub cdr: Vec<u8>,
}

/// The message of `/robot_description`.
pub fn description(urdf: &str) -> TopicMessage {
    TopicMessage::new("/robot_description", &Text { data: urdf })
}

impl TopicMessage {
    fn new<M: StandardMessage>(topic: impl Into<String>, message: &M) -> Self {
        TopicMessage { topic: topic.into(), type_name: M::TYPE, definition: M::DEFINITION, cdr: to_cdr(message) }
    }
}

/// Robot of a run and its latest state, from which the messages for viewers follow.
pub struct RobotTopics {
    tree: UrdfTree,
    model: Model,
    kinematics: Kinematics,
    imus: Vec<String>,
    force_torque_sensors: Vec<String>,
    contacts: Vec<String>,
    /// What the controller has consumed, for the base orientation of its input.
    unpacked: Unpacked,
    /// Source of the base pose in `/tf`.
    pub source: BaseSource,
    /// Added to the time of each message, ns: a live run has the monotonic clock, ROS 2 the wall clock.
    pub stamp_offset_ns: i64,
    state: RobotState,
    base: BaseState,
    last_transform: Option<i64>,
}

impl RobotTopics {
    /// The robot that RUN_INFO describes; `None` if its URDF cannot be read.
    pub fn new(info: &RunInfo, source: BaseSource) -> Option<Self> {
        let tree = UrdfTree::parse(&info.urdf, &info.robot).ok()?;
        // Without a valid description a viewer still draws the links.
        let robot =
            Params::from_toml(info.params(), "RUN_INFO").ok().and_then(|params| params.robot.description(&tree).ok());
        let model = Model::new(&tree, robot.as_ref().map_or(Base::Floating, |robot| robot.base)).ok()?;
        Some(RobotTopics {
            kinematics: Kinematics::new(&model),
            imus: info.imus.clone(),
            contacts: info.contacts.clone(),
            force_torque_sensors: info.force_torque_sensors.clone(),
            unpacked: Unpacked::default(),
            tree,
            model,
            source,
            stamp_offset_ns: 0,
            state: RobotState::default(),
            base: BaseState::identity(),
            last_transform: None,
        })
    }

    /// Updates the state from a message of the log and appends the messages for the viewer that follow from it.
    pub fn update_from(&mut self, channel: &str, data: &[u8], out: &mut Vec<TopicMessage>) {
        match channel {
            ROBOT_STATE => {
                let Ok(state) = RobotState::decode(data) else { return };
                out.push(self.joint_state(&state));
                self.imus(&state, out);
                self.force_torques(&state, out);
                self.state = state;
            }
            GROUND_TRUTH => {
                let Ok(truth) = GroundTruth::decode(data) else { return };
                self.base.p_WB = truth.p_WB.into();
                self.base.R_WB = quaternion::to_rotation(truth.q_WB_wxyz);
                self.transforms(truth.t_ns, out);
                self.wrenches(truth.t_ns, "contact_truth", &truth.f_F_W, &truth.tau_F_W, out);
            }
            CONTROLLER_INPUT if self.source == BaseSource::Imu || self.state.nj == 0 => {
                let Ok(input) = ControllerInput::decode(data) else { return };
                self.state.clone_from(&self.unpacked.update(&input).state);
                if self.source == BaseSource::Imu {
                    self.base.R_WB = self.base_by_imu();
                    self.transforms(input.t_ns, out);
                }
            }
            CONTROLLER_SNAPSHOT => self.unpacked.restore(data),
            BASE_TRACKING if self.source == BaseSource::Estimate => {
                let Ok(tracking) = BaseTracking::decode(data) else { return };
                let pose = Pose::from_xyz_rpy([0.0, 0.0, tracking.height_est], tracking.rpy_est);
                (self.base.p_WB, self.base.R_WB) = (pose.p, pose.R);
                self.transforms(tracking.t_ns, out);
            }
            CONTACT_ESTIMATE => {
                let Ok(estimate) = ContactEstimate::decode(data) else { return };
                self.wrenches(estimate.t_ns, "contact", &estimate.f_F_W, &[], out);
            }
            _ => {}
        }
    }

    fn header<'a>(&self, t_ns: i64, frame: &'a str) -> Header<'a> {
        Header::new(t_ns.saturating_add(self.stamp_offset_ns), frame)
    }

    fn joint_state(&self, state: &RobotState) -> TopicMessage {
        let message = JointState {
            header: self.header(state.t_ns, ""),
            name: self.model.joints.iter().map(|joint| &*joint.name).collect(),
            position: &state.q,
            velocity: &state.qd,
            effort: &state.tau,
        };
        TopicMessage::new("/joint_states", &message)
    }

    /// The first IMU on `/imu`, further ones on `/imu/NAME`.
    fn imus(&self, state: &RobotState, out: &mut Vec<TopicMessage>) {
        let vectors = state.w_WI_I.iter().zip(&state.a_I);
        let names = self.imus.iter().map(String::as_str).chain(std::iter::repeat(""));
        for (i, ((q_WI_wxyz, (w_WI_I, a_I)), name)) in state.q_WI_wxyz.iter().zip(vectors).zip(names).enumerate() {
            let message = Imu {
                header: self.header(state.t_ns, name),
                orientation: Quaternion::of_wxyz(*q_WI_wxyz),
                orientation_covariance: [0.0; 9],
                angular_velocity: *w_WI_I,
                angular_velocity_covariance: [0.0; 9],
                linear_acceleration: *a_I,
                linear_acceleration_covariance: [0.0; 9],
            };
            match (i, name) {
                (0, _) => out.push(TopicMessage::new("/imu", &message)),
                (_, "") => {}
                _ => out.push(TopicMessage::new(format!("/imu/{name}"), &message)),
            }
        }
    }

    /// Each force/torque sensor on `/ft/NAME`.
    fn force_torques(&self, state: &RobotState, out: &mut Vec<TopicMessage>) {
        for (name, (f_S, tau_S)) in self.force_torque_sensors.iter().zip(state.f_S.iter().zip(&state.tau_S)) {
            let message = WrenchStamped { header: self.header(state.t_ns, name), force: *f_S, torque: *tau_S };
            out.push(TopicMessage::new(format!("/ft/{name}"), &message));
        }
    }

    /// Updates the kinematics; `false` if the state has another number of joints than the robot.
    fn update(&mut self) -> bool {
        let fits = self.state.q.len() == self.model.nj() && self.state.qd.len() == self.model.nj();
        if fits {
            self.kinematics.update(&self.model, &self.base, &self.state.q, &self.state.qd);
        }
        fits
    }

    fn base_by_imu(&mut self) -> nalgebra::Matrix3<f64> {
        let upright = [1.0, 0.0, 0.0, 0.0];
        let R_WI = quaternion::to_rotation(self.state.q_WI_wxyz.first().copied().unwrap_or(upright));
        self.base = BaseState::identity();
        match self.model.frame(self.imus.first().map_or("", String::as_str)) {
            Ok(imu) if self.update() => R_WI * self.kinematics.R_WF(&self.model, imu).transpose(),
            _ => R_WI,
        }
    }

    /// Pose of every link in its parent link, of the root link in the world.
    fn transforms(&mut self, t_ns: i64, out: &mut Vec<TopicMessage>) {
        if self.last_transform.is_some_and(|last| (0..TRANSFORM_PERIOD_NS).contains(&t_ns.saturating_sub(last)))
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
        let transforms = self.tree.links.iter().zip(&poses).map(|(link, X_WC)| {
            let parent = link.parent_joint.map(|joint| self.tree.joints[joint].parent);
            let (name, X_PC) = match parent {
                None => (WORLD, *X_WC),
                Some(parent) => {
                    let (X_WP, R_PW) = (&poses[parent], poses[parent].R.transpose());
                    let X_PC = Pose { p: R_PW * (X_WC.p - X_WP.p), R: R_PW * X_WC.R };
                    (self.tree.links[parent].name.as_str(), X_PC)
                }
            };
            TransformStamped {
                header: self.header(t_ns, name),
                child_frame_id: &link.name,
                translation: X_PC.p.into(),
                rotation: Quaternion::of_wxyz(quaternion::from_rotation(&X_PC.R)),
            }
        });
        out.push(TopicMessage::new("/tf", &TfMessage { transforms: transforms.collect() }));
    }

    /// Contact forces and moments, given in W, as wrenches in the frames of the contacts. Without moments they are 0.
    fn wrenches(
        &mut self,
        t_ns: i64,
        topic: &str,
        f_F_W: &[[f64; 3]],
        tau_F_W: &[[f64; 3]],
        out: &mut Vec<TopicMessage>,
    ) {
        if !self.update() {
            return;
        }
        let moments = tau_F_W.iter().copied().chain(std::iter::repeat([0.0; 3]));
        for ((name, f_W), tau_W) in self.contacts.iter().zip(f_F_W).zip(moments) {
            let Ok(frame) = self.model.frame(name) else { continue };
            let R_FW = self.kinematics.R_WF(&self.model, frame).transpose();
            let [force, torque] = [*f_W, tau_W].map(|v_W| (R_FW * nalgebra::Vector3::from(v_W)).into());
            let message = WrenchStamped { header: self.header(t_ns, name), force, torque };
            out.push(TopicMessage::new(format!("/{topic}/{name}"), &message));
        }
    }
}
