//! Same parameters, state and inputs give the same bytes. Each check has a mutant that it must detect.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{Messages, Run, hyq, hyq_with, messages, run_with_puppet};
use controller::quadruped::Quadruped;
use controller::quadruped::leg::LegPhase;
use controller::quadruped::state::MovePhase;
use controller::stack::{S1, S3};
use controller::{Controller, Outbox};
use lcmtypes::{ControllerTick, LegState, Message, OperatorCommand, QuadrupedState, TickInput, channels};
use std::cell::RefCell;
use std::collections::BTreeSet;

/// Long enough for restarts after ticks 0, 1000 and 2000.
const TICKS: usize = 2100;
const SEED: u64 = 7;

fn recorded() -> Run {
    run_with_puppet(&mut hyq(), SEED, TICKS)
}

fn replay(controller: &mut dyn Controller, inputs: &[TickInput]) -> Vec<Messages> {
    let mut out = Outbox::new();
    let step = |input| {
        controller.step(input, &mut out);
        messages(&out)
    };
    inputs.iter().map(step).collect()
}

fn message<'a>(tick: &'a Messages, channel: &str) -> &'a [u8] {
    &tick.iter().find(|(c, _)| *c == channel).unwrap_or_else(|| panic!("no {channel}")).1
}

/// Tick, channel and field of the first difference.
fn first_difference(a: &[Messages], b: &[Messages]) -> Option<(usize, String)> {
    assert_eq!(a.len(), b.len());
    for (tick, (a, b)) in a.iter().zip(b).enumerate() {
        for (left, right) in a.iter().zip(b) {
            assert_eq!(left.0, right.0, "channels of tick {tick}");
            if left.1 != right.1 {
                let of_type = lcmtypes::types().of_message(&left.1).unwrap();
                let found = of_type.first_difference(&left.1, &right.1).unwrap().unwrap();
                return Some((tick, format!("{} {}: {} != {}", left.0, found.path, found.left, found.right)));
            }
        }
        assert_eq!(a.len(), b.len(), "messages of tick {tick}");
    }
    None
}

#[test]
fn two_controllers_agree_and_the_inputs_reach_every_leg_phase() {
    let run = recorded();
    assert_eq!(first_difference(&run.outputs, &replay(&mut hyq(), &run.inputs)), None);

    let (mut phases, mut modes, mut gaits) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
    for tick in &run.outputs {
        let legs = LegState::decode(message(tick, channels::LEG_STATE)).unwrap();
        phases.extend(legs.state);
        gaits.insert(legs.gait);
        modes.insert(ControllerTick::decode(message(tick, channels::CONTROLLER_TICK)).unwrap().mode);
    }
    assert_eq!(phases.len(), LegPhase::ALL.len());
    assert_eq!(modes.into_iter().collect::<Vec<_>>(), [ControllerTick::MODE_STANCE, ControllerTick::MODE_WALK]);
    assert_eq!(gaits.len(), 2);
}

/// Outputs of a controller whose workspace is poisoned before every tick.
fn replay_poisoned(mut controller: Quadruped, inputs: &[TickInput]) -> Vec<Messages> {
    let mut out = Outbox::new();
    let tick = |input| {
        controller.poison_workspace();
        controller.step(input, &mut out);
        messages(&out)
    };
    inputs.iter().map(tick).collect()
}

#[test]
fn poisoned_workspace_changes_no_bit() {
    let run = recorded();
    assert_eq!(first_difference(&run.outputs, &replay_poisoned(hyq(), &run.inputs)), None);
}

#[test]
fn poisoned_workspace_changes_no_bit_with_a_hierarchy_or_another_solver() {
    for (formula, solver) in [(S3, "active_set"), (S3, "clarabel"), (S1, "clarabel")] {
        let build = || hyq_with(&[("stack.formula", formula), ("qp.solver", &format!("\"{solver}\""))]);
        let run = run_with_puppet(&mut build(), SEED, 300);
        assert_eq!(first_difference(&run.outputs, &replay_poisoned(build(), &run.inputs)), None, "{formula}, {solver}");
    }
}

