//! Applies faults to messages.

use super::{FaultKind, FaultWindow, Quantity};
use crate::DriverError;
use crate::checks::{Window, to_ns};
use controller::quadruped::leg::Leg;
use lcmtypes::{RobotCommand, RobotState};
use robot_model::math::quaternion;
use std::collections::VecDeque;

/// The faults of one run, bound to one robot.
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
    DelayState { delay_ns: i64, delayed: VecDeque<(i64, RobotState)> },
    DropCommand,
    LateProcess,
    ClockJump { jump_ns: i64 },
    ImuBias { gyro: [f64; 3], turn_wxyz: [f64; 4] },
    StuckEncoder { joint: usize, held: Option<f64> },
    TorqueLoss { joint: usize, factor: f64 },
    FalseTouch { leg: Option<Leg>, force: f64, swing: Window },
}

impl FaultInjection {
    /// Binds faults to a robot.
    ///
    /// - `joints`: names of the actuated joints, in the order of the messages.
    ///
    /// # Errors
    /// [`DriverError::Unknown`] for a joint that the robot does not have.
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
                    Effect::DelayState { delay_ns: *delay_ns, delayed: VecDeque::new() }
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

    /// Applies the faults to a measurement, at time `t_ns` of the scenario. Returns false if no message arrives.
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
                Effect::DelayState { delay_ns, delayed } => {
                    delayed.push_back((t_ns + *delay_ns, state.clone()));
                    arrives &= arrived(delayed, t_ns, state);
                }
                Effect::StuckEncoder { joint, held } => {
                    let measured = state.q.get(*joint).copied().unwrap_or_default();
                    set(&mut state.q, *joint, *held.get_or_insert(measured));
                    set(&mut state.qd, *joint, 0.0);
                }
                Effect::ClockJump { jump_ns } => state.t_ns = state.t_ns.saturating_add(*jump_ns),
                Effect::ImuBias { gyro, turn_wxyz } => {
                    for (w_WI_I, q_WI_wxyz) in state.w_WI_I.iter_mut().zip(&mut state.q_WI_wxyz) {
                        w_WI_I.iter_mut().zip(&*gyro).for_each(|(read, bias)| *read += *bias);
                        *q_WI_wxyz = quaternion::product(*q_WI_wxyz, *turn_wxyz);
                    }
                }
                Effect::DropOperator | Effect::DropCommand | Effect::TorqueLoss { .. } | Effect::FalseTouch { .. } => {}
            }
        }
        arrives
    }

    /// Whether an operator command sent at `t_ns` arrives.
    pub fn operator_arrives(&self, t_ns: i64) -> bool {
        let stops = |effect: &Effect| matches!(effect, Effect::DropOperator);
        !self.faults.iter().any(|fault| fault.window.contains(t_ns) && stops(&fault.effect))
    }

    /// Whether a command reaches the drives at `t_ns`; if not, they keep the last one.
    pub fn command_arrives(&self, t_ns: i64) -> bool {
        let stops = |effect: &Effect| matches!(effect, Effect::DropCommand | Effect::LateProcess);
        !self.faults.iter().any(|fault| fault.window.contains(t_ns) && stops(&fault.effect))
    }

    /// End of the time in which the driver's process does not run, ns; `None` if it runs at `t_ns`.
    pub fn paused_until(&self, t_ns: i64) -> Option<i64> {
        let paused = self.faults.iter().filter(|fault| matches!(fault.effect, Effect::LateProcess));
        paused.filter(|fault| fault.window.contains(t_ns)).map(|fault| fault.window.end_ns).max()
    }

    /// Whether the run has a false touch at any time.
    pub fn has_false_touch(&self) -> bool {
        self.faults.iter().any(|fault| matches!(fault.effect, Effect::FalseTouch { .. }))
    }

    /// The false vertical contact force of each leg at `t_ns`, N; legs LF RF LH RH.
    ///
    /// - `t_swing`: time since lift-off was commanded, s; 0 in stance.
    pub fn false_touches(&self, t_ns: i64, t_swing: &[f64; 4]) -> [f64; 4] {
        let mut force = [0.0; 4];
        for fault in self.faults.iter().filter(|fault| fault.window.contains(t_ns)) {
            let Effect::FalseTouch { leg, force: added, swing } = &fault.effect else { continue };
            for of in Leg::ALL.into_iter().filter(|of| leg.is_none_or(|leg| leg == *of)) {
                let t_swing = t_swing[of as usize];
                if t_swing > 0.0 && swing.contains(to_ns(t_swing)) {
                    force[of as usize] += added;
                }
            }
        }
        force
    }

    /// Applies the faults to a command, at time `t_ns` of the scenario.
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

