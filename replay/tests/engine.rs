//! A replay finds every change at its tick and field: each test of equality has mutants that must be found.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::toy::{self, PERIOD_NS, SNAPSHOT, Toy};
use common::{Message, path};
use lcmtypes::channels::{self, Stage};
use lcmtypes::{ComponentState, ControllerTick, QuadrupedState, RobotCommand, RobotState, RunInfo, WbcSolution};
use replay::Error;
use replay::engine::{Cursor, Divergence, Index, Options, OtherParameters, Replay, ReplayReport};
use std::path::Path;

const TICKS: i64 = 1000;
/// Outputs of the toy per tick, without snapshots.
const OUTPUTS: u64 = 4;

fn log(name: &str, change: impl FnOnce(&mut Vec<Message>)) -> std::path::PathBuf {
    let path = path(name);
    let mut events = toy::events(TICKS);
    change(&mut events);
    toy::write(&path, &events);
    path
}

fn replay(path: &Path, options: &Options) -> ReplayReport {
    replay_toy(path, options, |toy| toy)
}

/// Replays with a changed toy.
fn replay_toy(path: &Path, options: &Options, change: impl Fn(Toy) -> Toy + Sync) -> ReplayReport {
    let replay = Replay::open_with(path, |info| Ok(toy::component(change(toy::toy(info)?)))).unwrap();
    replay.run(options, &mut |_| {}).unwrap()
}

fn place(divergence: &Divergence) -> (i64, &str, &str, &str) {
    (divergence.tick, &divergence.stage, &divergence.channel, &divergence.field)
}

/// The report without wall-clock times.
fn timeless(mut report: ReplayReport) -> ReplayReport {
    (report.wall_seconds, report.real_time_factor) = (0.0, 0.0);
    report
}

#[test]
fn an_unchanged_controller_replays_bit_for_bit() {
    for name in ["same.mcap", "same.lcmlog"] {
        let report = replay(&log(name, |_| {}), &Options::default());
        assert!(report.identical, "{name}: {report:?}");
        assert_eq!((report.ticks, report.snapshots_compared), (TICKS as u64, (TICKS / SNAPSHOT) as u64));
        assert_eq!(report.messages_compared, TICKS as u64 * OUTPUTS + report.snapshots_compared);
        assert_eq!((report.unverifiable_ticks, report.messages_not_recorded, report.messages_different), (0, 0, 0));
        let [component] = &report.components[..] else { panic!("{:?}", report.components) };
        assert_eq!((&*component.name, component.ticks, component.late_results), ("toy", TICKS as u64, 0));
        assert!(component.identical && component.first_divergence.is_none());
        assert_eq!((report.first_t_ns, report.last_t_ns), (Some(0), Some((TICKS - 1) * PERIOD_NS)));
    }
}

#[test]
fn a_change_in_a_stage_is_found_in_that_stage() {
    let path = log("stages.mcap", |_| {});
    let expected = [
        (Stage::Input, "CONTROLLER_TICK", "digest_input"),
        (Stage::Estimation, "CONTACT_ESTIMATE", "f_F_W"),
        (Stage::Gait, "CONTROLLER_TICK", "digest_gait"),
        (Stage::Tasks, "CONTROLLER_TICK", "digest_tasks"),
        (Stage::Qp, "WBC_SOLUTION", "vd"),
        (Stage::Output, "ROBOT_COMMAND", "tau"),
    ];
    for (stage, channel, field) in expected {
        let report = replay_toy(&path, &Options::default(), |toy| Toy { mutant: Some((stage, 321)), ..toy });
        assert!(!report.identical);
        let first = report.first_divergence.unwrap();
        assert_eq!(place(&first), (321, stage.name(), channel, field));
        assert_eq!(first.t_ns, 321 * PERIOD_NS);
    }
}

