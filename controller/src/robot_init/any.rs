//! A first description for any robot: base, IMU, soles, groups, posture, and gains of the drives for the controllers `hold` and `posture`.

use super::scaled::two_digits;
use super::soles::{add_soles, chains, turns_freely};
use super::srdf::{FromSrdf, Known, postures, within_limits};
use super::{Guess, Options, Proposal, RobotInitError, file_name, prepare, read_srdf};
use crate::hold::{self, Hold};
use crate::model::{
    Base, BaseState, JointInfo, JointKind, Kinematics, Model, NOMINAL, UrdfTree, check_runnable, mass_matrix,
};
use crate::params::{quoted, toml_key};
use lcmtypes::{ComponentInfo, RunInfo};
use nalgebra::DMatrix;
use std::fmt::Write;

/// Period of the drives' joint loop, s.
const TICK: f64 = 1e-3;
/// Error of a joint at which its drive gives its effort, rad or m.
const ERROR_AT_EFFORT: f64 = 0.1;
/// Largest natural frequency times the period, with the least inertia of a joint.
const LARGEST_FREQUENCY: f64 = 0.35;
/// Damping as a multiple of the stiffness, s.
const DAMPING_TIME: f64 = 0.04;
/// Largest part of a joint's speed that its damping removes in a period.
const LARGEST_STEP: f64 = 0.4;

/// Stiffness and damping of each drive, for a position loop that holds the robot: the effort at a small error, as far as the inertia of the joint allows it.
pub(super) fn drive_gains(model: &Model, q: &[f64]) -> Vec<(f64, f64)> {
    let mut kin = Kinematics::new(model);
    kin.update(model, &BaseState::identity(), q, &vec![0.0; model.nj()]);
    let mut M = DMatrix::zeros(model.nv(), model.nv());
    mass_matrix(model, &kin, &mut M);
    let inverse = M.clone().cholesky().map(|factor| factor.inverse());
    let first = model.nv() - model.nj();
    let gains = |(j, joint): (usize, &JointInfo)| {
        let at = first + j;
        // The inertia of a joint while all others are free.
        let inertia = inverse.as_ref().map_or(M[(at, at)], |inverse| 1.0 / inverse[(at, at)]);
        let largest = inertia * (LARGEST_FREQUENCY / TICK) * (LARGEST_FREQUENCY / TICK);
        let kp = (joint.effort / ERROR_AT_EFFORT).min(largest);
        let kd = (kp * DAMPING_TIME).min(LARGEST_STEP * inertia / TICK);
        (two_digits(kp), two_digits(kd))
    };
    model.joints.iter().enumerate().map(gains).collect()
}

