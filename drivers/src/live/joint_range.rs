//! Ranges of the values that a driver accepts in a ROBOT_COMMAND, computed from the robot description and its parameters.

use controller::params::Params;
use lcmtypes::RobotCommand;
use robot_model::{JointDescription, JointInfo};
use std::f64::consts::TAU;

/// Largest stiffness and damping as multiples of the largest ones of the robot's parameters.
const GAIN_FACTOR: f64 = 10.0;
/// Largest velocity reference as a multiple of the joint's velocity limit.
const VELOCITY_FACTOR: f64 = 10.0;
/// Distance of a position reference from the joint's limits, as a fraction of the joint's range.
const MARGIN: f64 = 0.25;
/// Smallest such distance, rad or m.
const MIN_MARGIN: f64 = 0.1;
/// Largest position reference of a continuous joint, rad.
const CONTINUOUS: f64 = 1e6;
/// Effort and velocity limit of a joint without limits, the largest number of a URDF: with infinite ranges, infinite values would be accepted.
const UNLIMITED: f64 = 1e9;

/// Ranges of one joint. Each begins at zero or is symmetric, except that of the position reference.
#[derive(Clone, Debug, PartialEq)]
pub struct JointRange {
    name: String,
    effort: f64,
    kp: f64,
    kd: f64,
    q_des: [f64; 2],
    qd_des: f64,
    /// Largest distance between reference and measurement, rad or m.
    error: f64,
}

impl JointRange {
    /// The ranges of each joint of a robot.
    ///
    /// - `described`: joints of the description, which may have gains of their own.
    pub fn of(joints: &[JointInfo], described: &[JointDescription], params: &Params) -> Vec<Self> {
        let of_joint = |joint: &JointInfo| described.iter().find(|other| other.name == joint.name);
        joints.iter().map(|joint| JointRange::new(joint, of_joint(joint), params)).collect()
    }

    fn new(joint: &JointInfo, described: Option<&JointDescription>, params: &Params) -> Self {
        let JointInfo { name, lower, upper, .. } = joint;
        let (effort, velocity) = (joint.effort.min(UNLIMITED), joint.velocity.min(UNLIMITED));
        let (hold, stand, safety) = (&params.hold, &params.stand, &params.safety);
        let own = |gain: fn(&JointDescription) -> Option<f64>| described.and_then(gain).unwrap_or(0.0);
        let (own_kp, own_kd) = (own(|joint| joint.stiffness), own(|joint| joint.damping));
        let range = upper - lower;
        let margin = (MARGIN * range).max(MIN_MARGIN);
        JointRange {
            name: name.clone(),
            effort,
            kp: GAIN_FACTOR * hold.kp.max(stand.stiffness * effort).max(own_kp),
            kd: GAIN_FACTOR * hold.kd.max(stand.damping * effort).max(safety.damping).max(own_kd),
            q_des: if range.is_finite() { [lower - margin, upper + margin] } else { [-CONTINUOUS, CONTINUOUS] },
            qd_des: VELOCITY_FACTOR * velocity,
            error: if range.is_finite() { range + 2.0 * margin } else { TAU },
        }
    }