#[test]
fn a_divergence_shows_both_values_to_the_last_bit() {
    let path = log("values.mcap", |_| {});
    let first = |stage| {
        let report = replay_toy(&path, &Options::default(), |toy| Toy { mutant: Some((stage, 321)), ..toy });
        report.first_divergence.unwrap()
    };
    let qp = first(Stage::Qp);
    assert_eq!((qp.index.clone(), qp.ulp), (Some(Index::One(1)), Some(1)));
    assert!(qp.recorded.contains("0x1.") && qp.recorded != qp.replayed, "{qp:?}");
    assert_eq!(first(Stage::Estimation).index, Some(Index::Many(vec![2, 1])));
    assert_eq!(first(Stage::Output).also, []);
    let json = serde_json::to_value(&qp).unwrap();
    let keys = ["tick", "stage", "channel", "field", "index", "recorded", "replayed", "ulp"];
    assert!(keys.iter().all(|key| !json[key].is_null()), "{json}");
    assert_eq!((&json["index"], &json["tick"]), (&1.into(), &321.into()));
}

#[test]
fn one_flipped_bit_of_an_input_is_found() {
    let flip = |state: &mut RobotState| state.q[0] = f64::from_bits(state.q[0].to_bits() ^ 1 << 20);
    let path = log("flip.mcap", |events| toy::change_input(events, 437, flip));
    let first = replay(&path, &Options::default()).first_divergence.unwrap();
    assert_eq!(place(&first), (437, "input", "CONTROLLER_TICK", "digest_input"));

    // Without digests the difference is found in the first stage with a channel.
    let path = log("flip_no_digests.mcap", |events| {
        toy::change_input(events, 437, flip);
        events.retain(|(channel, ..)| channel != channels::CONTROLLER_TICK);
    });
    let report = replay(&path, &Options::default());
    let first = report.first_divergence.unwrap();
    assert_eq!(place(&first), (437, "estimation", "CONTACT_ESTIMATE", "f_F_W"));
    assert_eq!(report.messages_not_recorded, TICKS as u64);
}

#[test]
fn a_changed_parameter_is_found_at_the_first_tick() {
    let path = log("parameter.mcap", |_| {});
    let set = vec![("gait.trot.swing_frequency".to_owned(), "2.5".to_owned())];
    let report = replay(&path, &Options { set, jobs: 2, ..Options::default() });
    let first = report.first_divergence.unwrap();
    assert_eq!(place(&first), (0, "tasks", "CONTROLLER_TICK", "digest_tasks"));
    // The stage has no message; later stages differ too.
    let also: Vec<_> = first.also.iter().map(|f| (&*f.channel, &*f.field, f.index.clone())).collect();
    assert_eq!(also, [("WBC_SOLUTION", "vd", Some(Index::One(1))), ("ROBOT_COMMAND", "tau", Some(Index::One(0)))]);
    assert_eq!(report.ticks, TICKS as u64);
    // The state is kept, so the last snapshot differs too.
    assert!(report.messages_different > 3 * TICKS as u64, "{}", report.messages_different);

    let set = vec![("gait.trot.no_such_thing".to_owned(), "2.5".to_owned())];
    let error = Replay::open_with(&path, toy::load).unwrap().run(&Options { set, ..Options::default() }, &mut |_| {});
    assert!(matches!(error, Err(Error::Load { .. })), "{error:?}");
}

/// As after a lost PARAMETER_CHANGE whose parameter changes no output.
#[test]
fn other_parameters_than_recorded_are_found_even_if_they_change_no_output() {
    let change = |tick: &mut ControllerTick| tick.digest_parameters += 1;
    let path = log("digest_parameters.mcap", |events| {
        (437..440).for_each(|tick| toy::change(events, channels::CONTROLLER_TICK, tick, change));
    });
    let report = replay(&path, &Options::default());
    // The last of them is compared, since the next tick has the parameters of the log again; but the state is unknown.
    assert_eq!(report.other_parameters, Some(OtherParameters { first_tick: 437, ticks: 2 }));
    assert!(report.identical && !report.complete, "{report:?}");
    // From tick 437 to the snapshot of tick 499 the state is unknown.
    assert_eq!((report.ticks, report.skipped_ticks), (TICKS as u64 - 63, 63));
    // A what-if replay has other parameters; only what they change is a difference.
    let set = vec![("wbc.friction".to_owned(), "0.5".to_owned())];
    assert!(replay(&path, &Options { set, ..Options::default() }).identical);
}