/// Derives a first description from a URDF, and builds the controller `hold` with it as a check.
///
/// - `base`: whether the root can move.
///
/// # Errors
/// An invalid URDF or SRDF, a joint that cannot move the robot, or a name with characters that a file name should not have.
pub fn propose_any(urdf: &str, source: &str, base: Base, options: &Options) -> Result<Proposal, RobotInitError> {
    let mut tree = UrdfTree::parse(urdf, source)?;
    let srdf = read_srdf(options, &tree)?;
    let original = tree.clone();
    let name = options.name.map_or_else(|| file_name(&tree.name), str::to_owned);
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c)) {
        return Err(RobotInitError::Name { found: name });
    }
    let mut changes = Vec::new();
    if base == Base::Floating {
        for link in prepare::trunk_as_root(&mut tree) {
            changes
                .push(format!("root link {link} is removed: it has no mass and no shape, and the trunk is elsewhere"));
        }
    }
    for (joint, q) in options.fixed {
        let others = || tree.joints.iter().filter(|j| j.kind != JointKind::Fixed).map(|j| j.name.clone()).collect();
        let at = tree.joints.iter().position(|other| other.name == *joint && other.kind != JointKind::Fixed);
        let at = at.ok_or_else(|| RobotInitError::Fix { joint: joint.clone(), others: others() })?;
        prepare::fix(&mut tree.joints[at], *q);
        changes.push(format!("joint {joint} is fixed at {q}"));
    }
    for link in prepare::balance(&mut tree) {
        changes.push(format!("link {link}: no mass distribution has its inertia; it is replaced by that of a sphere"));
    }
    let model = Model::new(&tree, base)?;
    let (mut states, mut look_at) = (srdf.as_ref().map(postures).unwrap_or_default(), Vec::new());
    let nominal = states.iter().position(|(name, _)| *name == NOMINAL).map(|at| states.remove(at).1);
    let nominal = nominal.map(|positions| within_limits(NOMINAL, &positions, &model, &mut look_at)).unwrap_or_default();
    let position = |joint: &JointInfo| nominal.get(&joint.name).copied().unwrap_or(resting(joint.lower, joint.upper));
    let q: Vec<f64> = model.joints.iter().map(position).collect();
    check_runnable(&model, &q)?;
    let soles = if base == Base::Floating { add_soles(&mut tree, &model, &q, options) } else { Vec::new() };
    for (link, _) in &soles {
        changes.push(format!("link {link} is added at the bottom of a foot"));
    }
    let model = Model::new(&tree, base)?;
    let gains = drive_gains(&model, &q);
    let urdf_file = if tree != original { format!("{name}_prepared.urdf") } else { options.urdf_file.to_owned() };
    let imu = tree.links.iter().find(|link| link.name.to_lowercase().contains("imu")).map(|link| link.name.clone());
    let imu = imu.or_else(|| (base == Base::Floating).then(|| tree.links[0].name.clone()));
    let chains = chains(&tree);
    let tip_turns =
        |tip: &&str| tree.links.iter().position(|link| link.name == **tip).is_some_and(|at| turns_freely(&tree, at));
    let tips = chains.iter().map(|(tip, _)| tip.as_str());
    let wheels: Vec<&str> = tips.filter(|tip| base == Base::Floating && tip_turns(tip)).collect();

    let contacts: Vec<String> = soles.iter().map(|(link, _)| link.clone()).collect();
    let known = Known { tree: &tree, model: &model, base, groups: &[], postures: &[], contacts: &contacts };
    let from_srdf = srdf.as_ref().map(|srdf| FromSrdf::new(srdf, &states, &known)).unwrap_or_default();

    let mut toml = format!(
        "# Description of {name}: what its URDF does not contain. A first guess by `hoof robot init`.\n\n[robot]\nname = {}\nurdf = {}\nbase = {}\n",
        quoted(&name),
        quoted(&urdf_file),
        if base == Base::Fixed { "\"fixed\"" } else { "\"floating\"" },
    );
    let mut add = |text: std::fmt::Arguments| writeln!(toml, "{text}").expect("writing to a String never fails");
    if let Some(link) = &imu {
        add(format_args!("\n[[robot.imu]]\nname = \"imu\"\nlink = {}", quoted(link)));
    }
    for (link, [x, y]) in &soles {
        let (link, geometry) = (quoted(link), format!("{{ x = {x:?}, y = {y:?} }}"));
        add(format_args!("\n[[robot.contact]]\nname = {link}\nlink = {link}\ngeometry.sole = {geometry}"));
    }
    let guessed = if from_srdf.groups.is_empty() { &chains[..] } else { &[] };
    for (tip, _) in guessed {
        add(format_args!("\n[[robot.group]]\nname = {0}\nkind = \"chain\"\ntip = {0}", quoted(tip)));
    }
    let source = if nominal.is_empty() { "Each joint at 0" } else { "As in the SRDF; each other joint at 0" };
    add(format_args!(
        "{}\n# {source}, or at the middle of its range if that does not contain 0.\n[robot.postures.nominal]",
        from_srdf.groups
    ));
    for (joint, q) in model.joints.iter().zip(&q) {
        add(format_args!("{} = {q:?}", toml_key(&joint.name)));
    }
    add(format_args!(
        "{}\n# Position loops of the drives: the effort at an error of {ERROR_AT_EFFORT} rad or m, as far as the inertia allows it.\n[robot.joints]",
        from_srdf.postures
    ));
    for (joint, (kp, kd)) in model.joints.iter().zip(&gains) {
        let name = toml_key(&joint.name);
        if from_srdf.passive.contains(&joint.name) {
            add(format_args!("{name} = {{ role = \"passive\", stiffness = 0.0, damping = 0.0 }}"));
        } else {
            add(format_args!("{name} = {{ stiffness = {kp:?}, damping = {kd:?} }}"));
        }
    }
    toml += &from_srdf.collisions;
    let written = (tree != original).then(|| {
        tree.name.clone_from(&name);
        let mut head = vec![format!("{name}, written by `hoof robot init` from {}. Changes:", options.urdf_file)];
        head.extend(changes.iter().map(|change| format!("- {change}")));
        tree.to_urdf(&head)
    });
    let text = written.as_deref().unwrap_or(urdf).to_owned();
    let info = RunInfo { urdf: text, ..RunInfo::default() }.with_component(ComponentInfo::new(hold::NAME, &toml));
    Hold::new(&info).map_err(|source| RobotInitError::Unusable { source: Box::new(source) })?;
    let guess = |what, value: String, because: &str| Guess { what, value, because: because.to_owned() };
    look_at.extend(changes);
    look_at.extend(from_srdf.look_at);
    if !wheels.is_empty() {
        look_at.push(format!(
            "[[robot.contact]]: {} turn without limits; a wheel needs a contact with geometry.wheel",
            wheels.join(", ")
        ));
    }
    if contacts.is_empty() && base == Base::Floating {
        look_at.push(
            "[[robot.contact]]: no foot was found at the lowest point; the robot stands on its shapes".to_owned(),
        );
    }
    let mut guesses = vec![
        guess("IMU", imu.unwrap_or_else(|| "none".to_owned()), "the first link with imu in its name, else the root"),
        guess("soles", contacts.join(" "), "ends of chains at the lowest point of the robot"),
        guess("posture nominal", "see the file".to_owned(), "0, or the middle of the range"),
        guess("gains", "see the file".to_owned(), "effort at 0.1 rad or m, limited by the inertia of each joint"),
    ];
    if !guessed.is_empty() {
        let groups = guessed.iter().map(|(tip, _)| tip.as_str()).collect::<Vec<_>>().join(" ");
        guesses.push(guess("groups", groups, "ends of chains"));
    }
    guesses.extend(from_srdf.guesses);
    Ok(Proposal {
        name,
        urdf: written,
        urdf_file,
        toml,
        total_mass: model.total_mass(),
        hip_height: 0.0,
        joints: model.nj(),
        posture: Vec::new(),
        guesses,
        look_at,
    })
}

