//! Arguments that select nothing, times outside the log, and options whose value is out of range: exit code 2, and the error names them.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{events, folder, hoof, rewrite};
use lcmtypes::channels::{EVENT, RUN_INFO};
use lcmtypes::{Event, Message};
use std::path::Path;

#[track_caller]
fn rejects(arguments: &str, facts: &[&str]) {
    let ran = hoof(arguments).exits(2);
    assert_eq!(ran.stdout, "", "{arguments}");
    for fact in facts {
        assert!(ran.stderr.contains(fact), "hoof {arguments}\nfound    {}expected {fact}", ran.stderr);
    }
}

fn log(folder: &Path) -> String {
    let log = folder.join("run.mcap");
    let sim = "sim --robot hyq --scenario scenarios/short_flat.toml --seconds 0.5";
    hoof(&format!("{sim} --log {}", log.display())).exits(0);
    log.display().to_string()
}

#[test]
fn a_selection_without_channels_is_an_error_that_lists_them() {
    let folder = folder("channels");
    let log = log(&folder);
    let out = folder.join("out.mcap");
    for command in [
        format!("log cat {log} --channels NOPE"),
        format!("log filter {log} {} --channels NOPE", out.display()),
        format!("log trim {log} {} --from 0.1 --channels NOPE", out.display()),
        format!("log recover {log} {} --channels NOPE", out.display()),
        format!("log convert {log} {} --channels NOPE", out.display()),
        format!("log diff {log} {log} --channels NOPE"),
        format!("log play {log} --lcm-url memq:// --flat-out --channels NOPE"),
        format!("log play {log} --lcm-url memq:// --flat-out --rename NOPE=A"),
    ] {
        rejects(&command, &["NOPE", &log, RUN_INFO]);
    }
    assert!(!out.exists());
    rejects(&format!("log cat {log} --exclude .*"), &["--exclude", RUN_INFO]);
    hoof(&format!("log cat {log} --channels {RUN_INFO}")).exits(0);
}

#[test]
fn an_argument_is_named_by_its_own_error() {
    let folder = folder("arguments");
    let log = log(&folder);
    rejects(&format!("replay {log} --set wbc.mu=0.5"), &["--set: ", "wbc.mu", "friction"]);
    rejects(&format!("debug {log} --once --set wbc.mu=0.5"), &["--set: ", "wbc.mu"]);
    rejects(&format!("replay {log} --sweep wbc.friction=0.5:9:3"), &["--sweep: ", "wbc.friction", "0.05 to 2"]);
    rejects(&format!("replay {log} --sweep wbc.friction=0.5:0.6:1"), &["--sweep", "COUNT"]);
    rejects(&format!("debug {log} --once --at 99"), &["--at 99", &log, "0.000 s"]);
    // Times of ticks whose number of seconds as f64 is above or below the number of nanoseconds.
    for tick in [0, 43, 123, 243, 499] {
        let shown = hoof(&format!("debug {log} --once --json --at {}", f64::from(tick) / 1e3)).exits(0).json();
        assert_eq!(shown["tick"], tick);
    }
    rejects(&format!("log trim {log} x.mcap --from -1"), &["-1", "0 to 1e9"]);
    rejects("log record x.mcap --rotate-mb 0", &["--rotate-mb 0", "0.001"]);
    rejects("log record x.mcap --lcm-url udpm://239.255.76.67:0", &["port", "1 to 65535"]);
    rejects("set wbc.friction=", &["wbc.friction=", "KEY=VALUE"]);
    hoof(&format!("report {log} --json")).exits(0).json();
}

#[test]
fn foreign_text_reaches_no_terminal_raw() {
    const HOSTILE: &str = "\u{1b}[2J\u{9b}31m\u{7}\u{202e}\r\nEVIL";
    let folder = folder("escapes");
    let (log, hostile) = (log(&folder), folder.join("hostile.mcap"));
    rewrite(Path::new(&log), &hostile, |event| {
        if *event.channel == *RUN_INFO {
            let mut info = lcmtypes::RunInfo::decode(&event.data).unwrap();
            (info.robot, info.scenario_name, info.toolchain, info.revision) =
                (HOSTILE.into(), HOSTILE.into(), HOSTILE.into(), HOSTILE.into());
            event.data.clear();
            info.encode(&mut event.data).unwrap();
        } else if *event.channel == *EVENT {
            let mut text = Event::decode(&event.data).unwrap();
            (text.source, text.text) = (HOSTILE.into(), HOSTILE.into());
            event.data.clear();
            text.encode(&mut event.data).unwrap();
        }
    });
    assert!(events(&hostile).iter().any(|event| *event.channel == *EVENT));
    let log = hostile.display();
    let shown = folder.join("report");
    for command in [
        format!("log info {log}"),
        format!("log verify {log}"),
        format!("log cat {log}"),
        format!("log cat {log} --json"),
        format!("replay {log}"),
        format!("replay {log} --json"),
        format!("replay {log} --break 10"),
        format!("debug {log} --once"),
        format!("spy --once --log {log}"),
        format!("report {log} --out {}", shown.display()),
    ] {
        let ran = hoof(&command);
        for c in (ran.stdout + &ran.stderr).chars().filter(|c| *c != '\n') {
            assert!(!c.is_control() && c != '\u{202e}', "{command}: {c:?}");
        }
    }
}