/// A CONTROLLER_TICK with one altered digest is no lost PARAMETER_CHANGE: the ticks after it have the parameters of the log.
#[test]
fn an_altered_digest_of_the_parameters_is_a_difference() {
    for tick in [0, 437, 998] {
        let change = |tick: &mut ControllerTick| tick.digest_parameters += 1;
        let path = log("digest_altered.mcap", |events| toy::change(events, channels::CONTROLLER_TICK, tick, change));
        let report = replay(&path, &Options::default());
        let first = report.first_divergence.as_ref().unwrap();
        assert_eq!((first.tick, report.messages_different), (tick, 1), "{report:?}");
        assert_eq!((report.ticks, report.other_parameters), (TICKS as u64, None));
    }
}

#[test]
fn after_a_missing_input_the_replay_continues_from_the_next_snapshot() {
    let missing = |(channel, t_ns, _): &Message| channel == channels::CONTROLLER_INPUT && *t_ns == 437 * PERIOD_NS;
    let path = log("missing.mcap", |events| events.retain(|event| !missing(event)));
    let report = replay(&path, &Options::default());
    assert!(report.identical, "{report:?}");
    // Ticks 438 to 499 have an input, but their state is unknown.
    assert_eq!((report.missing_input_ticks, report.skipped_ticks), (1, 62));
    assert_eq!(report.ticks, TICKS as u64 - 63);

    // All messages of the tick and its neighbours are missing: detected by the tick numbers.
    let path = log("gap.mcap", |events| events.retain(|(_, t_ns, _)| !(430..440).contains(&(t_ns / PERIOD_NS))));
    let report = replay(&path, &Options::default());
    assert_eq!((report.missing_input_ticks, report.skipped_ticks, report.identical), (10, 60, true));
}

#[test]
fn a_perturbed_state_is_found_in_the_snapshot() {
    let path = log("state.mcap", |events| {
        toy::change_state(events, 299, |state: &mut QuadrupedState| {
            state.zeta = state.zeta.next_down();
        });
    });
    let report = replay(&path, &Options::default());
    let first = report.first_divergence.unwrap();
    assert_eq!(place(&first), (299, "output", "CONTROLLER_SNAPSHOT", "controller.data.zeta"));
    assert_eq!(first.ulp, Some(1));
}

#[test]
fn a_wrongly_restored_state_is_found_in_the_next_tick() {
    let path = log("restore.mcap", |_| {});
    let options = Options { from_s: Some(0.35), ..Options::default() };
    assert!(replay(&path, &options).identical);
    let report = replay_toy(&path, &options, |toy| Toy { restores_badly: true, ..toy });
    let first = report.first_divergence.unwrap();
    assert_eq!(place(&first), (300, "estimation", "CONTACT_ESTIMATE", "f_F_W"));
}

#[test]
fn a_part_of_a_log_is_replayed_from_the_snapshot_before_it() {
    let path = log("part.mcap", |_| {});
    let part = |from_s, to_s| {
        let report = replay(&path, &Options { from_s, to_s, ..Options::default() });
        assert!(report.identical && report.skipped_ticks == 0, "{report:?}");
        (report.ticks, report.first_t_ns.unwrap() / PERIOD_NS, report.last_t_ns.unwrap() / PERIOD_NS)
    };
    assert_eq!(part(Some(0.55), Some(0.6)), (101, 500, 600));
    assert_eq!(part(Some(0.05), Some(0.1)), (101, 0, 100));
    assert_eq!(part(Some(0.9), None), (100, 900, 999));
    assert_eq!(part(None, Some(0.0)), (1, 0, 0));
}

