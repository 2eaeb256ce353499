//! Golden logs: the controller repeats them, a changed log fails at its tick, an accepted log has a reason.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{folder, hoof, rewrite, rewrite_one};
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_TICK, ROBOT_COMMAND, ROBOT_STATE};
use lcmtypes::{ControllerInput, ControllerTick, Message, RobotCommand, RobotState};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

#[test]
fn every_golden_log_is_repeated_bit_for_bit() {
    let logs = hoof("corpus check --json").exits(0).json()["logs"].as_array().unwrap().clone();
    assert!(logs.len() >= 2, "{logs:#?}");
    for log in &logs {
        assert_eq!((&log["identical"], &log["error"]), (&json!(true), &Value::Null), "{log:#}");
        assert!(log["ticks"].as_u64().unwrap() >= 1000, "{log:#}");
    }
}

/// A corpus of one log, made of a fresh run, so that nothing here depends on what is in logs/golden.
fn corpus(test: &str) -> (PathBuf, PathBuf) {
    let folder = folder(test);
    let (run, corpus) = (folder.join("run.mcap"), folder.join("corpus"));
    std::fs::create_dir(&corpus).unwrap();
    hoof(&format!("sim --robot hyq --scenario scenarios/short_flat.toml --log {}", run.display())).exits(0);
    hoof(&format!("corpus add {} --name trot --why first --dir {}", run.display(), corpus.display())).exits(0);
    let log = corpus.join("trot.mcap");
    (corpus, log)
}

fn check(corpus: &Path, code: i32) -> Value {
    let mut logs = hoof(&format!("corpus check --json --dir {}", corpus.display())).exits(code).json();
    assert_eq!(logs["logs"].as_array().unwrap().len(), 1);
    logs["logs"][0].take()
}

/// Puts an altered copy of a log in its place.
fn alter(log: &Path, change: impl Fn(&Path, &Path)) {
    let altered = log.with_extension("altered.mcap");
    change(log, &altered);
    std::fs::rename(altered, log).unwrap();
}

#[test]
fn a_changed_log_fails_by_tick_and_stage_until_it_is_accepted_with_a_reason() {
    let (corpus, log) = corpus("changed_output");
    assert_eq!(check(&corpus, 0)["ticks"], 2000);
    // As if the controller computed another task in tick 1500.
    alter(&log, |log, altered| {
        rewrite_one(log, altered, CONTROLLER_TICK, 1500, |tick: &mut ControllerTick| tick.digest[3] ^= 1);
    });
    let found = check(&corpus, 1);
    assert_eq!(found["identical"], false);
    let divergence = &found["first_divergence"];
    assert_eq!((&divergence["tick"], &divergence["stage"]), (&json!(1500), &json!("tasks")), "{divergence:#}");
    assert_eq!(divergence["t_s"], 1.5);
    let text = hoof(&format!("corpus check --dir {}", corpus.display())).exits(1).stdout;
    assert!(text.starts_with("trot: ") && text.contains("1500") && text.contains("tasks"), "{text}");

    let accept = format!("corpus accept trot --why better_tasks --json --dir {}", corpus.display());
    assert_eq!(hoof(&accept).exits(0).json()["before"], found);
    assert_eq!(check(&corpus, 0)["ticks"], 2000);
    for file in ["corpus.toml", "README.md"] {
        let text = std::fs::read_to_string(corpus.join(file)).unwrap();
        assert!(text.contains("better_tasks") && !text.contains("first"), "{file}: {text}");
    }
    let mut files: Vec<_> = std::fs::read_dir(&corpus).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    files.sort();
    assert_eq!(files, ["README.md", "corpus.toml", "trot.mcap"]);
}

#[test]
fn a_changed_input_fails_at_its_tick() {
    let (corpus, log) = corpus("changed_input");
    alter(&log, |log, altered| {
        rewrite_one(log, altered, CONTROLLER_INPUT, 42, |input: &mut ControllerInput| {
            assert!(input.change(ROBOT_STATE, |state: &mut RobotState| {
                state.tau[0] = f64::from_bits(state.tau[0].to_bits() ^ 1);
            }));
        });
    });
    let divergence = check(&corpus, 1)["first_divergence"].take();
    assert_eq!((&divergence["tick"], &divergence["stage"]), (&json!(42), &json!("input")));
}

/// Torques of another controller: the page lists the first sampled difference and contains only the changed figures.
#[test]
fn the_page_shows_recorded_and_replayed_values() {
    let (corpus, log) = corpus("page");
    alter(&log, |log, altered| {
        rewrite(log, altered, |event| {
            if *event.channel == *ROBOT_COMMAND {
                let mut command = RobotCommand::decode(&event.data).unwrap();
                if command.tick >= 1010 {
                    command.tau[3] += 10.0;
                }
                event.data.clear();
                command.encode(&mut event.data).unwrap();
            }
        });
    });
    let out = corpus.with_file_name("page");
    let found = hoof(&format!("corpus check --json --dir {} --html {}", corpus.display(), out.display())).exits(1);
    let json = found.json();
    assert_eq!(json["page"], json!(out.join("index.html")));
    let found_tick = json["logs"][0]["first_divergence"]["tick"].as_i64().unwrap();
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    // Kept are the ticks 1000, 1020, …, 1980: 49 of 100 differ.
    let row =
        "<td>ROBOT_COMMAND</td><td class=\"n\">49</td><td class=\"n\">100</td><td class=\"n\">1020</td><td>tau[3]</td>";
    assert!(page.contains(row), "{page:.20000}");
    let headings: Vec<_> =
        page.match_indices("<h3>").map(|(at, _)| page[at + 4..].split('<').next().unwrap()).collect();
    assert_eq!(headings, ["Joints"]);
    for (words, times) in [("<b>ROBOT_COMMAND.tau[3].</b>", 1), ("<figcaption>before", 1), ("<figcaption>after", 1)] {
        assert_eq!(page.matches(words).count(), times, "{words}");
    }
    assert_eq!(found_tick, 1020);
    let files: Vec<_> = std::fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(files, ["index.html"]);
}

#[test]
fn a_cut_or_missing_log_fails() {
    let (corpus, log) = corpus("cut");
    let whole = std::fs::read(&log).unwrap();
    std::fs::write(&log, &whole[..whole.len() / 2]).unwrap();
    let found = check(&corpus, 1);
    assert!(found["identical"] == false && found["error"].is_string(), "{found:#}");
    std::fs::remove_file(&log).unwrap();
    let error = check(&corpus, 1)["error"].take();
    assert!(error.as_str().unwrap().contains("trot.mcap"), "{error}");
}

#[test]
fn an_unknown_golden_log_is_an_error() {
    let (corpus, _) = corpus("unknown");
    let ran = hoof(&format!("corpus accept gallop --why x --dir {}", corpus.display())).exits(2);
    assert!(["corpus.toml", "gallop", "trot"].iter().all(|name| ran.stderr.contains(name)), "{}", ran.stderr);
}