    /// The first value of joint `j` of a command that is out of range, with its limits.
    pub fn check(&self, j: usize, command: &RobotCommand) -> Option<String> {
        let RobotCommand { tau, q_des, qd_des, kp, kd, .. } = command;
        // Without stiffness the position reference has no effect.
        let [low, high] = if kp[j] == 0.0 { [f64::MIN, f64::MAX] } else { self.q_des };
        // The torque may compensate the joint loop: the drive limits the sum.
        let torque = self.effort + kp[j] * self.error + kd[j] * (qd_des[j].abs() + self.qd_des);
        let values = [
            ("kp", kp[j], 0.0, self.kp),
            ("kd", kd[j], 0.0, self.kd),
            ("q_des", q_des[j], low, high),
            ("qd_des", qd_des[j], -self.qd_des, self.qd_des),
            ("tau", tau[j], -torque, torque),
        ];
        let (field, value, low, high) =
            values.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value))?;
        Some(format!("{field} of {} {value}, expected {low} to {high}", self.name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot_model::{DriveLimits, JointKind, JointRole};

    const PARAMS: &str = include_str!("../../../robots/hyq/hyq.toml");

    fn joint(effort: f64, lower: f64, upper: f64) -> JointInfo {
        let (name, kind) = ("knee".to_owned(), JointKind::Revolute);
        JointInfo { name, kind, lower, upper, effort, velocity: 12.0, drive: DriveLimits::default(), damping: 0.0 }
    }

    fn range(effort: f64, lower: f64, upper: f64) -> JointRange {
        let mut params = Params::from_toml(PARAMS, "hyq.toml").unwrap();
        (params.hold.kp, params.hold.kd, params.safety.damping) = (50.0, 1.0, 2.0);
        (params.stand.stiffness, params.stand.damping) = (3.0, 0.1);
        JointRange::of(&[joint(effort, lower, upper)], &[], &params).remove(0)
    }

    #[test]
    fn ranges_follow_from_effort_limits_and_gains() {
        let strong = range(150.0, -2.0, 1.0);
        assert_eq!((strong.kp, strong.kd), (4500.0, 150.0));
        assert_eq!((strong.q_des, strong.qd_des), ([-2.75, 1.75], 120.0));
        assert_eq!(strong.error, 4.5);
        let weak = range(2.5, 0.0, 0.4);
        assert_eq!((weak.kp, weak.kd), (500.0, 20.0));
        assert_eq!(weak.q_des, [-0.1, 0.5]);
        let continuous = range(2.5, f64::NEG_INFINITY, f64::INFINITY);
        assert_eq!((continuous.error, continuous.q_des), (TAU, [-CONTINUOUS, CONTINUOUS]));
    }

    #[test]
    fn larger_gains_of_the_description_extend_the_range() {
        let params = Params::from_toml(PARAMS, "hyq.toml").unwrap();
        let knee = [joint(2.5, 0.0, 0.4)];
        let own = |name: &str, stiffness, damping| JointDescription {
            name: name.to_owned(),
            role: JointRole::Actuated,
            effort: None,
            velocity: None,
            stiffness,
            damping,
            drive: DriveLimits::default(),
        };
        let described = [own("hip", Some(7e5), Some(7e4)), own("knee", Some(5000.0), Some(3000.0))];
        let range = |described: &[JointDescription]| JointRange::of(&knee, described, &params).remove(0);
        assert_eq!((range(&described).kp, range(&described).kd), (50_000.0, 30_000.0));
        assert_eq!(range(&[own("knee", Some(1e-3), None)]), range(&[]));
    }

    #[test]
    fn a_joint_without_limits_accepts_finite_values_only() {
        let params = Params::from_toml(PARAMS, "hyq.toml").unwrap();
        let (lower, upper) = (f64::NEG_INFINITY, f64::INFINITY);
        let wheel = JointInfo { velocity: f64::INFINITY, ..joint(f64::INFINITY, lower, upper) };
        let range = JointRange::of(&[wheel], &[], &params).remove(0);
        let good = RobotCommand { tau: vec![1e3], ..RobotCommand::zeros(1) };
        assert_eq!(range.check(0, &good), None);
        for change in [
            (|c: &mut RobotCommand| &mut c.tau) as fn(&mut RobotCommand) -> &mut Vec<f64>,
            |c| &mut c.kp,
            |c| &mut c.kd,
            |c| &mut c.qd_des,
            |c| &mut c.q_des,
        ] {
            let mut bad = good.clone();
            change(&mut bad)[0] = f64::INFINITY;
            assert!(range.check(0, &bad).is_some(), "{bad:?}");
        }
    }

    #[test]
    fn a_torque_beyond_the_effort_must_be_explained_by_the_joint_loop() {
        let range = range(150.0, -2.0, 1.0);
        let of = |tau: f64, kp: f64, kd: f64| RobotCommand {
            tau: vec![tau],
            kp: vec![kp],
            kd: vec![kd],
            ..RobotCommand::zeros(1)
        };
        assert_eq!(range.check(0, &of(-150.0, 0.0, 0.0)), None);
        assert!(range.check(0, &of(150.1, 0.0, 0.0)).is_some_and(|text| text.contains("tau of knee 150.1")));
        // 400 N m/rad over 4.5 rad, and 15 N m s/rad over 120 rad/s.
        assert_eq!(range.check(0, &of(150.0 + 1800.0 + 1800.0, 400.0, 15.0)), None);
        assert!(range.check(0, &of(150.0 + 1800.0 + 1801.0, 400.0, 15.0)).is_some());
        let nan = RobotCommand { qd_des: vec![f64::NAN], ..of(0.0, 1.0, 1.0) };
        assert!(range.check(0, &nan).is_some_and(|text| text.contains("qd_des of knee")));
    }
}
