//! Joints that several components command: whose rows the command has, what holds, and what a component that has timed out leads to.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{PARAMS, PERIOD_NS, URDF, hyq, standing};
use controller::{Component, LoadError, Outbox};
use lcmtypes::{
    ComponentInfo, ControllerInput, ControllerTick, Message, OperatorCommand, RobotCommand, RunInfo, channels,
};

/// Joints of the second component, by name and by index among HyQ's 12.
const JOINTS: [(&str, usize); 2] = [("lf_kfe_joint", 2), ("rh_haa_joint", 9)];
const PERIOD_TICKS: i32 = 2;
const LATENCY_TICKS: i32 = 3;
/// Ten periods and the latency.
const MAX_AGE: i64 = 23;

fn run(joints: &[&str]) -> RunInfo {
    let mut info = RunInfo { urdf: URDF.to_owned(), ..RunInfo::default() };
    let own = ComponentInfo::new("hold", PARAMS);
    let other = ComponentInfo {
        name: "arms".to_owned(),
        joints: joints.iter().map(ToString::to_string).collect(),
        n_joints: i32::try_from(joints.len()).unwrap(),
        period_ticks: PERIOD_TICKS,
        latency_ticks: LATENCY_TICKS,
        ..ComponentInfo::new("posture", PARAMS)
    };
    (info.n_components, info.components) = (2, vec![own, other]);
    info
}

fn shared() -> Component {
    controller::load(&run(&JOINTS.map(|(name, _)| name))).unwrap()
}

/// The input of a standing HyQ.
fn input(tick: i64) -> ControllerInput {
    let mut state = standing(hyq().robot()).state;
    state.t_ns = tick * PERIOD_NS;
    let mut input = ControllerInput { t_ns: state.t_ns, tick, ..ControllerInput::default() };
    input.deliver(channels::ROBOT_STATE, state.t_ns, &state).unwrap();
    input
}

/// A command whose numbers name joint and quantity.
fn command(mode: i8) -> RobotCommand {
    let numbers = |from: f64| (0..12_i32).map(|j| from + 0.001 * f64::from(j)).collect();
    let [tau, q_des, qd_des, kp, kd] = [1.0, 2.0, 3.0, 4.0, 5.0].map(numbers);
    RobotCommand { mode, nj: 12, tau, q_des, qd_des, kp, kd, ..RobotCommand::default() }
}

fn step(component: &mut Component, input: &ControllerInput) -> (RobotCommand, ControllerTick) {
    let mut out = Outbox::new();
    component.step(input, &mut out);
    let command = RobotCommand::decode(out.get(channels::ROBOT_COMMAND).unwrap()).unwrap();
    (command, ControllerTick::decode(out.get(channels::CONTROLLER_TICK).unwrap()).unwrap())
}

fn rows(command: &RobotCommand, j: usize) -> [f64; 5] {
    [command.tau[j], command.q_des[j], command.qd_des[j], command.kp[j], command.kd[j]]
}

const CHANNEL: &str = "arms/ROBOT_COMMAND";

#[test]
fn each_joint_takes_its_row_from_its_component_and_the_newest_command_holds() {
    let mut alone = controller::load(&run(&[])).unwrap();
    let mut shared = shared();
    let sent = command(RobotCommand::MODE_TORQUE);
    for tick in 0..8 {
        let mut input = input(tick);
        if tick == 3 {
            input.deliver(CHANNEL, 0, &sent).unwrap();
        }
        let (own, _) = step(&mut alone, &input);
        let (merged, status) = step(&mut shared, &input);
        assert_eq!((merged.mode, status.fault), (RobotCommand::MODE_TORQUE, ControllerTick::FAULT_NONE));
        for j in 0..12 {
            let is_other = JOINTS.iter().any(|(_, other)| *other == j);
            let expected = match is_other {
                true if tick < 3 => [0.0; 5],
                true => rows(&sent, j),
                false => rows(&own, j),
            };
            assert_eq!(rows(&merged, j), expected, "tick {tick}, joint {j}");
        }
    }
}