/// The state of tick 499 is recorded after its outputs: a part from this tick on starts at an earlier state, or its outputs would not be compared.
#[test]
fn a_part_of_a_log_includes_its_first_tick() {
    let change = |command: &mut RobotCommand| command.tau[0] += 1.0;
    let path = log("first_of_part.mcap", |events| toy::change(events, channels::ROBOT_COMMAND, 499, change));
    let part = |from_s| replay(&path, &Options { from_s: Some(from_s), ..Options::default() });
    let report = part(0.499);
    assert_eq!(report.first_divergence.map(|first| first.tick), Some(499));
    assert_eq!(report.first_t_ns, Some(400 * PERIOD_NS));
    let report = part(0.5);
    assert!(report.identical);
    assert_eq!(report.first_t_ns, Some(500 * PERIOD_NS));
}

#[test]
fn threads_do_not_change_the_report() {
    let flip = |state: &mut RobotState| state.q[0] += 1.0;
    let logs = [
        log("jobs.mcap", |_| {}),
        log("jobs_flip.mcap", |events| {
            toy::change_input(events, 437, flip);
            toy::change_input(events, 855, flip);
        }),
        log("jobs_gap.mcap", |events| events.retain(|(_, t_ns, _)| !(295..310).contains(&(t_ns / PERIOD_NS)))),
        log("jobs_late.mcap", |events| events.retain(|(c, t_ns, _)| c == "RUN_INFO" || *t_ns > 150 * PERIOD_NS)),
    ];
    for path in &logs {
        for from_s in [None, Some(0.45)] {
            let report = |jobs| timeless(replay(path, &Options { jobs, from_s, ..Options::default() }));
            let serial = report(1);
            assert!(serial.ticks >= 400);
            for jobs in 2..5 {
                assert_eq!(report(jobs), serial, "{} with {jobs} threads", path.display());
            }
        }
    }
}

/// A worker cannot start before the previous segment ends with a snapshot.
#[test]
fn a_long_log_without_snapshots_is_replayed_by_any_number_of_threads() {
    let path = path("stateless.mcap");
    let mut events = toy::events(5000);
    events.retain(|(channel, t_ns, _)| channel != channels::CONTROLLER_SNAPSHOT || *t_ns > 4500 * PERIOD_NS);
    toy::change_input(&mut events, 3210, |state: &mut RobotState| state.q[0] += 1.0);
    toy::write(&path, &events);
    let report = |jobs| timeless(replay(&path, &Options { jobs, ..Options::default() }));
    let serial = report(1);
    assert_eq!((serial.ticks, serial.first_divergence.as_ref().map(|first| first.tick)), (5000, Some(3210)));
    for jobs in 2..5 {
        assert_eq!(report(jobs), serial, "{jobs} threads");
    }
}

#[test]
fn of_several_errors_any_number_of_threads_reports_the_first() {
    // A state that decodes, but that the controller rejects.
    let reject = |state: &mut QuadrupedState| state.height = f64::NAN;
    let path = log("errors.mcap", |events| {
        events.retain(|(c, t_ns, _)| c != channels::CONTROLLER_INPUT || ![350, 650].contains(&(t_ns / PERIOD_NS)));
        toy::change_state(events, 399, reject);
        toy::change_state(events, 699, reject);
    });
    for jobs in 1..5 {
        let run = || Replay::open_with(&path, toy::load)?.run(&Options { jobs, ..Options::default() }, &mut |_| {});
        for _ in 0..10 {
            let error = run().unwrap_err();
            assert!(matches!(error, Error::Restore { tick: 399, .. }), "{jobs} threads: {error}");
        }
    }
}

