//! A first parameter file for a quadruped, derived from its URDF alone: `hoof robot init`.
//!
//! - `legs` finds legs, feet and IMU in the tree of links.
//! - `prepare` changes what controller and simulator cannot use; the result is written as a new URDF.
//! - `posture` solves for a standing posture within the joint limits, `lying` for one on the ground.
//! - `gains` scales gains by the inertia of the legs, `scaled` HyQ's forces and steps by mass and size.
//! - `toml_text` writes the parameter file.
//! - `any` writes a description of any other robot; `soles` finds its chains and feet.
//! - `srdf` adds what an SRDF contains: groups, postures, passive joints and disabled collisions.
//!
//! It runs before a controller exists; no controller uses it.

mod any;
mod error;
mod gains;
mod legs;
mod lying;
mod posture;
mod prepare;
mod scaled;
mod soles;
mod srdf;
mod toml_text;

pub use any::propose_any;
pub use error::RobotInitError;
pub use legs::{FoundLeg, FoundLegs};
pub use posture::Posture;

use crate::model::srdf::Srdf;
use crate::model::{AddedShape, Base, Bounds, GRAVITY, Model, NOMINAL, UrdfTree, check_runnable, with_shapes};
use crate::params::Params;
use crate::quadruped::Quadruped;
use crate::quadruped::leg::Leg;
use gains::Gains;
use scaled::Scaled;
use serde::Serialize;
use srdf::{FromSrdf, Known};

/// A first parameter file, and what a person should check in it.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// Name of the robot, usable as a file name.
    pub name: String,
    /// The URDF to write beside the parameters; `None` if the given one can be used as it is.
    pub urdf: Option<String>,
    /// Its file name, as in the parameters.
    pub urdf_file: String,
    /// The parameters as TOML. Keys that equal their defaults are included if they are the first to be tuned.
    pub toml: String,
    /// Mass of all links, kg.
    pub total_mass: f64,
    /// Height of the hips above the ground in the standing posture, m.
    pub hip_height: f64,
    /// Number of movable joints.
    pub joints: usize,
    /// Standing posture: for each leg (LF RF LH RH), its joints and their positions, rad.
    pub posture: Vec<(Leg, Vec<(String, f64)>)>,
    /// The guessed values, each with its reason.
    pub guesses: Vec<Guess>,
    /// Remarks that a person should check.
    pub look_at: Vec<String>,
}

/// A guessed value and its reason.
#[derive(Clone, Debug, Serialize)]
pub struct Guess {
    /// What was guessed.
    pub what: &'static str,
    /// The value with its unit.
    pub value: String,
    /// The reason.
    pub because: String,
}

/// What `propose` needs besides the URDF.
pub struct Options<'a> {
    /// File name of the URDF.
    pub urdf_file: &'a str,
    /// Whether the parameter file is written into the folder of the URDF. A changed URDF then has another name.
    pub beside: bool,
    /// Text of an SRDF, and its path for errors.
    pub srdf: Option<(&'a str, &'a str)>,
    /// Name of the robot; by default the URDF's, in lower case.
    pub name: Option<&'a str>,
    /// Positions at which joints outside of the legs are fixed, rad or m; by default 0, or the limit closest to it.
    pub fixed: &'a [(String, f64)],
    /// Bounding box of a mesh file; `None` if it cannot be read.
    pub bounds: &'a dyn Fn(&str) -> Option<Bounds>,
}

