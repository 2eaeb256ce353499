//! Sequences of controllers: which one commands the robot, start and stop, completeness of the snapshot.
#![allow(clippy::disallowed_types, non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{PARAMS, PERIOD_NS, URDF, command_of, hyq, standing, tick_of};
use controller::interface::Probe;
use controller::params::apply_overrides;
use controller::sequence::Sequence;
use controller::{Component, Controller, LoadError, Outbox, RestoreError};
use lcmtypes::{
    ComponentInfo, ControllerInput, ControllerTick, Message, RobotCommand, RobotState, RunInfo, Running, SequenceState,
    TickInput, channels,
};
use std::sync::LazyLock;

const HOLD: i64 = 1;
const QUADRUPED: i64 = 2;

fn load(controller: &str) -> Result<Box<dyn Controller>, LoadError> {
    load_with(controller, &[])
}

fn load_with(controller: &str, set: &[(&str, &str)]) -> Result<Box<dyn Controller>, LoadError> {
    let set: Vec<_> = set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    let component = ComponentInfo::new(controller, &apply_overrides(PARAMS, &set).unwrap());
    controller::load_controller(&RunInfo { urdf: URDF.to_owned(), ..RunInfo::default() }.with_component(component))
}

fn both() -> Box<dyn Controller> {
    load("sequence(hold, quadruped)").unwrap()
}

/// Input of a standing HyQ at a tick, with these controllers running.
fn input(tick: i64, running: i64) -> TickInput {
    static STANDING: LazyLock<TickInput> = LazyLock::new(|| standing(hyq().robot()));
    let mut input = STANDING.clone();
    (input.t_ns, input.tick, input.running) = (tick * PERIOD_NS, tick, running);
    input.state.t_ns = input.t_ns;
    input
}

fn messages(out: &Outbox) -> Vec<(String, Vec<u8>)> {
    out.iter().map(|(channel, bytes)| (channel.to_owned(), bytes.to_vec())).collect()
}

/// Controllers that run in each tick: each alone, both, none, one restarted.
fn schedule(tick: i64) -> i64 {
    match tick {
        0..3 => HOLD,
        3..6 => HOLD | QUADRUPED,
        6..9 => QUADRUPED,
        9..11 => 0,
        _ => HOLD,
    }
}

#[test]
fn the_last_running_controller_commands_the_robot() {
    let (mut sequence, mut out) = (both(), Outbox::new());
    let (mut alone, mut of_alone) = (load("quadruped").unwrap(), Outbox::new());
    for tick in 0..14 {
        let input = input(tick, schedule(tick));
        sequence.step(&input, &mut out);
        let channels: Vec<_> = out.iter().map(|(channel, _)| channel).collect();
        let (command, status) = (command_of(&out), tick_of(&out));
        match schedule(tick) {
            HOLD => {
                assert_eq!((command.mode, command.kp[0]), (RobotCommand::MODE_TORQUE, 300.0), "tick {tick}");
                assert_eq!(status.mode, ControllerTick::MODE_STAND_UP);
                assert_eq!(channels, ["ROBOT_COMMAND", "CONTROLLER_TICK"]);
                // The stages of hold are the first and the last of the sequence.
                assert_eq!((status.n_stages, &status.digest[1..5]), (6, &[0; 4][..]));
                assert!(status.digest[0] != 0 && status.digest[5] != 0);
            }
            0 => {
                assert_eq!((command.mode, command.kd[3]), (RobotCommand::MODE_DAMPING, 20.0), "tick {tick}");
                assert_eq!((status.mode, status.fault), (ControllerTick::MODE_IDLE, ControllerTick::FAULT_CONTROLLER));
            }
            started => {
                alone.step(&input, &mut of_alone);
                let beside = if started & HOLD > 0 { 2 } else { 0 };
                assert_eq!(channels[..beside], ["hold/ROBOT_COMMAND", "hold/CONTROLLER_TICK"][..beside]);
                assert_eq!(messages(&out)[beside..], messages(&of_alone), "tick {tick}");
            }
        }
    }
}

