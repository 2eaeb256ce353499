//! Checks of measured joint values.

use super::fault::{Fault, fault};
use super::params::SafetyParams;
use crate::model::JointInfo;
use lcmtypes::{ControllerTick, RobotState};

/// Largest plausible magnitude of a joint or gyro value, in its own unit: far above real values, and far below the overflow of a square.
const MAX_MAGNITUDE: f64 = 1e6;

/// Whether a joint or gyro value is finite and plausible.
pub fn is_plausible(x: f64) -> bool {
    x.abs() <= MAX_MAGNITUDE
}

/// Checks the number of joint values, and that each is finite and plausible.
///
/// - `nj`: joints of the model.
pub fn check_joint_values(nj: usize, measured: &RobotState) -> Option<Fault> {
    let RobotState { q, qd, tau, .. } = measured;
    for found in [q.len(), qd.len(), tau.len()] {
        if found != nj {
            #[expect(clippy::cast_precision_loss, reason = "a count for a person to read")]
            return fault(ControllerTick::FAULT_INPUT_SIZE, None, found as f64);
        }
    }
    for values in [q, qd, tau] {
        if let Some(j) = values.iter().position(|x| !is_plausible(*x)) {
            return fault(ControllerTick::FAULT_INPUT_NOT_FINITE, Some(j), values[j]);
        }
    }
    None
}

/// Checks measured position, velocity and torque of each joint against its limits in the URDF, widened by the margins of `params`.
///
/// - `joints`: as many as the measurement has.
pub fn check_joint_limits(joints: &[JointInfo], params: &SafetyParams, measured: &RobotState) -> Option<Fault> {
    for (j, joint) in joints.iter().enumerate() {
        let (q, qd, tau) = (measured.q[j], measured.qd[j], measured.tau[j]);
        if q < joint.lower - params.position_margin || q > joint.upper + params.position_margin {
            return fault(ControllerTick::FAULT_JOINT_POSITION, Some(j), q);
        }
        if qd.abs() > params.velocity_factor * joint.velocity {
            return fault(ControllerTick::FAULT_JOINT_VELOCITY, Some(j), qd);
        }
        if tau.abs() > params.torque_factor * joint.effort {
            return fault(ControllerTick::FAULT_JOINT_TORQUE, Some(j), tau);
        }
    }
    None
}
