//! What becomes of the log of an earlier run, or of one that goes on, when `hoof run` and `hoof log record` are started again.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::talker::Talker;
use common::{events, folder, hoof};
use std::path::Path;

fn url(test: u32) -> String {
    format!("udpm://239.255.78.6:{}?ttl=0&recv_buf_size=2000000", 20_000 + std::process::id() % 4000 * 10 + test)
}

#[test]
fn a_run_that_cannot_be_leaves_the_log_of_the_last_one_alone() {
    let folder = folder("wrong");
    let (file, log) = (folder.join("run.toml"), folder.join("run.mcap"));
    std::fs::write(&log, "of the last run").unwrap();
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/short_flat.toml");
    let (log_key, scenario) = (format!("log = {log:?}\n"), format!("[simulation]\nscenario = {scenario:?}\n"));
    for (text, wanted) in [
        (format!("robot = \"hyqq\"\n{log_key}{scenario}"), "no robot \"hyqq\""),
        (format!("robot = \"hyq\"\n{log_key}[simulation]\nscenario = \"nope.toml\"\n"), "nope.toml"),
        (format!("robot = \"hyq\"\n{log_key}{scenario}[[controller]]\nname = \"quadrupd\"\n"), "\"quadrupd\""),
        (format!("robot = \"hyq\"\n{log_key}set = [\"trunk.kpp=3\"]\n{scenario}"), "kpp"),
        (format!("robot = \"hyq\"\n{log_key}faults = \"nope.toml\"\n{scenario}"), "nope.toml"),
    ] {
        std::fs::write(&file, text).unwrap();
        let ran = hoof(&format!("run {} --ticks 100 --lcm-url {}", file.display(), url(0))).exits(2);
        assert!(ran.stderr.contains(wanted) && !ran.stderr.contains("recorder"), "{}", ran.stderr);
        assert_eq!(std::fs::read_to_string(&log).unwrap(), "of the last run", "{}", ran.stderr);
    }
}

#[test]
fn a_second_run_is_refused_while_the_first_goes_on_and_keeps_its_log_when_it_has_ended() {
    let (folder, url) = (folder("second"), url(1));
    let log = folder.join("run.mcap");
    let mut first = Talker::run(&url, &log, "--seconds 60");
    first.hear(&["controller: controlling"]);
    let run = format!("run runs/hyq_sim.toml --scenario scenarios/short_flat.toml --log {}", log.display());
    let second = hoof(&format!("{run} --ticks 100 --lcm-url {url}")).exits(2);
    assert!(second.stderr.starts_with("error: another driver sends ROBOT_STATE on udpm://"), "{}", second.stderr);
    // On another network, so that it is the log that stops it.
    let second = hoof(&format!("log record {} --lcm-url {}", log.display(), self::url(2))).exits(2);
    let wanted = format!("error: {}: another process is recording into it", log.display());
    assert_eq!(second.stderr.trim_end(), wanted);
    first.interrupt();
    first.end();
    let kept = std::fs::read(&log).unwrap();
    hoof(&format!("replay {}", log.display())).exits(0);

    let third = hoof(&format!("{run} --ticks 100 --lcm-url {url}"));
    let aside = folder.join("run.1.mcap");
    let said = format!("recorder: the log that had this name is {} now", aside.display());
    assert!(third.code < 2 && third.stderr.contains(&said), "{}", third.stderr);
    assert!(std::fs::read(&aside).unwrap() == kept, "not the log of the first run");
    assert!(events(&log).len() > 100);
}
