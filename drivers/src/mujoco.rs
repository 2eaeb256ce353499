//! [`Simulator`] implemented with MuJoCo.
//!
//! MuJoCo computes forces from the state at the start of a step and positions at its end. A step here is `mj_step2` followed by
//! `mj_step1`: after it, positions, velocities and contacts are those of the new instant; forces and accelerations are those of
//! the interval before it. The same inputs give the same bits, also in another process.

mod command;
mod contact;
mod params;

pub use params::SimParams;

use crate::DriverError;
use crate::drives::Drives;
use crate::floor::Floors;
use crate::mjcf::{self, IMU, TIME_STEP_S};
use crate::sensors::Sensors;
use crate::simulator::Simulator;
use crate::terrain::Terrain;
use contact::force_on;
use controller::params::RobotConfig;
use lcmtypes::{GroundTruth, RobotCommand, RobotState};
use mujoco_rs::prelude::{MjData, MjModel, MjtObjBase};
use nalgebra::Vector3;
use robot_model::math::quaternion;
use robot_model::{Base, JointInfo, JointKind, Model, Pose, UrdfTree, check_runnable, with_shapes};
use std::collections::BTreeMap;
use std::sync::Once;

/// Largest penetration of the ground at the start, m.
const MAX_PENETRATION: f64 = 1e-4;
/// Largest number of steps in which the robot is raised out of the ground.
const MAX_LIFTS: usize = 20;

/// A robot in MuJoCo.
pub struct MujocoSim {
    data: MjData<Box<MjModel>>,
    mjcf: String,
    terrain: Terrain,
    params: SimParams,
    sensors: Sensors,
    joint_names: Vec<String>,
    joints: Vec<JointIndex>,
    drives: Drives,
    floors: Floors,
    /// Index of each foot's own floor among the mocap bodies; `None` for a foot on the common ground.
    floor_bodies: [Option<usize>; 4],
    feet: Vec<usize>,
    foot_radius: f64,
    /// Name of each link and index of its body.
    body_of_link: Vec<(String, usize)>,
    base: usize,
    /// Height of the base above the ground when the robot stands on its feet, m.
    standing_height: f64,
    /// Indices of orientation, gyro and accelerometer in the sensor data.
    imu: [usize; 3],
    command: RobotCommand,
    /// Contact force on each foot in the last interval, in W, N.
    f_F_W: Vec<[f64; 3]>,
    contact: Vec<i8>,
}

/// Indices of a joint in MuJoCo, and its range.
struct JointIndex {
    qpos: usize,
    qvel: usize,
    /// Foot of its leg.
    foot: Option<usize>,
    lower: f64,
    upper: f64,
}