#[test]
fn absent_messages_are_counted_and_not_compared() {
    let path = log("trimmed.mcap", |events| {
        let keep = [channels::RUN_INFO, channels::CONTROLLER_INPUT, channels::CONTROLLER_TICK];
        events.retain(|(channel, t_ns, _)| {
            let index = keep.iter().position(|kept| kept == channel);
            index.is_some_and(|index| index < 2 || *t_ns >= 900 * PERIOD_NS)
        });
    });
    let report = replay(&path, &Options::default());
    assert!(report.identical);
    assert_eq!((report.messages_compared, report.unverifiable_ticks), (100, 900));
    assert_eq!(report.messages_not_recorded, TICKS as u64 * OUTPUTS + 10 - 100);

    // With nothing to compare, nothing is claimed.
    let path = log("inputs.mcap", |events| {
        events.retain(|(channel, ..)| [channels::RUN_INFO, channels::CONTROLLER_INPUT].contains(&channel.as_str()));
    });
    let report = replay(&path, &Options::default());
    assert_eq!((report.identical, report.messages_compared, report.unverifiable_ticks), (false, 0, TICKS as u64));
}

#[test]
fn an_output_that_no_longer_comes_is_a_difference() {
    let path = log("surplus.mcap", |events| {
        let leg_state = lcmtypes::LegState { t_ns: 500 * PERIOD_NS, tick: 500, ..Default::default() };
        events.push((channels::LEG_STATE.into(), 999 * PERIOD_NS, toy::encoded(&leg_state)));
        events.sort_by_key(|(_, t_ns, _)| *t_ns);
    });
    // 499 ticks late is beyond the window of 256 ticks.
    let report = replay(&path, &Options::default());
    assert_eq!((report.identical, report.complete, report.account.late_messages), (true, false, 1));
    let path = log("surplus_in_time.mcap", |events| {
        let leg_state = lcmtypes::LegState { t_ns: 500 * PERIOD_NS, tick: 500, ..Default::default() };
        events.push((channels::LEG_STATE.into(), 600 * PERIOD_NS, toy::encoded(&leg_state)));
        events.sort_by_key(|(_, t_ns, _)| *t_ns);
    });
    let first = replay(&path, &Options::default()).first_divergence.unwrap();
    assert_eq!(place(&first), (500, "gait", "LEG_STATE", ""));
    assert_eq!(first.replayed, "absent");
}

/// Over a bus the messages of a tick come late, and those of different channels in any order.
#[test]
fn the_order_of_messages_in_the_log_does_not_matter() {
    let mut random = common::Random(3);
    let path = log("order.mcap", |events| {
        let mut late: Vec<_> =
            events.drain(..).map(|event| (event.1 + random.next() as i64 % (50 * PERIOD_NS), event)).collect();
        late[0].0 = i64::MIN;
        late.sort_by_key(|(t_ns, _)| *t_ns);
        events.extend(late.into_iter().map(|(_, event)| event));
    });
    let report = replay(&path, &Options::default());
    assert!(report.identical, "{report:?}");
    assert_eq!((report.ticks, report.account.late_messages, report.missing_input_ticks), (TICKS as u64, 0, 0));
}

/// A live controller sends its commands directly. All other messages are sent by a thread that a busy machine can delay.
fn with_all_but_commands_late(name: &str, ticks: i64, late: i64) -> std::path::PathBuf {
    let path = path(name);
    let mut events = toy::events(ticks);
    events[1..].sort_by_key(|(channel, t_ns, _)| match channel.as_str() {
        channels::ROBOT_COMMAND => *t_ns,
        _ => t_ns + late * PERIOD_NS,
    });
    toy::write(&path, &events);
    path
}

