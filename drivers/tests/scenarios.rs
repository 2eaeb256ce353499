//! The scenarios of the project.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use controller::params::{Params, add_gaits};
use controller::quadruped::params::GaitParams;
use drivers::{DriverError, Scenario};
use lcmtypes::OperatorCommand;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios")
}

#[test]
fn every_scenario_is_valid_and_has_the_name_of_its_file() {
    let mut params = std::fs::read_to_string(folder().join("../robots/hyq/hyq.toml")).unwrap();
    for entry in std::fs::read_dir(folder().join("../gaits")).unwrap() {
        let path = entry.unwrap().path();
        params = add_gaits(&params, &std::fs::read_to_string(&path).unwrap(), &path.display().to_string()).unwrap();
    }
    let gaits = Params::from_toml(&params, "hyq").unwrap().gait;
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        let scenario = Scenario::load(&path, &gaits).unwrap();
        assert_eq!(Some(scenario.name.as_str()), path.file_stem().and_then(|stem| stem.to_str()));
        names.push(scenario.name);
    }
    for name in ["flat_trot", "rough_trot", "stand", "push_trot"] {
        assert!(names.iter().any(|found| found == name), "no scenario {name}");
    }
}

#[test]
fn rough_trot_stands_walks_in_all_directions_and_stands() {
    let mut script = Scenario::load(&folder().join("rough_trot.toml"), &GaitParams::default()).unwrap().operator;
    let sent: Vec<OperatorCommand> = (0..20_000).filter_map(|ms| script.operator_at(ms * 1_000_000)).collect();
    let mode_at = |t_s: i64| {
        sent.iter().take_while(|command| command.t_ns <= t_s * 1_000_000_000).last().map(|command| command.mode)
    };
    assert_eq!(mode_at(0), Some(OperatorCommand::MODE_STAND));
    assert_eq!(mode_at(10), Some(OperatorCommand::MODE_WALK));
    assert_eq!(mode_at(19), Some(OperatorCommand::MODE_STAND));
    let range = |value: fn(&OperatorCommand) -> f64| {
        sent.iter().map(value).fold((0.0f64, 0.0f64), |(low, high), value| (low.min(value), high.max(value)))
    };
    assert_eq!(range(|command| command.v_H[0]), (0.0, 0.3));
    assert_eq!(range(|command| command.v_H[1]), (-0.1, 0.1));
    assert_eq!(range(|command| command.yaw_rate), (-0.2, 0.2));
}

#[test]
fn a_missing_scenario_is_an_error_with_its_path() {
    let error = Scenario::load(Path::new("scenarios/nowhere.toml"), &GaitParams::default()).unwrap_err();
    assert!(matches!(&error, DriverError::Read { path, .. } if path.ends_with("nowhere.toml")), "{error}");
}
