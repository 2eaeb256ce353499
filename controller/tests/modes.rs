//! Modes of the controller: transitions, rejected requests, faults.
#![allow(clippy::disallowed_types, non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{Messages, Puppet, assert_damps, command_of, finite, get, hyq, hyq_with, messages, set_base, tick_of};
use controller::math::Rx;
use controller::params::Params;
use controller::quadruped::Quadruped;
use controller::quadruped::robot::Robot;
use controller::quadruped::state::MovePhase;
use controller::{Controller, Outbox};
use lcmtypes::{ContactEstimate, ControllerTick as Tick, Message, OperatorCommand as Op, RobotCommand, channels};
use nalgebra::Vector3;
use std::sync::LazyLock;
use test_support::replace_once;

/// A robot without noise that follows its references, and an operator that requests one mode at a time.
struct Story {
    controller: Quadruped,
    puppet: Puppet,
    out: Outbox,
    mode: i8,
    /// Changes the input of every tick.
    spoil: fn(&mut Puppet),
}

impl Story {
    /// Starts with the robot on the ground, the operator requests IDLE.
    fn lying() -> Self {
        Self::lying_with(hyq())
    }

    fn lying_with(controller: Quadruped) -> Self {
        let mut story = Story::standing_with(controller);
        let params = Params::from_toml(common::PARAMS, "hyq.toml").unwrap();
        let mut q = story.controller.robot().q_nominal.clone();
        for (name, value) in &params.robot.lying {
            q[story.controller.robot().model.joint(name).unwrap().index()] = *value;
        }
        story.puppet.put(&q);
        story.mode = Op::MODE_IDLE;
        story
    }

    fn standing() -> Self {
        Self::standing_with(hyq())
    }

    fn standing_with(controller: Quadruped) -> Self {
        let mut puppet = Puppet::new(7);
        puppet.noise = 0.0;
        Story { controller, puppet, out: Outbox::new(), mode: Op::MODE_STAND, spoil: |_| () }
    }

    fn tick(&mut self) -> Tick {
        let input = &mut self.puppet.input;
        input.op = Op { t_ns: input.t_ns, seq: input.tick, mode: self.mode, ..Op::default() };
        (self.spoil)(&mut self.puppet);
        self.controller.step(&self.puppet.input, &mut self.out);
        self.check_torques();
        self.puppet.react(&self.out);
        tick_of(&self.out)
    }

    /// Asserts that the total torque of every drive is within the effort limit: 150 N m for every joint of HyQ.
    fn check_torques(&self) {
        let RobotCommand { mode, tau, q_des, qd_des, kp, kd, .. } = command_of(&self.out);
        assert!(finite(&command_of(&self.out)));
        for j in 0..12 {
            let (q, qd) = (self.puppet.input.state.q[j], self.puppet.input.state.qd[j]);
            let total = match mode {
                RobotCommand::MODE_TORQUE => tau[j] + kp[j] * (q_des[j] - q) + kd[j] * (qd_des[j] - qd),
                RobotCommand::MODE_DAMPING => -kd[j] * qd,
                _ => 0.0,
            };
            assert!(total.is_nan() || total.abs() <= 150.0 + 1e-9, "joint {j}: {total} N m");
        }
    }

    /// The operator requests `mode` for some ticks. Returns the last tick.
    fn ask(&mut self, mode: i8, ticks: usize) -> Tick {
        self.mode = mode;
        (0..ticks).map(|_| self.tick()).last().unwrap()
    }

    /// The operator requests `mode` until the controller is in mode `until`; at most ten seconds.
    #[track_caller]
    fn ask_until(&mut self, mode: i8, until: i8) -> Tick {
        self.mode = mode;
        let tick = (0..10_000).map(|_| self.tick()).find(|tick| tick.mode == until);
        tick.unwrap_or_else(|| panic!("never in {until}, but in {:?}", tick_of(&self.out)))
    }

    fn phase(&self) -> MovePhase {
        self.controller.state().move_phase
    }

