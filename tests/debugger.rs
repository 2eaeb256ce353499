//! Debugging a log: all quantities of a tick, events, what-if replays, simulating again, runs that check their own replay.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{events, folder, hoof, messages};
use lcmtypes::channels::{EVENT, LEG_STATE, WBC_SOLUTION};
use lcmtypes::{Event, LegState, Message, WbcSolution};
use serde_json::{Value, json};
use std::path::Path;

fn run(log: &Path, more: &str) {
    hoof(&format!("sim --robot hyq --scenario scenarios/short_flat.toml --log {} {more}", log.display())).exits(0);
}

#[test]
fn break_shows_every_quantity_of_a_tick() {
    let folder = folder("break");
    let log = folder.join("run.mcap");
    run(&log, "");
    let tick = hoof(&format!("replay {} --break 1234 --json", log.display())).exits(0).json();
    for stage in ["input", "estimation", "gait", "tasks", "qp", "output", "recorded", "replayed"] {
        assert!(tick[stage].is_object(), "{stage}");
    }
    // The dump contains the values that were sent.
    let wbc: Vec<WbcSolution> = messages(&log, WBC_SOLUTION);
    let sent: Vec<f64> = serde_json::from_value(tick["qp"]["vd"].clone()).unwrap();
    assert_eq!(sent, wbc[1234].vd);
    assert_eq!(tick["qp"]["levels"][0]["terms"][1]["task"], "trunk");
    assert_eq!(tick["estimation"]["M"].as_array().unwrap().len(), 18);
    assert_eq!(tick["recorded"], tick["replayed"]);
    let text = hoof(&format!("replay {} --break 1234", log.display())).exits(0).stdout;
    assert!(text.contains("estimation") && text.contains("18 x 18"), "{text}");

    let ran = hoof(&format!("replay {} --break 2000", log.display())).exits(2);
    assert!(ran.stderr.contains("2000") && ran.stderr.contains("1999"), "{}", ran.stderr);
    let ran = hoof(&format!("replay {} --from 2.5", log.display())).exits(2);
    assert!(ran.stderr.contains("2.5") && ran.stderr.contains("1.999 s"), "{}", ran.stderr);
}

#[test]
fn the_debugger_finds_events() {
    let folder = folder("debug");
    let log = folder.join("run.mcap");
    run(&log, "");
    let legs: Vec<LegState> = messages(&log, LEG_STATE);
    let lands = |pair: &[LegState]| {
        let (before, now) = (pair[0].state, pair[1].state);
        (0..4).any(|i| before[i] != LegState::STATE_STANCE && now[i] == LegState::STATE_STANCE)
    };
    let touchdown = legs.windows(2).position(lands).unwrap() as i64 + 1;
    let found = hoof(&format!("debug {} --once --json --next touchdown", log.display())).exits(0).json();
    assert_eq!((&found["tick"], &found["events"][0]["kind"]), (&json!(touchdown), &json!("touchdown")));

    let screen = hoof(&format!("debug {} --once --tick {touchdown}", log.display())).exits(0).stdout;
    for shown in [&format!("tick {touchdown} "), "touchdown", "level 1: Solved", "posture", "WALK"] {
        assert!(screen.contains(shown), "{shown}:\n{screen}");
    }
    let changed = format!("debug {} --once --json --next divergence --set swing.height=0.11", log.display());
    let lift_off = legs.iter().find(|legs| legs.state.iter().any(|s| *s != LegState::STATE_STANCE)).unwrap().tick;
    let found = hoof(&changed).exits(1).json();
    assert_eq!((&found["tick"], &found["difference"]["stage"]), (&json!(lift_off), &json!("gait")));
    let ran = hoof(&format!("debug {} --once --next qp-failure", log.display())).exits(2);
    assert!(ran.stderr.contains("tick 0"), "{}", ran.stderr);
}

/// With too few iterations allowed, the solver fails; the debugger goes to the first failure. Contradicting constraints are covered by the controller's
/// tests: the programs of a standing robot have none.
#[test]
fn the_debugger_finds_a_solver_failure() {
    let folder = folder("failure");
    let log = folder.join("run.mcap");
    run(&log, "--set wbc.max_iterations=12");
    let found = hoof(&format!("debug {} --once --json --next qp-failure", log.display())).exits(0).json();
    let statuses: Vec<i8> = messages::<WbcSolution>(&log, WBC_SOLUTION).iter().map(|wbc| wbc.status).collect();
    let first = statuses.iter().skip(1).position(|status| *status != WbcSolution::STATUS_SOLVED).unwrap() + 1;
    assert_eq!((&found["tick"], &found["qp"]["solved"]), (&json!(first), &json!(false)));
    assert_eq!((&found["qp"]["levels"][0]["status"], &found["qp"]["conflict"]), (&json!("Failed"), &json!([])));
}

