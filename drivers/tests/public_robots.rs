//! Public robots by the description that `hoof robot init` writes from their URDFs alone: an arm and a humanoid hold their posture.
//!
//! `scripts/fetch_robots.sh` fetches the files, which are not part of this repository.
#![allow(non_snake_case, clippy::unwrap_used, clippy::print_stdout, missing_docs)]

mod common;

use common::Seen;
use controller::params::{Params, apply_overrides};
use controller::robot_init::{Options, propose_any};
use drivers::lockstep::LockstepOthers;
use drivers::{MujocoSim, Scenario, SimParams, Terrain, lockstep, mesh};
use lcmtypes::{ComponentInfo, RunInfo};
use robot_model::{Base, UrdfTree};
use std::path::Path;

/// Runs `hold` for some seconds. Returns the messages, the time of a fall, and the number of contacts.
fn hold(file: &str, base: Base, fixed: &[(String, f64)], seconds: f64) -> (Seen, Option<f64>, usize) {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("../robots/example-robot-data/robots").join(file);
    let urdf = std::fs::read(&path).unwrap_or_else(|error| panic!("{file}: {error}; run scripts/fetch_robots.sh"));
    let urdf = String::from_utf8_lossy(&urdf).into_owned();
    let bounds = |name: &str| mesh::bounds(name, &path);
    let options =
        Options { urdf_file: "robot.urdf", beside: false, srdf: None, name: Some("robot"), fixed, bounds: &bounds };
    let proposal = propose_any(&urdf, file, base, &options).unwrap();
    let urdf = proposal.urdf.unwrap_or(urdf);
    let params = apply_overrides(&proposal.toml, &[("hold.duration".to_owned(), "0.5".to_owned())]).unwrap();
    let info = RunInfo { urdf, ..RunInfo::default() }.with_component(ComponentInfo::new("hold", &params));
    let params = Params::from_toml(info.params(), file).unwrap();
    let text = format!(
        "name = \"hold\"\nduration_s = {seconds}\ncontroller = \"hold\"\n[terrain]\nkind = \"flat\"\n[[operator]]\nt_s = 0.0\nmode = \"stand\"\n"
    );
    let scenario = Scenario::parse(&text, "test", &params.gait).unwrap();
    let tree = UrdfTree::parse(&info.urdf, file).unwrap();
    let terrain = Terrain::new(&scenario.terrain, 0);
    let mut sim = MujocoSim::new(&tree, &params.robot, terrain, SimParams::of(&scenario)).unwrap();
    let mut controller = controller::load(&info).unwrap();
    let mut seen = Seen::default();
    let others = LockstepOthers::build(&info, &[], &[]).unwrap();
    let outcome = lockstep::run(&scenario, &info, &mut sim, &mut controller, others, &mut seen, &mut |_| {}).unwrap();
    assert_eq!(outcome.safe_state, None, "{file}");
    (seen, outcome.fell_at_s, params.robot.contact.len())
}

/// Largest distance of a joint from its reference at the end, rad.
fn error(seen: &Seen) -> f64 {
    let (state, command) = (seen.states.last().unwrap(), seen.commands.last().unwrap());
    state.q.iter().zip(&command.q_des).fold(0.0, |most, (q, q_des)| f64::max(most, (q - q_des).abs()))
}

#[test]
fn an_arm_of_seven_joints_holds_its_posture() {
    let fingers = ["panda_finger_joint1", "panda_finger_joint2"].map(|joint| (joint.to_owned(), 0.0));
    let (seen, fell, contacts) = hold("panda_description/urdf/panda.urdf", Base::Fixed, &fingers, 4.0);
    println!("panda: {} rad", error(&seen));
    assert_eq!((seen.states[0].q.len(), fell, contacts), (7, None, 0));
    assert!(error(&seen) < 0.1, "{}", error(&seen));
}

#[test]
fn a_humanoid_stands_on_its_soles() {
    let (seen, fell, contacts) = hold("g1_description/urdf/g1_29dof_rev_1_0.urdf", Base::Floating, &[], 6.0);
    println!("g1: {} rad, fell {fell:?}", error(&seen));
    assert_eq!((fell, contacts), (None, 2));
    assert!(error(&seen) < 0.1, "{}", error(&seen));
}
