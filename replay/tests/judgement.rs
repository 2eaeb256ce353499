//! A verdict covers every recorded message: missing, late, doubled, altered and foreign ones are named by channel and tick, and `verify` and a replay
//! agree on whether a log can be replayed.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::toy::{self, PERIOD_NS};
use common::{Message, path};
use lcmtypes::channels::{self, CONTROLLER_INPUT, CONTROLLER_TICK, ROBOT_COMMAND};
use lcmtypes::{ParameterChange, RobotCommand};
use replay::engine::{Options, OtherParameters, Replay, ReplayReport, Unused};
use replay::log::{EventFilter, Excerpt, LogSummary, RunClock, Types, copy_excerpt, path_of_run};

const TICKS: i64 = 1000;

fn replay_of(name: &str, change: impl FnOnce(&mut Vec<Message>)) -> ReplayReport {
    let path = path(name);
    let mut events = toy::events(TICKS);
    change(&mut events);
    toy::write(&path, &events);
    let replay = Replay::open_with(&path, toy::load).unwrap();
    let report = |jobs| {
        let report = replay.run(&Options { jobs, ..Options::default() }, &mut |_| {}).unwrap();
        ReplayReport { wall_seconds: 0.0, real_time_factor: 0.0, ..report }
    };
    let serial = report(1);
    assert_eq!(report(3), serial, "{name}");
    serial
}

/// Index of the message of a channel and tick.
fn place(events: &[Message], channel: &str, tick: i64) -> usize {
    events.iter().position(|(c, t_ns, _)| c == channel && *t_ns == tick * PERIOD_NS).unwrap()
}

/// Moves a message after the input of a later tick.
fn delay(events: &mut Vec<Message>, channel: &str, tick: i64, to: i64) {
    let mut late = events.remove(place(events, channel, tick));
    late.1 = to * PERIOD_NS;
    let at = place(events, CONTROLLER_INPUT, to) + 1;
    events.insert(at, late);
}

fn set_tick(events: &mut [Message], channel: &str, tick: i64, number: i64) {
    let at = place(events, channel, tick);
    events[at].2[16..24].copy_from_slice(&number.to_be_bytes());
}

fn first_unused(report: &ReplayReport) -> (&str, Option<i64>, Unused) {
    let first = &report.account.unused[0];
    (&first.channel, first.tick, first.why)
}

#[test]
fn a_missing_output_is_named() {
    for channel in [ROBOT_COMMAND, CONTROLLER_TICK, channels::CONTACT_ESTIMATE, channels::CONTROLLER_SNAPSHOT] {
        let report = replay_of("missing_output.mcap", |events| {
            events.remove(place(events, channel, 599));
        });
        assert!(report.identical && !report.complete, "{report:?}");
        let [missing] = &report.missing_outputs[..] else { panic!("{report:?}") };
        assert_eq!((&*missing.channel, missing.count, missing.first_tick), (channel, 1, 599));
    }
}

#[test]
fn a_late_message_is_named() {
    // A command up to 256 ticks late is compared; a later one is not compared, but counted as late.
    let altered = |events: &mut Vec<Message>, to| {
        toy::change(events, ROBOT_COMMAND, 100, |command: &mut RobotCommand| command.tau[0] += 1.0);
        delay(events, ROBOT_COMMAND, 100, to);
    };
    let report = replay_of("late_command.mcap", |events| altered(events, 300));
    assert_eq!(report.first_divergence.map(|first| first.tick), Some(100));
    let report = replay_of("too_late_command.mcap", |events| altered(events, 800));
    assert!(report.identical && !report.complete);
    assert_eq!(first_unused(&report), (ROBOT_COMMAND, Some(100), Unused::Late));
    assert_eq!((&*report.missing_outputs[0].channel, report.missing_outputs[0].first_tick), (ROBOT_COMMAND, 100));

    let report = replay_of("late_input.mcap", |events| delay(events, CONTROLLER_INPUT, 100, 800));
    assert_eq!(first_unused(&report), (CONTROLLER_INPUT, Some(100), Unused::Late));
    assert_eq!((report.missing_input_ticks, report.skipped_ticks, report.complete), (1, 99, false));
}

