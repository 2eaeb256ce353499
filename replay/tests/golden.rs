//! The golden logs, replayed from every snapshot and with any number of threads.
#![allow(clippy::unwrap_used, reason = "a test may")]

use lcmtypes::{Message, RunInfo, TextFile, channels};
use replay::engine::{Cursor, Options, Replay, ReplayReport};
use replay::log::{EventFilter, Excerpt, LogReader, LogWriter, Types, copy_excerpt};
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
        let (last, mut states) = (cursor.last_tick(), Vec::new());
        while let Some(state) = cursor.state_after(states.last().copied().unwrap_or(-1)).unwrap() {
            states.push(state);
        }
        assert!(states.len() >= 2, "{}: states after {states:?}", log.display());
        for state in states.into_iter().filter(|state| *state < last) {
            // From the snapshot's own tick on, that tick is compared too, from the snapshot before.
            let since_s = cursor.go_to(state + 1).unwrap().since_s;
            let report = run(&replay, &Options { from_s: Some(since_s), ..Options::default() });
            let place = format!("{} after tick {state}: {report:?}", log.display());
            assert_eq!((report.identical, report.skipped_ticks), (true, 0), "{place}");
            assert_eq!(report.ticks, last.abs_diff(state), "{place}");
        }
    }
}

/// Tick 0 has a snapshot; an excerpt that starts there needs the input of tick 0 too.
#[test]
fn an_excerpt_of_the_first_second_replays() {
    let log = &logs()[0];
    let out = std::env::temp_dir().join(format!("first_second_{}.mcap", std::process::id()));
    let around = Excerpt::Around { around_s: 0.6, before_s: 0.5, after_s: 0.1 };
    copy_excerpt(log, &out, around, EventFilter::default(), Types::default(), &mut |_| {}).unwrap();
    let report = run(&Replay::open(&out).unwrap(), &Options::default());
    std::fs::remove_file(&out).unwrap();
    assert!(report.identical && report.complete && report.first_t_ns == Some(0), "{report:?}");
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

/// Changes the text of one type; the text must contain what is replaced.
fn replace(files: &mut [TextFile], name: &str, old: &str, new: &str) {
    let file = files.iter_mut().find(|file| file.name == name).unwrap();
    assert!(file.text.contains(old), "{name}: {old}");
    file.text = file.text.replace(old, new);
}

/// Only fingerprints of messages decide whether a log is of another type version (`engine.rs` tests a changed one).
#[test]
fn other_type_texts_in_run_info_do_not_change_a_replay() {
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("../logs/golden/flat_trot.mcap");
    let copy = Path::new(env!("CARGO_TARGET_TMPDIR")).join("types_reworded.mcap");
    let mut out = LogWriter::create(&copy).unwrap();
    for event in LogReader::open(&log).unwrap().events() {
        let mut event = event.unwrap();
        if *event.channel == *channels::RUN_INFO {
            let mut info = RunInfo::decode(&event.data).unwrap();
            for file in &mut info.lcm_types {
                let lines = file.text.lines().map(|line| if line.starts_with("//") { "// reworded" } else { line });
                file.text = lines.collect::<Vec<_>>().join("\n");
            }
            // A type that the replay does not need has changed, one is missing, and one is unknown to this build.
            replace(&mut info.lcm_types, "timing_t.lcm", "wake_ns", "woken_ns");
            let text = "package hoofprint;\nstruct retired_t { int64_t t_ns; }\n".to_owned();
            info.lcm_types.push(TextFile { name: "retired_t.lcm".to_owned(), text });
            info.lcm_types.retain(|file| file.name != "executor_command_t.lcm");
            info.num_lcm_types = info.lcm_types.len() as i32;
            event.data.clear();
            info.encode(&mut event.data).unwrap();
        }
        out.write(&event.channel, event.t_ns, &event.data).unwrap();
    }
    out.finish().unwrap();
    let report = |log: &Path| run(&Replay::open(log).unwrap(), &Options::default());
    let (as_recorded, reworded) = (report(&log), report(&copy));
    assert!(reworded.identical, "{:?}", reworded.first_divergence);
    assert_eq!(reworded.deviations, as_recorded.deviations);
}
