//! ROBOT_INFO: the robot that a driver moves, compared with the robot that a run controls.

use lcmtypes::{RobotInfo, RunInfo};
use robot_model::RobotDescription;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;

/// Period at which a driver sends ROBOT_INFO, ns.
pub const ROBOT_INFO_EVERY_NS: i64 = 1_000_000_000;

/// Describes a robot.
///
/// - `joints`: names of the actuated joints, in URDF order.
/// - `sender_id`: identifies the driver.
pub fn robot_info(robot: &str, urdf: &str, joints: &[String], sender_id: i64) -> RobotInfo {
    let mut urdf_sha256 = String::new();
    for byte in Sha256::digest(urdf) {
        write!(urdf_sha256, "{byte:02x}").expect("writing to a string does not fail");
    }
    RobotInfo {
        t_ns: 0,
        sender_id,
        t_start_ns: 0,
        robot: robot.to_owned(),
        num_joints: i32::try_from(joints.len()).expect("robots have fewer than 2^31 joints"),
        joint_names: joints.to_vec(),
        urdf_sha256,
        ..RobotInfo::default()
    }
}

/// Links of the IMUs of a robot, in the order of the arrays of `robot_state_t`.
pub fn imu_links(robot: &RobotDescription) -> Vec<String> {
    robot.imus.iter().map(|imu| imu.link.clone()).collect()
}

/// The same robot with the links of its IMUs and the names of its force/torque sensors.
#[must_use]
pub fn with_sensors(robot: RobotInfo, imus: &[String], force_torque_sensors: &[String]) -> RobotInfo {
    let count = |names: &[String]| i32::try_from(names.len()).expect("robots have fewer than 2^31 sensors");
    RobotInfo {
        num_imus: count(imus),
        imus: imus.to_vec(),
        num_ft: count(force_torque_sensors),
        force_torque_sensors: force_torque_sensors.to_vec(),
        ..robot
    }
}

/// The robot that a run controls.
pub fn of_run(info: &RunInfo) -> RobotInfo {
    let robot = robot_info(&info.robot, &info.urdf, &info.joints, info.run_id);
    with_sensors(robot, &info.imus, &info.force_torque_sensors)
}

/// How a robot differs from the expected one, as a sentence; `None` if name, joints, sensors and URDF are equal. A driver with an empty hash and no sensors is
/// compared by its joints only.
pub fn difference(found: &RobotInfo, expected: &RobotInfo) -> Option<String> {
    if found.robot != expected.robot {
        return Some(format!("robot {:?}, expected {:?}", short(&found.robot), short(&expected.robot)));
    }
    let [n, m] = [found, expected].map(|info| info.joint_names.len());
    if n != m {
        return Some(format!("{n} joints, expected {m}"));
    }
    let mut joints = found.joint_names.iter().zip(&expected.joint_names).enumerate();
    if let Some((j, (a, b))) = joints.find(|(_, (a, b))| a != b) {
        return Some(format!("joint {j} is {:?}, expected {:?}", short(a), short(b)));
    }
    let sensors = |info: &RobotInfo| [info.imus.clone(), info.force_torque_sensors.clone()].concat();
    let (a, b) = (sensors(found), sensors(expected));
    let knows_sensors = !found.urdf_sha256.is_empty() || !a.is_empty();
    if let Some(k) = (0..a.len().max(b.len())).find(|k| a.get(*k) != b.get(*k)).filter(|_| knows_sensors) {
        let name = |names: &[String]| names.get(k).map_or("none".to_owned(), |name| format!("{:?}", short(name)));
        return Some(format!("sensor {k} is {}, expected {}", name(&a), name(&b)));
    }
    let [a, b] = [found, expected].map(|info| short(&info.urdf_sha256));
    (a != b && !a.is_empty() && !b.is_empty()).then(|| format!("URDF with SHA-256 {a}, expected {b}"))
}

/// At most 64 characters of a foreign text.
fn short(text: &str) -> String {
    text.chars().take(64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_differ_in_name_joints_or_urdf() {
        let joints = |names: [&str; 2]| names.map(str::to_owned);
        let expected = robot_info("a", "<robot/>", &joints(["x", "y"]), 1);
        assert_eq!(expected.urdf_sha256.len(), 64);
        let same = RobotInfo { t_ns: 5, sender_id: 2, t_start_ns: 3, ..expected.clone() };
        assert_eq!(difference(&same, &expected), None);
        let unknown = RobotInfo { urdf_sha256: String::new(), ..expected.clone() };
        assert_eq!(difference(&unknown, &expected), None);
        for (found, named) in [
            (robot_info("b", "<robot/>", &joints(["x", "y"]), 1), "\"b\""),
            (robot_info("a", "<robot/>", &joints(["y", "x"]), 1), "joint 0"),
            (robot_info("a", "<robot/>", &joints(["x", "y"])[..1], 1), "1 joints"),
            (with_sensors(expected.clone(), &["imu".to_owned()], &[]), "sensor 0"),
            (robot_info("a", "<robot />", &joints(["x", "y"]), 1), "SHA-256"),
        ] {
            assert!(difference(&found, &expected).is_some_and(|text| text.contains(named)), "{named}");
        }
    }
}
