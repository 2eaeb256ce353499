//! [`Simulator`] implemented with MuJoCo.
//!
//! MuJoCo computes forces from the state at the start of a step and positions at its end. A step here is `mj_step2` followed by
//! `mj_step1`: after it, positions, velocities and contacts are those of the new instant; forces and accelerations are those of
//! the interval before it. The same inputs give the same bits, also in another process.

mod build;
mod command;
mod contact;
mod params;

pub use params::SimParams;

use crate::DriverError;
use crate::checks::Window;
use crate::drives::Drives;
use crate::floor::Floors;
use crate::mjcf::contact::ContactPoint;
use crate::mjcf::{self, TIME_STEP_S};
use crate::sensors::Sensors;
use crate::simulator::Simulator;
use crate::terrain::Terrain;
use lcmtypes::{GroundTruth, RobotCommand, RobotState};
use mujoco_rs::prelude::{MjData, MjModel, MjtObjBase};
use nalgebra::Vector3;
use robot_model::math::quaternion;
use robot_model::{GRAVITY, Pose};
use std::collections::BTreeMap;

/// Largest penetration of the ground at the start, m.
const MAX_PENETRATION: f64 = 1e-4;
/// Largest number of steps in which the robot is raised out of the ground.
const MAX_LIFTS: usize = 20;

/// Largest distance of an object from its pose in the link at the start of a weld, m.
const WELD_DISTANCE_M: f64 = 0.05;

/// Indices of the readings of an IMU in the sensor data.
#[derive(Clone, Copy)]
struct Imu {
    /// It is on a body that cannot move.
    is_static: bool,
    orientation: usize,
    gyro: usize,
    accelerometer: usize,
}

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
    /// Index of each contact's own floor among the mocap bodies; `None` for a contact with the common ground.
    floor_bodies: Vec<Option<usize>>,
    contacts: Vec<ContactIndex>,
    /// Name of each object and index of its body.
    objects: Vec<(String, usize)>,
    /// Index of the constraint of each weld, and when it is active.
    welds: Vec<(usize, Window)>,
    /// Geoms from this index on are those of objects.
    first_object_geom: i32,
    /// Name of each link and index of its body.
    body_of_link: Vec<(String, usize)>,
    /// Pose of each link in its body.
    X_BL: Vec<Pose>,
    base: usize,
    is_fixed: bool,
    /// Height of the base above the ground when the robot stands on its feet, m.
    standing_height: f64,
    imus: Vec<Imu>,
    command: RobotCommand,
    /// Force on each contact in the last interval, in W, N.
    f_F_W: Vec<[f64; 3]>,
    /// Moment of this force about the point of the contact, in W, N m.
    tau_F_W: Vec<[f64; 3]>,
    contact: Vec<i8>,
}

/// Indices of a joint in MuJoCo, and its range.
struct JointIndex {
    qpos: usize,
    qvel: usize,
    /// The first contact that it moves.
    contact: Option<usize>,
    has_drive: bool,
    lower: f64,
    upper: f64,
}

/// A contact in MuJoCo.
struct ContactIndex {
    geom: usize,
    body: usize,
    /// Pose of the contact's link in the body.
    X_BL: Pose,
    point: ContactPoint,
}

impl MujocoSim {
    /// The model with its ground as MJCF text, for MuJoCo's viewer or a renderer.
    pub fn mjcf(&self) -> String {
        mjcf::with_elevation(&self.mjcf, &self.terrain)
    }

