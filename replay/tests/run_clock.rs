//! Every tool counts time from the run's first tick, also for a live log, in which controller and recorder use different clocks.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::toy::{self, PERIOD_NS, SNAPSHOT};
use common::{Message, path};
use lcmtypes::channels::{self, Stage};
use replay::engine::{Cursor, Options, Replay};
use replay::log::{
    CopyOptions, Event, EventFilter, Excerpt, LogReader, LogSummary, RunClock, Types, Zero, copy, copy_excerpt, diff,
};
use std::path::{Path, PathBuf};

const TICKS: i64 = 1000;
/// A monotonic clock, days after the machine was started.
const T0_NS: i64 = 400_000_000_000_000;
/// The recorder's clock counts from the Unix epoch; it starts 1 s before the first tick.
const RECORDER_NS: i64 = 1_700_000_000_000_000_000;
const BEFORE_NS: i64 = 1_000_000_000;

/// A run of the toy as a live recorder writes it: each message is received up to 0.7 ms after its tick.
fn live_log(name: &str) -> PathBuf {
    let path = path(name);
    let mut random = common::Random(3);
    let mut events: Vec<Message> =
        (0..100).map(|i| ("OTHER_DEVICE".to_owned(), RECORDER_NS + i * 10 * PERIOD_NS, vec![0; 8])).collect();
    events.extend(toy::events_from(TICKS, T0_NS).into_iter().map(|(channel, t_ns, data)| {
        let late_ns = (random.next() % 700_000) as i64;
        (channel, RECORDER_NS + BEFORE_NS + (t_ns - T0_NS) + late_ns, data)
    }));
    toy::write(&path, &events);
    path
}

fn open(path: &Path) -> Replay<'static> {
    let mutant = |info: &_| Ok(toy::component(toy::Toy { mutant: Some((Stage::Qp, 777)), ..toy::toy(info)? }));
    Replay::open_with(path, mutant).unwrap()
}

fn events(path: &Path) -> Vec<Event> {
    LogReader::open(path).unwrap().events().map(|event| event.unwrap()).collect()
}

/// Ticks of the inputs in a log.
fn ticks(path: &Path) -> Vec<i64> {
    let inputs = events(path).into_iter().filter(|event| *event.channel == *channels::CONTROLLER_INPUT);
    inputs.map(|event| i64::from_be_bytes(event.data[16..24].try_into().unwrap())).collect()
}

#[test]
fn all_tools_show_the_same_time_for_a_tick_of_a_live_log() {
    let log = live_log("live.mcap");
    let clock = RunClock::read(&log).unwrap();
    assert_eq!((clock.zero(), clock.first_tick_ns()), (Zero::FirstTick, Some(T0_NS)));
    let replay = open(&log);
    // Replay: the first difference, and a part of the log by time.
    let report = replay.run(&Options::default(), &mut |_| {}).unwrap();
    let first = report.first_divergence.unwrap();
    assert_eq!((first.tick, first.t_ns, first.t_s), (777, T0_NS + 777 * PERIOD_NS, 0.777));
    let options = Options { from_s: Some(0.25), to_s: Some(0.5), ..Options::default() };
    let part = replay.run(&options, &mut |_| {}).unwrap();
    assert_eq!((part.ticks, part.last_t_ns), (301, Some(T0_NS + 500 * PERIOD_NS)));
    // Debugger.
    let mut cursor = Cursor::open(&replay, &Options::default(), &mut |_| {}).unwrap();
    assert_eq!((cursor.tick_at(0.25).unwrap(), cursor.go_to(250).unwrap().since_s), (250, 0.25));
    // Filter, trim and cat: the messages of a tick have the time of the tick.
    let selected = path("live_selected.mcap");
    let filter = EventFilter::new(None, None, Some(0.25), Some(0.5)).unwrap().keep_replay();
    copy(&log, &selected, CopyOptions { filter, ..CopyOptions::default() }, &mut |_| {}).unwrap();
    assert_eq!(ticks(&selected), (250..=500).collect::<Vec<_>>());
    // Excerpt: from the snapshot before to the end of the part.
    let bundled = path("live_bundled.mcap");
    let window = Excerpt::Around { around_s: 0.45, before_s: 0.1, after_s: 0.05 };
    copy_excerpt(&log, &bundled, window, EventFilter::default(), Types::default(), &mut |_| {}).unwrap();
    assert_eq!(ticks(&bundled), (3 * SNAPSHOT..=500).collect::<Vec<_>>());
    // Comparison of logs: the copies start at different ticks and have the same times.
    let same = diff(
        &selected,
        &bundled,
        &EventFilter::new(Some("CONTROLLER_INPUT"), None, None, None).unwrap(),
        Types::default(),
        &mut |_| {},
    );
    assert_eq!(same.unwrap().channels[0].first.as_ref().unwrap().t_s, 0.25);
}

#[test]
fn a_trimmed_log_has_the_times_of_its_run() {
    let (log, part) = (live_log("whole.mcap"), path("part.mcap"));
    let window = Excerpt::Around { around_s: 0.85, before_s: 0.1, after_s: 0.1 };
    copy_excerpt(&log, &part, window, EventFilter::default(), Types::default(), &mut |_| {}).unwrap();
    let summary = LogSummary::read(&part).unwrap();
    assert_eq!(summary.zero, Zero::FirstTick);
    let (whole, trimmed) = (RunClock::read(&log).unwrap(), RunClock::read(&part).unwrap());
    assert_eq!(trimmed.first_tick_ns(), whole.first_tick_ns());
    // Each log takes the offset of the clocks from its own first tick, so the two differ by the latency of reception.
    assert!(trimmed.origin_ns().abs_diff(whole.origin_ns()) < 700_000);
    let replay = open(&part);
    let mut cursor = Cursor::open(&replay, &Options::default(), &mut |_| {}).unwrap();
    assert_eq!(cursor.go_to(850).unwrap().since_s, 850_000_000.0 * 1e-9);
    assert_eq!(cursor.tick_at(0.9).unwrap(), 900);
}

#[test]
fn a_log_without_a_run_counts_from_its_first_event() {
    let log = path("no_run.mcap");
    common::write(&log, &common::messages(10), 100);
    let clock = RunClock::read(&log).unwrap();
    assert_eq!((clock.zero(), clock.first_tick_ns()), (Zero::FirstEvent, None));
    assert_eq!(clock.of_log_time(events(&log)[4].t_ns), 1_000_000);
}
