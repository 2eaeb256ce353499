//! FaultInjection of a scenario: what goes wrong between robot and controller, and nothing else does.
//!
//! All of them act on the two messages that a driver exchanges, in one place, so a simulator and a robot fail alike. A false touch
//! needs to know besides when legs swing and where feet are.

use crate::DriverError;
use crate::floor::LegName;
use crate::scenario::{Window, to_ns};
use crate::terrain::{BadKey, check_range};
use controller::math::quaternion;
use controller::quadruped::leg::Leg;
use lcmtypes::{RobotCommand, RobotState};
use serde::Deserialize;
use std::collections::VecDeque;

/// What goes wrong.
#[derive(Clone, Debug, PartialEq)]
pub enum FaultKind {
    /// Position, velocity and torque of a joint read NaN.
    NanSensor {
        /// The joint.
        joint: String,
    },
    /// One sensor of a joint reads something besides the truth.
    FalseReading {
        /// The joint.
        joint: String,
        /// Which sensor.
        quantity: Quantity,
        /// What it reads besides, in its own unit.
        offset: f64,
    },
    /// No command of the operator arrives.
    DropOperator,
    /// No state message arrives.
    DropState,
    /// State messages arrive late.
    DelayState {
        /// How late, ns.
        delay_ns: i64,
    },
    /// No command arrives: the drives keep to the last one.
    DropCommand,
    /// The driver's process stands still: nothing passes in either direction.
    LateProcess,
    /// The driver's clock is ahead.
    ClockJump {
        /// By how much, ns; negative = behind.
        jump_ns: i64,
    },
    /// The IMU reads something besides the truth, in its own axes.
    ImuBias {
        /// Angular velocity, rad/s.
        gyro: [f64; 3],
        /// Rotation vector of the orientation, rad.
        orientation: [f64; 3],
    },
    /// Position of a joint keeps the value it had when the fault began, its velocity reads 0.
    StuckEncoder {
        /// The joint.
        joint: String,
    },
    /// A drive gives only a part of its torque, damping included.
    TorqueLoss {
        /// The joint.
        joint: String,
        /// The part that remains, 0 to 1.
        factor: f64,
    },
    /// In each swing of a leg, its torque sensors read for a moment as if the ground pushed it up.
    FalseTouch {
        /// Whose foot; none = all.
        leg: Option<Leg>,
        /// The force that is read, N.
        force: f64,
        /// When in the swing, ns after the leg was told to lift.
        swing: Window,
    },
}

/// What a joint's sensors read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// rad.
    Position,
    /// rad/s.
    Velocity,
    /// N m.
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

/// A fault and when it holds.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultWindow {
    /// When.
    pub window: Window,
    /// What.
    pub kind: FaultKind,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum FaultName {
    NanSensor,
    FalseReading,
    DropOperator,
    DropState,
    DelayState,
    DropCommand,
    LateProcess,
    ClockJump,
    ImuBias,
    StuckEncoder,
    TorqueLoss,
    FalseTouch,
}

/// A `[[fault]]` entry.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FaultEntry {
    t_s: f64,
    duration_s: f64,
    kind: FaultName,
    joint: Option<String>,
    factor: Option<f64>,
    quantity: Option<Quantity>,
    offset: Option<f64>,
    leg: Option<LegName>,
    #[serde(rename = "force_N")]
    force: Option<f64>,
    after_lift_off_s: Option<f64>,
    length_s: Option<f64>,
    delay_s: Option<f64>,
    jump_s: Option<f64>,
    #[serde(rename = "gyro_rad_s")]
    gyro: Option<[f64; 3]>,
    #[serde(rename = "orientation_rad")]
    orientation: Option<[f64; 3]>,
}

