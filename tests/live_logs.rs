//! Logs of an earlier run, or of one in progress, when `hoof run` or `hoof log record` is started again.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::live_process::LiveProcess;
use common::network::{self, url};
use common::{events, folder, hoof};
use std::path::Path;

#[test]
fn a_run_that_cannot_start_keeps_the_log_of_the_last_one() {
    let folder = folder("wrong");
    let (file, log) = (folder.join("run.toml"), folder.join("run.mcap"));
    std::fs::write(&log, "content of the last run").unwrap();
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/short_flat.toml");
    let (log_key, scenario) = (format!("log = {log:?}\n"), format!("[simulation]\nscenario = {scenario:?}\n"));
    for (text, named) in [
        (format!("robot = \"hyqq\"\n{log_key}{scenario}"), "\"hyqq\""),
        (format!("robot = \"hyq\"\n{log_key}[simulation]\nscenario = \"nope.toml\"\n"), "nope.toml"),
        (format!("robot = \"hyq\"\n{log_key}{scenario}[[controller]]\nname = \"quadrupd\"\n"), "\"quadrupd\""),
        (format!("robot = \"hyq\"\n{log_key}set = [\"trunk.kpp=3\"]\n{scenario}"), "kpp"),
        (format!("robot = \"hyq\"\n{log_key}faults = \"nope.toml\"\n{scenario}"), "nope.toml"),
    ] {
        std::fs::write(&file, text).unwrap();
        let ran = hoof(&format!("run {} --ticks 100 --lcm-url {}", file.display(), url(0))).exits(2);
        assert!(ran.stderr.contains(named) && !ran.stderr.contains("recorder"), "{}", ran.stderr);
        assert_eq!(std::fs::read_to_string(&log).unwrap(), "content of the last run", "{}", ran.stderr);
    }
}

#[test]
fn a_second_run_is_refused_during_the_first_and_keeps_its_log_afterwards() {
    let (folder, url) = (folder("second"), url(1));
    let log = folder.join("run.mcap");
    let mut first = LiveProcess::run(&url, &log, "--seconds 60");
    first.wait_for(&["controller: controlling"]);
    let run = format!("run runs/hyq_sim.toml --scenario scenarios/short_flat.toml --log {}", log.display());
    let second = hoof(&format!("{run} --ticks 100 --lcm-url {url}")).exits(2);
    assert!(
        ["driver", "ROBOT_STATE", url.split('?').next().unwrap()].iter().all(|name| second.stderr.contains(name)),
        "{}",
        second.stderr
    );
    // On another network, so that only the log is in use.
    let second = hoof(&format!("log record {} --lcm-url {}", log.display(), network::url(2))).exits(2);
    assert!(second.stderr.contains(&log.display().to_string()), "{}", second.stderr);
    first.interrupt();
    first.end();
    let kept = std::fs::read(&log).unwrap();
    hoof(&format!("replay {}", log.display())).exits(0);

    let third = hoof(&format!("{run} --json --ticks 100 --lcm-url {url}")).exits_as_reported();
    let aside = folder.join("run.1.mcap");
    assert!(third.stderr.contains(&aside.display().to_string()), "{}", third.stderr);
    assert!(std::fs::read(&aside).unwrap() == kept, "not the log of the first run");
    assert!(events(&log).len() > 100);
}
