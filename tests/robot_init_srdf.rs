//! `hoof robot init --srdf`: groups, postures, passive joints and disabled collisions of public SRDFs are in the file that it writes.
//!
//! `scripts/fetch_robots.sh` fetches the files, which are not part of this repository.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{folder, hoof};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Folder of the public robots.
fn robots() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("../robots/example-robot-data/robots")
}

/// Writes a file for `URDF` and `srdf/SRDF` of the folder `ROBOT_description`; returns its table `[robot]`, the remarks, and what `hoof robot info`
/// prints of it.
fn init(robot: &str, urdf: &str, srdf: &str, options: &str) -> (toml::Table, String, Value) {
    let from = robots().join(format!("{robot}_description"));
    let (urdf, srdf) = (from.join(urdf), from.join("srdf").join(srdf));
    assert!(srdf.exists(), "{}: run scripts/fetch_robots.sh", srdf.display());
    let out = folder(&format!("srdf_{}", srdf.file_stem().unwrap().display()));
    let (urdf, srdf, out) = (urdf.display(), srdf.display(), out.display());
    let report =
        hoof(&format!("robot init {urdf} --srdf {srdf} --out {out} --name robot {options} --json")).exits(0).json();
    let path = report["toml"].as_str().unwrap();
    let toml: toml::Table = std::fs::read_to_string(path).unwrap().parse().unwrap();
    let info = hoof(&format!("robot info {path} --json")).exits(0).json();
    (toml["robot"].as_table().unwrap().clone(), report["look_at"].to_string(), info)
}

/// Names of the groups in the file.
fn groups(robot: &toml::Table) -> Vec<&str> {
    robot["group"].as_array().unwrap().iter().map(|group| group["name"].as_str().unwrap()).collect()
}

fn group<'r>(robot: &'r toml::Table, name: &str) -> &'r toml::Value {
    robot["group"].as_array().unwrap().iter().find(|group| group["name"].as_str() == Some(name)).unwrap()
}

fn length(value: &Value) -> usize {
    value.as_array().unwrap().len()
}

#[test]
fn centauro_has_the_groups_and_postures_of_its_srdf() {
    let (robot, look_at, info) = init("centauro", "urdf/centauro.urdf", "centauro.srdf", "--base floating");
    let of_legs = ["front_left_leg", "front_right_leg", "rear_right_leg", "rear_left_leg"];
    assert_eq!(groups(&robot)[..4], of_legs);
    let leg = group(&robot, "rear_left_leg");
    assert_eq!(["kind", "root", "tip"].map(|key| leg[key].as_str().unwrap()), ["leg", "pelvis", "wheel_3"]);
    assert_eq!(group(&robot, "left_arm")["kind"].as_str(), Some("arm"));
    assert_eq!(group(&robot, "chains")["joints"].as_array().unwrap().len(), 39);
    let homing = robot["postures"]["homing_balanced"].as_table().unwrap();
    assert_eq!((homing.len(), homing["hip_yaw_3"].as_float()), (39, Some(1.28)));
    let names: Vec<&str> = robot["postures"].as_table().unwrap().keys().map(String::as_str).collect();
    assert_eq!(names, ["homing_balanced", "homing_nominal", "nominal"]);
    assert_eq!(info["groups"].as_array().unwrap().len(), 10);
    assert_eq!(length(&info["disabled_collisions"]), 0);
    assert!(!look_at.contains("SRDF"), "{look_at}");
}

#[test]
fn hyq_keeps_its_four_legs_and_has_the_groups_of_its_srdf_beside_them() {
    let (robot, look_at, info) = init("hyq", "robots/hyq_no_sensors.urdf", "hyq.srdf", "");
    assert_eq!(groups(&robot), ["lf_leg", "rf_leg", "lh_leg", "rh_leg"]);
    let names: Vec<&str> = info["groups"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    assert_eq!(names, ["LF", "RF", "LH", "RH", "lf_leg", "rf_leg", "lh_leg", "rh_leg"]);
    assert_eq!(robot["postures"]["standing"]["lh_kfe_joint"].as_float(), Some(1.5));
    assert_eq!(info["postures"].as_array().unwrap().len(), 4);
    assert_eq!(length(&info["disabled_collisions"]), 42);
    for part in ["unknown group", "\\\"rh_leg\\\"", "lh_haa_joint"] {
        assert!(look_at.contains(part), "{part}: {look_at}");
    }
}

#[test]
fn anymal_has_the_disabled_collisions_of_its_srdf() {
    let (robot, _, info) = init("anymal_b_simple", "robots/anymal.urdf", "anymal.srdf", "");
    assert_eq!(robot["postures"]["standing"]["LF_HFE"].as_float(), Some(0.7));
    assert_eq!(length(&info["disabled_collisions"]), 43);
}

#[test]
fn joints_that_the_changed_urdf_fixes_are_left_out() {
    let (robot, look_at, info) = init("anymal_b_simple", "robots/anymal-kinova.urdf", "anymal-kinova.srdf", "");
    let standing = robot["postures"]["standing_with_arm_up"].as_table().unwrap();
    assert_eq!((standing.len(), info["dof"].as_u64()), (12, Some(12)));
    assert!(!groups(&robot).contains(&"arm"), "{:?}", groups(&robot));
    assert!(look_at.contains("group arm of the SRDF is left out"), "{look_at}");
    assert!(look_at.contains("robot.postures.standing_with_arm_up: without j2s6s200_joint_1"), "{look_at}");
}

#[test]
fn an_invalid_srdf_is_an_error_that_names_it() {
    let out = folder("srdf_invalid");
    let srdf = out.join("loop.srdf");
    std::fs::write(&srdf, "<robot name=\"hyq\">\n<group name=\"a\"><group name=\"a\"/></group></robot>").unwrap();
    let init = format!("robot init robots/hyq/hyq.urdf --out {} --srdf", out.display());
    let error = hoof(&format!("{init} {}", srdf.display())).exits(2).stderr;
    assert!(error.contains("loop.srdf: line 2: ") && error.contains("a > a"), "{error}");
    let missing = hoof(&format!("{init} {}", out.join("none.srdf").display())).exits(2).stderr;
    assert!(missing.contains("none.srdf"), "{missing}");
    assert!(!out.join("hyq.toml").exists());
}