impl MujocoSim {
    /// Places a robot on the ground, as specified by [`SimParams::start`].
    ///
    /// # Errors
    /// Unknown links or joints, a joint that cannot move the robot ([`check_runnable`]), a model that MuJoCo rejects, or a mass that differs from the
    /// URDF by more than 1e-6 of it.
    pub fn new(tree: &UrdfTree, robot: &RobotConfig, terrain: Terrain, params: SimParams) -> Result<Self, DriverError> {
        disable_log_file();
        let model = Model::new(tree, Base::Floating)?;
        let posture = |joint: &JointInfo| robot.posture.get(&joint.name).copied().unwrap_or(0.0);
        check_runnable(&model, &model.joints.iter().map(posture).collect::<Vec<_>>())?;
        let (tree, _) = with_shapes(tree, &robot.feet, robot.foot_radius, &|_| None);
        let tree = &tree;
        let floors = Floors::new(&params.floors);
        let own_floor = std::array::from_fn(|foot| floors.has(foot));
        let mjcf = mjcf::write(tree, robot, &terrain, params.friction, own_floor)?;
        let refused = |error: String| DriverError::Model { robot: robot.name.clone(), error };
        let mut model = MjModel::from_xml_string(&mjcf.text).map_err(|error| refused(error.to_string()))?;
        if let Some(field) = terrain.field() {
            model.hfield_data_mut().iter_mut().zip(mjcf::elevation(field)).for_each(|(slot, height)| *slot = height);
        }
        let found = model.totalmass();
        if (found - mjcf.total_mass).abs() > 1e-6 * mjcf.total_mass {
            return Err(DriverError::Mass { robot: robot.name.clone(), found, expected: mjcf.total_mass });
        }

        let id = |kind: MjtObjBase, name: &str| {
            model.name_to_id(kind, name).ok_or_else(|| refused(format!("{name:?} is missing")))
        };
        let feet_of_subtree = mjcf::feet_of_subtree(tree, &robot.feet);
        let mut joint_names = Vec::new();
        let mut joints = Vec::new();
        for joint in tree.joints.iter().filter(|joint| joint.kind != JointKind::Fixed) {
            let place = id(MjtObjBase::mjOBJ_JOINT, &joint.name)?;
            let address =
                |addresses: &[i32]| usize::try_from(addresses[place]).map_err(|error| refused(error.to_string()));
            joints.push(JointIndex {
                qpos: address(model.jnt_qposadr())?,
                qvel: address(model.jnt_dofadr())?,
                foot: feet_of_subtree[joint.child].iter().position(|carries| *carries),
                lower: joint.limits.lower,
                upper: joint.limits.upper,
            });
            joint_names.push(joint.name.clone());
        }
        let feet = robot
            .feet
            .iter()
            .map(|foot| id(MjtObjBase::mjOBJ_GEOM, &mjcf::body_name(foot)))
            .collect::<Result<Vec<_>, _>>()?;
        let mut body_of_link = Vec::with_capacity(tree.links.len());
        for (link, body) in tree.links.iter().zip(&mjcf.body_of_link) {
            body_of_link.push((link.name.clone(), id(MjtObjBase::mjOBJ_BODY, body)?));
        }
        let mut imu = [0; 3];
        for (place, sensor) in imu.iter_mut().zip(["orientation", "gyro", "accelerometer"]) {
            let sensor = id(MjtObjBase::mjOBJ_SENSOR, &format!("{IMU}_{sensor}"))?;
            *place = usize::try_from(model.sensor_adr()[sensor]).map_err(|error| refused(error.to_string()))?;
        }

        let mut floor_bodies = [None; 4];
        for (foot, place) in floor_bodies.iter_mut().enumerate().filter(|(foot, _)| own_floor[*foot]) {
            let body = id(MjtObjBase::mjOBJ_BODY, &mjcf::floor_name(foot))?;
            *place = usize::try_from(model.body_mocapid()[body]).ok();
        }
        let base = body_of_link[0].1;
        let mut sim = MujocoSim {
            data: MjData::try_new(Box::new(model)).map_err(|error| refused(error.to_string()))?,
            mjcf: mjcf.text,
            terrain,
            sensors: Sensors { resolution: robot.sensors.clone(), noise: params.noise.clone(), seed: params.seed },
            drives: Drives::new(&params.drives, &joint_names, TIME_STEP_S)?,
            floors,
            floor_bodies,
            params,
            command: RobotCommand::default(),
            joint_names,
            joints,
            foot_radius: robot.foot_radius,
            body_of_link,
            base,
            standing_height: 0.0,
            imu,
            f_F_W: vec![[0.0; 3]; feet.len()],
            contact: vec![0; feet.len()],
            feet,
        };
        let start = std::mem::take(&mut sim.params.start);
        sim.reset(&robot.posture)?;
        if !start.is_plain() {
            let posture = start.posture_of(robot)?;
            sim.params.start = start;
            sim.reset(&posture)?;
        }
        Ok(sim)
    }

    /// The model with its ground as MJCF text, for MuJoCo's viewer or a renderer.
    pub fn mjcf(&self) -> String {
        mjcf::with_elevation(&self.mjcf, &self.terrain)
    }

