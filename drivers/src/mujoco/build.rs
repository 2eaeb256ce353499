//! Builds a simulation: the model, and the indices of its parts in MuJoCo.

use super::{ContactIndex, Imu, JointIndex, MujocoSim, SimParams};
use crate::DriverError;
use crate::drives::Drives;
use crate::floor::Floors;
use crate::mjcf::contact::{ContactPoint, MOST_FLOORS, floor_bits};
use crate::mjcf::object::{object_name, weld_name};
use crate::mjcf::{self, TIME_STEP_S};
use crate::sensors::Sensors;
use crate::simulator::Simulator;
use crate::terrain::Terrain;
use controller::params::RobotConfig;
use lcmtypes::RobotCommand;
use mujoco_rs::prelude::{MjData, MjModel, MjtObjBase};
use robot_model::{Base, JointInfo, JointKind, JointRole, NOMINAL, UrdfTree, check_runnable, with_shapes};
use std::sync::Once;

impl MujocoSim {
    /// Places a robot on the ground, as specified by [`SimParams::start`].
    ///
    /// # Errors
    /// Unknown links or joints, an object with the name of a link, more floors than MuJoCo has bits, a joint that cannot move the robot
    /// ([`check_runnable`]), a model that MuJoCo rejects, or a mass that differs from the URDF by more than 1e-6 of it.
    pub fn new(
        tree: &UrdfTree,
        config: &RobotConfig,
        terrain: Terrain,
        params: SimParams,
    ) -> Result<Self, DriverError> {
        disable_log_file();
        let robot = &config.description(tree)?;
        let model = robot.model(tree)?;
        let nominal = robot.postures.get(NOMINAL).cloned().unwrap_or_default();
        let posture = |joint: &JointInfo| nominal.get(&joint.name).copied().unwrap_or(0.0);
        check_runnable(&model, &model.joints.iter().map(posture).collect::<Vec<_>>())?;
        let links: Vec<String> = robot.contacts.iter().map(|contact| contact.link.clone()).collect();
        let (tree, _) = with_shapes(tree, &links, config.foot_radius, &|_| None);
        let tree = &tree;
        let time_step_s = TIME_STEP_S / f64::from(params.physics_steps);
        let floors = Floors::new(&params.floors, robot)?;
        let own_floor: Vec<bool> = (0..robot.contacts.len()).map(|contact| floors.has(contact)).collect();
        for weld in &params.welds {
            link_exists("weld.link", tree, &weld.link)?;
        }
        if let Some(object) =
            params.objects.iter().find(|object| tree.links.iter().any(|link| link.name == object.name))
        {
            return Err(DriverError::ObjectNamedAsLink { name: object.name.clone() });
        }
        let own_floor =
            floor_bits(&own_floor).map_err(|found| DriverError::TooManyFloors { found, most: MOST_FLOORS })?;
        let scene = (params.objects.as_slice(), params.welds.as_slice());
        let mjcf = mjcf::write(tree, robot, &terrain, params.friction, time_step_s, &own_floor, scene);
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
        let contact_of_subtree = mjcf::contact::of_subtree(tree, robot, &|_| true);
        let mut joint_names = Vec::new();
        let mut joints = Vec::new();
        let movable = tree.joints.iter().filter(|joint| joint.kind != JointKind::Fixed);
        for (joint, described) in movable.zip(&robot.joints) {
            let place = id(MjtObjBase::mjOBJ_JOINT, &joint.name)?;
            let address =
                |addresses: &[i32]| usize::try_from(addresses[place]).map_err(|error| refused(error.to_string()));
            joints.push(JointIndex {
                qpos: address(model.jnt_qposadr())?,
                qvel: address(model.jnt_dofadr())?,
                contact: contact_of_subtree[joint.child],
                has_drive: described.role == JointRole::Actuated,
                lower: joint.limits.lower,
                upper: joint.limits.upper,
            });
            joint_names.push(joint.name.clone());
        }
        let mut body_of_link = Vec::with_capacity(tree.links.len());
        for (link, body) in tree.links.iter().zip(&mjcf.body_of_link) {
            body_of_link.push((link.name.clone(), id(MjtObjBase::mjOBJ_BODY, body)?));
        }
        let mut objects = Vec::with_capacity(params.objects.len());
        for object in &params.objects {
            objects.push((object.name.clone(), id(MjtObjBase::mjOBJ_BODY, &object_name(&object.name))?));
        }
        let mut welds = Vec::with_capacity(params.welds.len());
        for (number, weld) in params.welds.iter().enumerate() {
            welds.push((id(MjtObjBase::mjOBJ_EQUALITY, &weld_name(number))?, weld.window));
        }
        let mut contacts = Vec::with_capacity(robot.contacts.len());
        for contact in &robot.contacts {
            let link = tree.links.iter().position(|link| link.name == contact.link);
            let link = link.ok_or_else(|| refused(format!("link {:?} is missing", contact.link)))?;
            contacts.push(ContactIndex {
                geom: id(MjtObjBase::mjOBJ_GEOM, &mjcf::contact_name(&contact.name))?,
                body: body_of_link[link].1,
                X_BL: mjcf.X_BL[link],
                point: ContactPoint::new(contact, tree),
            });
        }
        let sensor = |name: &str| {
            let sensor = id(MjtObjBase::mjOBJ_SENSOR, name)?;
            usize::try_from(model.sensor_adr()[sensor]).map_err(|error| refused(error.to_string()))
        };
        let mut imus = Vec::new();
        for imu in &robot.imus {
            let name = mjcf::imu_name(&imu.name);
            let [orientation, gyro, accelerometer] =
                ["orientation", "gyro", "accelerometer"].map(|of| sensor(&format!("{name}_{of}")));
            let link = tree.links.iter().position(|link| link.name == imu.link);
            let is_static = link.is_some_and(|link| model.body_weldid()[body_of_link[link].1] == 0);
            imus.push(Imu { is_static, orientation: orientation?, gyro: gyro?, accelerometer: accelerometer? });
        }
        let mut floor_bodies = vec![None; contacts.len()];
        for (contact, place) in floor_bodies.iter_mut().enumerate().filter(|(contact, _)| own_floor[*contact].is_some())
        {
            let body = id(MjtObjBase::mjOBJ_BODY, &mjcf::floor_name(&robot.contacts[contact].name))?;
            *place = usize::try_from(model.body_mocapid()[body]).ok();
        }
        let base = body_of_link[0].1;
        let geoms = model.geom_bodyid().len();
        let mut sim = MujocoSim {
            data: MjData::try_new(Box::new(model)).map_err(|error| refused(error.to_string()))?,
            mjcf: mjcf.text,
            X_BL: mjcf.X_BL,
            terrain,
            sensors: Sensors { resolution: config.sensors.clone(), noise: params.noise.clone(), seed: params.seed },
            drives: Drives::new(&params.drives, &joint_names, time_step_s)?,
            first_object_geom: i32::try_from(geoms - objects.len()).unwrap_or(i32::MAX),
            objects,
            welds,
            floors,
            floor_bodies,
            params,
            command: RobotCommand::default(),
            joint_names,
            joints,
            body_of_link,
            base,
            is_fixed: robot.base == Base::Fixed,
            standing_height: 0.0,
            imus,
            f_F_W: vec![[0.0; 3]; contacts.len()],
            tau_F_W: vec![[0.0; 3]; contacts.len()],
            contact: vec![0; contacts.len()],
            contacts,
        };
        let start = std::mem::take(&mut sim.params.start);
        sim.reset(&nominal)?;
        if !start.is_plain() {
            let posture = start.posture_of(robot)?;
            sim.params.start = start;
            sim.reset(&posture)?;
        }
        Ok(sim)
    }
}

/// Checks that a robot has a link.
fn link_exists(wanted_by: &str, tree: &UrdfTree, name: &str) -> Result<(), DriverError> {
    if tree.links.iter().any(|link| link.name == name) {
        return Ok(());
    }
    let known = tree.links.iter().map(|link| link.name.clone()).collect();
    Err(DriverError::Unknown { wanted_by: wanted_by.to_owned(), what: "link", name: name.to_owned(), known })
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