impl FaultEntry {
    pub(crate) fn resolve(self) -> Result<FaultWindow, BadKey> {
        check_range("t_s", &[self.t_s], 0.0..=36_000.0)?;
        check_range("duration_s", &[self.duration_s], 0.0..=36_000.0)?;
        let FaultEntry { t_s, duration_s, kind, joint, factor, leg, force, after_lift_off_s, length_s, .. } = self;
        let FaultEntry { delay_s, jump_s, gyro, orientation, quantity, offset, .. } = self;
        let missing = |key, expected: &str| BadKey { key, found: "missing".to_owned(), expected: expected.to_owned() };

        let false_reading = matches!(kind, FaultName::FalseReading);
        let of_joint =
            false_reading || matches!(kind, FaultName::NanSensor | FaultName::StuckEncoder | FaultName::TorqueLoss);
        let false_touch = matches!(kind, FaultName::FalseTouch);
        let imu_bias = matches!(kind, FaultName::ImuBias);
        let keys = [
            ("joint", joint.is_some(), of_joint),
            ("factor", factor.is_some(), matches!(kind, FaultName::TorqueLoss)),
            ("quantity", quantity.is_some(), false_reading),
            ("offset", offset.is_some(), false_reading),
            ("leg", leg.is_some(), false_touch),
            ("force_N", force.is_some(), false_touch),
            ("after_lift_off_s", after_lift_off_s.is_some(), false_touch),
            ("length_s", length_s.is_some(), false_touch),
            ("delay_s", delay_s.is_some(), matches!(kind, FaultName::DelayState)),
            ("jump_s", jump_s.is_some(), matches!(kind, FaultName::ClockJump)),
            ("gyro_rad_s", gyro.is_some(), imu_bias),
            ("orientation_rad", orientation.is_some(), imu_bias),
        ];
        if let Some((key, ..)) = keys.into_iter().find(|(_, given, belongs)| *given && !belongs) {
            let expected = "no such key with this kind of fault".to_owned();
            return Err(BadKey { key, found: "given".to_owned(), expected });
        }
        let joint = || joint.ok_or_else(|| missing("joint", "the name of a joint"));
        let kind = match kind {
            FaultName::NanSensor => FaultKind::NanSensor { joint: joint()? },
            FaultName::FalseReading => {
                let quantity = quantity.ok_or_else(|| missing("quantity", "position, velocity or torque"))?;
                let offset = offset.ok_or_else(|| missing("offset", "what is read besides the truth"))?;
                check_range("offset", &[offset], -1e6..=1e6)?;
                FaultKind::FalseReading { joint: joint()?, quantity, offset }
            }
            FaultName::DropOperator => FaultKind::DropOperator,
            FaultName::DropState => FaultKind::DropState,
            FaultName::DelayState => {
                let delay = delay_s.ok_or_else(|| missing("delay_s", "how late messages arrive, s"))?;
                check_range("delay_s", &[delay], 0.0..=10.0)?;
                FaultKind::DelayState { delay_ns: to_ns(delay) }
            }
            FaultName::DropCommand => FaultKind::DropCommand,
            FaultName::LateProcess => FaultKind::LateProcess,
            FaultName::ClockJump => {
                let jump = jump_s.ok_or_else(|| missing("jump_s", "by how much the clock is ahead, s"))?;
                check_range("jump_s", &[jump], -1e6..=1e6)?;
                FaultKind::ClockJump { jump_ns: to_ns(jump) }
            }
            FaultName::ImuBias => {
                let (gyro, orientation) = (gyro.unwrap_or_default(), orientation.unwrap_or_default());
                check_range("gyro_rad_s", &gyro, -100.0..=100.0)?;
                check_range("orientation_rad", &orientation, -4.0..=4.0)?;
                FaultKind::ImuBias { gyro, orientation }
            }
            FaultName::StuckEncoder => FaultKind::StuckEncoder { joint: joint()? },
            FaultName::TorqueLoss => {
                let factor = factor.ok_or_else(|| missing("factor", "the part of the torque that remains"))?;
                check_range("factor", &[factor], 0.0..=1.0)?;
                FaultKind::TorqueLoss { joint: joint()?, factor }
            }
            FaultName::FalseTouch => {
                let force = force.ok_or_else(|| missing("force_N", "the force that is read, N"))?;
                let (after, length) = (after_lift_off_s.unwrap_or(0.05), length_s.unwrap_or(0.01));
                check_range("force_N", &[force], 0.0..=10_000.0)?;
                check_range("after_lift_off_s", &[after], 0.0..=10.0)?;
                check_range("length_s", &[length], 0.0..=10.0)?;
                FaultKind::FalseTouch { leg: leg.map(Leg::from), force, swing: Window::new(after, length) }
            }
        };
        Ok(FaultWindow { window: Window::new(t_s, duration_s), kind })
    }
}