    #[track_caller]
    fn until_phase(&mut self, phase: MovePhase) {
        let reached = (0..10_000).any(|_| {
            self.tick();
            self.phase() == phase
        });
        assert!(reached, "never in {phase:?}, but in {:?}", self.phase());
    }
}

/// Asserts that the request `asked` is rejected: the mode stays, and the tick reports the requested mode.
#[track_caller]
fn assert_rejected(story: &mut Story, mode: i8, asked: i8) {
    let tick = story.ask(asked, 1);
    assert_eq!((tick.mode, tick.fault, tick.fault_index), (mode, Tick::FAULT_OPERATOR_REFUSED, asked.into()));
}

#[test]
fn stands_up_walks_stops_and_sits_down() {
    let mut story = Story::lying();
    assert_eq!(story.ask(Op::MODE_IDLE, 600).mode, Tick::MODE_IDLE);
    assert_eq!(command_of(&story.out).mode, RobotCommand::MODE_IDLE);
    let mut phases = vec![];
    let mut modes = vec![];
    for (mode, ticks) in [
        (Op::MODE_STAND, 6000),
        (Op::MODE_WALK, 1000),
        (Op::MODE_STAND, 1000),
        (Op::MODE_SIT, 9000),
        (Op::MODE_IDLE, 5),
    ] {
        story.mode = mode;
        for _ in 0..ticks {
            let Tick { mode, fault, .. } = story.tick();
            modes.push(mode);
            phases.push(story.phase());
            // The puppet has no ground below its swinging feet.
            let is_held = mode == Tick::MODE_WALK && fault == Tick::FAULT_NO_GROUND;
            assert!(fault == Tick::FAULT_NONE || is_held, "fault {fault} in mode {mode}");
        }
    }
    modes.dedup();
    phases.dedup();
    let expected = [Tick::MODE_STAND_UP, Tick::MODE_STANCE, Tick::MODE_WALK, Tick::MODE_STANCE, Tick::MODE_SIT];
    assert_eq!(modes, [&expected[..], &[Tick::MODE_IDLE]].concat());
    use MovePhase::{Gather, Lie, Lower, None, Release, Rise, Spread};
    assert_eq!(phases, [Gather, Rise, None, Lower, Spread, Release, Lie, None]);
}

#[test]
fn standing_up_ends_in_the_nominal_posture() {
    let mut story = Story::lying();
    story.ask(Op::MODE_IDLE, 600);
    story.ask_until(Op::MODE_STAND, Tick::MODE_STANCE);
    let robot = story.controller.robot();
    let contact: ContactEstimate = get(&story.out, channels::CONTACT_ESTIMATE);
    assert!((contact.height - robot.nominal_height).abs() < 2e-3, "{}", contact.height);
    let legs: lcmtypes::LegState = get(&story.out, channels::LEG_STATE);
    for (leg, of_robot) in robot.legs.iter() {
        let off = Vector3::from(legs.p_BF_H_est[leg as usize]) - of_robot.p_nominal_H;
        assert!(off.norm() < 3e-3, "{} is {off} off", leg.name());
    }
}

#[test]
fn a_robot_that_stands_at_the_first_tick_is_held_for_every_request() {
    for asked in [Op::MODE_STAND, Op::MODE_WALK, Op::MODE_SIT, 77] {
        let mut story = Story::standing();
        let mode = story.ask(asked, 1).mode;
        assert!(matches!(mode, Tick::MODE_STANCE | Tick::MODE_WALK), "{mode}");
    }
    let mut story = Story::standing();
    story.spoil = |puppet| puppet.input.op.seq = -1;
    assert_eq!(story.ask(Op::MODE_STAND, 50).mode, Tick::MODE_STANCE);
    let mut story = Story::standing();
    assert_eq!(story.ask(Op::MODE_IDLE, 50).mode, Tick::MODE_IDLE);
}

