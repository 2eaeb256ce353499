//! The robot of a log: joint names, torque limits, mass and link positions from the URDF in RUN_INFO, by [`robot_model`].

use robot_model::{Base, BaseState, Kinematics, Model, ModelError, UrdfTree};

use crate::math::Vec3;

/// The model of the robot in a log.
///
/// The base is fixed in the model: positions are relative to the base link, and a robot without mass can be drawn.
#[derive(Clone, Debug)]
pub struct Robot {
    model: Model,
    /// Parent and child link of each joint, fixed joints included: indices of frames of the model.
    ends: Vec<(usize, usize)>,
}

impl Robot {
    /// Reads the text of a URDF.
    ///
    /// # Errors
    /// The text is not one tree of links with finite, plausible values.
    pub fn parse(urdf: &str) -> Result<Self, ModelError> {
        let tree = UrdfTree::parse(urdf, "URDF in RUN_INFO")?;
        let ends = tree.joints.iter().map(|joint| (joint.parent, joint.child)).collect();
        Ok(Self { model: Model::new(&tree, Base::Fixed)?, ends })
    }

    /// Number of movable joints.
    pub fn nj(&self) -> usize {
        self.model.nj()
    }

    /// Names of the movable joints, in the order of the URDF and of every message.
    pub fn joint_names(&self) -> impl Iterator<Item = &str> {
        self.model.joints.iter().map(|joint| joint.name.as_str())
    }

    /// Largest torque (N m) or force (N) of a joint; `None` if the URDF has no limit or the limit is 0.
    pub fn effort(&self, joint: usize) -> Option<f64> {
        self.model.joints.get(joint).map(|joint| joint.effort).filter(|effort| effort.is_finite() && *effort > 0.0)
    }

    /// Sum of the masses of all links, kg.
    pub fn mass_kg(&self) -> f64 {
        self.model.total_mass()
    }

    /// One line per joint, from the origin of its parent link to the origin of its child link, in the frame of the base link, m.
    /// `q`: positions of the movable joints, rad or m. The list is empty unless `q` has [`Robot::nj`] values.
    pub fn sticks(&self, q: &[f64]) -> Vec<(Vec3, Vec3)> {
        if q.len() != self.nj() {
            return Vec::new();
        }
        let mut kinematics = Kinematics::new(&self.model);
        kinematics.update(&self.model, &BaseState::identity(), q, &vec![0.0; q.len()]);
        let origins: Vec<Vec3> =
            self.model.frames().map(|(frame, _)| kinematics.p_BF_W(&self.model, frame).into()).collect();
        self.ends.iter().map(|&(parent, child)| (origins[parent], origins[child])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEG: &str = r#"<?xml version="1.0"?><robot name="r">
        <link name="base"><inertial><mass value="2.5"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <joint name='hip' type='revolute'><origin xyz="0 0.2 0" rpy="0 0 0"/><parent link="base"/><child link="thigh"/><axis xyz="0 1 0"/>
        <limit lower="-2" upper="2" effort="30" velocity="9"/></joint>
        <link name="thigh"><inertial><mass value='1.5'/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link><link name="toe"/>
        <joint name="foot" type="fixed"><origin xyz="0 0 -0.4"/><parent link="thigh"/><child link="toe"/></joint></robot>"#;

    #[test]
    fn joints_limits_and_mass_are_read() {
        let robot = Robot::parse(LEG).unwrap();
        assert_eq!((robot.mass_kg(), robot.nj()), (4.0, 1));
        assert_eq!(robot.joint_names().collect::<Vec<_>>(), ["hip"]);
        assert_eq!((robot.effort(0), robot.effort(1)), (Some(30.0), None));
        assert!(Robot::parse("no robot < here").is_err());
    }

    /// A thigh of 0.4 m that hangs down swings backward by a quarter turn about +y.
    #[test]
    fn a_quarter_turn_lifts_the_foot() {
        let robot = Robot::parse(LEG).unwrap();
        let [(base, hip), (_, foot)] = robot.sticks(&[std::f64::consts::FRAC_PI_2])[..] else { panic!("two sticks") };
        assert_eq!((base, hip), ([0.0; 3], [0.0, 0.2, 0.0]));
        for (found, expected) in foot.into_iter().zip([-0.4, 0.2, 0.0]) {
            assert!((found - expected).abs() < 1e-15, "{foot:?}");
        }
        assert!(robot.sticks(&[]).is_empty());
    }
}
