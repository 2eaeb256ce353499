//! ROBOT_INFO: by which a controller knows that the robot behind a driver is the robot of its run.

use lcmtypes::RobotInfo;
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
    }
}