#[test]
fn a_sweep_reports_the_tick_at_which_each_value_departs_from_the_record() {
    let folder = folder("sweep");
    let log = folder.join("run.mcap");
    run(&log, "");
    let plot = folder.join("sweep.svg");
    let sweep = |more: &str| {
        let command = format!("replay {} --sweep posture.stance_kp=450:550:3 --json {more}", log.display());
        hoof(&command).exits(0).json()["rows"].as_array().unwrap().clone()
    };
    let rows = sweep(&format!("--bound 5 --plot {}", plot.display()));
    let identical: Vec<&Value> = rows.iter().map(|row| &row["identical"]).collect();
    assert_eq!(identical, [false, true, false]);
    assert_eq!(rows[1]["departure"], Value::Null);
    assert!(rows[0]["departure"]["tick"].is_i64() && rows[0]["tau_difference_max"].as_f64().unwrap() <= 5.0);
    let wider = sweep("--bound 1e9 --jobs 1");
    assert!(wider.iter().all(|row| row["departure"].is_null() && row["ticks"] == 2000));
    assert!(std::fs::read_to_string(plot).unwrap().contains("<svg"));
}

#[test]
fn resim_with_unchanged_parameters_repeats_the_log() {
    let folder = folder("resim");
    let (log, again, changed) = (folder.join("run.mcap"), folder.join("again.mcap"), folder.join("changed.mcap"));
    run(&log, "--seconds 1.5 --seed 7");
    let same = hoof(&format!("replay {} --json --resim {}", log.display(), again.display())).exits(0).json();
    assert_eq!((&same["same_bits"], &same["recorded"]["tracking"]), (&json!(true), &same["simulated"]["tracking"]));
    let set = format!("replay {} --json --resim {} --set swing.height=0.08", log.display(), changed.display());
    let other = hoof(&set).exits(0).json();
    assert_eq!(other["same_bits"], false);
    assert!(other["recorded"]["tracking"] != other["simulated"]["tracking"]);
}

#[test]
fn prove_writes_the_verdict_of_a_replay_into_the_log() {
    let folder = folder("prove");
    for name in ["run.mcap", "run.lcmlog"] {
        let log = folder.join(name);
        run(&log, "--prove");
        let last = events(&log).into_iter().rfind(|event| *event.channel == *EVENT).unwrap();
        let verdict = Event::decode(&last.data).unwrap();
        assert_eq!((verdict.source.as_str(), verdict.level, verdict.tick), ("proof", Event::LEVEL_INFO, -1));
        assert!(verdict.text.contains("2000 ticks") && verdict.text.contains("12002"), "{}", verdict.text);
        assert_eq!(hoof(&format!("replay {} --json", log.display())).exits(0).json()["identical"], true);
    }
}

#[test]
fn a_field_log_becomes_a_small_golden_log() {
    let folder = folder("around");
    let (log, corpus) = (folder.join("run.mcap"), folder.join("corpus"));
    std::fs::create_dir(&corpus).unwrap();
    run(&log, "");
    let add = format!("corpus add {} --around 1.4 --span 0.4 --name stumble --why x --keep all", log.display());
    hoof(&format!("{add} --dir {}", corpus.display())).exits(0);
    let check = format!("corpus check --json --dir {}", corpus.display());
    let found = hoof(&check).exits(0).json()["logs"][0].take();
    // From the tick after the snapshot of tick 1000 up to 1.6 s.
    assert_eq!((&found["identical"], &found["ticks"]), (&json!(true), &json!(599)));
    let size = |path: &Path| std::fs::metadata(path).unwrap().len();
    assert!(size(&corpus.join("stumble.mcap")) < size(&log) / 2);
    // Another file under the name of the golden log.
    let bytes = std::fs::read(&log).unwrap();
    std::fs::write(corpus.join("stumble.mcap"), bytes).unwrap();
    let found = hoof(&check).exits(1).json()["logs"][0].take();
    assert_eq!((&found["altered"], &found["identical"]), (&json!(true), &json!(false)));
}