/// Formulas with each task that is not in the default.
const FURTHER: [&str; 6] = [
    "1e6 contact + 1e3 trunk + swing + posture",
    "contact / trunk / swing + posture",
    "1e6 relative_feet + 1e3 trunk + posture",
    "1e6 contact + 1e3 trunk + posture + 0.1 cone_center",
    "1e6 contact + 1e3 trunk + posture + 0.1 internal_forces",
    "relative_feet / trunk / swing + posture / cone_center + internal_forces",
];

#[test]
fn a_run_with_each_further_task_replays_bit_for_bit() {
    let constraints = S1.split_once("<<").unwrap().1;
    let plain = run_with_puppet(&mut hyq(), SEED, 300);
    for tasks in FURTHER {
        let formula = format!("{tasks} <<{constraints}");
        let build = || hyq_with(&[("stack.formula", &formula)]);
        let run = run_with_puppet(&mut build(), SEED, 300);
        // The task has an effect.
        assert!(first_difference(&plain.outputs, &run.outputs).is_some(), "{tasks}");
        assert_eq!(first_difference(&run.outputs, &replay(&mut build(), &run.inputs)), None, "{tasks}");
        assert_eq!(first_difference(&run.outputs, &replay_poisoned(build(), &run.inputs)), None, "{tasks}");
    }
}

/// State of a new controller after these inputs.
fn state_after(inputs: &[TickInput]) -> Vec<u8> {
    let mut state = Vec::new();
    run_to(hyq(), inputs).snapshot(&mut state);
    state
}

#[test]
fn restart_from_any_snapshot_gives_the_same_run() {
    let run = recorded();
    let mut restarts = 0;
    // A controller with another history, now in the safe state.
    let mut used = run_to(hyq(), &run.inputs[..300]);
    used.step(&damped(&run.inputs[300]), &mut Outbox::new());
    for tick in 0..run.outputs.len() {
        if tick % 1000 != 0 {
            continue;
        }
        restarts += 1;
        let snapshot = &state_after(&run.inputs[..=tick]);
        let mut written = Vec::new();
        for controller in [&mut hyq(), &mut used] {
            controller.restore(snapshot).unwrap();
            written.clear();
            controller.snapshot(&mut written);
            assert_eq!(written, *snapshot, "a restored snapshot is written unchanged");
            let tail = replay(controller, &run.inputs[tick + 1..]);
            assert_eq!(first_difference(&run.outputs[tick + 1..], &tail), None, "restart after tick {tick}");
        }
    }
    assert_eq!(restarts, 3);
}

#[test]
fn restart_in_the_safe_state_gives_the_same_run() {
    let run = recorded();
    let mut controller = run_to(hyq(), &run.inputs[..300]);
    controller.step(&damped(&run.inputs[300]), &mut Outbox::new());
    let mut snapshot = Vec::new();
    controller.snapshot(&mut snapshot);
    let mut fresh = hyq();
    fresh.restore(&snapshot).unwrap();
    let tail = &run.inputs[301..320];
    assert_eq!(first_difference(&replay(&mut controller, tail), &replay(&mut fresh, tail)), None);
}

#[test]
fn unsolved_programs_do_not_change_later_ticks() {
    let run = recorded();
    // An iteration limit that is sufficient to trot, but not for joints at eight times their largest speed.
    let hyq = || hyq_with(&[("wbc.max_iterations", "30"), ("safety.velocity_factor", "10")]);
    let mut controller = run_to(hyq(), &run.inputs[..300]);
    let mut failures = 0;
    for (input, size) in run.inputs[300..304].iter().zip([90.0, -90.0, 60.0, 30.0]) {
        let mut wild = input.clone();
        wild.state.qd.iter_mut().zip([1.0, -1.0].into_iter().cycle()).for_each(|(qd, sign)| *qd = sign * size);
        controller.step(&wild, &mut Outbox::new());
        failures = failures.max(controller.state().qp_failures);
    }
    assert!(failures > 0, "every program was solved: the inputs are not extreme enough");
    let mut snapshot = Vec::new();
    controller.snapshot(&mut snapshot);
    let mut fresh = hyq();
    fresh.restore(&snapshot).unwrap();
    let tail = &run.inputs[304..400];
    assert_eq!(first_difference(&replay(&mut controller, tail), &replay(&mut fresh, tail)), None);
}