#[test]
fn the_joints_of_a_component_that_has_timed_out_are_damped_and_the_fault_names_it() {
    let mut shared = shared();
    for tick in 0..60 {
        let mut input = input(tick);
        if [5, 50].contains(&tick) {
            input.deliver(CHANNEL, 0, &command(RobotCommand::MODE_TORQUE)).unwrap();
        }
        let (merged, status) = step(&mut shared, &input);
        let timed_out = (5 + MAX_AGE + 1..50).contains(&tick);
        let expected = if timed_out { (ControllerTick::FAULT_COMPONENT, 1) } else { (ControllerTick::FAULT_NONE, -1) };
        assert_eq!((status.fault, status.fault_index), expected, "tick {tick}");
        if timed_out {
            #[expect(clippy::cast_precision_loss, reason = "a small number of ticks")]
            let age = (tick - 5) as f64;
            assert_eq!(status.fault_value, age);
            assert_eq!(rows(&merged, 2), [0.0, 0.0, 0.0, 0.0, 20.0], "safety.damping of HyQ");
            assert_ne!(rows(&merged, 3), [0.0, 0.0, 0.0, 0.0, 20.0]);
        }
    }
    // One that has never sent a command has timed out too.
    let mut shared = self::shared();
    for tick in 0..30 {
        let (_, status) = step(&mut shared, &input(tick));
        let fault = if tick > MAX_AGE { ControllerTick::FAULT_COMPONENT } else { ControllerTick::FAULT_NONE };
        assert_eq!(status.fault, fault, "tick {tick}");
        assert!(tick <= MAX_AGE || status.fault_value == -1.0);
    }
}

#[test]
fn an_emergency_stop_damps_all_joints_and_an_idle_component_has_no_torque() {
    let mut shared = shared();
    let mut first = input(0);
    first.deliver(CHANNEL, 0, &command(RobotCommand::MODE_IDLE)).unwrap();
    let (merged, _) = step(&mut shared, &first);
    assert_eq!(rows(&merged, 2), [0.0; 5]);
    let mut stop = input(1);
    let op = OperatorCommand { mode: OperatorCommand::MODE_DAMPING, ..OperatorCommand::default() };
    stop.deliver(channels::OPERATOR_COMMAND, 0, &op).unwrap();
    stop.deliver(CHANNEL, 0, &command(RobotCommand::MODE_TORQUE)).unwrap();
    let (merged, status) = step(&mut shared, &stop);
    assert_eq!((merged.mode, status.fault), (RobotCommand::MODE_DAMPING, ControllerTick::FAULT_OPERATOR));
    assert!((0..12).all(|j| rows(&merged, j) == [0.0, 0.0, 0.0, 0.0, 20.0]));
}

#[test]
fn commands_that_cannot_be_applied_are_counted_and_the_one_before_holds() {
    let mut shared = shared();
    let good = command(RobotCommand::MODE_TORQUE);
    let mut not_finite = good.clone();
    not_finite.kp[11] = f64::NAN;
    let mut first = input(0);
    first.deliver(CHANNEL, 0, &good).unwrap();
    step(&mut shared, &first);
    for bad in [not_finite, RobotCommand::zeros(11), RobotCommand { mode: 7, ..good.clone() }] {
        let mut next = input(1);
        next.deliver(CHANNEL, 0, &bad).unwrap();
        let (merged, status) = step(&mut shared, &next);
        assert_eq!((rows(&merged, 2), status.n_ignored), (rows(&good, 2), 1));
    }
}

#[test]
fn a_snapshot_has_the_held_commands_and_the_workspace_is_scratch() {
    let (mut shared, mut other) = (self::shared(), self::shared());
    let mut bytes = Vec::new();
    for tick in 0..40 {
        let mut input = input(tick);
        if tick == 4 {
            input.deliver(CHANNEL, 0, &command(RobotCommand::MODE_TORQUE)).unwrap();
        }
        let expected = step(&mut shared, &input);
        if tick > 8 {
            other.poison_workspace();
            assert_eq!(step(&mut other, &input), expected, "tick {tick}");
        }
        if tick == 8 {
            shared.snapshot(&mut bytes);
            other.restore(&bytes).unwrap();
        }
    }
}

#[test]
fn joints_that_are_unknown_or_commanded_twice_are_errors_of_their_component() {
    for joints in [["lf_kfe_joint", "knee"], ["lf_kfe_joint", "lf_kfe_joint"]] {
        let error = controller::load(&run(&joints)).err().unwrap();
        assert!(matches!(&error, LoadError::Component { component, .. } if component == "arms"), "{error}");
    }
}
