//! A component: what it reads of the delivered messages, what it ignores, what holds from tick to tick, and its snapshot.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{PARAMS, PERIOD_NS, Puppet, URDF, hyq, messages, standing, tick_of};
use controller::runtime::MAX_MESSAGES;
use controller::{Component, Delivery, Outbox, Unpacked};
use lcmtypes::{
    ComponentInfo, ComponentState, ControllerInput, ControllerTick, Message, OperatorCommand, QuadrupedState,
    RobotState, RunInfo, Running, channels,
};

fn component() -> Component {
    Component::new(Box::new(hyq()))
}

/// A standing HyQ that walks from tick 100 on. The operator's command is delivered every tenth tick.
fn inputs(ticks: i64) -> Vec<ControllerInput> {
    let (mut puppet, mut out, mut component) = (Puppet::new(7), Outbox::new(), component());
    let mut delivery = Delivery::new(3);
    let mut inputs = Vec::new();
    for tick in 0..ticks {
        delivery.begin(puppet.input.t_ns, tick);
        assert!(delivery.put(channels::ROBOT_STATE, puppet.input.t_ns, &puppet.input.state).unwrap());
        if tick % 10 == 0 {
            assert!(delivery.put(channels::OPERATOR_COMMAND, puppet.input.t_op_ns, &puppet.input.op).unwrap());
        }
        component.step(delivery.input(), &mut out);
        inputs.push(delivery.input().clone());
        puppet.react(&out);
    }
    inputs
}

fn input(tick: i64) -> ControllerInput {
    ControllerInput { t_ns: tick * PERIOD_NS, tick, run_id: 3, ..ControllerInput::default() }
}

#[test]
fn newer_messages_replace_older_ones_and_the_others_hold() {
    let mut first = input(0);
    let state = standing(hyq().robot()).state;
    let op = |seq| OperatorCommand { seq, ..OperatorCommand::default() };
    first.deliver(channels::RUNNING, 0, &Running { t_ns: 0, running: 2 }).unwrap();
    first.deliver(channels::OPERATOR_COMMAND, -5, &op(1)).unwrap();
    first.deliver(channels::OPERATOR_COMMAND, -4, &op(2)).unwrap();
    first.deliver(channels::ROBOT_STATE, 0, &state).unwrap();
    let found = Unpacked::all([&input(0), &first, &input(2)]);
    assert_eq!((found[0].op.seq, found[0].state.nj, found[0].running), (-1, 0, 0), "before the first messages");
    for (tick, found) in [(0, &found[1]), (2, &found[2])] {
        assert_eq!((found.tick, found.running, found.op.seq, found.t_op_ns), (tick, 2, 2, -4));
        assert_eq!((&found.state, found.n_ignored), (&state, 0));
    }
}

#[test]
fn unknown_and_undecodable_messages_are_counted_and_change_nothing() {
    let (mut plain, mut component) = (component(), self::component());
    let (mut of_plain, mut out) = (Outbox::new(), Outbox::new());
    for mut input in inputs(60) {
        plain.step(&input, &mut of_plain);
        let is_last = input.tick == 59;
        if is_last {
            input.deliver("PLAN", 0, &Running::default()).unwrap();
            input.deliver(channels::ROBOT_STATE, 0, &OperatorCommand::default()).unwrap();
            input.deliver(channels::OPERATOR_COMMAND, 0, &RobotState::default()).unwrap();
            input.messages.last_mut().unwrap().data.truncate(9);
        }
        component.step(&input, &mut out);
        let (a, b) = (tick_of(&of_plain), tick_of(&out));
        assert_eq!((a.n_ignored, b.n_ignored), (0, if is_last { 3 } else { 0 }));
        assert_eq!((a.mode, a.fault, &a.digest[1..]), (b.mode, b.fault, &b.digest[1..]));
        assert_eq!(a.digest[0] != b.digest[0], is_last, "the count is part of the input");
    }
}