#[test]
fn a_doubled_message_is_named() {
    let double = |events: &mut Vec<Message>, channel: &str| {
        let at = place(events, channel, 599);
        events.insert(at, events[at].clone());
    };
    for channel in [CONTROLLER_INPUT, ROBOT_COMMAND] {
        let report = replay_of("doubled.mcap", |events| double(events, channel));
        assert!(report.identical && !report.complete);
        assert_eq!(first_unused(&report), (channel, Some(599), Unused::Doubled));
    }
    let report = replay_of("doubled_input.mcap", |events| {
        double(events, CONTROLLER_INPUT);
        let at = place(events, CONTROLLER_INPUT, 599);
        toy::change_input(&mut events[at + 1..], 599, |state| state.q[0] += 1.0);
    });
    assert_eq!(first_unused(&report), (CONTROLLER_INPUT, Some(599), Unused::DoubledOtherBytes));
    assert!(report.identical && !report.complete);
    let report = replay_of("doubled_command.mcap", |events| {
        double(events, ROBOT_COMMAND);
        toy::change(events, ROBOT_COMMAND, 599, |command: &mut RobotCommand| command.tau[0] += 1.0);
    });
    assert_eq!(report.first_divergence.map(|first| (first.tick, first.channel)), Some((599, ROBOT_COMMAND.into())));
}

#[test]
fn a_wrong_tick_costs_one_message() {
    for number in [i64::MIN | 599, -1, 599 | 1 << 62, i64::MAX, 5000] {
        let report = replay_of("command_tick.mcap", |events| set_tick(events, ROBOT_COMMAND, 599, number));
        assert!(report.identical && !report.complete, "{number}: {report:?}");
        assert_eq!(first_unused(&report), (ROBOT_COMMAND, Some(number), Unused::NoInput));
        assert_eq!((report.ticks, report.missing_input_ticks), (TICKS as u64, 0));
        assert_eq!(report.missing_outputs[0].first_tick, 599);

        let report = replay_of("input_tick.mcap", |events| set_tick(events, CONTROLLER_INPUT, 599, number));
        assert!(report.identical && !report.complete, "{number}: {report:?}");
        assert!(report.missing_input_ticks >= 1 && report.missing_ticks[0].0 == 599, "{number}: {report:?}");
    }
}

#[test]
fn an_undecodable_message_costs_itself() {
    let report = replay_of("undecodable.mcap", |events| {
        let at = place(events, CONTROLLER_INPUT, 599);
        events[at].2.truncate(60);
    });
    assert_eq!(first_unused(&report), (CONTROLLER_INPUT, Some(599), Unused::Undecodable));
    // Tick 599 has a snapshot, so the replay continues with tick 600.
    assert_eq!((report.missing_input_ticks, report.skipped_ticks, report.complete), (1, 0, false));
    let report = replay_of("undecodable_state.mcap", |events| {
        let at = place(events, channels::CONTROLLER_SNAPSHOT, 599);
        events[at].2.truncate(60);
    });
    assert_eq!(first_unused(&report), (channels::CONTROLLER_SNAPSHOT, Some(599), Unused::Undecodable));
    assert_eq!((report.ticks, report.identical, report.complete), (TICKS as u64, true, false));
    // A cut command of another program with the identity of the run, before or after the run's own one.
    for after in [0, 1] {
        let report = replay_of("undecodable_command.mcap", |events| {
            let at = place(events, ROBOT_COMMAND, 599);
            let mut cut = events[at].clone();
            cut.2.truncate(50);
            events.insert(at + after, cut);
        });
        assert_eq!(first_unused(&report), (ROBOT_COMMAND, Some(599), Unused::Undecodable));
        assert!(report.identical && !report.complete && report.missing_outputs.is_empty(), "{report:?}");
    }
}

/// The run stays complete with messages of other programs on any channel.
#[test]
fn messages_of_others_are_no_outputs() {
    let other = lcmtypes::Event { tick: -1, ..Default::default() };
    let stance = lcmtypes::LegState { tick: 300, ..Default::default() };
    for (channel, data) in [
        ("PLANNER_EVENT", toy::encoded(&other)),
        ("PLANNER_EVENT", toy::encoded(&lcmtypes::Event { tick: 300, ..Default::default() })),
        ("planner/LEG_STATE", toy::encoded(&stance)),
        ("planner/CONTROLLER_SNAPSHOT", toy::encoded(&stance)),
        ("EVENT", toy::encoded(&other)),
        ("PLANNER", vec![7; 100]),
    ] {
        let report = replay_of("foreign.mcap", |events| {
            events.insert(1500, (channel.into(), events[1500].1, data.clone()));
            events.push((channel.into(), TICKS * PERIOD_NS, data));
        });
        assert!(report.identical && report.complete && report.ticks == TICKS as u64, "{channel}: {report:?}");
        assert_eq!(report.account.unused, []);
    }
    // A command of another controller has another run_id.
    let report = replay_of("foreign_command.mcap", |events| {
        let command = RobotCommand { tick: 300, run_id: 99, ..RobotCommand::zeros(1) };
        events.insert(1500, (ROBOT_COMMAND.into(), events[1500].1, toy::encoded(&command)));
    });
    assert!(report.identical && report.complete, "{report:?}");
    assert_eq!(report.account.foreign_messages, 1);
    for known in channels::CHANNELS {
        let report = replay_of("foreign_type.mcap", |events| {
            events.insert(1500, (known.name.into(), events[1500].1, vec![0xa5; 100]));
        });
        assert!(report.identical && report.complete && report.ticks == TICKS as u64, "{}: {report:?}", known.name);
    }
}

