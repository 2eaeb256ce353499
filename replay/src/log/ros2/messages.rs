//! The standard ROS 2 messages that viewers read, and their encoding in CDR (Common Data Representation).

use super::definitions;
use byteorder::LittleEndian;
use serde::Serialize;

/// Encapsulation header: plain CDR, version 1, little-endian. Source: OMG, *DDS Interoperability Wire Protocol* 2.5, §10.2.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// A message in CDR. Primitives are aligned to their size, counted from the end of the encapsulation header.
pub(super) fn to_cdr(message: &impl Serialize) -> Vec<u8> {
    let mut out = HEADER.to_vec();
    cdr_encoding::to_writer::<_, LittleEndian, _>(&mut out, message)
        .expect("writing to memory does not fail, and every sequence has a known length");
    out
}

/// A message type of a ROS 2 package.
pub(super) trait StandardMessage: Serialize {
    /// Package and name, such as `sensor_msgs/msg/Imu`.
    const TYPE: &'static str;
    /// Definition in the language `ros2msg`.
    const DEFINITION: &'static str;
}

/// `std_msgs/String`.
#[derive(Serialize)]
pub(super) struct Text<'a> {
    pub data: &'a str,
}

/// `builtin_interfaces/Time`.
#[derive(Serialize)]
struct Time {
    sec: i32,
    nanosec: u32,
}

/// `std_msgs/Header`.
#[derive(Serialize)]
pub(super) struct Header<'a> {
    stamp: Time,
    frame_id: &'a str,
}

impl<'a> Header<'a> {
    /// A time in ns and a frame. A time beyond 2038 is written as the last second that the type holds.
    pub fn new(t_ns: i64, frame_id: &'a str) -> Self {
        let sec = i32::try_from(t_ns.div_euclid(1_000_000_000)).unwrap_or(i32::MAX);
        Header { stamp: Time { sec, nanosec: t_ns.rem_euclid(1_000_000_000) as u32 }, frame_id }
    }
}

/// `geometry_msgs/Quaternion`: x y z w.
#[derive(Serialize)]
pub(super) struct Quaternion([f64; 4]);

impl Quaternion {
    /// From the order of our messages, w x y z.
    pub fn of_wxyz([w, x, y, z]: [f64; 4]) -> Self {
        Quaternion([x, y, z, w])
    }
}

/// `geometry_msgs/TransformStamped`: pose of a frame in its parent, m.
#[derive(Serialize)]
pub(super) struct TransformStamped<'a> {
    pub header: Header<'a>,
    pub child_frame_id: &'a str,
    pub translation: [f64; 3],
    pub rotation: Quaternion,
}

/// `tf2_msgs/TFMessage`.
#[derive(Serialize)]
pub(super) struct TfMessage<'a> {
    pub transforms: Vec<TransformStamped<'a>>,
}

/// `sensor_msgs/JointState`: rad, rad/s, N·m for revolute joints.
#[derive(Serialize)]
pub(super) struct JointState<'a> {
    pub header: Header<'a>,
    pub name: Vec<&'a str>,
    pub position: &'a [f64],
    pub velocity: &'a [f64],
    pub effort: &'a [f64],
}

/// `sensor_msgs/Imu`: rad/s and m/s², in the frame of the IMU. Covariances of zero mean "unknown".
#[derive(Serialize)]
pub(super) struct Imu<'a> {
    pub header: Header<'a>,
    pub orientation: Quaternion,
    pub orientation_covariance: [f64; 9],
    pub angular_velocity: [f64; 3],
    pub angular_velocity_covariance: [f64; 9],
    pub linear_acceleration: [f64; 3],
    pub linear_acceleration_covariance: [f64; 9],
}

/// `geometry_msgs/WrenchStamped`: N, N·m.
#[derive(Serialize)]
pub(super) struct WrenchStamped<'a> {
    pub header: Header<'a>,
    pub force: [f64; 3],
    pub torque: [f64; 3],
}

impl StandardMessage for Text<'_> {
    const TYPE: &'static str = "std_msgs/msg/String";
    const DEFINITION: &'static str = definitions::STRING;
}

impl StandardMessage for TfMessage<'_> {
    const TYPE: &'static str = "tf2_msgs/msg/TFMessage";
    const DEFINITION: &'static str = definitions::TF_MESSAGE;
}

impl StandardMessage for JointState<'_> {
    const TYPE: &'static str = "sensor_msgs/msg/JointState";
    const DEFINITION: &'static str = definitions::JOINT_STATE;
}

impl StandardMessage for Imu<'_> {
    const TYPE: &'static str = "sensor_msgs/msg/Imu";
    const DEFINITION: &'static str = definitions::IMU;
}

impl StandardMessage for WrenchStamped<'_> {
    const TYPE: &'static str = "geometry_msgs/msg/WrenchStamped";
    const DEFINITION: &'static str = definitions::WRENCH_STAMPED;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected bytes by hand, from the alignment rules.
    #[test]
    fn primitives_are_aligned_after_the_header() {
        #[rustfmt::skip]
        assert_eq!(to_cdr(&(1_u8, 1.0_f64, "ab", -2_i16)), [
            0, 1, 0, 0,
            1, 0, 0, 0, 0, 0, 0, 0,
            0, 0, 0, 0, 0, 0, 0xf0, 0x3f,
            3, 0, 0, 0, b'a', b'b', 0, 0,
            0xfe, 0xff,
        ]);
    }

    #[test]
    fn a_header_has_seconds_nanoseconds_and_frame() {
        #[rustfmt::skip]
        assert_eq!(to_cdr(&Header::new(-1, "W")), [
            0, 1, 0, 0,
            0xff, 0xff, 0xff, 0xff, 0xff, 0xc9, 0x9a, 0x3b,
            2, 0, 0, 0, b'W', 0,
        ]);
    }
}