    /// The ground.
    pub fn terrain(&self) -> &Terrain {
        &self.terrain
    }

    /// Pose of the base in W.
    fn X_WB(&self) -> Pose {
        Pose { p: Vector3::from(self.data.xpos()[self.base]), R: quaternion::to_rotation(self.data.xquat()[self.base]) }
    }

    /// Sums the contact forces on each foot. Valid between the computation of forces and the next collision pass.
    fn read_contact_forces(&mut self) {
        self.f_F_W.fill([0.0; 3]);
        self.contact.fill(0);
        for (index, contact) in self.data.contact().iter().enumerate() {
            for (foot, &geom) in self.feet.iter().enumerate() {
                let geoms = [contact.geom1, contact.geom2];
                let Some(f_W) = force_on(geom, geoms, &contact.frame, &self.data.contact_force(index)) else {
                    continue;
                };
                self.f_F_W[foot].iter_mut().zip(f_W).for_each(|(sum, part)| *sum += part);
                self.contact[foot] |= i8::from(contact.exclude == 0);
            }
        }
    }

    /// Torque of the drive's joint loop, N m; the range of the motor limits it to the effort.
    fn torque(&self, joint: usize) -> f64 {
        let RobotCommand { mode, tau, q_des, qd_des, kp, kd, .. } = &self.command;
        let place = &self.joints[joint];
        let (q, qd) = (self.data.qpos()[place.qpos], self.data.qvel()[place.qvel]);
        match *mode {
            RobotCommand::MODE_TORQUE => tau[joint] + kp[joint] * (q_des[joint] - q) + kd[joint] * (qd_des[joint] - qd),
            RobotCommand::MODE_DAMPING => -kd[joint] * qd,
            _ => 0.0,
        }
    }

    /// Applies the floor moves that are due and whose foot is high enough.
    fn move_floors(&mut self) {
        let t_ns = (self.data.time() * 1e9).round() as i64;
        for (foot, place) in self.floor_bodies.iter().enumerate() {
            let Some(place) = *place else { continue };
            let lowest = self.data.geom_xpos()[self.feet[foot]][2] - self.foot_radius;
            if let Some(height) = self.floors.update(t_ns, foot, lowest) {
                self.data.mocap_pos_mut()[place][2] = height;
            }
        }
    }

    /// Raises the robot until no part of it penetrates the ground; a lying robot touches it with more than its feet.
    fn lift_out_of_the_ground(&mut self) {
        for _ in 0..MAX_LIFTS {
            self.data.forward();
            let deepest = self.data.contact().iter().map(|contact| contact.dist).fold(0.0, f64::min);
            if deepest > -MAX_PENETRATION {
                break;
            }
            self.data.qpos_mut()[2] -= deepest;
        }
    }

    fn check_finite(&self) -> Result<(), DriverError> {
        let values = self.data.qpos().iter().chain(self.data.qvel());
        match values.enumerate().find(|(_, value)| !value.is_finite()) {
            None => Ok(()),
            Some((index, found)) => Err(DriverError::Diverged { t_s: self.data.time(), index, found: *found }),
        }
    }
}

impl Simulator for MujocoSim {
    fn joints(&self) -> &[String] {
        &self.joint_names
    }

    fn period_ns(&self) -> i64 {
        (TIME_STEP_S * 1e9).round() as i64
    }