/// The toy with another gain from tick 500 on; PARAMETER_CHANGE is published at each of the `published` ticks.
fn with_change(published: &[i64]) -> Vec<Message> {
    let mut events = toy::events_with(TICKS, Some((500, "gait.trot.swing_frequency", "2.5")));
    for tick in published {
        let change = ParameterChange {
            tick: 500,
            key: "gait.trot.swing_frequency".into(),
            value: "2.5".into(),
            ..Default::default()
        };
        let at = place(&events, CONTROLLER_INPUT, *tick);
        events.insert(at, (channels::PARAMETER_CHANGE.into(), tick * PERIOD_NS, toy::encoded(&change)));
    }
    events
}

#[test]
fn a_lost_parameter_change_is_a_loss_and_no_difference() {
    for published in [vec![500], vec![500, 700], vec![700], vec![999]] {
        let report = replay_of("change.mcap", |events| *events = with_change(&published));
        assert!(report.identical && report.complete && report.ticks == TICKS as u64, "{published:?}: {report:?}");
    }
    let report = replay_of("change_lost.mcap", |events| *events = with_change(&[]));
    assert!(report.identical && !report.complete, "{report:?}");
    assert_eq!((report.ticks, report.skipped_ticks), (500, 500));
    assert_eq!(report.other_parameters, Some(OtherParameters { first_tick: 500, ticks: 500 }));
}

/// A parameter change that this build refuses costs the ticks that were computed with it, not the log.
#[test]
fn a_parameter_change_that_is_not_valid_is_named() {
    let with_other = |tick: i64, key: &str, value: &str| {
        let mut events = with_change(&[500]);
        let change = ParameterChange { tick, key: key.into(), value: value.into(), ..Default::default() };
        let at = place(&events, CONTROLLER_INPUT, 300);
        events.insert(at, (channels::PARAMETER_CHANGE.into(), 300 * PERIOD_NS, toy::encoded(&change)));
        events
    };
    for (key, value) in [("wbc.frictiom", "0.5"), ("wbc.friction", "0.x"), ("wbc.friction", "-1.0"), ("\u{1b}[31m", "")]
    {
        let log = path("change_invalid.mcap");
        toy::write(&log, &with_other(300, key, value));
        let report = Replay::open_with(&log, toy::load).unwrap().run(&Options::default(), &mut |_| {}).unwrap();
        assert!(report.identical && !report.complete && report.ticks == TICKS as u64, "{key}: {report:?}");
        assert_eq!(report.account.rejected_changes, 1);
        assert_eq!(report.account.first_rejected_change.as_ref().map(|change| change.tick), Some(300));
        assert!(!report.account.text().concat().contains('\u{1b}'));
    }
    // An altered change, of which no undamaged copy is in the log.
    let report = replay_of("change_altered.mcap", |events| {
        *events = with_change(&[500]);
        for (channel, _, bytes) in events {
            if channel == channels::PARAMETER_CHANGE {
                // The last letter of the key.
                *bytes.iter_mut().rev().nth(9).unwrap() ^= 1;
            }
        }
    });
    assert_eq!((report.account.rejected_changes, report.ticks), (1, 500), "{report:?}");
    assert_eq!(report.other_parameters, Some(OtherParameters { first_tick: 500, ticks: 500 }));
}

