//! Check and limits of a command before it is published.

use super::fault::{Fault, fault};
use super::joints::is_plausible;
use crate::model::JointInfo;
use lcmtypes::{ControllerTick, RobotCommand, RobotState};

/// Checks that every number of a command is finite.
pub fn check_command(command: &RobotCommand) -> Option<Fault> {
    let RobotCommand { tau, q_des, qd_des, kp, kd, .. } = command;
    for values in [tau, q_des, qd_des, kp, kd] {
        if let Some(j) = values.iter().position(|x| !x.is_finite()) {
            return fault(ControllerTick::FAULT_COMMAND, Some(j), values[j]);
        }
    }
    None
}

/// Limits the torque that the drives will apply at the measured state, `tau + kp (q_des - q) + kd (qd_des - qd)`, to what each joint's
/// drive can do at its velocity ([`JointInfo::torque_range`]). This is the last step before a command is published, in the safe state too.
///
/// A joint without a plausible measurement is not limited: a limit computed from such a value could remove all damping.
pub fn limit_command(joints: &[JointInfo], command: &mut RobotCommand, measured: &RobotState) {
    for (j, joint) in joints.iter().enumerate() {
        let (Some(&q), Some(&qd)) = (measured.q.get(j), measured.qd.get(j)) else { continue };
        if !is_plausible(q) || !is_plausible(qd) {
            continue;
        }
        match command.mode {
            RobotCommand::MODE_TORQUE => {
                let feedback = command.kp[j] * (command.q_des[j] - q) + command.kd[j] * (command.qd_des[j] - qd);
                let total = command.tau[j] + feedback;
                let (least, most) = joint.torque_range(qd);
                if total < least || total > most {
                    command.tau[j] = total.clamp(least, most) - feedback;
                }
            }
            RobotCommand::MODE_DAMPING if qd.abs() * command.kd[j] > joint.effort => {
                command.kd[j] = joint.effort / qd.abs();
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_non_finite_number_in_a_command_is_a_fault_of_its_joint() {
        let good = RobotCommand::zeros(3);
        assert_eq!(check_command(&good), None);
        let fields: [fn(&mut RobotCommand) -> &mut Vec<f64>; 5] =
            [|c| &mut c.tau, |c| &mut c.q_des, |c| &mut c.qd_des, |c| &mut c.kp, |c| &mut c.kd];
        for (number, values) in [f64::NAN, f64::INFINITY].into_iter().flat_map(|x| fields.map(|values| (x, values))) {
            let mut command = good.clone();
            values(&mut command)[2] = number;
            let found = check_command(&command).unwrap();
            assert_eq!((found.code, found.index), (ControllerTick::FAULT_COMMAND, 2));
        }
    }
}