/// The faults of one run on one robot.
#[derive(Clone, Debug)]
pub struct FaultInjection {
    faults: Vec<ActiveFault>,
}

#[derive(Clone, Debug)]
struct ActiveFault {
    window: Window,
    effect: Effect,
}

#[derive(Clone, Debug)]
enum Effect {
    NanSensor { joint: usize },
    FalseReading { joint: usize, quantity: Quantity, offset: f64 },
    DropOperator,
    DropState,
    DelayState { delay_ns: i64, under_way: VecDeque<(i64, RobotState)> },
    DropCommand,
    LateProcess,
    ClockJump { jump_ns: i64 },
    ImuBias { gyro: [f64; 3], turn_wxyz: [f64; 4] },
    StuckEncoder { joint: usize, held: Option<f64> },
    TorqueLoss { joint: usize, factor: f64 },
    FalseTouch { leg: Option<Leg>, force: f64, swing: Window },
}

impl FaultInjection {
    /// Binds faults to a robot whose actuated joints are `joints`, in the order of its messages.
    ///
    /// # Errors
    /// [`DriverError::Unknown`] for a joint that the robot lacks.
    pub fn new(faults: &[FaultWindow], joints: &[String]) -> Result<Self, DriverError> {
        let index = |fault: usize, name: &str| {
            joints.iter().position(|joint| joint == name).ok_or_else(|| DriverError::Unknown {
                wanted_by: format!("fault[{}].joint", fault + 1),
                what: "joint",
                name: name.to_owned(),
                known: joints.to_vec(),
            })
        };
        let bind = |(number, fault): (usize, &FaultWindow)| {
            let effect = match &fault.kind {
                FaultKind::NanSensor { joint } => Effect::NanSensor { joint: index(number, joint)? },
                FaultKind::FalseReading { joint, quantity, offset } => {
                    Effect::FalseReading { joint: index(number, joint)?, quantity: *quantity, offset: *offset }
                }
                FaultKind::DropOperator => Effect::DropOperator,
                FaultKind::DropState => Effect::DropState,
                FaultKind::DelayState { delay_ns } => {
                    Effect::DelayState { delay_ns: *delay_ns, under_way: VecDeque::new() }
                }
                FaultKind::DropCommand => Effect::DropCommand,
                FaultKind::LateProcess => Effect::LateProcess,
                FaultKind::ClockJump { jump_ns } => Effect::ClockJump { jump_ns: *jump_ns },
                FaultKind::ImuBias { gyro, orientation } => {
                    Effect::ImuBias { gyro: *gyro, turn_wxyz: quaternion::from_rotation_vector(*orientation) }
                }
                FaultKind::StuckEncoder { joint } => Effect::StuckEncoder { joint: index(number, joint)?, held: None },
                FaultKind::TorqueLoss { joint, factor } => {
                    Effect::TorqueLoss { joint: index(number, joint)?, factor: *factor }
                }
                FaultKind::FalseTouch { leg, force, swing } => {
                    Effect::FalseTouch { leg: *leg, force: *force, swing: *swing }
                }
            };
            Ok(ActiveFault { window: fault.window, effect })
        };
        Ok(FaultInjection { faults: faults.iter().enumerate().map(bind).collect::<Result<_, DriverError>>()? })
    }

