//! Checks a command before it is applied.

use crate::DriverError;
use lcmtypes::RobotCommand;

/// Checks mode, array lengths and values of a command.
///
/// - `joints`: names of the actuated joints.
///
/// # Errors
/// [`DriverError::CommandMode`], [`DriverError::CommandSize`], [`DriverError::CommandNotFinite`]
pub(super) fn check(command: &RobotCommand, joints: &[String]) -> Result<(), DriverError> {
    let tick = command.tick;
    let fields: [(_, &[f64]); 5] = [
        ("tau", &command.tau),
        ("q_des", &command.q_des),
        ("qd_des", &command.qd_des),
        ("kp", &command.kp),
        ("kd", &command.kd),
    ];
    if !matches!(command.mode, RobotCommand::MODE_IDLE | RobotCommand::MODE_TORQUE | RobotCommand::MODE_DAMPING) {
        return Err(DriverError::CommandMode { tick, found: command.mode });
    }
    for (field, values) in fields {
        if values.len() != joints.len() {
            return Err(DriverError::CommandSize { tick, field, found: values.len(), expected: joints.len() });
        }
        if let Some((joint, found)) = values.iter().enumerate().find(|(_, value)| !value.is_finite()) {
            return Err(DriverError::CommandNotFinite { tick, field, joint: joints[joint].clone(), found: *found });
        }
    }
    Ok(())
}