/// 0, or the middle of a range that does not contain it.
fn resting(lower: f64, upper: f64) -> f64 {
    if (lower..=upper).contains(&0.0) { 0.0 } else { f64::midpoint(lower, upper) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn proposal(urdf: &str) -> Proposal {
        let options =
            Options { urdf_file: "a.urdf", beside: false, srdf: None, name: Some("a"), fixed: &[], bounds: &|_| None };
        propose_any(urdf, "a.urdf", Base::Floating, &options).unwrap()
    }

    #[test]
    fn wheels_receive_no_soles() {
        let written = proposal(include_str!("../../../robots/centauro/centauro.urdf"));
        let table: toml::Table = written.toml.parse().unwrap();
        assert!(!table["robot"].as_table().unwrap().contains_key("contact"), "{}", written.toml);
        assert!(written.look_at.iter().any(|text| text.contains("geometry.wheel")), "{:?}", written.look_at);
    }

    #[test]
    fn the_link_of_a_sole_has_a_new_name() {
        let inertial = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
        let urdf = format!(
            "<robot name=\"a\"><link name=\"a\">{inertial}</link><link name=\"b\">{inertial}<collision><geometry><box size=\"0.2 0.1 0.1\"/></geometry>\
             </collision></link><link name=\"b_bottom\"/><joint name=\"j\" type=\"revolute\"><parent link=\"a\"/><child link=\"b\"/>\
             <origin xyz=\"0 0 -1\"/><axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" effort=\"9\" velocity=\"9\"/></joint>\
             <joint name=\"f\" type=\"fixed\"><parent link=\"b\"/><child link=\"b_bottom\"/></joint></robot>"
        );
        let written: toml::Table = proposal(&urdf).toml.parse().unwrap();
        assert_eq!(written["robot"]["contact"][0]["link"].as_str(), Some("b_bottom_2"));
    }
}