#[test]
fn a_restarted_controller_starts_as_on_its_first_tick() {
    let (mut sequence, mut out) = (both(), Outbox::new());
    for tick in 0..14 {
        sequence.step(&input(tick, schedule(tick)), &mut out);
    }
    let (mut fresh, mut of_fresh) = (both(), Outbox::new());
    for tick in 11..14 {
        fresh.step(&input(tick, HOLD), &mut of_fresh);
    }
    assert_eq!(messages(&out), messages(&of_fresh));
}

#[test]
fn restart_from_any_snapshot_gives_the_same_run() {
    for restart in 0..14 {
        let (mut sequence, mut out) = (both(), Outbox::new());
        let (mut restarted, mut of_restarted) = (both(), Outbox::new());
        for tick in 0..20 {
            sequence.step(&input(tick, schedule(tick)), &mut out);
            if tick == restart {
                let mut state = Vec::new();
                sequence.snapshot(&mut state);
                restarted.restore(&state).unwrap();
                restarted.poison_workspace();
            }
            if tick > restart {
                restarted.step(&input(tick, schedule(tick)), &mut of_restarted);
                assert_eq!(messages(&out), messages(&of_restarted), "tick {tick} after tick {restart}");
            }
        }
    }
}

#[test]
fn the_snapshot_of_another_list_is_refused() {
    let mut alone = Vec::new();
    load("quadruped").unwrap().snapshot(&mut alone);
    assert!(both().restore(&alone).is_err());
    let one = load("sequence(quadruped)").unwrap();
    alone.clear();
    one.snapshot(&mut alone);
    assert_eq!(both().restore(&alone).unwrap_err().to_string(), "snapshot holds 1 controllers, the run has 2");
}

#[test]
fn hold_moves_to_the_posture_and_damps_when_measurements_time_out() {
    let (mut hold, mut out) = (load("hold").unwrap(), Outbox::new());
    let robot = hyq();
    let folded: Vec<f64> = robot.robot().q_nominal.iter().map(|q| q + 0.4).collect();
    let (mut before, mut fastest) = (folded.clone(), 0.0_f64);
    for tick in 0..3100 {
        let mut input = input(tick, HOLD);
        input.state.q.clone_from(&folded);
        hold.step(&input, &mut out);
        let command = command_of(&out);
        for (j, (&now, &before)) in command.q_des.iter().zip(&before).enumerate() {
            let rate = (now - before) * 1e3;
            fastest = fastest.max(rate.abs());
            assert!(
                (command.qd_des[j] - rate).abs() < 1e-3,
                "joint {j}, tick {tick}: {} and {rate}",
                command.qd_des[j]
            );
        }
        before.clone_from(&command.q_des);
    }
    assert_eq!(before, robot.robot().q_nominal);
    // The largest rate is 15/8 of the mean rate: 0.4 rad in 3 s.
    assert!((fastest - 0.25).abs() < 1e-3, "{fastest}");
    assert_eq!(tick_of(&out).mode, ControllerTick::MODE_STANCE);

    let mut late = input(3100, HOLD);
    late.state.t_ns -= 1_000_000_000;
    hold.step(&late, &mut out);
    assert_eq!(command_of(&out).mode, RobotCommand::MODE_DAMPING);
    let status = tick_of(&out);
    assert_eq!((status.fault, status.fault_value), (ControllerTick::FAULT_STATE_STALE, 1.0));
    hold.step(&input(3101, HOLD), &mut out);
    assert_eq!(command_of(&out).mode, RobotCommand::MODE_DAMPING, "it stays damped");
}

