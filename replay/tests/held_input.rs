//! What holds of earlier messages at the start of a part of a log: RUNNING is delivered only when it changes.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::toy::{encoded, write};
use common::{Message as Recorded, path};
use controller::{Delivery, Outbox};
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, ROBOT_STATE, RUN_INFO, RUNNING};
use lcmtypes::{
    ComponentInfo, ComponentState, ControllerInput, Message, PostureState, RobotState, RunInfo, Running, SequenceState,
};
use replay::engine::{Cursor, Options, Replay};
use replay::log::ros2::{BaseSource, RobotTopics};
use replay::log::{Types, VerifyReport, verify};
use std::path::Path;
use std::sync::LazyLock;

const PERIOD_NS: i64 = 1_000_000;

/// Controllers that run in each tick: `hold` alone, both, none, both.
fn schedule(tick: i64) -> i64 {
    match tick {
        0..400 => 1,
        400..1500 => 3,
        1500..1800 => 0,
        _ => 3,
    }
}

fn info() -> RunInfo {
    let component = ComponentInfo::new("sequence(hold, posture)", include_str!("../../robots/hyq/hyq.toml"));
    let urdf = include_str!("../../robots/hyq/hyq.urdf").to_owned();
    RunInfo { urdf, imus: vec!["trunk_imu".to_owned()], n_imus: 1, ..RunInfo::default() }.with_component(component)
}

/// 2100 ticks of a sequence of controllers, each message with its tick.
fn run() -> Vec<(i64, Recorded)> {
    static RUN: LazyLock<Vec<(i64, Recorded)>> = LazyLock::new(|| {
        let (info, mut delivery, mut out) = (info(), Delivery::new(0), Outbox::new());
        let mut component = controller::load(&info).unwrap();
        let mut events = vec![(-1, (RUN_INFO.to_owned(), 0, encoded(&info)))];
        let mut running = 0;
        for tick in 0..2100 {
            let t_ns = tick * PERIOD_NS;
            delivery.begin(t_ns, tick);
            let state = RobotState { t_ns, seq: tick, ..RobotState::zeros(12, 1, 0) };
            delivery.put(ROBOT_STATE, t_ns, &state).unwrap();
            if std::mem::replace(&mut running, schedule(tick)) != running {
                delivery.put(RUNNING, t_ns, &Running { running, ..Running::default() }).unwrap();
            }
            out.clear();
            component.step(delivery.input(), &mut out);
            events.push((tick, (CONTROLLER_INPUT.to_owned(), t_ns, encoded(delivery.input()))));
            events.extend(out.iter().map(|(channel, bytes)| (tick, (channel.to_owned(), t_ns, bytes.to_vec()))));
        }
        events
    });
    RUN.clone()
}

/// Writes the events that `keep` accepts: tick, and whether it is a snapshot.
fn part(name: &str, keep: impl Fn(i64, bool) -> bool) -> std::path::PathBuf {
    let (log, mut events) = (path(name), run());
    events.retain(|(tick, (channel, ..))| *tick < 0 || keep(*tick, channel == CONTROLLER_SNAPSHOT));
    write(&log, &events.into_iter().map(|(_, event)| event).collect::<Vec<_>>());
    log
}

fn verified(log: &Path) -> VerifyReport {
    verify(log, Types::default(), &mut |_| {}).unwrap()
}

#[test]
fn expected_outputs_follow_the_controllers_that_run() {
    let whole = part("held_whole.mcap", |_, _| true);
    let from_snapshot = part("held_part.mcap", |tick, is_snapshot| tick > 1000 || tick == 1000 && is_snapshot);
    // Ticks before the first snapshot cannot be computed, but their inputs hold after it.
    let from_input = part("held_late.mcap", |tick, _| tick >= 300);
    for (log, computable) in [(whole, 2100), (from_snapshot, 1099), (from_input, 1099)] {
        let report = verified(&log).replay;
        assert_eq!(report.why, [""; 0], "{}", log.display());
        assert_eq!((report.computable, report.outputs), (computable, computable));
    }
}

/// The type of a member's state is in no fingerprint of the messages around it.
#[test]
fn a_snapshot_with_a_member_of_another_type_is_left_out() {
    let (log, mut events) = (path("held_types.mcap"), run());
    let is_snapshot = |(tick, (channel, ..)): &&mut (i64, Recorded)| *tick == 1000 && channel == CONTROLLER_SNAPSHOT;
    let (_, (.., data)) = events.iter_mut().find(is_snapshot).unwrap();
    let mut state = ComponentState::decode(data).unwrap();
    let mut sequence = SequenceState::decode(&state.controller.data).unwrap();
    sequence.parts[1].data[7] ^= 1;
    state.controller.data = encoded(&sequence);
    *data = encoded(&state);
    write(&log, &events.into_iter().map(|(_, event)| event).collect::<Vec<_>>());
    let replay = Replay::open(&log).unwrap();
    let report = replay.run(&Options::default(), &mut |_| {}).unwrap();
    assert_eq!((report.identical, report.ticks, report.snapshots_compared), (true, 2100, 2));
    let judged = verified(&log).replay.account;
    assert_eq!(judged.other_types, report.account.other_types);
    let [other] = &judged.other_types[..] else { panic!("{judged:?}") };
    assert_eq!((&*other.channel, &*other.type_name), (CONTROLLER_SNAPSHOT, "hoofprint.posture_state_t"));
    assert_eq!((other.found, other.expected), (PostureState::FINGERPRINT ^ 1, PostureState::FINGERPRINT));
    assert_eq!((other.count, other.is_every_message), (1, false));
    let mut cursor = Cursor::open(&replay, &Options::default(), &mut |_| {}).unwrap();
    assert!(cursor.go_to(1001).unwrap().divergence.is_none());
}

#[test]
fn a_viewer_draws_the_robot_from_the_input_in_a_snapshot() {
    let mut topics = RobotTopics::new(&info(), BaseSource::Imu).unwrap();
    let (_, (.., snapshot)) = run().into_iter().rev().find(|(_, (c, ..))| c == CONTROLLER_SNAPSHOT).unwrap();
    let (mut out, input) = (Vec::new(), ControllerInput { tick: 2001, ..ControllerInput::default() });
    topics.update_from(CONTROLLER_SNAPSHOT, &snapshot, &mut out);
    topics.update_from(CONTROLLER_INPUT, &encoded(&input), &mut out);
    assert_eq!(out.iter().map(|message| &*message.topic).collect::<Vec<_>>(), ["/tf"]);
}
