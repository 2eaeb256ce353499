//! Fault injection: errors of sensors, messages, clocks and drives between a robot and its controller.
//!
//! All faults act on the messages ROBOT_STATE and ROBOT_COMMAND in [`FaultInjection`], so a simulator and a live robot fail in the
//! same way. A false touch also needs the swing time of the legs and, from the simulator, the Jacobians of the feet.

mod entry;
mod inject;

pub(crate) use entry::FaultEntry;
pub use inject::FaultInjection;

use crate::checks::Window;
use controller::quadruped::leg::Leg;
use serde::Deserialize;

/// A fault.
#[derive(Clone, Debug, PartialEq)]
pub enum FaultKind {
    /// Position, velocity and torque sensor of a joint read NaN.
    NanSensor {
        /// The joint.
        joint: String,
    },
    /// One sensor of a joint has an offset.
    FalseReading {
        /// The joint.
        joint: String,
        /// Which sensor.
        quantity: Quantity,
        /// Offset, in the unit of the sensor.
        offset: f64,
    },
    /// Operator commands are lost.
    DropOperator,
    /// ROBOT_STATE messages are lost.
    DropState,
    /// ROBOT_STATE messages are delayed.
    DelayState {
        /// Delay, ns.
        delay_ns: i64,
    },
    /// ROBOT_COMMAND messages are lost; the drives keep the last command.
    DropCommand,
    /// The driver's process does not run: messages are lost in both directions.
    LateProcess,
    /// The driver's clock jumps.
    ClockJump {
        /// Jump, ns; positive: ahead.
        jump_ns: i64,
    },
    /// The IMU has an offset, in its own axes.
    ImuBias {
        /// Angular velocity, rad/s.
        gyro: [f64; 3],
        /// Rotation vector of the orientation, rad.
        orientation: [f64; 3],
    },
    /// The position sensor of a joint keeps its value from the start of the fault; the velocity reads 0.
    StuckEncoder {
        /// The joint.
        joint: String,
    },
    /// A drive gives only a fraction of its torque, damping included.
    TorqueLoss {
        /// The joint.
        joint: String,
        /// The remaining fraction, 0 to 1.
        factor: f64,
    },
    /// In each swing of a leg, its torque sensors read a vertical contact force for a short time.
    FalseTouch {
        /// The leg; `None` for all legs.
        leg: Option<Leg>,
        /// The force, N.
        force: f64,
        /// Time within the swing, ns after lift-off was commanded.
        swing: Window,
    },
}

/// Sensor of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Position, rad.
    Position,
    /// Velocity, rad/s.
    Velocity,
    /// Torque, N m.
    Torque,
}

impl std::fmt::Display for FaultKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            FaultKind::NanSensor { joint } => write!(f, "nan_sensor of {joint}"),
            FaultKind::FalseReading { joint, quantity, offset } => {
                write!(f, "false_reading of {offset} in the {quantity:?} of {joint}")
            }
            FaultKind::DropOperator => write!(f, "drop_operator"),
            FaultKind::DropState => write!(f, "drop_state"),
            FaultKind::DelayState { delay_ns } => write!(f, "delay_state by {} us", delay_ns / 1000),
            FaultKind::DropCommand => write!(f, "drop_command"),
            FaultKind::LateProcess => write!(f, "late_process"),
            FaultKind::ClockJump { jump_ns } => write!(f, "clock_jump by {} us", jump_ns / 1000),
            FaultKind::ImuBias { gyro, orientation } => write!(f, "imu_bias of {gyro:?} rad/s and {orientation:?} rad"),
            FaultKind::StuckEncoder { joint } => write!(f, "stuck_encoder of {joint}"),
            FaultKind::TorqueLoss { joint, factor } => write!(f, "torque_loss of {joint} to {factor}"),
            FaultKind::FalseTouch { leg, force, .. } => {
                write!(f, "false_touch of {} with {force} N", leg.map_or("all feet", Leg::name))
            }
        }
    }
}

/// A fault and when it is active.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultWindow {
    /// When it is active.
    pub window: Window,
    /// The fault.
    pub kind: FaultKind,
}