    /// Spoils a measurement in place, at `t_ns` of the scenario. False: no message arrives, and none must be sent.
    #[must_use]
    pub fn on_state(&mut self, t_ns: i64, state: &mut RobotState) -> bool {
        let mut arrives = true;
        for fault in self.faults.iter_mut().filter(|fault| fault.window.contains(t_ns)) {
            match &mut fault.effect {
                Effect::NanSensor { joint } => {
                    for values in [&mut state.q, &mut state.qd, &mut state.tau] {
                        set(values, *joint, f64::NAN);
                    }
                }
                Effect::FalseReading { joint, quantity, offset } => {
                    let values = match quantity {
                        Quantity::Position => &mut state.q,
                        Quantity::Velocity => &mut state.qd,
                        Quantity::Torque => &mut state.tau,
                    };
                    if let Some(value) = values.get_mut(*joint) {
                        *value += *offset;
                    }
                }
                Effect::DropState | Effect::LateProcess => arrives = false,
                Effect::DelayState { delay_ns, under_way } => {
                    under_way.push_back((t_ns + *delay_ns, state.clone()));
                    arrives &= arrived(under_way, t_ns, state);
                }
                Effect::StuckEncoder { joint, held } => {
                    let measured = state.q.get(*joint).copied().unwrap_or_default();
                    set(&mut state.q, *joint, *held.get_or_insert(measured));
                    set(&mut state.qd, *joint, 0.0);
                }
                Effect::ClockJump { jump_ns } => state.t_ns = state.t_ns.saturating_add(*jump_ns),
                Effect::ImuBias { gyro, turn_wxyz } => {
                    state.w_WI_I.iter_mut().zip(gyro).for_each(|(read, bias)| *read += *bias);
                    state.q_WI_wxyz = quaternion::product(state.q_WI_wxyz, *turn_wxyz);
                }
                Effect::DropOperator | Effect::DropCommand | Effect::TorqueLoss { .. } | Effect::FalseTouch { .. } => {}
            }
        }
        arrives
    }

    /// Whether a command of the operator arrives at `t_ns`.
    pub fn operator_arrives(&self, t_ns: i64) -> bool {
        let stops = |effect: &Effect| matches!(effect, Effect::DropOperator);
        !self.faults.iter().any(|fault| fault.window.contains(t_ns) && stops(&fault.effect))
    }

    /// Whether a command reaches the drives at `t_ns`; if not, they keep to the last one.
    pub fn command_arrives(&self, t_ns: i64) -> bool {
        let stops = |effect: &Effect| matches!(effect, Effect::DropCommand | Effect::LateProcess);
        !self.faults.iter().any(|fault| fault.window.contains(t_ns) && stops(&fault.effect))
    }

    /// Until when the driver's process stands still, if it does at `t_ns`.
    pub fn stands_still_until(&self, t_ns: i64) -> Option<i64> {
        let still = self.faults.iter().filter(|fault| matches!(fault.effect, Effect::LateProcess));
        still.filter(|fault| fault.window.contains(t_ns)).map(|fault| fault.window.end_ns).max()
    }

    /// Whether any fault is a false touch at some time.
    pub fn touch_falsely(&self) -> bool {
        self.faults.iter().any(|fault| matches!(fault.effect, Effect::FalseTouch { .. }))
    }

    /// The vertical force, N, that the torque sensors of each leg are to read besides the true ones; `t_swing`: time since the leg was told to
    /// lift, s, 0 for a leg that stands. Legs LF RF LH RH.
    pub fn false_touches(&self, t_ns: i64, t_swing: &[f64; 4]) -> [f64; 4] {
        let mut force = [0.0; 4];
        for fault in self.faults.iter().filter(|fault| fault.window.contains(t_ns)) {
            let Effect::FalseTouch { leg, force: read, swing } = &fault.effect else { continue };
            for of in Leg::ALL.into_iter().filter(|of| leg.is_none_or(|leg| leg == *of)) {
                let t_swing = t_swing[of as usize];
                if t_swing > 0.0 && swing.contains(to_ns(t_swing)) {
                    force[of as usize] += read;
                }
            }
        }
        force
    }

    /// Spoils a command at `t_ns` in place, on its way to the drives.
    pub fn on_command(&self, t_ns: i64, command: &mut RobotCommand) {
        for ActiveFault { window, effect } in &self.faults {
            if let (Effect::TorqueLoss { joint, factor }, true) = (effect, window.contains(t_ns)) {
                for values in [&mut command.tau, &mut command.kp, &mut command.kd] {
                    if let Some(value) = values.get_mut(*joint) {
                        *value *= factor;
                    }
                }
            }
        }
    }
}

/// Puts the newest message that has arrived into `state`; false if none has.
fn arrived(under_way: &mut VecDeque<(i64, RobotState)>, t_ns: i64, state: &mut RobotState) -> bool {
    let mut any = false;
    while let Some((_, message)) = under_way.pop_front_if(|(at_ns, _)| *at_ns <= t_ns) {
        (*state, any) = (message, true);
    }
    any
}