#[test]
fn mutant_one_low_bit_of_one_joint_angle() {
    const AT: usize = 700;
    let run = recorded();
    let mut inputs = run.inputs.clone();
    let q = &mut inputs[AT].state.q[4];
    *q = f64::from_bits(q.to_bits() ^ 2);
    let outputs = replay(&mut hyq(), &inputs);
    assert_eq!(first_difference(&run.outputs, &outputs).unwrap().0, AT);
    let tick = |outputs: &[Messages]| ControllerTick::decode(message(&outputs[AT], channels::CONTROLLER_TICK)).unwrap();
    let (a, b) = (tick(&run.outputs), tick(&outputs));
    assert_ne!(a.digest[0], b.digest[0]);
    assert_ne!(a.digest[1], b.digest[1]);
}

#[test]
fn mutant_one_parameter() {
    let run = recorded();
    let outputs = replay(&mut hyq_with(&[("trunk.kp", "[1000.0, 1000.0000000000001, 1000.0]")]), &run.inputs);
    let tick = |outputs: &Messages| ControllerTick::decode(message(outputs, channels::CONTROLLER_TICK)).unwrap();
    let ticks = run.outputs.iter().zip(&outputs).map(|(recorded, replayed)| (tick(recorded), tick(replayed)));
    let (a, b) = ticks.clone().next().unwrap();
    assert_ne!(a.digest_parameters, b.digest_parameters);
    let (a, b) = { ticks }.find(|(a, b)| a.digest[3] != b.digest[3]).expect("the trunk gain is part of the tasks");
    assert_eq!((a.digest[1], a.digest[2]), (b.digest[1], b.digest[2]));
}

/// A state and the inputs that follow.
struct Situation {
    /// Name, for failure messages.
    name: String,
    /// Restores one state after the other: only the state may matter.
    controller: RefCell<Quadruped>,
    snapshot: Vec<u8>,
    inputs: Vec<TickInput>,
}

impl Situation {
    fn new(name: &str, overrides: &[(&str, &str)], snapshot: Vec<u8>, inputs: Vec<TickInput>) -> Self {
        Situation { name: name.to_owned(), controller: RefCell::new(hyq_with(overrides)), snapshot, inputs }
    }

    /// Outputs of the controller from this state on.
    fn outputs(&self, snapshot: &[u8]) -> Option<Vec<Messages>> {
        let mut controller = self.controller.borrow_mut();
        controller.restore(snapshot).ok()?;
        Some(replay(&mut *controller, &self.inputs))
    }
}

/// Fields on which the outputs do not depend, with the reason.
fn is_exempt(path: &str) -> bool {
    // The tick takes its number from the input.
    path == "tick"
        // The length of the arrays: another length is rejected.
        || path == "nj"
}

#[test]
fn mutant_every_field_of_the_state() {
    let situations = situations();
    let outputs =
        |s: &Situation| s.outputs(&s.snapshot).unwrap_or_else(|| panic!("{}: the snapshot is rejected", s.name));
    let expected: Vec<_> = situations.iter().map(outputs).collect();
    let state_type = lcmtypes::types().by_name(QuadrupedState::TYPE).unwrap();
    let leaves: Vec<String> =
        state_type.leaves(&situations[0].snapshot).unwrap().into_iter().map(|(path, _)| path).collect();
    assert!(leaves.len() > 80, "{} leaves", leaves.len());

    let differs = |path: &str| {
        let found = situations.iter().zip(&expected).find(|(situation, expected)| {
            let state = state_type.decode(&situation.snapshot).unwrap();
            other_values(state.get(path).unwrap()).into_iter().any(|value| {
                let mut mutant = state.clone();
                mutant.set(path, value).unwrap();
                let Ok(mutant) = state_type.encode(&mutant) else { return false };
                situation.outputs(&mutant).is_some_and(|outputs| first_difference(expected, &outputs).is_some())
            })
        });
        found.map(|(situation, _)| situation.name.as_str())
    };
    let names: Vec<&str> = situations.iter().map(|situation| situation.name.as_str()).collect();
    for path in &leaves {
        let found = differs(path);
        assert_eq!(found.is_some(), !is_exempt(path), "{path} changes the outputs in {found:?}; situations: {names:?}");
    }
}