    /// The ground.
    pub fn terrain(&self) -> &Terrain {
        &self.terrain
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

    /// Pose of an object in W; `None` if there is none with this name.
    pub fn object_pose(&self, name: &str) -> Option<Pose> {
        self.objects.iter().find(|(object, _)| object == name).map(|(_, body)| self.X_W(*body))
    }

    /// Pose of a link of the robot in W; `None` if there is none with this name.
    pub fn link_pose(&self, name: &str) -> Option<Pose> {
        let (at, (_, body)) = self.body_of_link.iter().enumerate().find(|(_, (link, _))| link == name)?;
        Some(self.X_W(*body).then(&self.X_BL[at]))
    }

    /// Pose of a body in W.
    fn X_W(&self, body: usize) -> Pose {
        Pose { p: Vector3::from(self.data.xpos()[body]), R: quaternion::to_rotation(self.data.xquat()[body]) }
    }

    /// Simulated time, ns.
    fn t_ns(&self) -> i64 {
        (self.data.time() * 1e9).round() as i64
    }

    /// Activates and deactivates the welds for the next step.
    ///
    /// # Errors
    /// [`DriverError::FarWeld`]: a weld begins, and its object is far from the pose in the link.
    fn update_welds(&mut self) -> Result<(), DriverError> {
        let t_ns = self.t_ns();
        for (number, (weld, window)) in (1..).zip(&self.welds) {
            let is_active = window.contains(t_ns);
            if is_active && !self.data.eq_active()[*weld] {
                let distance = self.weld_distance(*weld);
                if distance > WELD_DISTANCE_M {
                    return Err(DriverError::FarWeld { number, distance, expected: WELD_DISTANCE_M });
                }
            }
            self.data.eq_active_mut()[*weld] = is_active;
        }
        Ok(())
    }

    /// Distance of the object of a weld from its pose in the link, m.
    fn weld_distance(&self, weld: usize) -> f64 {
        let body = |ids: &[i32]| usize::try_from(ids[weld]).expect("the constraint has two bodies");
        let (link, object) = (body(self.data.model().eq_obj1id()), body(self.data.model().eq_obj2id()));
        // Anchor (3), position (3) and quaternion (4) of the object's body in the link's.
        let data = &self.data.model().eq_data()[weld];
        let p_LO = Vector3::new(data[3], data[4], data[5]);
        let X_WL = self.X_W(link);
        (X_WL.p + X_WL.R * p_LO - Vector3::from(self.data.xpos()[object])).norm()
    }

    /// Applies the floor moves that are due and whose foot is high enough.
    fn move_floors(&mut self) {
        let t_ns = self.t_ns();
        for (foot, place) in self.floor_bodies.iter().enumerate() {
            let Some(place) = *place else { continue };
            let lowest = self.lowest_point(&self.contacts[foot])[2];
            if let Some(height) = self.floors.update(t_ns, foot, lowest) {
                self.data.mocap_pos_mut()[place][2] = height;
            }
        }
    }

    /// Places the base of a robot that is not fixed: on its feet if it has any, else on the parts that touch the ground.
    fn place_base(&mut self) {
        self.data.qpos_mut()[..3].fill(0.0);
        self.data.qpos_mut()[3..7].copy_from_slice(&self.params.start.quaternion_wxyz());
        self.data.kinematics();
        let lift = |contact: &ContactIndex| {
            let [x, y, z] = self.p_WL(contact);
            let R_WL = quaternion::to_rotation(self.data.xquat()[contact.body]) * contact.X_BL.R;
            self.terrain.height_at(x, y) + contact.point.depth(&R_WL) - z
        };
        let feet = self.contacts.iter().filter(|contact| contact.point.is_foot());
        let lifts = feet.map(lift).reduce(f64::max);
        let height = lifts.unwrap_or(0.0);
        self.data.qpos_mut()[2] = height;
        if !self.params.start.is_plain() || lifts.is_none() {
            self.lift_out_of_the_ground();
        }
        if self.params.start.is_plain() {
            self.standing_height = self.data.qpos()[2] - self.terrain.height_at(0.0, 0.0);
        }
    }

    /// Raises the robot until no part of it penetrates the ground; a lying robot touches it with more than its feet.
    fn lift_out_of_the_ground(&mut self) {
        for _ in 0..MAX_LIFTS {
            self.data.forward();
            let of_robot =
                self.data.contact().iter().filter(|contact| contact.geom1.max(contact.geom2) < self.first_object_geom);
            let deepest = of_robot.map(|contact| contact.dist).fold(0.0, f64::min);
            if deepest > -MAX_PENETRATION {
                break;
            }
            self.data.qpos_mut()[2] -= deepest;
        }
    }

    /// One physics step.
    fn physics_step(&mut self) -> Result<(), DriverError> {
        for joint in 0..self.joints.len() {
            let JointIndex { contact, has_drive, .. } = self.joints[joint];
            if !has_drive {
                continue;
            }
            let airborne = contact.is_some_and(|contact| self.contact[contact] == 0);
            self.data.ctrl_mut()[joint] = self.drives.torque(joint, self.torque(joint), airborne);
        }
        self.move_floors();
        self.data.step2();
        self.read_contact_forces();
        self.check_finite()?;
        self.update_welds()?;
        self.data.step1();
        Ok(())
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
                wanted_by: "posture".to_owned(),
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
        if !self.is_fixed {
            self.place_base();
        }
        self.data.forward();
        self.read_contact_forces();
        // Held until the first step: the accelerometer reads gravity, not the fall of a limp robot.
        self.data.qacc_mut().fill(0.0);
        self.data.rne_post_constraint();
        self.data.sensor_acc();
        self.update_welds()?;
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
        let read = self.data.sensordata();
        state.n_imus = self.imus.len() as i32;
        state.q_WI_wxyz.resize(self.imus.len(), [0.0; 4]);
        state.w_WI_I.resize(self.imus.len(), [0.0; 3]);
        state.a_I.resize(self.imus.len(), [0.0; 3]);
        for (k, imu) in self.imus.iter().enumerate() {
            let Imu { is_static, orientation, gyro, accelerometer } = *imu;
            state.q_WI_wxyz[k].copy_from_slice(&read[orientation..orientation + 4]);
            state.w_WI_I[k].copy_from_slice(&read[gyro..gyro + 3]);
            state.a_I[k].copy_from_slice(&read[accelerometer..accelerometer + 3]);
            // MuJoCo computes no acceleration of bodies that cannot move: it would read 0 instead of gravity.
            if is_static {
                let R_WI = quaternion::to_rotation(state.q_WI_wxyz[k]);
                state.a_I[k] = (R_WI.transpose() * Vector3::new(0.0, 0.0, GRAVITY)).into();
            }
        }
        self.sensors.measure(state);
    }

    fn ground_truth(&self, t_ns: i64, truth: &mut GroundTruth) {
        // Velocity of the free joint: linear velocity of the origin in W, then angular velocity in B.
        let [vx, vy, vz, wx, wy, wz] =
            if self.is_fixed { [0.0; 6] } else { std::array::from_fn(|i| self.data.qvel()[i]) };
        truth.t_ns = t_ns;
        truth.p_WB = self.data.xpos()[self.base];
        truth.q_WB_wxyz = self.data.xquat()[self.base];
        truth.v_WB = [vx, vy, vz];
        truth.w_WB_W = (self.X_W(self.base).R * Vector3::new(wx, wy, wz)).into();
        truth.n_contacts = self.contacts.len() as i32;
        truth.p_WF.clear();
        truth.v_WF.clear();
        for contact in &self.contacts {
            truth.p_WF.push(self.lowest_point(contact));
            let [_, _, _, vx, vy, vz] = self.data.object_velocity(MjtObjBase::mjOBJ_GEOM, contact.geom, false);
            truth.v_WF.push([vx, vy, vz]);
        }
        truth.f_F_W.clone_from(&self.f_F_W);
        truth.tau_F_W.clone_from(&self.tau_F_W);
        truth.contact.clone_from(&self.contact);
        let [fx, fy, fz, tx, ty, tz] = self.data.xfrc_applied()[self.base];
        truth.f_push_W = [fx, fy, fz];
        truth.tau_push_W = [tx, ty, tz];
        truth.n_objects = self.objects.len() as i32;
        for list in [&mut truth.p_WO, &mut truth.v_WO, &mut truth.w_WO_W] {
            list.clear();
        }
        truth.q_WO_wxyz.clear();
        for &(_, body) in &self.objects {
            let [wx, wy, wz, vx, vy, vz] = self.data.object_velocity(MjtObjBase::mjOBJ_XBODY, body, false);
            truth.p_WO.push(self.data.xpos()[body]);
            truth.q_WO_wxyz.push(self.data.xquat()[body]);
            truth.v_WO.push([vx, vy, vz]);
            truth.w_WO_W.push([wx, wy, wz]);
        }
    }

    fn apply(&mut self, command: &RobotCommand) -> Result<(), DriverError> {
        command::check(command, &self.joint_names)?;
        self.command.clone_from(command);
        Ok(())
    }

    fn step(&mut self) -> Result<(), DriverError> {
        (0..self.params.physics_steps).try_for_each(|_| self.physics_step())
    }

    fn add_push(&mut self, link: Option<&str>, f_W: [f64; 3], tau_W: [f64; 3]) -> Result<(), DriverError> {
        let body = match link {
            None => self.base,
            Some(name) => {
                let found = self.body_of_link.iter().chain(&self.objects).find(|(link, _)| link == name);
                found.map(|(_, body)| *body).ok_or_else(|| DriverError::Unknown {
                    wanted_by: "push.link".to_owned(),
                    what: "link or object",
                    name: name.to_owned(),
                    known: self.body_of_link.iter().chain(&self.objects).map(|(link, _)| link.clone()).collect(),
                })?
            }
        };
        let wrench = f_W.into_iter().chain(tau_W);
        self.data.xfrc_applied_mut()[body].iter_mut().zip(wrench).for_each(|(sum, part)| *sum += part);
        Ok(())
    }

    fn torque_of_touch(&self, foot: usize, f_W: [f64; 3]) -> Vec<f64> {
        let contact = &self.contacts[foot];
        let (J, _) = self.data.jac(true, false, &self.lowest_point(contact), contact.body);
        let nv = J.len() / 3;
        let of_joint = |joint: &JointIndex| -(0..3).map(|axis| J[axis * nv + joint.qvel] * f_W[axis]).sum::<f64>();
        self.joints.iter().map(of_joint).collect()
    }

    fn clear_pushes(&mut self) {
        self.data.xfrc_applied_mut().fill([0.0; 6]);
    }

    fn fallen(&self) -> bool {
        if self.is_fixed {
            return false;
        }
        let p = self.X_W(self.base).p;
        let height = p.z - self.terrain.height_at(p.x, p.y);
        height < self.params.min_height * self.standing_height || self.tipped()
    }

    fn below_ground(&self) -> bool {
        let [x, y, z] = self.data.xipos()[self.base];
        !self.is_fixed && z < self.terrain.height_at(x, y)
    }

    fn tipped(&self) -> bool {
        if self.is_fixed {
            return false;
        }
        let R = self.X_W(self.base).R;
        // R = Rz(yaw) Ry(pitch) Rx(roll)
        let pitch = libm::asin(-R[(2, 0)].clamp(-1.0, 1.0));
        let roll = libm::atan2(R[(2, 1)], R[(2, 2)]);
        roll.abs() > self.params.max_tilt || pitch.abs() > self.params.max_tilt
    }
}
