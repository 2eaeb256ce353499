//! The golden logs, from every state in them and in any number of threads.
#![allow(clippy::unwrap_used, reason = "a test may")]

use replay::engine::{Cursor, Options, Replay, ReplayReport};
use std::path::{Path, PathBuf};

fn logs() -> Vec<PathBuf> {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("../logs/golden");
    let files = std::fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path());
    let mut logs: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|ending| ending == "mcap")).collect();
    logs.sort();
    assert!(logs.len() >= 5, "{logs:?}");
    logs
}

/// All that does not depend on a clock.
fn run(replay: &Replay, options: &Options) -> ReplayReport {
    let report = replay.run(options, &mut |_| {}).unwrap();
    ReplayReport { wall_seconds: 0.0, real_time_factor: 0.0, ..report }
}

/// A log keeps a state a second; from each of them on the replay is the rest of the record.
#[test]
fn every_state_of_every_golden_log_leads_to_its_tail() {
    for log in logs() {
        let replay = Replay::open(&log).unwrap();
        let mut cursor = Cursor::open(&replay, &Options::default(), &mut |_| {}).unwrap();
        let (last, states) = (cursor.last_tick(), cursor.snapshots().to_vec());
        assert!(states.len() >= 2, "{}: states after {states:?}", log.display());
        for state in states.into_iter().filter(|state| *state < last) {
            let since_s = cursor.go_to(state).unwrap().since_s;
            let report = run(&replay, &Options { from_s: Some(since_s), ..Options::default() });
            let place = format!("{} behind tick {state}: {report:?}", log.display());
            assert_eq!((report.identical, report.skipped_ticks), (true, 0), "{place}");
            assert_eq!(report.ticks, last.abs_diff(state), "{place}");
        }
    }
}

#[test]
fn threads_do_not_change_the_report_of_any_golden_log() {
    for log in logs() {
        let replay = Replay::open(&log).unwrap();
        let serial = run(&replay, &Options::default());
        assert!(serial.identical, "{}: {serial:?}", log.display());
        for jobs in 2..5 {
            assert_eq!(
                run(&replay, &Options { jobs, ..Options::default() }),
                serial,
                "{}, {jobs} threads",
                log.display()
            );
        }
    }
}