/// States in which different fields matter: walking, stretched legs, contact events, stopping, no QP solution, safe state, stand/sit
/// transitions.
fn situations() -> Vec<Situation> {
    const HORIZON: usize = 25;
    let run = recorded();
    let mut situations = Vec::new();
    let (mut controller, mut out) = (hyq(), Outbox::new());
    for (tick, input) in run.inputs[..TICKS - HORIZON].iter().enumerate() {
        controller.step(input, &mut out);
        if tick % 110 == 60 {
            let mut snapshot = Vec::new();
            controller.snapshot(&mut snapshot);
            let inputs = run.inputs[tick + 1..][..HORIZON].to_vec();
            situations.push(Situation::new(&format!("tick {tick} of the recorded run"), &[], snapshot, inputs));
        }
    }
    let (snapshot, inputs) = (situations[2].snapshot.clone(), situations[2].inputs.clone());

    let overrides = &[("contact.min_jacobian_det", "1.0")];
    situations.push(Situation::new("all legs count as stretched", overrides, snapshot.clone(), inputs.clone()));

    let mut in_the_air = QuadrupedState::decode(&snapshot).unwrap();
    in_the_air.leg_state = [LegState::STATE_SWING_UP; 4];
    in_the_air.t_leg = [0.0; 4];
    let mut bytes = Vec::new();
    in_the_air.encode(&mut bytes).unwrap();
    situations.push(Situation::new("all feet in swing", &[], bytes, inputs.clone()));

    // Feet in swing with a step reflex, for two directions of the step.
    for heading in [0.0, std::f64::consts::PI] {
        in_the_air.t_leg = [0.06; 4];
        (in_the_air.step_heading, in_the_air.reflexes) = ([heading; 4], [1; 4]);
        let mut bytes = Vec::new();
        in_the_air.encode(&mut bytes).unwrap();
        let overrides = &[("recovery.reflex_load", "1e-9"), ("recovery.step_reflex", "true")];
        let name = format!("step reflex, heading {heading:.1} rad");
        situations.push(Situation::new(&name, overrides, bytes, inputs.clone()));
    }

    // Stance feet whose contact is about to be declared lost.
    let mut missing = QuadrupedState::decode(&snapshot).unwrap();
    (missing.leg_state, missing.t_unloaded, missing.t_leg) = ([LegState::STATE_STANCE; 4], [0.045; 4], [1.0; 4]);
    let mut bytes = Vec::new();
    missing.encode(&mut bytes).unwrap();
    let overrides = &[("contact.touch_load", "1.0"), ("recovery.lost_contact_time", "0.05")];
    let idle = inputs.iter().cloned().map(|mut input| {
        input.state.tau.fill(0.0);
        input
    });
    situations.push(Situation::new("contact about to be lost", overrides, bytes, idle.collect()));

    let overrides = &[("contact.touch_load", "1.0")];
    let (standing, then) = (situations[0].snapshot.clone(), situations[0].inputs.clone());
    situations.push(Situation::new("standing, no new contact detected", overrides, standing, then));

    let mut about_to_stop = QuadrupedState::decode(&snapshot).unwrap();
    about_to_stop.leg_state = [LegState::STATE_STANCE; 4];
    let mut bytes = Vec::new();
    about_to_stop.encode(&mut bytes).unwrap();
    let stand = |input: &TickInput| {
        let op = OperatorCommand { mode: OperatorCommand::MODE_STAND, ..input.op.clone() };
        TickInput { op, ..input.clone() }
    };
    situations.push(Situation::new("stopping to stand", &[], bytes, inputs.iter().map(stand).collect()));

    let overrides = &[("qp.solver", "\"clarabel\""), ("wbc.max_iterations", "1")];
    situations.push(Situation::new("no QP solution", overrides, snapshot.clone(), inputs.clone()));

    let mut damping = hyq();
    damping.restore(&snapshot).unwrap();
    damping.step(&damped(&inputs[0]), &mut out);
    let mut snapshot = Vec::new();
    damping.snapshot(&mut snapshot);
    situations.push(Situation::new("safe state", &[], snapshot.clone(), inputs[1..].to_vec()));
    // At rest for almost long enough, while the operator requests IDLE.
    let mut about_to_idle = QuadrupedState::decode(&snapshot).unwrap();
    about_to_idle.t_still = 0.49;
    let mut bytes = Vec::new();
    about_to_idle.encode(&mut bytes).unwrap();
    let resting = |input: &TickInput| {
        let mut input =
            TickInput { op: OperatorCommand { mode: OperatorCommand::MODE_IDLE, ..input.op.clone() }, ..input.clone() };
        input.state.qd.fill(0.0);
        input
    };
    let inputs_at_rest = inputs[1..].iter().map(resting).collect();
    situations.push(Situation::new("safe state, about to become IDLE", &[], bytes, inputs_at_rest));

    // No foot on the ground for almost the longest time allowed.
    let mut in_flight = QuadrupedState::decode(&situations[0].snapshot).unwrap();
    (in_flight.t_no_contact, in_flight.contact) = (0.49, [0; 4]);
    let mut bytes = Vec::new();
    in_flight.encode(&mut bytes).unwrap();
    let overrides = &[("contact.touch_load", "1.0"), ("recovery.lost_contact_time", "0.0")];
    let idle = situations[0].inputs.iter().cloned().map(|mut input| {
        input.state.tau.fill(0.0);
        input
    });
    let idle = idle.collect();
    situations.push(Situation::new("no contact, about to enter the safe state", overrides, bytes, idle));

    // Order for speed only: rare situations first; stand/sit transitions, in which most fields do not matter, last.
    situations.reverse();
    situations.extend(transitions());
    situations
}