#[test]
fn requests_that_do_not_fit_the_mode_are_rejected() {
    let mut story = Story::lying();
    // Not at rest for half a second yet.
    assert_rejected(&mut story, Tick::MODE_IDLE, Op::MODE_STAND);
    story.ask(Op::MODE_IDLE, 600);
    for asked in [Op::MODE_WALK, Op::MODE_SIT] {
        assert_rejected(&mut story, Tick::MODE_IDLE, asked);
    }
    assert_rejected(&mut story, Tick::MODE_IDLE, 77);
    assert_eq!(story.ask(Op::MODE_STAND, 300).mode, Tick::MODE_STAND_UP);
    for asked in [Op::MODE_WALK, Op::MODE_IDLE] {
        assert_rejected(&mut story, Tick::MODE_STAND_UP, asked);
    }
    // A rejected request does not stop the transition.
    story.ask_until(Op::MODE_WALK, Tick::MODE_WALK);
    story.ask_until(Op::MODE_STAND, Tick::MODE_STANCE);
    assert_rejected(&mut story, Tick::MODE_STANCE, Op::MODE_IDLE);
    assert_eq!(story.ask(Op::MODE_WALK, 300).mode, Tick::MODE_WALK);
    assert_rejected(&mut story, Tick::MODE_WALK, Op::MODE_IDLE);
    story.ask_until(Op::MODE_STAND, Tick::MODE_STANCE);
    story.ask(Op::MODE_SIT, 100);
    assert_rejected(&mut story, Tick::MODE_SIT, Op::MODE_WALK);
    // IDLE follows SIT: the request waits.
    let waits = story.ask(Op::MODE_IDLE, 1);
    assert_eq!((waits.mode, waits.fault), (Tick::MODE_SIT, Tick::FAULT_NONE));
    story.ask_until(Op::MODE_IDLE, Tick::MODE_IDLE);
}

#[test]
fn sitting_down_and_standing_up_can_be_reversed() {
    let mut story = Story::standing();
    story.ask(Op::MODE_STAND, 100);
    for phase in [MovePhase::Lower, MovePhase::Spread, MovePhase::Release] {
        story.mode = Op::MODE_SIT;
        story.until_phase(phase);
        story.ask(Op::MODE_SIT, 100);
        assert_eq!(story.ask(Op::MODE_STAND, 1).mode, Tick::MODE_STAND_UP);
        story.ask_until(Op::MODE_STAND, Tick::MODE_STANCE);
    }
    story.ask_until(Op::MODE_SIT, Tick::MODE_SIT);
    for phase in [MovePhase::Gather, MovePhase::Rise] {
        story.mode = Op::MODE_SIT;
        story.until_phase(MovePhase::Lie);
        story.mode = Op::MODE_STAND;
        story.until_phase(phase);
        story.ask(Op::MODE_STAND, 200);
        assert_eq!(story.ask(Op::MODE_SIT, 1).mode, Tick::MODE_SIT);
    }
    story.until_phase(MovePhase::Lie);
}

#[test]
fn joint_references_of_a_transition_have_no_steps() {
    let mut story = Story::lying();
    story.ask(Op::MODE_IDLE, 600);
    let mut before: Option<Vec<f64>> = None;
    for (mode, ticks) in [(Op::MODE_STAND, 1500), (Op::MODE_SIT, 500), (Op::MODE_STAND, 5000), (Op::MODE_SIT, 9000)] {
        story.mode = mode;
        for _ in 0..ticks {
            let tick = story.tick();
            let q_des = command_of(&story.out).q_des;
            let moves = matches!(tick.mode, Tick::MODE_STAND_UP | Tick::MODE_SIT);
            if let (true, Some(before)) = (moves, &before) {
                for (j, (now, before)) in q_des.iter().zip(before).enumerate() {
                    // The fastest motion: a knee folds at 1.9 rad/s while the base is lowered by 0.2 m/s, plus a blend of the same speed.
                    assert!((now - before).abs() < 4e-3, "joint {j} jumps by {} at tick {}", now - before, tick.tick);
                }
            }
            before = moves.then_some(q_des);
        }
    }
}

