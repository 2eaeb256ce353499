//! `hoof log play`, received by `hoof log record` and by liblcm.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::network::url;
use common::{command, events, folder, hoof, ran};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::channels;
use replay::log::{Event, LogWriter};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A short run of the simulator.
fn run(folder: &Path) -> (PathBuf, Vec<Event>) {
    let log = folder.join("run.mcap");
    hoof(&format!("sim --robot hyq --scenario scenarios/short_flat.toml --seconds 0.5 --log {}", log.display()))
        .exits(0);
    let events = events(&log);
    (log, events)
}

/// Records with `hoof log record` what `hoof log play` sends: the recorded events and the player's JSON.
fn played(arguments: &str, url: &str, out: &Path) -> (Vec<Event>, serde_json::Value) {
    let mut recorder = command();
    recorder.args(["log", "record", "--lcm-url", url]).arg(out).stderr(Stdio::piped()).stdout(Stdio::piped());
    let mut recorder = recorder.spawn().unwrap();
    let mut stderr = BufReader::new(recorder.stderr.take().unwrap());
    let mut stderr_text = String::new();
    while !stderr_text.contains("udpm://") {
        assert!(stderr.read_line(&mut stderr_text).unwrap() > 0, "the recorder ended: {stderr_text}");
    }
    let json = hoof(&format!("log play --json --lcm-url {url} {arguments}")).exits(0).json();
    assert!(Command::new("kill").args(["-INT", &recorder.id().to_string()]).status().unwrap().success());
    ran(recorder.wait_with_output().unwrap()).exits(0);
    let mut received = events(out);
    // The recorder's own summary.
    assert_eq!(&*received.pop().unwrap().channel, channels::EVENT);
    (received, json)
}

fn content(events: &[Event]) -> Vec<(&str, &[u8])> {
    events.iter().map(|event| (&*event.channel, &event.data[..])).collect()
}

#[test]
fn a_log_played_and_recorded_is_the_same_log() {
    let folder = folder("circle");
    let (log, recorded) = run(&folder);
    for (test, pace) in [(0, "--speed 0.5"), (1, "--time tick --speed 0.5"), (2, "--time publish --speed 0.5")] {
        let out = folder.join(format!("received{test}.mcap"));
        let (received, json) = played(&format!("{pace} {}", log.display()), &url(test), &out);
        assert!(content(&received) == content(&recorded), "{pace}: {} of {} messages", received.len(), recorded.len());
        assert_eq!(json["events"], recorded.len());
        assert_eq!(json["lateness"]["events"], recorded.len());
        // Half a second at half speed: no machine plays it faster.
        assert!(json["wall_seconds"].as_f64().unwrap() > 0.99);
        let lateness = |key: &str| json["lateness"][key].as_f64().unwrap();
        assert!(lateness("p50_us") <= lateness("p99_us") && lateness("p99_us") <= lateness("max_us"));
    }
}

#[test]
fn part_of_a_log_on_renamed_channels() {
    let folder = folder("part");
    let log = folder.join("log.lcmlog");
    let mut writer = LogWriter::create(&log).unwrap();
    for i in 0..100 {
        writer.write(["A", "B", "CC"][i % 3], i as i64 * 10_000_000, &[i as u8]).unwrap();
    }
    writer.finish().unwrap();
    let arguments = format!("--flat-out --from 0.2 --to 0.5 --channels A|C+ --rename A=X {}", log.display());
    let (received, json) = played(&arguments, &url(3), &folder.join("received.lcmlog"));
    let expected: Vec<(&str, Vec<u8>)> =
        (20..50).filter(|i| i % 3 != 1).map(|i| (if i % 3 == 0 { "X" } else { "CC" }, vec![i])).collect();
    assert_eq!(content(&received), expected.iter().map(|(name, data)| (*name, &data[..])).collect::<Vec<_>>());
    assert_eq!((&json["events"], &json["lateness"]["events"]), (&20.into(), &0.into()));
}

#[test]
fn errors_name_the_invalid_argument() {
    let folder = folder("wrong");
    let log = folder.join("log.lcmlog");
    let mut writer = LogWriter::create(&log).unwrap();
    writer.write("A", 0, b"x").unwrap();
    writer.finish().unwrap();
    let cases: [(&str, &[&str]); 6] = [
        ("--speed 0", &["--speed 0", "0.001", "1000"]),
        ("--rename AB", &["--rename AB", "A=B"]),
        ("--from 2 --to 1", &["--from 2", "--to 1"]),
        ("--channels A(", &["A("]),
        ("--time tick", &["t_ns", "tick"]),
        ("--lcm-url nonsense://", &["nonsense://"]),
    ];
    for (arguments, facts) in cases {
        let ran = hoof(&format!("log play {arguments} {}", log.display())).exits(2);
        assert!(facts.iter().all(|fact| ran.stderr.contains(fact)), "{arguments}: {}", ran.stderr);
    }
}

/// Publishes on a channel every millisecond, as a driver does, while `then` runs.
fn with_live_traffic(url: &str, channel: &str, then: impl FnOnce()) {
    struct Over<'a>(&'a AtomicBool);
    impl Drop for Over<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::SeqCst);
        }
    }
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut bus = LcmBus::open(url).unwrap();
            while !over.load(Ordering::SeqCst) {
                bus.publish(channel, b"of a live robot").unwrap();
                bus.handle(Duration::from_millis(1)).unwrap();
            }
        });
        let _over = Over(&over);
        then();
    });
}

#[test]
fn play_refuses_to_drive_a_live_robot() {
    let log = folder("alive").join("log.lcmlog");
    let mut writer = LogWriter::create(&log).unwrap();
    for channel in ["A", channels::ROBOT_STATE, channels::ROBOT_COMMAND] {
        writer.write(channel, 0, b"x").unwrap();
    }
    writer.finish().unwrap();
    let url = url(4);
    for live in [channels::ROBOT_STATE, channels::ROBOT_COMMAND] {
        with_live_traffic(&url, live, || {
            let play = |more: &str| hoof(&format!("log play {} --lcm-url {url} {more}", log.display()));
            for (more, names) in [
                ("--channels A|ROBOT_.*", "ROBOT_STATE, ROBOT_COMMAND"),
                ("--channels A --rename A=PARAMETER_REQUEST", "PARAMETER_REQUEST"),
                // A recent one would damp the robot, as a second run does.
                ("--channels A --rename A=EXPECTED_ROBOT", "EXPECTED_ROBOT"),
                ("", "ROBOT_STATE, ROBOT_COMMAND"),
            ] {
                let error = play(more).exits(2).stderr;
                assert!([&url, live, names].iter().all(|fact| error.contains(fact)), "{error}");
            }
            for more in ["--channels A", "--channels ROBOT_STATE --rename ROBOT_STATE=OLD_STATE", "--force"] {
                play(more).exits(0);
            }
        });
    }
}