/// Moves the newest message whose delay is over into `state`; returns false if there is none.
fn arrived(delayed: &mut VecDeque<(i64, RobotState)>, t_ns: i64, state: &mut RobotState) -> bool {
    let mut any = false;
    while let Some((_, message)) = delayed.pop_front_if(|(at_ns, _)| *at_ns <= t_ns) {
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

    fn on_state(faults: &mut FaultInjection, t_ns: i64) -> (bool, RobotState) {
        let mut state = state(t_ns);
        let arrives = faults.on_state(t_ns, &mut state);
        (arrives, state)
    }

    #[test]
    fn a_nan_sensor_affects_one_joint_within_its_window() {
        let mut faults = faults(FaultKind::NanSensor { joint: "knee".to_owned() });
        let (_, during) = on_state(&mut faults, 10);
        assert!(during.q[1].is_nan() && during.qd[1].is_nan() && during.tau[1].is_nan());
        assert_eq!((during.q[0], during.qd[0], during.tau[0]), (10.0, 1.0, 3.0));
        assert_eq!(on_state(&mut faults, 9), (true, state(9)));
        assert_eq!(on_state(&mut faults, 20), (true, state(20)));
    }

    #[test]
    fn a_false_reading_affects_one_sensor_of_one_joint() {
        for (quantity, expected) in [
            (Quantity::Position, [112.5, 2.0, 4.0]),
            (Quantity::Velocity, [110.0, 4.5, 4.0]),
            (Quantity::Torque, [110.0, 2.0, 6.5]),
        ] {
            let mut faults = faults(FaultKind::FalseReading { joint: "knee".to_owned(), quantity, offset: 2.5 });
            let (_, during) = on_state(&mut faults, 10);
            assert_eq!([during.q[1], during.qd[1], during.tau[1]], expected, "{quantity:?}");
            assert_eq!((during.q[0], during.qd[0], during.tau[0]), (10.0, 1.0, 3.0));
            assert_eq!(on_state(&mut faults, 20), (true, state(20)));
        }
    }

    #[test]
    fn dropped_operator_commands_do_not_arrive() {
        let faults = faults(FaultKind::DropOperator);
        assert_eq!([9, 10, 19, 20].map(|t_ns| faults.operator_arrives(t_ns)), [true, false, false, true]);
    }

    #[test]
    fn a_stuck_encoder_keeps_its_first_value() {
        let mut faults = faults(FaultKind::StuckEncoder { joint: "hip".to_owned() });
        for t_ns in [10, 15, 19] {
            let (_, state) = on_state(&mut faults, t_ns);
            assert_eq!((state.q[0], state.qd[0]), (10.0, 0.0));
            assert_eq!(state.qd[1], 2.0);
        }
    }

    #[test]
    fn dropped_states_do_not_arrive() {
        let mut faults = faults(FaultKind::DropState);
        assert_eq!([9, 10, 19, 20].map(|t_ns| on_state(&mut faults, t_ns).0), [true, false, false, true]);
    }

    #[test]
    fn a_delayed_state_arrives_later_unchanged() {
        let mut faults = faults(FaultKind::DelayState { delay_ns: 3 });
        assert_eq!(on_state(&mut faults, 9), (true, state(9)));
        let arrived: Vec<Option<i64>> = (10..16)
            .map(|t_ns| on_state(&mut faults, t_ns))
            .map(|(arrives, state)| arrives.then_some(state.t_ns))
            .collect();
        assert_eq!(arrived, [None, None, None, Some(10), Some(11), Some(12)]);
        // After a gap, the newest message whose delay is over is used.
        assert_eq!(on_state(&mut faults, 19), (true, state(15)));
        assert_eq!(on_state(&mut faults, 20), (true, state(20)));
    }

    #[test]
    fn a_paused_process_passes_no_message() {
        let mut late = faults(FaultKind::LateProcess);
        assert_eq!([9, 10, 19, 20].map(|t_ns| on_state(&mut late, t_ns).0), [true, false, false, true]);
        assert_eq!([9, 10, 19, 20].map(|t_ns| late.command_arrives(t_ns)), [true, false, false, true]);
        assert_eq!([9, 10, 20].map(|t_ns| late.paused_until(t_ns)), [None, Some(20), None]);
        let mut drop_command = faults(FaultKind::DropCommand);
        assert_eq!([9, 10, 19, 20].map(|t_ns| drop_command.command_arrives(t_ns)), [true, false, false, true]);
        assert_eq!((on_state(&mut drop_command, 12), drop_command.paused_until(12)), ((true, state(12)), None));
    }

    #[test]
    fn a_clock_jump_changes_the_time_only() {
        let mut faults = faults(FaultKind::ClockJump { jump_ns: -7 });
        assert_eq!(on_state(&mut faults, 12).1, RobotState { t_ns: 5, ..state(12) });
    }

    /// Worked out by hand: a quarter turn to the left, then one about the new x axis; half-angles of 45 degrees.
    #[test]
    fn an_imu_bias_is_in_the_axes_of_the_imu() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let mut faults = faults(FaultKind::ImuBias { gyro: [0.1, 0.0, -0.2], orientation: [quarter, 0.0, 0.0] });
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let mut state =
            RobotState { q_WI_wxyz: vec![[half, 0.0, 0.0, half]], w_WI_I: vec![[1.0, 2.0, 3.0]], ..state(12) };
        assert!(faults.on_state(12, &mut state));
        assert_eq!(state.w_WI_I, [[1.1, 2.0, 2.8]]);
        // (1 + k)(1 + i) / 2 = (1 + i + k + ki) / 2, and ki = j.
        state.q_WI_wxyz[0].iter().for_each(|part| assert!((part - 0.5).abs() < 1e-15, "{:?}", state.q_WI_wxyz));
    }

    #[test]
    fn torque_loss_scales_feed_forward_torque_and_gains() {
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
    fn a_false_touch_acts_in_every_swing_at_its_time() {
        let swing = Window { start_ns: 2_000_000, end_ns: 4_000_000 };
        let faults = faults(FaultKind::FalseTouch { leg: Some(Leg::RF), force: 60.0, swing });
        assert!(faults.has_false_touch());
        let read = |t_ns, t_swing| faults.false_touches(t_ns, &[t_swing, t_swing, 0.0, t_swing]);
        assert_eq!([0.0, 0.001, 0.002, 0.003, 0.004].map(|t| read(12, t)[1]), [0.0, 0.0, 60.0, 60.0, 0.0]);
        assert_eq!(read(12, 0.002), [0.0, 60.0, 0.0, 0.0], "no other leg");
        assert_eq!([9, 20].map(|t_ns| read(t_ns, 0.002)), [[0.0; 4]; 2], "not outside its window");
    }

    #[test]
    fn an_unknown_joint_is_an_error_with_the_known_ones() {
        let window = Window { start_ns: 0, end_ns: 1 };
        let fault = FaultWindow { window, kind: FaultKind::NanSensor { joint: "elbow".to_owned() } };
        let error = FaultInjection::new(&[fault], &["hip".to_owned(), "knee".to_owned()]).unwrap_err();
        let DriverError::Unknown { wanted_by, name, known, .. } = error else { panic!("{error}") };
        assert_eq!(
            (&*wanted_by, &*name, &known[..]),
            ("fault[1].joint", "elbow", &["hip".to_owned(), "knee".to_owned()][..])
        );
    }
}