#[test]
fn a_joint_that_does_not_follow_leads_to_damping_with_its_index() {
    for (mode, spoil, joint) in [
        (Tick::MODE_STAND_UP, (|p| p.input.state.q[4] = 1.18) as fn(&mut Puppet), 4),
        (Tick::MODE_SIT, |p| (p.input.state.q[8], p.input.state.qd[8]) = (1.5, 0.0), 8),
    ] {
        let (mut story, asked) = match mode {
            Tick::MODE_SIT => (Story::standing(), Op::MODE_SIT),
            _ => (Story::lying(), Op::MODE_STAND),
        };
        story.ask(story.mode, 600);
        story.spoil = spoil;
        story.ask_until(asked, mode);
        let tick = story.ask_until(asked, Tick::MODE_DAMPING);
        assert_eq!((tick.fault, tick.fault_index), (Tick::FAULT_POSTURE, joint));
        // stand.max_error is 0.4 rad.
        assert!(tick.fault_value.abs() > 0.37 && tick.fault_value.abs() < 0.41, "{tick:?}");
        assert_damps(&command_of(&story.out));
    }
}

#[test]
fn a_hind_pair_without_ground_leads_to_damping_with_the_index_of_the_leg() {
    let mut story = Story::lying();
    story.ask(Op::MODE_IDLE, 600);
    story.ask(Op::MODE_STAND, 10);
    // Joints 6 to 8 are those of LH, 9 to 11 of RH.
    story.spoil = |puppet| puppet.input.state.tau[6..12].fill(0.0);
    let tick = story.ask_until(Op::MODE_STAND, Tick::MODE_DAMPING);
    assert_eq!((tick.fault, tick.fault_index), (Tick::FAULT_NO_CONTACT, 2));
    // One foot may be in the air: in STANCE it reaches for the ground.
    let mut story = Story::lying();
    story.ask(Op::MODE_IDLE, 600);
    story.spoil = |puppet| puppet.input.state.tau[6..9].fill(0.0);
    story.ask_until(Op::MODE_STAND, Tick::MODE_STANCE);
}

#[test]
fn a_tilted_robot_does_not_stand_up() {
    let mut story = Story::lying();
    static HYQ: LazyLock<Robot> =
        LazyLock::new(|| Robot::new(common::URDF, &Params::from_toml(common::PARAMS, "").unwrap().robot).unwrap());
    story.spoil = |puppet| set_base(&HYQ, &mut puppet.input, &Rx(0.7), &Vector3::zeros());
    story.ask(Op::MODE_IDLE, 600);
    let tick = story.ask(Op::MODE_STAND, 1);
    assert_eq!((tick.mode, tick.fault), (Tick::MODE_DAMPING, Tick::FAULT_TILT));
    // It also does not become IDLE while it is tilted.
    let tick = story.ask(Op::MODE_IDLE, 1000);
    assert_eq!((tick.mode, tick.fault), (Tick::MODE_DAMPING, Tick::FAULT_TILT));
    story.spoil = |_| ();
    assert_eq!(story.ask(Op::MODE_IDLE, 1000).mode, Tick::MODE_IDLE);
}