/// The middle of every phase of the stand/sit transitions, each also with a joint that is about to be reported as not following.
fn transitions() -> Vec<Situation> {
    let (mut puppet, mut controller, mut out) = (common::Puppet::new(9), hyq(), Outbox::new());
    puppet.noise = 0.0;
    let mut found = Vec::new();
    let mut step = |controller: &mut Quadruped, tick: usize| {
        let mode = if (100..7000).contains(&tick) { OperatorCommand::MODE_SIT } else { OperatorCommand::MODE_STAND };
        puppet.input.op = OperatorCommand { mode, seq: 1, ..OperatorCommand::default() };
        let input = puppet.input.clone();
        controller.step(&input, &mut out);
        puppet.react(&out);
        input
    };
    let mut seen = Vec::new();
    for tick in 0..11_000 {
        step(&mut controller, tick);
        let phase = controller.state().move_phase;
        let middle = controller.state().move_progress > 0.3 || phase == MovePhase::Lie;
        if phase == MovePhase::None || !middle || seen.contains(&phase) {
            continue;
        }
        seen.push(phase);
        let mut snapshot = Vec::new();
        controller.snapshot(&mut snapshot);
        let mut ahead = hyq();
        ahead.restore(&snapshot).unwrap();
        let inputs: Vec<_> = (1..=10).map(|later| step(&mut ahead, tick + later)).collect();
        controller = ahead;
        found.push(Situation::new(&format!("stand/sit phase {phase:?}"), &[], snapshot.clone(), inputs.clone()));
        let mut stuck = QuadrupedState::decode(&snapshot).unwrap();
        stuck.t_held = 1.99;
        let mut bytes = Vec::new();
        stuck.encode(&mut bytes).unwrap();
        let name = format!("stand/sit phase {phase:?}, a joint does not follow");
        found.push(Situation::new(&name, &[("stand.max_error", "1e-9")], bytes, inputs));
    }
    assert_eq!(seen.len(), MovePhase::ALL.len() - 1);
    found
}

/// Other values of the same type.
fn other_values(value: &lcm_idl::Value) -> Vec<lcm_idl::Value> {
    use lcm_idl::Value;
    match *value {
        Value::Boolean(x) => vec![(!x).into()],
        Value::Int8(x) => (0..7).filter(|y| *y != x).map(Into::into).collect(),
        Value::Int32(x) => vec![0.into(), (x + 1).into(), (x - 1).into()],
        Value::Int64(x) => vec![(x - 2_500_000).into()],
        // Both signs: a torque at its limit cannot increase.
        Value::Double(x) if x.is_finite() => [0.01, -0.01].map(|part| (x + part * (1.0 + x.abs())).into()).into(),
        Value::Double(_) => vec![0.01.into()],
        _ => panic!("{} in a state", value.kind()),
    }
}

fn run_to(mut controller: controller::quadruped::Quadruped, inputs: &[TickInput]) -> controller::quadruped::Quadruped {
    replay(&mut controller, inputs);
    controller
}

fn damped(input: &TickInput) -> TickInput {
    let op = OperatorCommand { mode: OperatorCommand::MODE_DAMPING, ..input.op.clone() };
    TickInput { op, ..input.clone() }
}
