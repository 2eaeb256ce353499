//! Robots that are not quadrupeds with the tools that every run has: simulation with proof, replay, report, debugger, export.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{folder, hoof};

/// With soft knees COMAN sinks: simulation and report say so. A quadruped's options and scenarios are refused by name.
#[test]
fn a_fall_is_reported_and_options_of_quadrupeds_are_refused() {
    let folder = folder("falls");
    let log = folder.join("run.mcap");
    let sim = |robot: &str, more: &str| {
        hoof(&format!("sim --robot {robot} --log {} --seconds 2 --json {more}", log.display()))
    };
    let soft = "--set robot.joints.LKneeSag.stiffness=1.0 --set robot.joints.RKneeSag.stiffness=1.0";
    let fell = sim("coman", &format!("--scenario scenarios/hold.toml {soft}")).exits(1).json();
    assert_eq!(fell["fell"], true);
    let metrics = hoof(&format!("report {} --json", log.display())).exits(0).json()["metrics"].clone();
    assert_eq!(metrics["safety"]["fell"], true);
    let (sim_s, report_s) = (fell["fell_at_s"].as_f64().unwrap(), metrics["safety"]["fell_at_s"].as_f64().unwrap());
    assert!((sim_s - report_s).abs() < 0.0015, "{sim_s} {report_s}");
    for (more, named) in [
        ("--scenario scenarios/flat_trot.toml", "scenarios/hold.toml"),
        ("--scenario scenarios/hold.toml --stack s1", "--stack"),
        ("--scenario scenarios/hold.toml --gait gaits/pace.toml", "--gait"),
    ] {
        let refused = sim("coman", more).exits(2);
        assert!(refused.stderr.contains(named) && refused.stderr.contains("robot.feet"), "{}", refused.stderr);
    }
}

/// A log of Centauro replays bit for bit, and a log with one changed bit of an output does not; report, debugger, spy and ROS 2 export read it.
#[test]
fn a_log_of_centauro_works_with_every_tool() {
    let folder = folder("any_robot");
    for (robot, joints) in [("centauro", 39), ("coman_plus", 28), ("centauro_upper", 15)] {
        let log = folder.join(format!("{robot}.mcap"));
        let log = log.display();
        let sim = format!(
            "sim --robot {robot} --scenario scenarios/hold.toml --seconds 2 --set hold.duration=0.5 --log {log} --json"
        );
        let summary = hoof(&sim).exits(0).json();
        assert_eq!((&summary["fell"], &summary["ticks"]), (&false.into(), &2000.into()), "{robot}");
        let replay = hoof(&format!("replay {log} --json")).exits(0).json();
        assert_eq!((&replay["identical"], &replay["ticks"]), (&true.into(), &2000.into()), "{robot}: {replay}");
        // Another motion is another output.
        let other = hoof(&format!("replay {log} --set hold.duration=0.6 --json")).exits(1).json();
        assert_eq!(other["identical"], false, "{robot}");
        // The report of a robot without feet: what `hoof sim` said of the fall, and no rows of legs or of the published quadruped.
        let metrics = hoof(&format!("report {log} --json")).exits(0).json()["metrics"].clone();
        assert_eq!(
            (&metrics["run"]["quadruped"], &metrics["safety"]["fell"]),
            (&false.into(), &false.into()),
            "{robot}"
        );
        assert!(metrics["slip"].is_null() && metrics["contact"].is_null(), "{robot}");
        assert_eq!(metrics["tracking"]["feet"], serde_json::json!([]), "{robot}");
        let height = metrics["safety"]["min_height_m"].as_f64();
        assert_eq!(height.is_some_and(|height| height > 0.4), robot != "centauro_upper", "{robot}: {height:?}");
        let report = folder.join(format!("report_{robot}"));
        let written = hoof(&format!("report {log} --out {}", report.display())).exits(0);
        let page = std::fs::read_to_string(report.join("report.html")).unwrap();
        assert!(!page.contains("Table 3") && !written.stdout.contains("Tracking error"), "{robot}");
        hoof(&format!(
            "log convert {log} {} --to mcap --encoding ros2",
            folder.join(format!("{robot}_ros2.mcap")).display()
        ))
        .exits(0);
        hoof(&format!("debug {log} --tick 500 --once")).exits(0);
        let info = hoof(&format!("log info {log} --json")).exits(0).json();
        assert_eq!(info["runs"][0]["robot"], robot, "{info}");
        assert_eq!(hoof(&format!("robot info {robot} --json")).exits(0).json()["dof"], joints);
    }
}
