//! The golden logs, replayed from every snapshot and with any number of threads.
#![allow(clippy::unwrap_used, reason = "a test may")]

use lcmtypes::{Message, RunInfo, TextFile, channels};
use replay::engine::{Cursor, Options, Replay, ReplayReport};
use replay::log::{LogReader, LogWriter};
use std::path::{Path, PathBuf};

fn logs() -> Vec<PathBuf> {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("../logs/golden");
    let files = std::fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path());
    let mut logs: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|ending| ending == "mcap")).collect();
    logs.sort();
    assert!(logs.len() >= 5, "{logs:?}");
    logs
}

/// The report without wall-clock times.
fn run(replay: &Replay, options: &Options) -> ReplayReport {
    let report = replay.run(options, &mut |_| {}).unwrap();
    ReplayReport { wall_seconds: 0.0, real_time_factor: 0.0, ..report }
}

/// A log contains a snapshot per second; the replay from each is identical to the rest of the log.
#[test]
fn every_golden_log_replays_from_every_snapshot() {
    for log in logs() {
        let replay = Replay::open(&log).unwrap();
        let mut cursor = Cursor::open(&replay, &Options::default(), &mut |_| {}).unwrap();
        let (last, states) = (cursor.last_tick(), cursor.snapshots().to_vec());
        assert!(states.len() >= 2, "{}: states after {states:?}", log.display());
        for state in states.into_iter().filter(|state| *state < last) {
            let since_s = cursor.go_to(state).unwrap().since_s;
            let report = run(&replay, &Options { from_s: Some(since_s), ..Options::default() });
            let place = format!("{} after tick {state}: {report:?}", log.display());
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

/// Copies a golden log with other `.lcm` texts in its RUN_INFO and returns the differences in types that its replay reports.
fn types_reported(name: &str, edit: impl Fn(&mut Vec<TextFile>)) -> Vec<String> {
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("../logs/golden/flat_trot.mcap");
    let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let mut out = LogWriter::create(&copy).unwrap();
    for event in LogReader::open(log).unwrap().events() {
        let mut event = event.unwrap();
        if *event.channel == *channels::RUN_INFO {
            let mut info = RunInfo::decode(&event.data).unwrap();
            edit(&mut info.lcm_types);
            info.num_lcm_types = info.lcm_types.len() as i32;
            event.data.clear();
            info.encode(&mut event.data).unwrap();
        }
        out.write(&event.channel, event.t_ns, &event.data).unwrap();
    }
    out.finish().unwrap();
    let report = run(&Replay::open(&copy).unwrap(), &Options::default());
    assert!(report.identical, "{:?}", report.first_divergence);
    report.deviations.into_iter().filter(|d| d.what == "types").map(|d| d.log).collect()
}

/// Changes the text of one type; the text must contain what is replaced.
fn replace(files: &mut [TextFile], name: &str, old: &str, new: &str) {
    let file = files.iter_mut().find(|file| file.name == name).unwrap();
    assert!(file.text.contains(old), "{name}: {old}");
    file.text = file.text.replace(old, new);
}

#[test]
fn only_changed_types_that_the_replay_needs_are_reported() {
    let same = types_reported("types_same.mcap", |files| {
        for file in files.iter_mut() {
            let lines = file.text.lines().map(|line| if line.starts_with("//") { "// reworded" } else { line });
            file.text = lines.collect::<Vec<_>>().join("\n");
        }
        // A type that the replay does not need has changed, and the log describes a type that this build does not have.
        replace(files, "timing_t.lcm", "wake_ns", "woken_ns");
        let text = "package hoofprint;\nstruct retired_t { int64_t t_ns; }\n".to_owned();
        files.push(TextFile { name: "retired_t.lcm".to_owned(), text });
        files.retain(|file| file.name != "executor_command_t.lcm");
    });
    assert_eq!(same, Vec::<String>::new());
    let nested = types_reported("types_nested.mcap", |files| {
        replace(files, "robot_state_t.lcm", "double tau[", "float tau[");
    });
    assert_eq!(nested.len(), 1, "{nested:?}");
    let renamed = types_reported("types_renamed.mcap", |files| {
        replace(files, "controller_tick_t.lcm", "int64_t digest_qp", "int64_t digest_solver");
        replace(files, "robot_state_t.lcm", "double tau[", "float tau[");
    });
    // robot_state_t is a field of controller_input_t, so its change changes the fingerprint of that type.
    assert_eq!(renamed.len(), 2, "{renamed:?}");
    assert!(renamed[0].starts_with("hoofprint.controller_input_t "), "{renamed:?}");
    assert!(renamed[1].starts_with("hoofprint.controller_tick_t "), "{renamed:?}");
}