#[test]
fn inputs_may_come_seconds_after_their_commands() {
    let path = with_all_but_commands_late("late_inputs.mcap", 6000, 5000);
    let report = replay(&path, &Options::default());
    assert!(report.identical, "{report:?}");
    assert_eq!((report.ticks, report.account.late_messages, report.missing_input_ticks), (6000, 0, 0));

    // The delay is limited: later inputs are missing, and the replay continues from the next snapshot.
    let path = with_all_but_commands_late("too_late_inputs.mcap", 20_000, 17_000);
    let report = replay(&path, &Options::default());
    assert!(report.identical && report.account.late_messages > 0 && report.missing_input_ticks > 0, "{report:?}");
}

#[test]
fn the_log_of_a_replay_is_the_replayed_log() {
    for ending in ["mcap", "lcmlog"] {
        let recorded = log(&format!("out_a.{ending}"), |_| {});
        let out = path(&format!("out_b.{ending}"));
        replay(&recorded, &Options { out: Some(out.clone()), jobs: 4, ..Options::default() });
        assert!(std::fs::read(recorded).unwrap() == std::fs::read(out).unwrap(), "{ending}");
    }
    // With another parameter it is the log of a run with that parameter.
    let out = path("out_other.mcap");
    let set = vec![("gait.trot.swing_frequency".to_owned(), "2.5".to_owned())];
    replay(&log("out_c.mcap", |_| {}), &Options { out: Some(out.clone()), set, ..Options::default() });
    assert!(replay(&out, &Options::default()).identical);
    assert!(Replay::open(&out).unwrap().info().params().contains("2.5"));
}

#[test]
fn a_log_cannot_be_its_own_output() {
    let path = log("itself.mcap", |_| {});
    let bytes = std::fs::read(&path).unwrap();
    let options = Options { out: Some(path.clone()), ..Options::default() };
    let error = Replay::open_with(&path, toy::load).unwrap().run(&options, &mut |_| {});
    assert!(matches!(error, Err(Error::SameFile { .. })), "{error:?}");
    let error = replay::corpus::trim_to_golden(&path, &path, &[]);
    assert!(matches!(error, Err(Error::SameFile { .. })), "{error:?}");
    // The same file by other names.
    let (hard, soft) = (common::path("itself_hard.mcap"), common::path("itself_soft.mcap"));
    [&hard, &soft].iter().for_each(|link| drop(std::fs::remove_file(link)));
    std::fs::hard_link(&path, &hard).unwrap();
    std::os::unix::fs::symlink(&path, &soft).unwrap();
    for link in [&hard, &soft] {
        let error = replay::corpus::trim_to_golden(&path, link, &[]);
        assert!(matches!(error, Err(Error::SameFile { .. })), "{error:?}");
    }
    assert!(std::fs::read(&path).unwrap() == bytes);
}

#[test]
fn a_cut_log_is_replayed_up_to_the_cut() {
    let path = log("whole.lcmlog", |_| {});
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let report = replay(&path, &Options::default());
    assert!(report.identical && report.cut && report.ticks > 400, "{report:?}");
}

#[test]
fn a_log_that_is_not_one_run_is_rejected() {
    let run = |path: &Path| Replay::open_with(path, toy::load)?.run(&Options::default(), &mut |_| {});
    let without = |name: &str, channel: &str| log(name, |events| events.retain(|(c, ..)| c != channel));
    let error = run(&without("no_info.mcap", channels::RUN_INFO)).unwrap_err();
    assert!(matches!(error, Error::NoRunInfo { events: 7010, .. }), "{error}");
    let error = run(&without("no_input.mcap", channels::CONTROLLER_INPUT)).unwrap_err();
    assert!(matches!(error, Error::NoInput { .. }), "{error}");

    let path = log("two_runs.mcap", |events| {
        let info = RunInfo { run_id: 2, ..Default::default() };
        events.push((channels::RUN_INFO.into(), TICKS * PERIOD_NS, toy::encoded(&info)));
    });
    let error = run(&path).unwrap_err();
    assert!(matches!(error, Error::SeveralRuns { .. }), "{error}");
    // A repeated RUN_INFO is the same run.
    let path = log("info_again.mcap", |events| {
        let info = events[0].clone();
        events.insert(3000, info);
    });
    assert!(run(&path).unwrap().identical);

    // Without any output of the type that this build computes, nothing is judged.
    let path = log("version.mcap", |events| of_other_type(events, channels::CONTROLLER_TICK));
    let error = run(&path).unwrap_err();
    let expected = <ControllerTick as lcmtypes::Message>::FINGERPRINT;
    let Error::OtherTypeVersion { channel, type_name, found, .. } = &error else { panic!("{error}") };
    assert_eq!((&**channel, &**type_name), (channels::CONTROLLER_TICK, "hoofprint.controller_tick_t"));
    assert_eq!(*found, expected ^ 1);
}