/// Bytes that are inserted move every chunk: the offsets in the index are wrong, and the log is read from its start instead.
#[test]
fn an_index_with_wrong_offsets_is_not_used() {
    let log = path("moved_chunks.mcap");
    toy::write(&log, &with_change(&[500]));
    let mut bytes = std::fs::read(&log).unwrap();
    // After the magic and the header: a metadata record with an empty name and no values.
    let header_end = 8 + 9 + u64::from_le_bytes(*bytes[9..].first_chunk().unwrap()) as usize;
    let metadata = [&[0x0c_u8][..], &8_u64.to_le_bytes(), &[0; 8]].concat();
    bytes.splice(header_end..header_end, metadata);
    std::fs::write(&log, bytes).unwrap();
    let report = Replay::open_with(&log, toy::load).unwrap().run(&Options::default(), &mut |_| {}).unwrap();
    // The inserted bytes are damage, but no parameter change is lost.
    assert_eq!(
        (report.identical, report.damaged, report.ticks, report.other_parameters),
        (true, 1, TICKS as u64, None)
    );
}

/// An output without input is reported with the place of its tick in the file, not with the end of the log.
#[test]
fn an_output_without_input_is_reported_at_its_offset() {
    let path = path("no_input.lcmlog");
    let mut events = toy::events(TICKS);
    set_tick(&mut events, ROBOT_COMMAND, 599, 5000);
    toy::write(&path, &events);
    let report = Replay::open_with(&path, toy::load).unwrap().run(&Options::default(), &mut |_| {}).unwrap();
    let place = replay::log::LogReader::open(&path).unwrap().events().map(Result::unwrap);
    let place = place
        .filter(|event| *event.channel == *ROBOT_COMMAND)
        .find(|event| event.data[16..24] == 5000_i64.to_be_bytes());
    assert_eq!(report.account.unused[0].offset, place.unwrap().offset);
}

/// With an override, the changes of the same key do not apply, neither in the replay nor in the log that it writes.
#[test]
fn a_written_log_has_the_parameters_it_was_computed_with() {
    let (log, out) = (path("held.mcap"), path("held_out.mcap"));
    toy::write(&log, &with_change(&[500, 700]));
    let set = vec![("gait.trot.swing_frequency".to_owned(), "3.5".to_owned())];
    let replay = |path: &std::path::Path, options: &Options| {
        Replay::open_with(path, toy::load).unwrap().run(options, &mut |_| {}).unwrap()
    };
    replay(&log, &Options { set, out: Some(out.clone()), ..Options::default() });
    let again = replay(&out, &Options::default());
    assert!(again.identical && again.complete && again.ticks == TICKS as u64, "{again:?}");
}

/// Two runs, the second after a restart of the machine, whose clock starts again from 0.
#[test]
fn each_run_of_a_log_is_read_on_its_own() {
    let log = path("two_runs.mcap");
    let mut events = toy::events_of_run(1, 1000, 5_000_000_000);
    let second = toy::events_of_run(2, 700, 0);
    // A command of another program is no run, and takes no events with it.
    let at = place(&events, ROBOT_COMMAND, 5500);
    let mut foreign = events[at].clone();
    foreign.2[24..32].copy_from_slice(&77_i64.to_be_bytes());
    events.insert(at, foreign);
    events.extend(second.into_iter().map(|(channel, t_ns, data)| (channel, t_ns + 20_000_000_000, data)));
    toy::write(&log, &events);
    let runs = LogSummary::read(&log).unwrap().runs;
    let found: Vec<_> = runs.iter().map(|run| (run.number, run.ticks, run.first_tick, run.first_t_ns)).collect();
    assert_eq!(found, [(1, 1000, Some(0), Some(5_000_000_000)), (2, 700, Some(0), Some(0))]);
    let open = |path: &std::path::Path| Replay::open_with(path, toy::load);
    let error = open(&log).unwrap().run(&Options::default(), &mut |_| {}).unwrap_err();
    assert!(matches!(error, replay::Error::SeveralRuns { .. }), "{error}");
    let whole = Excerpt::Range { from_s: None, to_s: None };
    let out = path("both.mcap");
    let error = copy_excerpt(&log, &out, whole, EventFilter::default(), Types::default(), &mut |_| {}).unwrap_err();
    assert!(matches!(error, replay::Error::SeveralRuns { .. }) && !out.exists(), "{error}");
    for (number, ticks) in [(1, 1000), (2, 700)] {
        let one = path_of_run(&log, number);
        let copied = path(&format!("run_{number}.mcap"));
        copy_excerpt(&one, &copied, whole, EventFilter::default(), Types::default(), &mut |_| {}).unwrap();
        for path in [&one, &copied] {
            let report = open(path).unwrap().run(&Options::default(), &mut |_| {}).unwrap();
            assert!(report.identical && report.complete && report.ticks == ticks, "{number}: {report:?}");
        }
    }
    assert_eq!(LogSummary::read(path_of_run(&log, 2)).unwrap().runs[0].number, 2);
    assert!(matches!(open(&path_of_run(&log, 3)), Err(replay::Error::NoSuchRun { number: 3, runs: 2, .. })));
    // The first input decides whose RUN_INFO gives time zero.
    let late: Vec<_> = toy::events_of_run(2, 700, 9_000_000_000).into_iter().skip(2000).collect();
    let mut mixed = vec![toy::events_of_run(1, 1, 5_000_000_000)[0].clone()];
    mixed.extend(late);
    mixed.push(toy::events_of_run(2, 1, 9_000_000_000)[0].clone());
    toy::write(&log, &mixed);
    assert_eq!(RunClock::read(&log).unwrap().first_tick_ns(), Some(9_000_000_000));
}