#[test]
fn damping_changes_only_to_idle_at_rest_and_without_a_fault() {
    let mut story = Story::standing();
    story.ask(Op::MODE_STAND, 600);
    story.spoil = |puppet| puppet.input.state.q[3] = f64::NAN;
    let tick = story.ask(Op::MODE_STAND, 1);
    assert_eq!((tick.mode, tick.fault, tick.fault_index), (Tick::MODE_DAMPING, Tick::FAULT_INPUT_NOT_FINITE, 3));
    assert_eq!(story.ask(Op::MODE_IDLE, 1000).mode, Tick::MODE_DAMPING);
    story.spoil = |_| ();
    for asked in [Op::MODE_STAND, Op::MODE_WALK, Op::MODE_SIT, 77] {
        let tick = story.ask(asked, 100);
        assert_eq!((tick.mode, tick.fault), (Tick::MODE_DAMPING, Tick::FAULT_INPUT_NOT_FINITE), "asked for {asked}");
    }
    // The robot is at rest now; a moving joint ends the rest.
    story.spoil = |puppet| puppet.input.state.qd[1] = 0.4;
    assert_rejected(&mut story, Tick::MODE_DAMPING, Op::MODE_IDLE);
    story.spoil = |_| ();
    let ticks = (1..).find(|_| story.ask(Op::MODE_IDLE, 1).mode == Tick::MODE_IDLE).unwrap();
    assert_eq!(ticks, 500, "half a second of rest");
    assert_eq!(tick_of(&story.out).fault, Tick::FAULT_NONE);
}

#[test]
fn the_emergency_stop_works_in_every_mode() {
    type Way = fn(&mut Story);
    let ways: [(i8, Way); 5] = [
        (Tick::MODE_IDLE, |_| ()),
        (Tick::MODE_STAND_UP, |s| _ = s.ask(Op::MODE_STAND, 700)),
        (Tick::MODE_STANCE, |s| _ = s.ask_until(Op::MODE_STAND, Tick::MODE_STANCE)),
        (Tick::MODE_WALK, |s| {
            s.ask_until(Op::MODE_STAND, Tick::MODE_STANCE);
            s.ask(Op::MODE_WALK, 300);
        }),
        (Tick::MODE_SIT, |s| {
            s.ask_until(Op::MODE_STAND, Tick::MODE_STANCE);
            s.ask(Op::MODE_SIT, 300);
        }),
    ];
    for (mode, way) in ways {
        let mut story = Story::lying();
        story.ask(Op::MODE_IDLE, 600);
        way(&mut story);
        assert_eq!(tick_of(&story.out).mode, mode);
        // A stop is followed whatever its age.
        story.spoil = |puppet| puppet.input.t_op_ns = 0;
        let tick = story.ask(Op::MODE_DAMPING, 1);
        assert_eq!((tick.mode, tick.fault), (Tick::MODE_DAMPING, Tick::FAULT_OPERATOR));
        assert_damps(&command_of(&story.out));
    }
}

#[test]
fn a_timed_out_operator_starts_no_transition() {
    let lost: fn(&mut Puppet) = |puppet| puppet.input.t_op_ns = puppet.input.t_ns - 500_000_001;
    let stale = |tick: &Tick| tick.fault == Tick::FAULT_OPERATOR_STALE && tick.fault_value > 0.5;
    // On the ground the robot stays there, whatever was requested last.
    let mut story = Story::lying();
    story.ask(Op::MODE_IDLE, 600);
    story.spoil = lost;
    for asked in [Op::MODE_STAND, Op::MODE_WALK, Op::MODE_SIT] {
        let tick = story.ask(asked, 100);
        assert!(tick.mode == Tick::MODE_IDLE && stale(&tick), "{tick:?}");
    }
    // Walking stops; the robot stands.
    let mut story = Story::standing();
    story.ask(Op::MODE_WALK, 600);
    story.spoil = lost;
    assert_eq!(story.ask(Op::MODE_WALK, 1).mode, Tick::MODE_WALK);
    for asked in [Op::MODE_WALK, Op::MODE_SIT, Op::MODE_IDLE] {
        let tick = story.ask(asked, 800);
        assert!(tick.mode == Tick::MODE_STANCE && stale(&tick), "{tick:?}");
    }
    // At the limit of the age the command is still followed.
    story.spoil = |puppet| puppet.input.t_op_ns = puppet.input.t_ns - 500_000_000;
    assert_eq!(story.ask(Op::MODE_SIT, 1).mode, Tick::MODE_SIT);
    // A started transition continues to its end.
    story.spoil = lost;
    story.until_phase(MovePhase::Lie);
}