/// A change of times and gains at any tick gives no step in the references and no torque above the effort.
#[test]
fn hold_changes_parameters_without_a_step() {
    let robot = hyq();
    let folded: Vec<f64> = robot.robot().q_nominal.iter().map(|q| q + 0.4).collect();
    for (change, key, value) in
        [(1500, "hold.duration", "30.0"), (3050, "hold.duration", "30.0"), (1500, "hold.kp", "1e4")]
    {
        let (mut hold, mut out) = (load("hold").unwrap(), Outbox::new());
        let mut before = folded.clone();
        for tick in 0..3100 {
            if tick == change {
                let mut other = load_with("hold", &[(key, value)]).unwrap();
                let mut state = Vec::new();
                hold.snapshot(&mut state);
                other.restore(&state).unwrap();
                hold = other;
            }
            let mut input = input(tick, HOLD);
            input.state.q.clone_from(&folded);
            hold.step(&input, &mut out);
            let command = command_of(&out);
            for (j, joint) in robot.robot().model.joints.iter().enumerate() {
                let step = (command.q_des[j] - before[j]).abs();
                assert!(step < 3e-4, "{key}, tick {tick}, joint {j}: {step} rad");
                let loop_ = command.kp[j] * (command.q_des[j] - folded[j]) + command.kd[j] * command.qd_des[j];
                let total = command.tau[j] + loop_;
                assert!(total.abs() <= joint.effort * (1.0 + 1e-9), "{key}, tick {tick}, joint {j}: {total} N m");
            }
            before.clone_from(&command.q_des);
        }
    }
}

#[test]
fn hold_damps_on_implausible_measurements() {
    for (spoil, code) in [
        (|s| s.qd[3] = 500.0, ControllerTick::FAULT_JOINT_VELOCITY),
        (|s| s.q[3] = 50.0, ControllerTick::FAULT_JOINT_POSITION),
        (|s| s.tau[3] = f64::NAN, ControllerTick::FAULT_INPUT_NOT_FINITE),
    ] as [(fn(&mut RobotState), i32); 3]
    {
        let (mut hold, mut out) = (load("hold").unwrap(), Outbox::new());
        hold.step(&input(0, HOLD), &mut out);
        let mut bad = input(1, HOLD);
        spoil(&mut bad.state);
        hold.step(&bad, &mut out);
        assert_eq!(command_of(&out).mode, RobotCommand::MODE_DAMPING);
        assert_eq!((tick_of(&out).fault, tick_of(&out).fault_index), (code, 3));
    }
}

/// A stopped controller's state is not part of the snapshot: after a panic it may be inconsistent.
#[test]
fn the_snapshot_contains_no_state_of_a_stopped_controller() {
    let state = |controller: &dyn Controller| {
        let mut state = Vec::new();
        controller.snapshot(&mut state);
        SequenceState::decode(&state).unwrap().parts
    };
    let (mut sequence, mut out) = (both(), Outbox::new());
    let unused = state(&*sequence);
    for (tick, running) in [(0, HOLD | QUADRUPED), (1, HOLD | QUADRUPED), (2, HOLD)] {
        sequence.step(&input(tick, running), &mut out);
    }
    let now = state(&*sequence);
    assert!(now[0] != unused[0] && now[1] == unused[1]);
}

#[test]
fn a_list_that_cannot_be_run_is_refused_by_name() {
    for (list, name) in [("sequence(hold, walker)", "walker"), ("sequence()", ""), ("walker", "walker")] {
        let error = load(list).err().unwrap();
        assert!(matches!(&error, LoadError::UnknownController { found } if found == name), "{list}: {error}");
    }
    let twice = load("sequence(hold, hold)").err().unwrap();
    assert!(matches!(&twice, LoadError::Sequence { what } if what.contains("\"hold\"")), "{twice}");
}

/// A controller that counts the messages on a channel of its own.
#[derive(Default)]
struct Listener {
    received: i64,
}

