//! Gaits from files: they walk, change while walking, replay bit for bit, and are named in reports and errors.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{folder, hoof, messages};
use lcmtypes::{ControllerTick, LegState, channels};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A walk of HyQ on flat ground: time, s, and what the operator changes.
fn scenario(seconds: f64, keys: &[(f64, &str)]) -> String {
    let entry = |(t_s, keys): &(f64, &str)| format!("[[operator]]\nt_s = {t_s:?}\n{keys}\n");
    let operator: String = keys.iter().map(entry).collect();
    format!("name = \"gaits\"\nduration_s = {seconds:?}\nseed = 1\n[terrain]\nkind = \"flat\"\n{operator}")
}

/// Writes a file of a test and returns its path.
fn file(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

const SIM: &str = "sim --robot hyq --json";

#[test]
fn trot_a_gait_of_a_file_and_crawl_follow_each_other_while_walking_and_replay_bit_for_bit() {
    let folder = folder("gait_switch");
    let keys = [
        (0.0, "mode = \"stand\""),
        (0.5, "mode = \"walk\"\nv_x = 0.1"),
        (2.0, "gait = \"crawl_lf_rf_lh_rh\""),
        (6.0, "gait = \"single_lf\""),
        (9.0, "gait = \"crawl\""),
    ];
    let walk = file(&folder, "walk.toml", &scenario(12.0, &keys));
    let log = folder.join("walk.mcap");
    // The names in this order have the numbers 2 to 7, then 8 to 11.
    let files = "--gait gaits/single_leg.toml --gait gaits/crawl_orders.toml";
    let run = hoof(&format!("{SIM} {files} --scenario {} --log {}", walk.display(), log.display())).exits(0).json();
    assert_eq!((&run["fell"], &run["safe_state"]), (&json!(false), &Value::Null));
    let mut gaits: Vec<i8> = messages::<LegState>(&log, channels::LEG_STATE).iter().map(|legs| legs.gait).collect();
    gaits.dedup();
    assert_eq!(gaits, [0, 4, 8, 1]);
    let replayed = hoof(&format!("replay {} --jobs 2 --json", log.display())).exits(0).json();
    assert_eq!((&replayed["identical"], &replayed["ticks"]), (&json!(true), &json!(12_000)));

    // The timeline of the report and the debugger have the names, from the parameters in the log.
    let plots = file(&folder, "plots.toml", "formats = [\"svg\"]\n[[figure]]\nkind = \"gait\"\n");
    let out = folder.join("report");
    let command = format!("report {} --plots {} --out {}", log.display(), plots.display(), out.display());
    hoof(&command).exits(0);
    let timeline = std::fs::read_to_string(out.join("happenings.json")).unwrap();
    let timeline: Value = serde_json::from_str(&timeline).unwrap();
    let changes = changes_of_gait(&timeline);
    let names: Vec<&str> = changes.iter().filter_map(|(_, text)| text.split_whitespace().last()).collect();
    assert_eq!(names, ["crawl_lf_rf_lh_rh", "single_lf", "crawl"], "{timeline}");
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    for ((tick, _), name) in changes.iter().zip(names) {
        assert!(page.contains(name), "{name}");
        let shown = hoof(&format!("replay {} --break {tick} --json", log.display())).exits(0).json();
        assert_eq!(shown["gait"]["gait"], name, "tick {tick}");
    }
}

/// Tick and text of every change of the gait in the timeline of a report.
fn changes_of_gait(timeline: &Value) -> Vec<(i64, String)> {
    match timeline {
        Value::Array(values) => values.iter().flat_map(changes_of_gait).collect(),
        Value::Object(entry) if entry.get("what").is_some_and(|what| what == "gait") => {
            vec![(entry["tick"].as_i64().unwrap(), entry["text"].as_str().unwrap().to_owned())]
        }
        Value::Object(entry) => entry.values().flat_map(changes_of_gait).collect(),
        _ => Vec::new(),
    }
}

/// With the commanded duty factor of 0.5 three legs of this gait would swing at phase 0; 0.6 leaves two. The gait file has 0.88.
#[test]
fn a_commanded_duty_factor_that_a_gait_does_not_allow_is_rejected_and_the_walk_goes_on() {
    let folder = folder("gait_duty");
    let amble = "[gait.amble]\nduty = 0.88\nswing_frequency = 3.0\nlift_off_phase = [0.0, 0.55, 0.8, 0.3]\nsway = 0.25\n\
                 residual_load = 0.05\n";
    let gaits = file(&folder, "amble.toml", amble);
    let keys = [
        (0.0, "mode = \"stand\"\ngait = \"amble\""),
        (0.5, "mode = \"walk\""),
        (4.0, "duty = 0.5"),
        (6.0, "duty = 0.86"),
    ];
    let walk = file(&folder, "walk.toml", &scenario(9.0, &keys));
    let log = folder.join("walk.mcap");
    let command = format!("{SIM} --gait {} --scenario {} --log {}", gaits.display(), walk.display(), log.display());
    let run = hoof(&command).exits(0).json();
    assert_eq!((&run["fell"], &run["safe_state"]), (&json!(false), &Value::Null));
    let ticks: Vec<ControllerTick> = messages(&log, channels::CONTROLLER_TICK);
    let rejected = |tick: &&ControllerTick| tick.fault == ControllerTick::FAULT_OPERATOR_RANGE;
    let numbers: Vec<i64> = ticks.iter().filter(rejected).map(|tick| tick.tick).collect();
    // Operator commands arrive within 0.1 s.
    assert!(numbers.first().is_some_and(|first| (4000..4110).contains(first)), "{:?}", numbers.first());
    assert!(numbers.last().is_some_and(|last| (5990..6110).contains(last)), "{:?}", numbers.last());
    for tick in ticks.iter().filter(rejected) {
        assert_eq!((tick.fault_index, tick.fault_value, tick.mode), (1, 0.5, ControllerTick::MODE_WALK));
    }
    // The duty factor of the gait stays: one leg swings at a time, and the gait is still this one.
    for legs in messages::<LegState>(&log, channels::LEG_STATE).into_iter().filter(|legs| legs.tick >= 500) {
        assert!(legs.state.iter().filter(|state| **state != LegState::STATE_STANCE).count() <= 1, "tick {}", legs.tick);
        assert_eq!(legs.gait, 2);
    }
}

/// A gait, and the velocity at which it walks in the test, m/s; `None` if it falls, as its file says.
type Shipped = (&'static str, Option<f64>);

/// The files of `gaits/` and their gaits.
const SHIPPED: [(&str, &[Shipped]); 4] = [
    (
        "crawl_orders",
        &[
            ("crawl_lf_rh_rf_lh", Some(0.1)),
            ("crawl_lf_lh_rf_rh", Some(0.1)),
            ("crawl_lf_rf_rh_lh", Some(0.1)),
            ("crawl_lf_rf_lh_rh", Some(0.1)),
            ("crawl_lf_rh_lh_rf", Some(0.1)),
            ("crawl_lf_lh_rh_rf", Some(0.1)),
        ],
    ),
    ("pace", &[("pace", None)]),
    ("bound", &[("bound", None)]),
    (
        "single_leg",
        &[("single_lf", Some(0.0)), ("single_rf", Some(0.0)), ("single_lh", Some(0.0)), ("single_rh", Some(0.0))],
    ),
];

#[test]
fn every_shipped_gait_walks_for_ten_seconds_or_falls_as_its_file_says() {
    let folder = folder("shipped");
    let mut files: Vec<String> =
        std::fs::read_dir("gaits").unwrap().map(|entry| stem(&entry.unwrap().path())).collect();
    files.sort();
    let mut known = SHIPPED.map(|(file, _)| file.to_owned());
    known.sort();
    assert_eq!(files, known);
    for (name, gaits) in SHIPPED {
        let text: toml::Table = std::fs::read_to_string(format!("gaits/{name}.toml")).unwrap().parse().unwrap();
        let mut listed: Vec<&str> = gaits.iter().map(|(gait, _)| *gait).collect();
        listed.sort_unstable();
        assert_eq!(text["gait"].as_table().unwrap().keys().collect::<Vec<_>>(), listed);
        for (gait, speed) in gaits {
            let keys = [
                (0.0, format!("mode = \"stand\"\ngait = \"{gait}\"")),
                (0.5, "mode = \"walk\"".to_owned()),
                (1.5, format!("v_x = {:?}", speed.unwrap_or(0.0))),
            ];
            let keys: Vec<(f64, &str)> = keys.iter().map(|(t_s, keys)| (*t_s, &**keys)).collect();
            let walk = file(&folder, "walk.toml", &scenario(10.5, &keys));
            let log = folder.join("walk.mcap");
            let command =
                format!("{SIM} --gait gaits/{name}.toml --scenario {} --log {}", walk.display(), log.display());
            let run = hoof(&command).json();
            let falls = run["fell"] != false || !run["safe_state"].is_null();
            assert_eq!(falls, speed.is_none(), "{gait}: {run}");
            if let Some(speed) = speed {
                let walked = run["distance_m"].as_f64().unwrap();
                assert!(walked > 0.7 * 9.0 * speed, "{gait}: {walked} m at {speed} m/s");
            }
        }
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap().to_str().unwrap().to_owned()
}

#[test]
fn wrong_gaits_are_errors_that_name_file_gait_key_and_value() {
    let folder = folder("errors");
    let good = "[gait.pace]\nduty = 0.55\nswing_frequency = 4.0\nlift_off_phase = [0.0, 0.5, 0.0, 0.5]\n";
    let walk = file(&folder, "walk.toml", &scenario(0.1, &[(0.0, "mode = \"stand\"\ngait = \"pace\"")]));
    let log = folder.join("x.mcap");
    let sim = |gaits: &str| hoof(&format!("{SIM} {gaits} --scenario {} --log {}", walk.display(), log.display()));
    let rejects = |gaits: &str, facts: &[&str]| {
        let ran = sim(gaits).exits(2);
        assert!(facts.iter().all(|fact| ran.stderr.contains(fact)), "{facts:?} in {}", ran.stderr);
        assert!(!log.exists());
    };
    rejects("", &["walk.toml:9", "operator[1].gait", "\"pace\"", "trot, crawl"]);
    let path = file(&folder, "gait.toml", good);
    let option = format!("--gait {}", path.display());
    rejects(&format!("{option} {option}"), &["gait.toml", "\"pace\"", "name"]);
    rejects("--gait gaits/no_such.toml", &["gaits/no_such.toml"]);
    for (from, to, facts) in [
        ("0.55", "1.5", &["gait.toml", "\"pace\"", "duty", "1.5", "at least 0.5"] as &[&str]),
        ("[0.0, 0.5, 0.0, 0.5]", "[0.0, 0.0, 0.0, 0.5]", &["gait.toml", "\"pace\"", "lift_off_phase", "3 legs swing"]),
        ("[0.0, 0.5, 0.0, 0.5]", "[-1, -1, -1, -1]", &["gait.toml", "\"pace\"", "lift_off_phase", "steps"]),
        ("duty", "dutty", &["gait.toml", "dutty", "`duty`"]),
        ("[gait.pace]", "[gait.trot]", &["gait.toml", "\"trot\"", "name"]),
        ("[gait.pace]", "[gait.\"\\u001b[2J\"]", &["gait.toml", "name", "\\u{1b}"]),
        ("[gait.pace]", "[wbc]\nfriction = 0.6\n[gait.pace]", &["gait.toml", "wbc"]),
    ] {
        assert!(good.contains(from));
        std::fs::write(&path, good.replace(from, to)).unwrap();
        rejects(&option, facts);
    }
    // A pace stands on the two legs of one side: a warning, with the part of the stride.
    std::fs::write(&path, good).unwrap();
    let ran = sim(&option).exits(0);
    assert_eq!(ran.stderr.matches("warning: gait pace").count(), 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("LF and LH") && ran.stderr.contains("45 %"), "{}", ran.stderr);
}
