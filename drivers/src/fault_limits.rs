//! The limits that a fault's value is compared with, for the texts of EVENTs.

use controller::params::{Params, apply_overrides};
use controller::quadruped::params::{DUTY, STEP_HEIGHT, SWING_FREQUENCY};
use lcmtypes::{ControllerTick, RunInfo};
use robot_model::{Joint, JointKind, UrdfTree};

/// Limits of a run: parameters in force, and joints in URDF order.
#[derive(Debug)]
pub struct FaultLimits {
    params: Params,
    joints: Vec<Joint>,
}

impl FaultLimits {
    /// The limits at the start of a run; `None` if its description cannot be read.
    pub fn new(info: &RunInfo) -> Option<Self> {
        let params = Params::from_toml(info.params(), "RUN_INFO").ok()?;
        let tree = UrdfTree::parse(&info.urdf, "RUN_INFO").ok()?;
        let joints = tree.joints.into_iter().filter(|joint| joint.kind != JointKind::Fixed).collect();
        Some(FaultLimits { params, joints })
    }

    /// Takes a changed parameter.
    pub fn change(&mut self, key: &str, value: &str) {
        let changed = apply_overrides(&self.params.to_toml(), &[(key.to_owned(), value.to_owned())]);
        if let Some(params) = changed.ok().and_then(|text| Params::from_toml(&text, "parameters").ok()) {
            self.params = params;
        }
    }

    /// The limit of a fault in the unit of its value, and where it comes from; `None` if the fault has no limit.
    ///
    /// - `fault`, `index`: FAULT_* and index of `controller_tick_t`.
    pub fn text(&self, fault: i32, index: Option<usize>) -> Option<String> {
        let Params { safety, stand, trunk, .. } = &self.params;
        let joint = || self.joints.get(index?);
        Some(match fault {
            ControllerTick::FAULT_STATE_STALE => format!("limit {} (safety.max_state_age)", safety.max_state_age),
            ControllerTick::FAULT_TILT => format!("limit {} (safety.max_tilt)", safety.max_tilt),
            ControllerTick::FAULT_QP => format!("limit {} (safety.max_qp_failures)", safety.max_qp_failures),
            ControllerTick::FAULT_OPERATOR_STALE => {
                format!("limit {} (safety.max_operator_age)", safety.max_operator_age)
            }
            ControllerTick::FAULT_NO_CONTACT if index.is_none() => {
                format!("limit {} (safety.max_flight_time)", safety.max_flight_time)
            }
            ControllerTick::FAULT_HEIGHT => {
                format!("limit {} of the nominal height (safety.min_height)", safety.min_height)
            }
            ControllerTick::FAULT_POSTURE => format!("limit {} for {} s (stand)", stand.max_error, stand.timeout),
            ControllerTick::FAULT_JOINT_POSITION => {
                let (joint, margin) = (joint()?, safety.position_margin);
                format!("limits {:.3} to {:.3}", joint.limits.lower - margin, joint.limits.upper + margin)
            }
            ControllerTick::FAULT_JOINT_VELOCITY => {
                format!("limit {:.3}", safety.velocity_factor * joint()?.limits.velocity)
            }
            ControllerTick::FAULT_JOINT_TORQUE => format!("limit {:.3}", safety.torque_factor * joint()?.limits.effort),
            ControllerTick::FAULT_OPERATOR_RANGE => match index? {
                3 | 4 => format!("limit {} (trunk.max_orientation)", trunk.max_orientation),
                5 => format!("limit {} (trunk.max_height_offset)", trunk.max_height_offset),
                k => format!("expected {}", [SWING_FREQUENCY, DUTY, STEP_HEIGHT].get(k)?.expected),
            },
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot_files::RobotFiles;

    #[test]
    fn limits_are_those_of_the_parameters_in_force() {
        let (files, params) = RobotFiles::find_with_params("hyq").unwrap();
        let mut limits =
            FaultLimits::new(&RunInfo { urdf: files.urdf, ..RunInfo::default() }.with_params(params)).unwrap();
        for (key, value, fault, index) in [
            ("safety.max_tilt", "0.71", ControllerTick::FAULT_TILT, None),
            ("trunk.max_orientation", "0.21", ControllerTick::FAULT_OPERATOR_RANGE, Some(4)),
            ("trunk.max_height_offset", "0.03", ControllerTick::FAULT_OPERATOR_RANGE, Some(5)),
        ] {
            let before = limits.text(fault, index).unwrap();
            limits.change(key, value);
            let text = limits.text(fault, index).unwrap();
            assert!(!before.contains(value) && text.contains(value) && text.contains(key), "{before}; {text}");
        }
        let duty = limits.text(ControllerTick::FAULT_OPERATOR_RANGE, Some(1)).unwrap();
        assert!(duty.contains(DUTY.expected), "{duty}");
        assert!(limits.text(ControllerTick::FAULT_JOINT_TORQUE, Some(0)).is_some());
        assert_eq!(limits.text(ControllerTick::FAULT_JOINT_TORQUE, Some(12)), None, "HyQ has 12 joints");
        assert_eq!(limits.text(ControllerTick::FAULT_COMMAND, None), None);
    }
}