/// The controller of HyQ with five times faster stand/sit transitions.
fn quick() -> Quadruped {
    hyq_with(&[("stand.joint_speed", "5.0"), ("stand.rise_speed", "1.0")])
}

/// Inputs and outputs of a run with stand/sit transitions and an emergency stop.
fn recorded() -> (Vec<lcmtypes::TickInput>, Vec<Messages>) {
    let mut story = Story::lying_with(quick());
    story.puppet.noise = 0.1;
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    for (mode, ticks) in [
        (Op::MODE_IDLE, 600),
        (Op::MODE_STAND, 1200),
        (Op::MODE_SIT, 300),
        (Op::MODE_STAND, 200),
        (Op::MODE_SIT, 2500),
        (Op::MODE_DAMPING, 20),
        (Op::MODE_IDLE, 600),
    ] {
        story.mode = mode;
        for _ in 0..ticks {
            let input = &mut story.puppet.input;
            input.op = Op { t_ns: input.t_ns, seq: input.tick, mode, ..Op::default() };
            inputs.push(input.clone());
            story.controller.step(&story.puppet.input, &mut story.out);
            outputs.push(messages(&story.out));
            story.puppet.react(&story.out);
        }
    }
    (inputs, outputs)
}

fn tick_of_messages(tick: &Messages) -> Tick {
    let (_, bytes) = tick.iter().find(|(channel, _)| *channel == channels::CONTROLLER_TICK).unwrap();
    Tick::decode(bytes).unwrap()
}

#[test]
fn poisoned_workspace_and_restarts_change_no_bit() {
    let (inputs, outputs) = recorded();
    let phases: std::collections::BTreeSet<_> = outputs.iter().map(|tick| tick_of_messages(tick).mode).collect();
    assert_eq!(phases.len(), 5, "every mode except WALK: {phases:?}");
    let (mut poisoned, mut out) = (quick(), Outbox::new());
    for (tick, (input, expected)) in inputs.iter().zip(&outputs).enumerate() {
        poisoned.poison_workspace();
        poisoned.step(input, &mut out);
        assert_eq!(messages(&out), *expected, "poisoned, tick {tick}");
        if tick % 7 == 0 {
            let mut snapshot = Vec::new();
            poisoned.snapshot(&mut snapshot);
            poisoned = quick();
            poisoned.restore(&snapshot).unwrap();
        }
    }
}

#[test]
fn a_lying_posture_out_of_range_is_rejected_with_the_name_of_the_joint() {
    let error = |overrides: &[(&str, &str)]| {
        Quadruped::new(common::URDF, &common::params_with(overrides)).err().unwrap().to_string()
    };
    let out_of_range = error(&[("robot.lying.lf_kfe_joint", "0.0")]);
    for part in ["hyq", "robot.lying.lf_kfe_joint", "-2.44346095279", "-0.349065850399"] {
        assert!(out_of_range.contains(part), "{part}: {out_of_range}");
    }
    let left_out = replace_once(common::PARAMS, "lf_kfe_joint = -2.44\n", "");
    let error = Quadruped::new(common::URDF, &left_out).err().unwrap().to_string();
    assert!(error.contains("robot.lying.lf_kfe_joint") && error.contains("NaN"), "{error}");
}

#[test]
fn without_a_lying_posture_the_robot_lies_with_folded_legs() {
    let i = common::PARAMS.find("[robot.lying]").unwrap();
    let j = i + common::PARAMS[i..].find("\n\n").unwrap();
    let text = [&common::PARAMS[..i], &common::PARAMS[j..]].concat();
    let mut story = Story::standing_with(Quadruped::new(common::URDF, &text).unwrap());
    story.ask(Op::MODE_STAND, 100);
    story.mode = Op::MODE_SIT;
    story.until_phase(MovePhase::Spread);
    let folded = command_of(&story.out).q_des;
    story.until_phase(MovePhase::Lie);
    let lies = command_of(&story.out).q_des;
    assert!(folded.iter().zip(&lies).all(|(a, b)| (a - b).abs() < 1e-12));
}