#[test]
fn ticks_without_a_robot_state_are_faults_once_the_last_one_is_too_old() {
    let (mut component, mut out) = (component(), Outbox::new());
    component.step(&input(0), &mut out);
    let tick = tick_of(&out);
    assert_eq!((tick.mode, tick.fault), (ControllerTick::MODE_IDLE, ControllerTick::FAULT_INPUT_SIZE));
    let mut with_state = input(1);
    let state = RobotState { t_ns: PERIOD_NS, ..standing(hyq().robot()).state };
    with_state.deliver(channels::ROBOT_STATE, PERIOD_NS, &state).unwrap();
    component.step(&with_state, &mut out);
    // safety.max_state_age is 10 ms.
    for tick in 2..=11 {
        component.step(&input(tick), &mut out);
        assert_eq!(tick_of(&out).fault, ControllerTick::FAULT_NONE, "tick {tick}");
    }
    component.step(&input(12), &mut out);
    let tick = tick_of(&out);
    assert_eq!((tick.mode, tick.fault), (ControllerTick::MODE_DAMPING, ControllerTick::FAULT_STATE_STALE));
}

/// The restart is in the middle of the operator's period: the command in force is known from the snapshot only.
#[test]
fn restart_from_a_snapshot_gives_the_same_run() {
    let inputs = inputs(400);
    for restart in [0, 95, 105, 303] {
        let (mut component, mut out) = (component(), Outbox::new());
        let (mut restarted, mut of_restarted) = (self::component(), Outbox::new());
        for (tick, input) in inputs.iter().enumerate() {
            component.step(input, &mut out);
            if tick > restart {
                restarted.step(input, &mut of_restarted);
                assert_eq!(messages(&out), messages(&of_restarted), "tick {tick} after tick {restart}");
            }
            if tick == restart {
                let mut state = Vec::new();
                component.snapshot(&mut state);
                restarted.restore(&state).unwrap();
                restarted.poison_workspace();
            }
        }
    }
}

#[test]
fn the_published_snapshot_contains_input_and_controller() {
    let (mut component, mut out) = (component(), Outbox::new());
    let inputs = inputs(2);
    component.step(&inputs[0], &mut out);
    let mut state = Vec::new();
    component.snapshot(&mut state);
    assert_eq!(out.get(channels::CONTROLLER_SNAPSHOT), Some(&state[..]));
    let state = ComponentState::decode(&state).unwrap();
    assert_eq!((state.tick, &state.input), (0, component.input()));
    assert_eq!(QuadrupedState::decode(&state.controller.data).unwrap().tick, 0);
    component.step(&inputs[1], &mut out);
    assert_eq!(out.get(channels::CONTROLLER_SNAPSHOT), None);
    assert!(component.restore(&state.controller.data).is_err(), "the state of a controller alone");
}

#[test]
fn a_delivery_is_bounded() {
    let mut delivery = Delivery::new(3);
    for tick in 0..3 {
        delivery.begin(tick, tick);
        let delivered = (0..MAX_MESSAGES + 2).filter(|_| delivery.put("X", 0, &Running::default()).unwrap()).count();
        assert_eq!((delivered, delivery.room()), (MAX_MESSAGES, 0));
        assert_eq!(delivery.input().n_messages as usize, MAX_MESSAGES);
    }
    delivery.begin(3, 3);
    delivery.late("PLAN", 2);
    let input = delivery.input();
    assert_eq!((input.n_messages, input.n_late, input.late[0].due_tick), (0, 1, 2));
    assert_eq!(Unpacked::default().update(input).n_late, 1);
}

#[test]
fn a_run_names_its_stages() {
    let load = |kind: &str| {
        let info = RunInfo { urdf: URDF.to_owned(), ..RunInfo::default() };
        controller::load(&info.with_component(ComponentInfo::new(kind, PARAMS))).unwrap()
    };
    let six = ["input", "estimation", "gait", "tasks", "qp", "output"];
    assert_eq!(load("quadruped").stages(), six);
    assert_eq!(load("hold").stages(), ["input", "output"]);
    for list in ["sequence(hold, quadruped)", "sequence(quadruped, hold)"] {
        assert_eq!(load(list).stages(), six, "{list}");
    }
}