fn set(values: &mut [f64], index: usize, value: f64) {
    if let Some(slot) = values.get_mut(index) {
        *slot = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(kind: FaultKind) -> FaultInjection {
        let window = Window { start_ns: 10, end_ns: 20 };
        FaultInjection::new(&[FaultWindow { window, kind }], &["hip".to_owned(), "knee".to_owned()]).unwrap()
    }

    fn state(t_ns: i64) -> RobotState {
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let q = vec![t_ns as f64, 100.0 + t_ns as f64];
        RobotState { t_ns, nj: 2, q, qd: vec![1.0, 2.0], tau: vec![3.0, 4.0], ..RobotState::default() }
    }

    fn spoiled(faults: &mut FaultInjection, t_ns: i64) -> (bool, RobotState) {
        let mut state = state(t_ns);
        let arrives = faults.on_state(t_ns, &mut state);
        (arrives, state)
    }

    #[test]
    fn a_nan_sensor_spoils_one_joint_while_it_holds() {
        let mut faults = faults(FaultKind::NanSensor { joint: "knee".to_owned() });
        let (_, during) = spoiled(&mut faults, 10);
        assert!(during.q[1].is_nan() && during.qd[1].is_nan() && during.tau[1].is_nan());
        assert_eq!((during.q[0], during.qd[0], during.tau[0]), (10.0, 1.0, 3.0));
        assert_eq!(spoiled(&mut faults, 9), (true, state(9)));
        assert_eq!(spoiled(&mut faults, 20), (true, state(20)));
    }

    #[test]
    fn a_false_reading_spoils_one_sensor_of_one_joint() {
        for (quantity, expected) in [
            (Quantity::Position, [112.5, 2.0, 4.0]),
            (Quantity::Velocity, [110.0, 4.5, 4.0]),
            (Quantity::Torque, [110.0, 2.0, 6.5]),
        ] {
            let mut faults = faults(FaultKind::FalseReading { joint: "knee".to_owned(), quantity, offset: 2.5 });
            let (_, during) = spoiled(&mut faults, 10);
            assert_eq!([during.q[1], during.qd[1], during.tau[1]], expected, "{quantity:?}");
            assert_eq!((during.q[0], during.qd[0], during.tau[0]), (10.0, 1.0, 3.0));
            assert_eq!(spoiled(&mut faults, 20), (true, state(20)));
        }
    }

    #[test]
    fn an_operator_who_is_cut_off_is_not_heard() {
        let faults = faults(FaultKind::DropOperator);
        assert_eq!([9, 10, 19, 20].map(|t_ns| faults.operator_arrives(t_ns)), [true, false, false, true]);
    }

    #[test]
    fn a_stuck_encoder_keeps_its_first_value() {
        let mut faults = faults(FaultKind::StuckEncoder { joint: "hip".to_owned() });
        for t_ns in [10, 15, 19] {
            let (_, state) = spoiled(&mut faults, t_ns);
            assert_eq!((state.q[0], state.qd[0]), (10.0, 0.0));
            assert_eq!(state.qd[1], 2.0);
        }
    }

    #[test]
    fn dropped_states_do_not_arrive() {
        let mut faults = faults(FaultKind::DropState);
        assert_eq!([9, 10, 19, 20].map(|t_ns| spoiled(&mut faults, t_ns).0), [true, false, false, true]);
    }

    #[test]
    fn a_delayed_state_arrives_later_as_it_was() {
        let mut faults = faults(FaultKind::DelayState { delay_ns: 3 });
        assert_eq!(spoiled(&mut faults, 9), (true, state(9)));
        let arrived: Vec<Option<i64>> = (10..16)
            .map(|t_ns| spoiled(&mut faults, t_ns))
            .map(|(arrives, state)| arrives.then_some(state.t_ns))
            .collect();
        assert_eq!(arrived, [None, None, None, Some(10), Some(11), Some(12)]);
        // After a gap the newest that has arrived counts.
        assert_eq!(spoiled(&mut faults, 19), (true, state(15)));
        assert_eq!(spoiled(&mut faults, 20), (true, state(20)));
    }

    #[test]
    fn a_process_that_stands_still_passes_nothing_on() {
        let mut late = faults(FaultKind::LateProcess);
        assert_eq!([9, 10, 19, 20].map(|t_ns| spoiled(&mut late, t_ns).0), [true, false, false, true]);
        assert_eq!([9, 10, 19, 20].map(|t_ns| late.command_arrives(t_ns)), [true, false, false, true]);
        assert_eq!([9, 10, 20].map(|t_ns| late.stands_still_until(t_ns)), [None, Some(20), None]);
        let mut deaf = faults(FaultKind::DropCommand);
        assert_eq!([9, 10, 19, 20].map(|t_ns| deaf.command_arrives(t_ns)), [true, false, false, true]);
        assert_eq!((spoiled(&mut deaf, 12), deaf.stands_still_until(12)), ((true, state(12)), None));
    }

    #[test]
    fn a_clock_that_jumps_spoils_the_time_alone() {
        let mut faults = faults(FaultKind::ClockJump { jump_ns: -7 });
        assert_eq!(spoiled(&mut faults, 12).1, RobotState { t_ns: 5, ..state(12) });
    }

    /// By hand: a quarter turn to the left, then one about the new x axis, in half-angles of 45 degrees.
    #[test]
    fn a_biased_imu_reads_a_turn_in_its_own_axes() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let mut faults = faults(FaultKind::ImuBias { gyro: [0.1, 0.0, -0.2], orientation: [quarter, 0.0, 0.0] });
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let mut state = RobotState { q_WI_wxyz: [half, 0.0, 0.0, half], w_WI_I: [1.0, 2.0, 3.0], ..state(12) };
        assert!(faults.on_state(12, &mut state));
        assert_eq!(state.w_WI_I, [1.1, 2.0, 2.8]);
        // (1 + k)(1 + i) / 2 = (1 + i + k + ki) / 2, and ki = j.
        state.q_WI_wxyz.iter().for_each(|part| assert!((part - 0.5).abs() < 1e-15, "{:?}", state.q_WI_wxyz));
    }

    #[test]
    fn torque_loss_scales_all_that_makes_torque() {
        let faults = faults(FaultKind::TorqueLoss { joint: "knee".to_owned(), factor: 0.5 });
        let full = RobotCommand {
            nj: 2,
            tau: vec![10.0, 20.0],
            q_des: vec![1.0, 1.0],
            qd_des: vec![2.0, 2.0],
            kp: vec![30.0, 40.0],
            kd: vec![5.0, 6.0],
            ..RobotCommand::default()
        };
        let mut command = full.clone();
        faults.on_command(12, &mut command);
        let half = RobotCommand { tau: vec![10.0, 10.0], kp: vec![30.0, 20.0], kd: vec![5.0, 3.0], ..full.clone() };
        assert_eq!(command, half);
        let mut command = full.clone();
        faults.on_command(25, &mut command);
        assert_eq!(command, full);
    }

    #[test]
    fn a_false_touch_comes_in_every_swing_at_its_time() {
        let swing = Window { start_ns: 2_000_000, end_ns: 4_000_000 };
        let faults = faults(FaultKind::FalseTouch { leg: Some(Leg::RF), force: 60.0, swing });
        assert!(faults.touch_falsely());
        let read = |t_ns, t_swing| faults.false_touches(t_ns, &[t_swing, t_swing, 0.0, t_swing]);
        assert_eq!([0.0, 0.001, 0.002, 0.003, 0.004].map(|t| read(12, t)[1]), [0.0, 0.0, 60.0, 60.0, 0.0]);
        assert_eq!(read(12, 0.002), [0.0, 60.0, 0.0, 0.0], "no other leg");
        assert_eq!([9, 20].map(|t_ns| read(t_ns, 0.002)), [[0.0; 4]; 2], "not outside its window");
    }

    #[test]
    fn an_unknown_joint_is_named_beside_those_there_are() {
        let window = Window { start_ns: 0, end_ns: 1 };
        let fault = FaultWindow { window, kind: FaultKind::NanSensor { joint: "elbow".to_owned() } };
        let error = FaultInjection::new(&[fault], &["hip".to_owned(), "knee".to_owned()]).unwrap_err();
        assert_eq!(error.to_string(), "fault[1].joint: the robot has no joint \"elbow\", it has: hip, knee");
    }
}