    fn reset(&mut self, posture: &BTreeMap<String, f64>) -> Result<(), DriverError> {
        if let Some(name) = posture.keys().find(|name| !self.joint_names.contains(name)) {
            return Err(DriverError::Unknown {
                wanted_by: "robot.posture".to_owned(),
                what: "joint",
                name: name.clone(),
                known: self.joint_names.clone(),
            });
        }
        self.data.reset();
        self.drives.reset();
        self.floors.reset();
        self.command = RobotCommand { mode: RobotCommand::MODE_IDLE, ..RobotCommand::default() };
        for (name, place) in self.joint_names.iter().zip(&self.joints) {
            let q = posture.get(name).copied().unwrap_or_else(|| 0.0f64.max(place.lower).min(place.upper));
            self.data.qpos_mut()[place.qpos] = q;
        }
        // The free joint comes first: position of the base, then its quaternion.
        self.data.qpos_mut()[..3].fill(0.0);
        self.data.qpos_mut()[3..7].copy_from_slice(&self.params.start.quaternion_wxyz());
        self.data.kinematics();
        let lift = |&foot: &usize| {
            let [x, y, z] = self.data.geom_xpos()[foot];
            self.terrain.height_at(x, y) + self.foot_radius - z
        };
        let height = self.feet.iter().map(lift).fold(f64::NEG_INFINITY, f64::max);
        self.data.qpos_mut()[2] = height;
        if self.params.start.is_plain() {
            self.standing_height = height - self.terrain.height_at(0.0, 0.0);
        } else {
            self.lift_out_of_the_ground();
        }
        self.data.forward();
        self.read_contact_forces();
        // Held until the first step: the accelerometer reads gravity, not the fall of a limp robot.
        self.data.qacc_mut().fill(0.0);
        self.data.rne_post_constraint();
        self.data.sensor_acc();
        self.data.step1();
        self.check_finite()
    }

    fn robot_state(&self, t_ns: i64, seq: i64, state: &mut RobotState) {
        let of_joints = |values: &[f64], place: fn(&JointIndex) -> usize, out: &mut Vec<f64>| {
            out.clear();
            out.extend(self.joints.iter().map(|joint| values[place(joint)]));
        };
        state.t_ns = t_ns;
        state.seq = seq;
        state.nj = self.joints.len() as i32;
        of_joints(self.data.qpos(), |joint| joint.qpos, &mut state.q);
        of_joints(self.data.qvel(), |joint| joint.qvel, &mut state.qd);
        of_joints(self.data.qfrc_actuator(), |joint| joint.qvel, &mut state.tau);
        let [orientation, gyro, accelerometer] = self.imu;
        let read = self.data.sensordata();
        state.n_imus = 1;
        state.q_WI_wxyz.resize(1, [0.0; 4]);
        state.w_WI_I.resize(1, [0.0; 3]);
        state.a_I.resize(1, [0.0; 3]);
        state.q_WI_wxyz[0].copy_from_slice(&read[orientation..orientation + 4]);
        state.w_WI_I[0].copy_from_slice(&read[gyro..gyro + 3]);
        state.a_I[0].copy_from_slice(&read[accelerometer..accelerometer + 3]);
        self.sensors.measure(state);
    }

    fn ground_truth(&self, t_ns: i64, truth: &mut GroundTruth) {
        // Velocity of the free joint: linear velocity of the origin in W, then angular velocity in B.
        let [vx, vy, vz, wx, wy, wz] = std::array::from_fn(|i| self.data.qvel()[i]);
        truth.t_ns = t_ns;
        truth.p_WB = self.data.xpos()[self.base];
        truth.q_WB_wxyz = self.data.xquat()[self.base];
        truth.v_WB = [vx, vy, vz];
        truth.w_WB_W = (self.X_WB().R * Vector3::new(wx, wy, wz)).into();
        truth.n_contacts = self.feet.len() as i32;
        truth.p_WF.clear();
        truth.v_WF.clear();
        for &foot in &self.feet {
            let [x, y, z] = self.data.geom_xpos()[foot];
            truth.p_WF.push([x, y, z - self.foot_radius]);
            let [_, _, _, vx, vy, vz] = self.data.object_velocity(MjtObjBase::mjOBJ_GEOM, foot, false);
            truth.v_WF.push([vx, vy, vz]);
        }
        truth.f_F_W.clone_from(&self.f_F_W);
        // A sphere touches in a point.
        truth.tau_F_W.resize(self.feet.len(), [0.0; 3]);
        truth.contact.clone_from(&self.contact);
        let [fx, fy, fz, tx, ty, tz] = self.data.xfrc_applied()[self.base];
        truth.f_push_W = [fx, fy, fz];
        truth.tau_push_W = [tx, ty, tz];
    }

