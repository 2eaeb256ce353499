//! Bridge between a live run on LCM and ROS 2 topics over DDS, without a ROS installation.
//!
//! It publishes what a viewer of ROS 2 reads, with the types and encodings of `hoof log convert --encoding ros2`, and optionally takes velocity commands.
//! It never touches the control thread: it is a process of its own that receives messages of the run like any other program, and its commands are those of one
//! more operator.
//!
//! | topic | type | from |
//! |---|---|---|
//! | `/joint_states` | `sensor_msgs/JointState` | ROBOT_STATE |
//! | `/imu` | `sensor_msgs/Imu` | ROBOT_STATE |
//! | `/tf` | `tf2_msgs/TFMessage` | ROBOT_STATE and BASE_TRACKING |
//! | `/contact/FOOT` | `geometry_msgs/WrenchStamped` | CONTACT_ESTIMATE |
//! | `/robot_description` | `std_msgs/String`, latched | RUN_INFO |
//! | `/cmd_vel` (input) | `geometry_msgs/Twist` | [`twist::TwistOperator`] |
//!
//! | module | content |
//! |---|---|
//! | [`session`] | the loop: newest messages of the run to topics, commands to the run |
//! | [`dds`] | participant, writers and reader |
//! | [`twist`] | velocity commands: decoding, and when a robot follows them |

#![allow(non_snake_case, reason = "names carry frames: see ARCHITECTURE.md")]

pub mod dds;
pub mod session;
pub mod twist;

/// Error of the bridge.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum Error {
    #[error("DDS domain {domain}: cannot {what}: {reason}")]
    Dds { domain: u16, what: String, reason: String },
    #[error("DDS domain {domain}, expected 0 to {limit}")]
    Domain { domain: u16, limit: u16 },
    #[error(transparent)]
    Bus(#[from] lcmtypes::bus::BusError),
    #[error("{channel}: {source}")]
    Encode { channel: String, source: lcmtypes::EncodeError },
}
