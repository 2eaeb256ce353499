//! Cursor, what-if replays, missing inputs, and differences between log and replay.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::toy::{self, PERIOD_NS, SNAPSHOT, Toy};
use common::{Message, path};
use lcmtypes::channels::{self, Stage};
use lcmtypes::{Event, RobotCommand, RunInfo, Timing};
use replay::Error;
use replay::engine::{Build, Cursor, Options, Replay, TimedOverride, When};
use std::path::{Path, PathBuf};

const TICKS: i64 = 1000;

fn log(name: &str, change: impl FnOnce(&mut Vec<Message>)) -> PathBuf {
    let path = path(name);
    let mut events = toy::events(TICKS);
    change(&mut events);
    toy::write(&path, &events);
    path
}

fn open(path: &Path, change: impl Fn(Toy) -> Toy + Sync + 'static) -> Replay<'static> {
    Replay::open_with(path, move |info| Ok(toy::component(change(toy::toy(info)?)))).unwrap()
}

fn set(key: &str, value: &str) -> (String, String) {
    (key.to_owned(), value.to_owned())
}

const GAIN: &str = "gait.trot.swing_frequency";

#[test]
fn a_cursor_reproduces_any_tick_in_any_order() {
    let path = log("any.mcap", |events| {
        let event = Event { t_ns: 555 * PERIOD_NS, tick: 555, text: "said".into(), ..Event::default() };
        events.push((channels::EVENT.into(), 555 * PERIOD_NS, toy::encoded(&event)));
        events.sort_by_key(|(_, t_ns, _)| *t_ns);
    });
    let replay = open(&path, |toy| toy);
    let mut cursor = Cursor::open(&replay, &Options::default(), &mut |_| {}).unwrap();
    assert_eq!((cursor.first_tick(), cursor.last_tick()), (0, TICKS - 1));
    let around = |cursor: &mut Cursor, tick| (cursor.state_before(tick).unwrap(), cursor.state_after(tick).unwrap());
    assert_eq!(around(&mut cursor, 0), (None, Some(SNAPSHOT - 1)));
    assert_eq!(around(&mut cursor, TICKS - 1), (Some(9 * SNAPSHOT - 1), None));
    let state = 5 * SNAPSHOT - 1;
    assert_eq!(around(&mut cursor, state), (Some(state - SNAPSHOT), Some(state + SNAPSHOT)));
    assert_eq!(around(&mut cursor, state + 1), (Some(state), Some(state + SNAPSHOT)));
    for tick in [0, 999, 555, 554, 99, 100, 555, 1, 998, 300] {
        let moment = cursor.go_to(tick).unwrap();
        assert_eq!((moment.tick, moment.t_ns, moment.divergence.is_none()), (tick, tick * PERIOD_NS, true));
        let recorded = moment.recorded(channels::ROBOT_COMMAND).unwrap();
        assert_eq!(moment.replayed(channels::ROBOT_COMMAND), Some(recorded), "tick {tick}");
        assert_eq!(moment.is_snapshot, tick % SNAPSHOT == SNAPSHOT - 1);
        let said: Vec<&str> = moment.beside.iter().map(|event| &*event.channel).collect();
        let expected: &[&str] = if tick == 555 { &["EVENT", "TIMING"] } else { &["TIMING"] };
        let mut said = said;
        said.sort_unstable();
        assert_eq!(said, expected, "tick {tick}");
        let timing = moment.beside.iter().find(|event| *event.channel == *channels::TIMING).unwrap();
        assert_eq!(<Timing as lcmtypes::Message>::decode(&timing.data).unwrap().wall_ns, 17 * tick);
    }
    assert_eq!(cursor.tick_at(0.2505).unwrap(), 250);
    let error = cursor.go_to(TICKS).unwrap_err();
    assert!(matches!(error, Error::NoSuchTick { first: 0, last: 999, .. }), "{error}");
}

#[test]
fn a_cursor_finds_the_first_tick_that_differs() {
    let path = log("search.mcap", |_| {});
    let replay = open(&path, |toy| Toy { mutant: Some((Stage::Qp, 777)), ..toy });
    let mut cursor = Cursor::open(&replay, &Options::default(), &mut |_| {}).unwrap();
    let found = cursor.search(40, u64::MAX, &mut |moment| moment.divergence.is_some()).unwrap().unwrap();
    let first = found.divergence.unwrap();
    assert_eq!((found.tick, &*first.stage, first.last_agreed_tick), (777, "qp", Some(776)));
    assert!(cursor.search(40, 700, &mut |moment| moment.divergence.is_some()).unwrap().is_none());
}

#[test]
fn a_tick_without_input_is_missing_and_later_states_are_unknown() {
    let path = log("hole.mcap", |events| {
        events.retain(|(c, t_ns, _)| c != channels::CONTROLLER_INPUT || ![437, 441, 442].contains(&(t_ns / PERIOD_NS)));
    });
    let replay = open(&path, |toy| toy);
    let report = replay.run(&Options::default(), &mut |_| {}).unwrap();
    assert_eq!((report.missing_ticks, report.identical), (vec![(437, 437), (441, 442)], true));
    for jobs in 2..4 {
        let report = replay.run(&Options { jobs, ..Options::default() }, &mut |_| {}).unwrap();
        assert_eq!(report.missing_ticks, [(437, 437), (441, 442)]);
    }
    let mut cursor = Cursor::open(&replay, &Options::default(), &mut |_| {}).unwrap();
    assert!(matches!(cursor.go_to(437), Err(Error::NoSuchTick { tick: 437, .. })));
    assert!(matches!(cursor.go_to(450), Err(Error::StateUnknown { tick: 450, .. })));
    assert!(cursor.go_to(436).unwrap().divergence.is_none());
    assert!(cursor.go_to(500).unwrap().divergence.is_none());
}

#[test]
fn a_time_after_the_end_is_an_error() {
    let path = log("end.mcap", |_| {});
    let replay = open(&path, |toy| toy);
    let from = |from_s| replay.run(&Options { from_s: Some(from_s), ..Options::default() }, &mut |_| {});
    assert!(from(0.95).unwrap().identical);
    let error = from(1.5).unwrap_err();
    assert!(matches!(error, Error::BeyondEnd { last_s, .. } if (last_s - 0.999).abs() < 1e-9), "{error}");
}

/// The replay from each snapshot is identical to the rest of the log.
#[test]
fn a_log_replays_from_every_snapshot() {
    let path = log("tail.mcap", |_| {});
    let replay = open(&path, |toy| toy);
    for state in 0..9 {
        // The tick after the snapshot: a part from the snapshot's own tick on starts at the snapshot before, because it compares that tick too.
        let from_s = Some((state * SNAPSHOT + SNAPSHOT) as f64 * 1e-3);
        let report = replay.run(&Options { from_s, ..Options::default() }, &mut |_| {}).unwrap();
        assert!(report.identical && report.skipped_ticks == 0, "{report:?}");
        assert_eq!(report.ticks as i64, TICKS - (state + 1) * SNAPSHOT);
    }
}

#[test]
fn a_timed_override_keeps_the_state() {
    let path = log("changes.mcap", |_| {});
    let replay = open(&path, |toy| toy);
    let change = |when| TimedOverride { when, key: GAIN.to_owned(), value: "2.5".to_owned() };
    for (when, tick) in [(When::Tick(321), 321), (When::Seconds(0.3205), 321), (When::Seconds(0.7), 700)] {
        let report =
            replay.run(&Options { timed_overrides: vec![change(when)], ..Options::default() }, &mut |_| {}).unwrap();
        let first = report.first_divergence.unwrap();
        assert_eq!((first.tick, &*first.stage, first.last_agreed_tick), (tick, "tasks", Some(tick - 1)), "{when:?}");
    }
    // An override with the same value changes nothing, so the state is handed over completely.
    let same = TimedOverride { when: When::Tick(500), key: GAIN.to_owned(), value: "2.0".to_owned() };
    let report = replay.run(&Options { timed_overrides: vec![same], ..Options::default() }, &mut |_| {}).unwrap();
    assert!(report.identical, "{:?}", report.first_divergence);
    let options = Options {
        timed_overrides: vec![change(When::Tick(3))],
        out: Some(common::path("changes_out.mcap")),
        ..Options::default()
    };
    assert!(matches!(replay.run(&options, &mut |_| {}), Err(Error::ParameterChangesInLog)));
}

/// The departure is the first tick at which recorded and replayed torques differ by more than the bound.
#[test]
fn the_departure_is_the_first_tick_above_the_bound() {
    let path = log("departure.mcap", |_| {});
    let out = common::path("departure_out.mcap");
    let replay = open(&path, |toy| toy);
    let what = set(GAIN, "3.0");
    let options = Options { set: vec![what], bound: Some(0.05), out: Some(out.clone()), ..Options::default() };
    let found = replay.run(&options, &mut |_| {}).unwrap().what_if.unwrap();
    let torques = |path: &Path| -> Vec<f64> {
        let events = replay::log::LogReader::open(path).unwrap().events().map(|event| event.unwrap());
        let commands = events.filter(|event| *event.channel == *channels::ROBOT_COMMAND);
        commands.map(|event| <RobotCommand as lcmtypes::Message>::decode(&event.data).unwrap().tau[0]).collect()
    };
    let (before, after) = (torques(&path), torques(&out));
    let expected = before.iter().zip(&after).position(|(a, b)| (a - b).abs() > 0.05).unwrap();
    let departure = found.departure.unwrap();
    assert_eq!((departure.tick, departure.joint, found.ticks), (expected as i64, 0, expected as u64));
    assert_eq!(departure.by, after[expected] - before[expected]);
    assert_eq!(found.samples.len(), TICKS as usize);
    let wide = Options { set: vec![set(GAIN, "3.0")], bound: Some(1e9), ..Options::default() };
    let found = replay.run(&wide, &mut |_| {}).unwrap().what_if.unwrap();
    assert_eq!((found.departure, found.ticks), (None, TICKS as u64));
}

#[test]
fn differences_in_build_and_parameters_are_reported() {
    let path = log("deviations.mcap", |_| {});
    let replay = open(&path, |toy| toy);
    let here = Build { revision: "abc".into(), dirty: true, toolchain: "rustc 9".into(), flags: String::new() };
    let options = Options { set: vec![set("wbc.friction", "0.7")], here: Some(here), ..Options::default() };
    let report = replay.run(&options, &mut |_| {}).unwrap();
    let named: Vec<(&str, &str, &str)> = report
        .deviations
        .iter()
        .filter(|d| !d.log.is_empty())
        .map(|d| (d.what.as_str(), d.log.as_str(), d.here.as_str()))
        .collect();
    assert_eq!(named, [("dirty", "false", "true")]);
    let named: Vec<&str> = report.deviations.iter().map(|d| d.what.as_str()).collect();
    // The toy's parameters are partial, so the overridden one and the defaults are not in the log.
    assert!(named.starts_with(&["revision", "dirty", "toolchain"]) && named.contains(&"wbc.friction"), "{named:?}");
    let complete = log("complete.mcap", |events| {
        let mut info = <RunInfo as lcmtypes::Message>::decode(&events[0].2).unwrap();
        let params = controller::params::Params::from_toml(info.params(), "").unwrap().to_toml();
        info = info.with_params(params);
        events[0].2 = toy::encoded(&info);
    });
    let replay = open(&complete, |toy| toy);
    assert_eq!(replay.run(&Options::default(), &mut |_| {}).unwrap().deviations, []);
    let options = Options { set: vec![set("wbc.friction", "0.7")], ..Options::default() };
    let named = replay.run(&options, &mut |_| {}).unwrap().deviations;
    assert_eq!(named.len(), 1);
    assert_eq!((&*named[0].what, &*named[0].log, &*named[0].here), ("wbc.friction", "0.6", "0.7"));
}

/// Places are those of the index of an MCAP, or of the first pass through an event log.
#[test]
fn a_cursor_goes_to_any_tick_of_a_long_log() {
    for name in ["long.mcap", "long.lcmlog"] {
        let path = path(name);
        toy::write(&path, &toy::events(12_000));
        let replay = open(&path, |toy| toy);
        let mut cursor = Cursor::open(&replay, &Options::default(), &mut |_| {}).unwrap();
        assert_eq!((cursor.first_tick(), cursor.last_tick()), (0, 11_999), "{name}");
        for tick in [11_999, 0, 6050, 6049, 100, 99, 9999, 5999] {
            let moment = cursor.go_to(tick).unwrap();
            assert_eq!((moment.tick, moment.divergence), (tick, None), "{name}");
        }
        assert_eq!(cursor.tick_at(7.0205).unwrap(), 7020, "{name}");
        assert_eq!(cursor.state_before(7000).unwrap(), Some(6999), "{name}");
    }
}
