//! `hoof robot ik`: goals that are met, one that cannot be, and wrong arguments.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::command;
use common::ran;

fn ik(arguments: &[&str]) -> common::Ran {
    ran(command().args(["robot", "ik"]).args(arguments).output().unwrap())
}

#[test]
fn goals_are_met_with_held_feet_or_named() {
    let held = ["coman", "--hold", "l_sole", "--hold", "r_sole", "--json", "--goal"];
    let found = ik(&[&held[..], &["RSoftHand 0.25 -0.2 0.55"]].concat()).exits(0).json();
    assert_eq!((&found["met"], found["goals"].as_array().unwrap().len()), (&true.into(), 3));
    for goal in found["goals"].as_array().unwrap() {
        let error = |key: &str| goal[key].as_f64().unwrap();
        assert!(error("position_error_m") < 1e-4 && error("orientation_error_rad") < 1e-3, "{goal}");
    }
    // The pose of the found joints, by `hoof robot eval`.
    let qd: serde_json::Map<_, _> =
        found["q"].as_object().unwrap().keys().map(|joint| (joint.clone(), 0.0.into())).collect();
    let mut base = found["base"].clone();
    (base["linear_velocity"], base["angular_velocity"]) = ([0.0; 3].to_vec().into(), [0.0; 3].to_vec().into());
    let state = serde_json::json!({ "base": base, "q": found["q"], "qd": qd });
    let file = common::folder("ik").join("state.json");
    std::fs::write(&file, state.to_string()).unwrap();
    let eval = ran(command().args(["robot", "eval", "coman", "--state"]).arg(&file).output().unwrap()).exits(0).json();
    let hand = &eval["frames"]["RSoftHand"]["position_m"];
    for (k, expected) in [0.25, -0.2, 0.55].into_iter().enumerate() {
        assert!((hand[k].as_f64().unwrap() - expected).abs() < 1e-4, "{hand}");
    }
    let far = ik(&[&held[..], &["RSoftHand 3 0 0.5"]].concat()).exits(1).json();
    let missed: Vec<_> = far["goals"].as_array().unwrap().iter().filter(|goal| goal["met"] == false).collect();
    assert!(missed.iter().any(|goal| goal["link"] == "RSoftHand"), "{far}");
}

#[test]
fn wrong_goals_are_errors() {
    for arguments in [
        &["coman"][..],
        &["coman", "--goal", "RSoftHand 1 2"],
        &["coman", "--goal", "RSoftHand 1 2 x"],
        &["coman", "--goal", "no_such_link 0 0 0"],
        &["coman", "--goal", "RSoftHand 0 0 0 1 1 0 0"],
        &["coman", "--goal", "RSoftHand nan 0 0"],
        &["coman", "--hold", "l_sole", "--posture", "no_such"],
    ] {
        ik(arguments).exits(2);
    }
}