/// Derives a first parameter file from a URDF, and builds a controller with it as a check.
///
/// - `urdf`: text of the URDF.
/// - `source`: path of the URDF, for errors.
///
/// # Errors
/// An invalid URDF or SRDF; a robot without four legs of three revolute joints each; a leg that cannot reach the ground; a name with
/// characters that a file name should not have.
pub fn propose(urdf: &str, source: &str, options: &Options) -> Result<Proposal, RobotInitError> {
    let mut tree = UrdfTree::parse(urdf, source)?;
    let srdf = read_srdf(options, &tree)?;
    let mut changes = Vec::new();
    let name = options.name.map_or_else(|| file_name(&tree.name), str::to_owned);
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c)) {
        return Err(RobotInitError::Name { found: name });
    }
    for link in prepare::trunk_as_root(&mut tree) {
        changes.push(format!("root link {link} is removed: it has no mass and no shape, and the trunk is elsewhere"));
    }
    fix_others(&mut tree, options.fixed, &mut changes)?;
    let model = Model::new(&tree, Base::Floating)?;
    check_runnable(&model, &vec![0.0; model.nj()])?;
    let found = legs::find(&tree, &model)?;
    for leg in &found.legs {
        if let Some((_, offset)) = legs::sphere(&tree, leg.foot).filter(|(_, offset)| offset.norm() > 1e-6) {
            prepare::center_foot(&mut tree, leg.foot, offset);
            let (link, distance) = (&tree.links[leg.foot].name, offset.norm());
            changes.push(format!(
                "the foot of {link} is at the centre of its sphere, {distance:.4} m from the origin of the link"
            ));
        }
    }
    for link in prepare::balance(&mut tree) {
        changes.push(format!("link {link}: no mass distribution has its inertia; it is replaced by that of a sphere"));
    }
    let model = Model::new(&tree, Base::Floating)?;
    let mut found = legs::find(&tree, &model)?;
    let plans = posture::plans(&tree, &model, &found.legs)?;
    let stance = posture::stand(&tree, &model, &plans)?;

    let size = model.total_mass() * GRAVITY * stance.leg_length;
    for joint in prepare::limit_efforts(&mut tree, &found.legs, size) {
        changes.push(format!(
            "joint {joint}: its effort or velocity limit is not that of a motor; a usual value is assumed"
        ));
    }
    let feet = found.legs.each_ref().map(|leg| tree.links[leg.foot].name.clone());
    let (mut tree, added) = with_shapes(&tree, &feet, found.foot_radius, options.bounds);
    for AddedShape { link, from_mesh } in added {
        let from = if from_mesh { "the bounding box of its mesh" } else { "a shape from joint to joint" };
        changes.push(format!("link {link} has no shape that can touch the ground; it receives {from}"));
    }
    let model = Model::new(&tree, Base::Floating)?;
    let lying = lying::lie(&tree, &model, &plans, &stance.q, found.foot_radius);
    let gains = Gains::new(&model, &found.legs, &stance.q, size);
    let scaled = Scaled::new(model.total_mass(), stance.hip_height + found.foot_radius);

    let (urdf_file, prepared) = if changes.is_empty() {
        (options.urdf_file.to_owned(), None)
    } else {
        tree.name.clone_from(&name);
        let file = format!("{name}.urdf");
        let file = if options.beside && file == options.urdf_file { format!("{name}_prepared.urdf") } else { file };
        let mut head = vec![format!("{name}, written by `hoof robot init` from {}. Changes:", options.urdf_file)];
        head.extend(changes.iter().map(|change| format!("- {change}")));
        (file, Some(tree.to_urdf(&head)))
    };
    let known = Known {
        tree: &tree,
        model: &model,
        base: Base::Floating,
        groups: &Leg::ALL.map(Leg::name),
        postures: &[NOMINAL, "lying"],
        contacts: &feet,
    };
    let from_srdf = srdf.map(|srdf| FromSrdf::new(&srdf, &srdf::postures(&srdf), &known)).unwrap_or_default();
    let toml = toml_text::write(&toml_text::Parts {
        name: &name,
        urdf: &urdf_file,
        tree: &tree,
        model: &model,
        found: &found,
        stance: &stance,
        lying: &lying,
        scaled: &scaled,
        gains: &gains,
        srdf: &from_srdf,
    });
    // The controller checks posture, legs and stack.
    Quadruped::new(prepared.as_deref().unwrap_or(urdf), &toml)
        .map_err(|source| RobotInitError::Unusable { source: Box::new(source) })?;
    let params = Params::from_toml(&toml, &name)?;

    if stance.either_way {
        found.look_at.push("robot.posture: the knees can bend either way; here they point to the middle".to_owned());
    }
    found.look_at.extend(changes);
    found.look_at.extend(model.warnings.iter().map(ToString::to_string));
    found.look_at.extend(from_srdf.look_at);
    let mut guesses = guesses(&params, &found, &stance, &scaled);
    guesses.extend(from_srdf.guesses);
    let joint = |&j: &usize| (model.joints[j].name.clone(), stance.q[j]);
    let posture = Leg::ALL.into_iter().zip(&found.legs).map(|(leg, of)| (leg, of.joints.iter().map(joint).collect()));
    Ok(Proposal {
        posture: posture.collect(),
        guesses,
        look_at: found.look_at,
        total_mass: model.total_mass(),
        hip_height: stance.hip_height + found.foot_radius,
        joints: model.nj(),
        urdf: prepared,
        urdf_file,
        name,
        toml,
    })
}

/// The SRDF of the options.
fn read_srdf(options: &Options, tree: &UrdfTree) -> Result<Option<Srdf>, RobotInitError> {
    Ok(options.srdf.map(|(text, source)| Srdf::parse(text, source, tree)).transpose()?)
}

/// Fixes the joints outside of the legs.
fn fix_others(tree: &mut UrdfTree, at: &[(String, f64)], changes: &mut Vec<String>) -> Result<(), RobotInitError> {
    let others = legs::outside(tree, &Model::new(tree, Base::Floating)?)?;
    if let Some((joint, _)) = at.iter().find(|(name, _)| others.iter().all(|&j| tree.joints[j].name != *name)) {
        let others = others.iter().map(|&j| tree.joints[j].name.clone()).collect();
        return Err(RobotInitError::Fix { joint: joint.clone(), others });
    }
    for j in others {
        let joint = &mut tree.joints[j];
        let given = at.iter().find(|(name, _)| *name == joint.name).map(|(_, q)| *q);
        let q = given.unwrap_or_else(|| 0.0_f64.max(joint.limits.lower).min(joint.limits.upper));
        prepare::fix(joint, q);
        changes.push(format!("joint {} is not part of a leg; it is fixed at {q}", joint.name));
    }
    Ok(())
}

/// A name in lower case, with `_` for characters that a file name should not have.
fn file_name(name: &str) -> String {
    name.to_lowercase().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

fn guesses(params: &Params, found: &FoundLegs, stance: &Posture, scaled: &Scaled) -> Vec<Guess> {
    let guess = |what, value: String, because: &str| Guess { what, value, because: because.to_owned() };
    let robot = &params.robot;
    vec![
        guess("feet LF RF LH RH", robot.feet.join(" "), "ends of the chains of three joints, ordered by hip position"),
        guess("foot radius", format!("{} m", robot.foot_radius), found.radius_because),
        guess("IMU", robot.imu_link.clone(), found.imu_because),
        guess(
            "height",
            format!("{:.3} m of the base above the centres of the feet", stance.height),
            "feet below the hips at 85 % of the length of the shortest leg",
        ),
        guess(
            "step",
            format!("{} m high, at most {} m long", scaled.step_height, scaled.step_length),
            "HyQ's, scaled by height",
        ),
        guess(
            "trot",
            format!("swings of {:.3} s", 1.0 / scaled.trot),
            "HyQ's, scaled by the square root of the height",
        ),
    ]
}
