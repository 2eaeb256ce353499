//! Every public SRDF that has a URDF is read as Pinocchio reads it, and its groups as MoveIt defines them.
//!
//! The expected values are from `scripts/srdf_fixtures.py`. The files have many licences and are not part of this repository: `scripts/setup.sh` fetches
//! them.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

use robot_model::UrdfTree;
use robot_model::srdf::{GroupState, Srdf, SrdfGroup, SrdfWarning};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Deserialize)]
struct Fixture {
    robots: Vec<Expected>,
}

#[derive(Deserialize)]
struct Expected {
    srdf: String,
    urdf: String,
    groups: Vec<(String, Vec<String>)>,
    states: Vec<(String, BTreeMap<String, f64>)>,
    /// Indices into the sorted names of the links.
    pairs: Vec<[usize; 2]>,
    passive: Vec<String>,
}

fn fixture() -> Vec<Expected> {
    let Fixture { robots } = serde_json::from_str(include_str!("data/public_srdfs.json")).unwrap();
    robots
}

/// The tree of the URDF and the content of the SRDF.
fn read(robot: &Expected) -> (UrdfTree, Srdf) {
    let text = |file: &str| {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("../robots").join(file);
        let bytes = std::fs::read(path);
        let bytes = bytes.unwrap_or_else(|error| panic!("target/robots/{file}: {error}; run scripts/fetch_robots.sh"));
        String::from_utf8_lossy(&bytes).into_owned()
    };
    let tree = UrdfTree::parse(&text(&robot.urdf), &robot.urdf).unwrap();
    let srdf = Srdf::parse(&text(&robot.srdf), &robot.srdf, &tree).unwrap();
    (tree, srdf)
}

fn of(file: &str) -> (UrdfTree, Srdf) {
    read(fixture().iter().find(|robot| robot.srdf.ends_with(file)).unwrap())
}

#[test]
fn public_srdfs_are_read_as_pinocchio_reads_them() {
    let robots = fixture();
    let pairs: usize = robots.iter().map(|robot| robot.pairs.len()).sum();
    let states: usize = robots.iter().map(|robot| robot.states.len()).sum();
    assert_eq!((robots.len(), states, pairs), (37, 41, 6656));
    for robot in &robots {
        let (tree, srdf) = read(robot);
        let file = &robot.srdf;
        let groups: Vec<_> = srdf.groups.iter().map(|group| (group.name.clone(), group.joints.clone())).collect();
        assert_eq!(groups, robot.groups, "{file}");
        assert_eq!(srdf.states.len(), robot.states.len(), "{file}");
        for (GroupState { name, joints, .. }, (expected_name, expected)) in srdf.states.iter().zip(&robot.states) {
            assert_eq!((name, joints.len()), (expected_name, expected.len()), "{file}");
            for (joint, q) in joints {
                // The position of a joint without limits has gone through sine and cosine.
                assert!((q - expected[joint]).abs() < 1e-12, "{file}: {name}: {joint}: {q}");
            }
        }
        let mut links: Vec<&str> = tree.links.iter().map(|link| link.name.as_str()).collect();
        links.sort_unstable();
        let at = |link: &String| links.binary_search(&link.as_str()).unwrap();
        let pair = |links: &[String; 2]| [at(&links[0]).min(at(&links[1])), at(&links[0]).max(at(&links[1]))];
        let mut found: Vec<[usize; 2]> = srdf.disabled_collisions.iter().map(|pair_of| pair(&pair_of.links)).collect();
        found.sort_unstable();
        assert_eq!(found, robot.pairs, "{file}");
        assert_eq!(srdf.passive_joints, robot.passive, "{file}");
    }
}

#[test]
fn the_file_of_hyq_names_groups_that_do_not_exist_and_a_chain_to_another_leg() {
    let (_, srdf) = of("hyq.srdf");
    let chain = |name: &str| srdf.groups.iter().find(|group| group.name == name).unwrap().chain.clone();
    assert_eq!(chain("lf_leg"), Some(["trunk".to_owned(), "lf_foot".to_owned()]));
    assert_eq!(chain("rh_leg"), None);
    let [
        SrdfWarning::ChainHasOthers { group, tip, joints, .. },
        SrdfWarning::Unknown { what: "group", names, near, .. },
    ] = &srdf.warnings[..]
    else {
        panic!("{:?}", srdf.warnings);
    };
    assert_eq!((group.as_str(), tip.as_str(), joints.len()), ("rh_leg", "lh_foot", 3));
    assert_eq!((&names[..], near[0].as_str()), (&["lf", "rf", "lh", "rh"].map(str::to_owned)[..], "lf_leg"));
}

#[test]
fn the_file_of_centauro_has_chains_and_a_group_of_groups() {
    let (_, srdf) = of("centauro.srdf");
    assert_eq!(srdf.warnings, []);
    let by_chain = srdf.groups.iter().filter(|group| group.chain.is_some());
    assert_eq!((srdf.groups.len(), by_chain.count()), (10, 9));
    let SrdfGroup { name, joints, .. } = &srdf.groups[9];
    assert_eq!((name.as_str(), joints.len()), ("chains", 39));
}