/// Changes the type of all messages of a channel.
fn of_other_type(events: &mut [Message], channel: &str) {
    events.iter_mut().filter(|(c, ..)| c == channel).for_each(|(.., data)| data[7] ^= 1);
}

/// The fingerprint of CONTROLLER_SNAPSHOT does not cover the controller's state in it.
#[test]
fn a_snapshot_with_a_state_of_another_type_is_left_out() {
    let expected = <QuadrupedState as lcmtypes::Message>::FINGERPRINT;
    type Edit = fn(&mut Vec<u8>);
    let edits: [(_, Edit, _); 2] = [("old", |data| data[7] ^= 1, expected ^ 1), ("empty", Vec::clear, 0)];
    for (name, edit, found) in edits {
        let path = log(&format!("{name}_state.mcap"), |events| {
            toy::change(events, channels::CONTROLLER_SNAPSHOT, 299, |state: &mut ComponentState| {
                edit(&mut state.controller.data);
                state.controller.size = state.controller.data.len() as i32;
            });
        });
        for jobs in [1, 3] {
            let report = replay(&path, &Options { jobs, ..Options::default() });
            assert_eq!((report.identical, report.ticks, report.snapshots_compared), (true, TICKS as u64, 9), "{name}");
            let [other] = &report.account.other_types[..] else { panic!("{report:?}") };
            assert_eq!((&*other.channel, other.count), (channels::CONTROLLER_SNAPSHOT, 1));
            assert_eq!((other.found, other.expected, other.is_every_message), (found, expected, false), "{name}");
        }
        let replay = Replay::open_with(&path, toy::load).unwrap();
        let mut cursor = Cursor::open(&replay, &Options::default(), &mut |_| {}).unwrap();
        assert!(cursor.go_to(305).unwrap().divergence.is_none());
        assert_eq!(cursor.state_before(305).unwrap(), Some(199));
    }
    // A state of the right type that is cut costs itself.
    let path = log("cut_state.mcap", |events| {
        toy::change(events, channels::CONTROLLER_SNAPSHOT, 299, |state: &mut ComponentState| {
            state.controller.data.truncate(60);
            state.controller.size = 60;
        });
    });
    let report = replay(&path, &Options::default());
    assert_eq!((report.identical, report.complete, report.account.undecodable_messages), (true, false, 1));
}

#[test]
fn a_debug_channel_of_another_type_is_left_out_of_the_comparison() {
    let path = log("debug_version.mcap", |events| of_other_type(events, channels::WBC_SOLUTION));
    let report = replay(&path, &Options::default());
    assert!(report.identical && report.complete, "{report:?}");
    assert_eq!(report.messages_compared, TICKS as u64 * (OUTPUTS - 1) + report.snapshots_compared);
    let [other] = &report.account.other_types[..] else { panic!("{report:?}") };
    let expected = <WbcSolution as lcmtypes::Message>::FINGERPRINT;
    assert_eq!((other.count, other.is_every_message, &*other.channel), (TICKS as u64, true, channels::WBC_SOLUTION));
    assert_eq!((other.found, other.expected), (expected ^ 1, expected));
}