    fn apply(&mut self, command: &RobotCommand) -> Result<(), DriverError> {
        command::check(command, &self.joint_names)?;
        self.command.clone_from(command);
        Ok(())
    }

    fn step(&mut self) -> Result<(), DriverError> {
        for joint in 0..self.joints.len() {
            let airborne = self.joints[joint].foot.is_some_and(|foot| self.contact[foot] == 0);
            self.data.ctrl_mut()[joint] = self.drives.torque(joint, self.torque(joint), airborne);
        }
        self.move_floors();
        self.data.step2();
        self.read_contact_forces();
        self.check_finite()?;
        self.data.step1();
        Ok(())
    }

    fn add_push(&mut self, link: Option<&str>, f_W: [f64; 3], tau_W: [f64; 3]) -> Result<(), DriverError> {
        let body = match link {
            None => self.base,
            Some(name) => {
                let found = self.body_of_link.iter().find(|(link, _)| link == name);
                found.map(|(_, body)| *body).ok_or_else(|| DriverError::Unknown {
                    wanted_by: "push.link".to_owned(),
                    what: "link",
                    name: name.to_owned(),
                    known: self.body_of_link.iter().map(|(link, _)| link.clone()).collect(),
                })?
            }
        };
        let wrench = f_W.into_iter().chain(tau_W);
        self.data.xfrc_applied_mut()[body].iter_mut().zip(wrench).for_each(|(sum, part)| *sum += part);
        Ok(())
    }

    fn torque_of_touch(&self, foot: usize, f_W: [f64; 3]) -> Vec<f64> {
        let geom = self.feet[foot];
        let [x, y, z] = self.data.geom_xpos()[geom];
        let body = usize::try_from(self.data.model().geom_bodyid()[geom]).unwrap_or(self.base);
        let (J, _) = self.data.jac(true, false, &[x, y, z - self.foot_radius], body);
        let nv = J.len() / 3;
        let of_joint = |joint: &JointIndex| -(0..3).map(|axis| J[axis * nv + joint.qvel] * f_W[axis]).sum::<f64>();
        self.joints.iter().map(of_joint).collect()
    }

    fn clear_pushes(&mut self) {
        self.data.xfrc_applied_mut().fill([0.0; 6]);
    }

    fn fallen(&self) -> bool {
        let p = self.X_WB().p;
        let height = p.z - self.terrain.height_at(p.x, p.y);
        height < self.params.min_height * self.standing_height || self.tipped()
    }

    fn below_ground(&self) -> bool {
        let [x, y, z] = self.data.xipos()[self.base];
        z < self.terrain.height_at(x, y)
    }

    fn tipped(&self) -> bool {
        let R = self.X_WB().R;
        // R = Rz(yaw) Ry(pitch) Rx(roll)
        let pitch = libm::asin(-R[(2, 0)].clamp(-1.0, 1.0));
        let roll = libm::atan2(R[(2, 1)], R[(2, 2)]);
        roll.abs() > self.params.max_tilt || pitch.abs() > self.params.max_tilt
    }
}

/// Stops MuJoCo from writing its warnings to a file in the working directory. Divergence is checked in `check_finite`.
#[expect(unsafe_code, reason = "a global of the C library")]
fn disable_log_file() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // SAFETY: this runs before the first use of MuJoCo in this process: every use goes through `MujocoSim::new`, which waits here.
        unsafe { mujoco_rs::prelude::set_log_config(mujoco_rs::prelude::log_config().with_logto_file(false)) }
    });
}