impl Controller for Listener {
    fn name(&self) -> &'static str {
        "listener"
    }

    fn stages(&self) -> &[&'static str] {
        &["output"]
    }

    fn receive(&mut self, _input: &TickInput, channel: &str, _data: &[u8]) -> bool {
        self.received += i64::from(channel == "PLAN");
        channel == "PLAN"
    }

    fn step_probed(&mut self, input: &TickInput, out: &mut Outbox, _probe: &mut dyn Probe) {
        out.clear();
        let n_ignored = input.n_ignored;
        let tick =
            ControllerTick { tick: self.received, n_ignored, n_stages: 1, digest: vec![0], ..Default::default() };
        out.put(channels::CONTROLLER_TICK, &tick).unwrap();
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        Running { t_ns: 0, running: self.received }.encode(out).unwrap();
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        self.received = Running::decode(bytes)?.running;
        Ok(())
    }

    fn poison_workspace(&mut self) {}
}

/// A member receives messages while it runs, from its first tick on; a replay from any snapshot counts the same.
#[test]
fn members_that_run_receive_messages_on_other_channels() {
    let component = || {
        let listener: Box<dyn Controller> = Box::new(Listener::default());
        Component::new(Box::new(Sequence::new(vec![listener], RobotCommand::zeros(12), 0).unwrap()))
    };
    let input = |tick: i64| {
        let mut input = ControllerInput { tick, ..ControllerInput::default() };
        input.deliver("PLAN", 0, &Running::default()).unwrap();
        // After the message in the same delivery: the order of the two does not matter.
        let running = i64::from(!(3..5).contains(&tick));
        input.deliver(channels::RUNNING, 0, &Running { t_ns: 0, running }).unwrap();
        input
    };
    let (mut whole, mut out) = (component(), Outbox::new());
    let mut received = Vec::new();
    for tick in 0..8 {
        let mut part = component();
        let mut state = Vec::new();
        whole.snapshot(&mut state);
        part.restore(&state).unwrap();
        let mut of_part = Outbox::new();
        whole.step(&input(tick), &mut out);
        part.step(&input(tick), &mut of_part);
        assert_eq!(messages(&of_part), messages(&out), "tick {tick}");
        let status = tick_of(&out);
        received.push((if (3..5).contains(&tick) { -1 } else { status.tick }, status.n_ignored));
    }
    assert_eq!(received, [(1, 0), (2, 0), (3, 0), (-1, 1), (-1, 1), (1, 0), (2, 0), (3, 0)]);
}

/// The largest step of a joint reference when `posture` takes over from `hold` in the middle of its motion, rad.
fn largest_step(with_handover: bool) -> f64 {
    let set = [("hold.duration", "0.5"), ("motion.posture", "\"nominal\"")];
    let mut sequence = load_with("sequence(hold, posture)", &set).unwrap();
    let (mut out, mut last, mut largest) = (Outbox::new(), None::<RobotCommand>, 0.0_f64);
    for tick in 0..400 {
        let is_switched = tick >= 200;
        let mut input = input(tick, if is_switched { 2 } else { 1 });
        // The joints lag behind their references by 0.05 rad, as under a load.
        for (j, q) in input.state.q.iter_mut().enumerate() {
            *q = last.as_ref().map_or(*q - 0.3, |last| last.q_des[j] - 0.05);
        }
        if tick == 200 && with_handover {
            let mut bytes = Vec::new();
            last.as_ref().unwrap().encode(&mut bytes).unwrap();
            assert!(sequence.receive(&input, channels::ROBOT_COMMAND, &bytes));
        }
        sequence.step(&input, &mut out);
        let command = command_of(&out);
        assert_eq!(tick_of(&out).fault, ControllerTick::FAULT_NONE, "tick {tick}");
        if let Some(last) = last {
            let steps = last.q_des.iter().zip(&command.q_des).map(|(before, now)| (now - before).abs());
            largest = steps.fold(largest, f64::max);
        }
        last = Some(command);
    }
    largest
}

/// HyQ's joints are allowed 12 rad/s: 0.012 rad in a tick. Without the last command the reference jumps to the measured position.
#[test]
fn a_controller_that_takes_over_continues_from_the_last_command() {
    assert!(largest_step(true) < 0.012, "{}", largest_step(true));
    assert!(largest_step(false) > 0.04, "{}", largest_step(false));
}