/// A part of a long log is found by the index, also if the clock of the recorder steps.
#[test]
fn a_replay_from_a_time_starts_near_it() {
    let log = path("long.mcap");
    let mut events = toy::events(12_000);
    // The clock of the recorder steps back by 5 s half-way.
    events.iter_mut().filter(|(_, t_ns, _)| *t_ns > 6000 * PERIOD_NS).for_each(|(_, t_ns, _)| *t_ns -= 5_000_000_000);
    toy::write(&log, &events);
    let replay = Replay::open_with(&log, toy::load).unwrap();
    for (from_s, to_s, start) in [(0.05, 0.2, 0), (3.45, 3.5, 3400), (7.25, 7.5, 7200), (11.95, 12.0, 11_900)] {
        let options = Options { from_s: Some(from_s), to_s: Some(to_s), ..Options::default() };
        let report = replay.run(&options, &mut |_| {}).unwrap();
        assert!(report.identical && report.complete, "{from_s}: {report:?}");
        assert_eq!(report.first_t_ns.map(|t_ns| t_ns / PERIOD_NS), Some(start), "{from_s}");
        let last = ((to_s * 1000.0) as i64).min(11_999);
        assert_eq!(report.last_t_ns.map(|t_ns| t_ns / PERIOD_NS), Some(last), "{from_s}");
        // An excerpt of the same part replays on its own.
        let part = path("long_part.mcap");
        let around = Excerpt::Around { around_s: from_s, before_s: 0.0, after_s: to_s - from_s };
        copy_excerpt(&log, &part, around, EventFilter::default(), Types::default(), &mut |_| {}).unwrap();
        let replayed = Replay::open_with(&part, toy::load).unwrap().run(&Options::default(), &mut |_| {}).unwrap();
        assert!(replayed.identical && replayed.complete, "{from_s}: {replayed:?}");
        assert_eq!(replayed.last_t_ns.map(|t_ns| t_ns / PERIOD_NS), Some(last), "{from_s}");
    }
    // Damage before the part is not read.
    let mut bytes = std::fs::read(&log).unwrap();
    // In the second chunk: the first one contains RUN_INFO, and between chunks there are indexes, which are not read here.
    let zstd = [0x28, 0xb5, 0x2f, 0xfd];
    let (chunk, _) = bytes.windows(4).enumerate().filter(|(_, start)| *start == zstd).nth(1).unwrap();
    bytes[chunk + 64..chunk + 128].fill(0xff);
    std::fs::write(&log, bytes).unwrap();
    let damaged = |from_s| {
        let options = Options { from_s, to_s: Some(7.5), ..Options::default() };
        Replay::open_with(&log, toy::load).unwrap().run(&options, &mut |_| {}).unwrap().damaged
    };
    assert!(damaged(None) > 0);
    assert_eq!(damaged(Some(7.25)), 0);
}

/// A controller that restores only a part of its state differs after the first snapshot, with any number of threads.
#[test]
fn state_that_a_snapshot_lacks_is_found_with_one_thread() {
    let path = path("hidden.mcap");
    toy::write(&path, &toy::events(TICKS));
    let load = |info: &_| Ok(toy::component(toy::Toy { forgets: true, ..toy::toy(info)? }));
    for jobs in 1..4 {
        let replay = Replay::open_with(&path, load).unwrap();
        let report = replay.run(&Options { jobs, ..Options::default() }, &mut |_| {}).unwrap();
        assert!(!report.identical, "{jobs}");
        assert_eq!(report.first_divergence.map(|first| first.tick), Some(100), "{jobs}");
    }
}
