//! `hoof report`: figures selected by a file, several logs, limits.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{folder, hoof};
use std::path::Path;
use test_support::replace_once;

/// Simulates two seconds into `FOLDER/NAME.mcap`; returns the path of the log.
fn run(folder: &Path, name: &str) -> String {
    simulate(folder, name).0
}

/// As [`run`], with the JSON that `hoof sim` prints.
fn simulate(folder: &Path, name: &str) -> (String, serde_json::Value) {
    let log = folder.join(format!("{name}.mcap")).display().to_string();
    let ran = hoof(&format!("sim --robot hyq --scenario scenarios/short_flat.toml --log {log} --json")).exits(0);
    (log, ran.json())
}

/// Writes a file into a folder; returns its path.
fn file(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

#[test]
fn the_printed_plots_can_be_used() {
    let folder = folder("print_plots");
    let log = run(&folder, "flat_trot");
    let printed = hoof("report --print-plots").exits(0).stdout;
    assert_eq!(printed.matches("\n[[figure]]\n").count(), 15);
    let quick = replace_once(&printed, "[\"svg\", \"pdf\", \"png\"]", "[\"svg\"]");
    let plots = file(&folder, "plots.toml", &quick);
    let out = folder.join("out");
    let ran = hoof(&format!("report {log} --plots {plots} --out {}", out.display())).exits(0);
    assert!(ran.stdout.contains("roll [rad]"), "{}", ran.stdout);
    for name in ["report.html", "walk.svg", "joint_torque.svg", "timing.tex", "happenings.json"] {
        assert!(out.join(name).exists(), "{name}");
    }
    let unknown = file(&folder, "unknown.toml", &replace_once(&quick, "png_dpi", "dpi"));
    let ran = hoof(&format!("report {log} --plots {unknown} --out {}", out.display())).exits(2);
    assert!(ran.stderr.contains("unknown.toml") && ran.stderr.contains("unknown field `dpi`"), "{}", ran.stderr);
}

#[test]
fn a_violated_limit_gives_exit_code_1() {
    let folder = folder("limits");
    let log = run(&folder, "flat_trot");
    let met =
        file(&folder, "met.toml", "[limits]\n\"tracking.pitch.std\" = 0.02\n\"safety.fell\" = { equals = false }\n");
    let ran = hoof(&format!("report {log} --check {met}")).exits(0);
    assert!(ran.stdout.contains("pass safety.fell = false"), "{}", ran.stdout);
    let strict = file(&folder, "strict.toml", "[limits]\n\"tracking.pitch.std\" = 0.0\n");
    let ran = hoof(&format!("report {log} --check {strict} --json")).exits(1);
    let json = ran.json();
    assert_eq!((json["pass"].as_bool(), json["check"][0]["limits"][0]["pass"].as_bool()), (Some(false), Some(false)));
    let typed = file(&folder, "typed.toml", "[limits]\n\"tracking.pich.std\" = 0.0\n");
    let ran = hoof(&format!("report {log} --check {typed}")).exits(2);
    assert!(
        ran.stderr.contains("`tracking.pich.std`") && ran.stderr.contains("`tracking.pitch.std`"),
        "{}",
        ran.stderr
    );
}

#[test]
fn sim_and_report_agree_on_the_distance_walked() {
    let folder = folder("distance");
    let (log, sim) = simulate(&folder, "flat_trot");
    let plots = file(&folder, "plots.toml", "formats = [\"svg\"]\n[[figure]]\nkind = \"gait\"\n");
    let out = folder.join("out");
    let report = hoof(&format!("report {log} --plots {plots} --out {} --json", out.display())).exits(0).json();
    assert!(sim["distance_m"].as_f64().unwrap() > 0.0, "{sim}");
    assert_eq!(report["metrics"]["locomotion"]["distance_m"], sim["distance_m"]);
}

#[test]
fn two_logs_are_overlaid_and_compared() {
    let folder = folder("two");
    let (log, other) = (run(&folder, "one"), run(&folder, "other"));
    let plots = file(&folder, "plots.toml", "formats = [\"svg\"]\n[[figure]]\nkind = \"base_tracking\"\n");
    let out = folder.join("out");
    let arguments = format!("report {log} {other} --name flat --name rough --plots {plots} --out {}", out.display());
    let ran = hoof(&format!("{arguments} --json")).exits(0);
    assert_eq!(ran.json()["runs"][1]["name"], "rough");
    let svg = std::fs::read_to_string(out.join("base_tracking.svg")).unwrap();
    assert!(svg.contains(">flat</text>") && svg.contains(">rough</text>"));
    assert!(std::fs::read_to_string(out.join("comparison.tex")).unwrap().contains(" & flat & rough & mean & std \\\\"));
}
