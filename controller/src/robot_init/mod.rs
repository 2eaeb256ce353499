//! A first parameter file for a quadruped, derived from its URDF alone: `hoof robot init`.
//!
//! - `legs` finds legs, feet and IMU in the tree of links.
//! - `posture` solves for a standing posture within the joint limits.
//! - this file scales HyQ's forces and steps by mass and size, and writes the TOML text.
//!
//! It runs before a controller exists; no controller uses it.

mod error;
mod legs;
mod posture;

pub use error::RobotInitError;
pub use legs::{FoundLeg, FoundLegs};
pub use posture::Posture;

use crate::model::{Base, Model, UrdfTree};
use crate::params::Params;
use crate::quadruped::Quadruped;
use crate::quadruped::leg::Leg;
use crate::quadruped::params::{FootholdParams, SwingParams, WbcParams};
use serde::Serialize;

/// Mass of HyQ, kg. The default parameters are made for HyQ.
const HYQ_MASS: f64 = 86.8;
/// Height of HyQ's base above the ground, m.
const HYQ_HEIGHT: f64 = 0.6;
/// Swing frequency of HyQ's trot, Hz.
const HYQ_TROT: f64 = 4.0;

/// A first parameter file, and what a person should check in it.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// Name of the robot, usable as a file name.
    pub name: String,
    /// The parameters as TOML. Keys that equal their defaults are included if they are the first to be tuned.
    pub toml: String,
    /// Mass of all links, kg.
    pub total_mass: f64,
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

/// Derives a first parameter file from a URDF, and builds a controller with it as a check.
///
/// - `urdf`: text of the URDF.
/// - `source`: path of the URDF, for errors.
/// - `urdf_file`: file name of the URDF beside the parameter file.
/// - `name`: name of the robot; by default the URDF's, in lower case.
///
/// # Errors
/// An invalid URDF; a robot without four legs of three revolute joints each; a leg that cannot reach the ground; a name with
/// characters that a file name should not have.
pub fn propose(urdf: &str, source: &str, urdf_file: &str, name: Option<&str>) -> Result<Proposal, RobotInitError> {
    let tree = UrdfTree::parse(urdf, source)?;
    let model = Model::new(&tree, Base::Floating)?;
    let mut found = legs::find(&tree, &model)?;
    let stance = posture::stand(&tree, &model, &found.legs)?;
    let name = name.map_or_else(|| file_name(&tree.name), str::to_owned);
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c)) {
        return Err(RobotInitError::Name { found: name });
    }
    let scaled = Scaled::new(model.total_mass(), stance.height + found.foot_radius);
    let toml = write(&name, urdf_file, &tree, &model, &found, &stance, &scaled);
    // The controller checks posture, legs and stack.
    Quadruped::new(urdf, &toml).map_err(|source| RobotInitError::Unusable { source: Box::new(source) })?;
    let params = Params::from_toml(&toml, &name)?;

    if stance.either_way {
        found.look_at.push("robot.posture: the knees can bend either way; here they point to the middle".to_owned());
    }
    if found.legs.iter().flat_map(|leg| leg.joints).any(|j| !model.joints[j].effort.is_finite()) {
        found.look_at.push("the URDF limits no effort: torques are not clamped".to_owned());
    }
    found.look_at.extend(tree.warnings.iter().chain(&model.warnings).map(ToString::to_string));
    let joint = |&j: &usize| (model.joints[j].name.clone(), stance.q[j]);
    let posture = Leg::ALL.into_iter().zip(&found.legs).map(|(leg, of)| (leg, of.joints.iter().map(joint).collect()));
    Ok(Proposal {
        posture: posture.collect(),
        guesses: guesses(&params, &found, &stance, &scaled),
        look_at: found.look_at,
        total_mass: model.total_mass(),
        joints: model.nj(),
        name,
        toml,
    })
}

/// A name in lower case, with `_` for characters that a file name should not have.
fn file_name(name: &str) -> String {
    name.to_lowercase().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// Parameters of HyQ, scaled by mass and size.
struct Scaled {
    /// N.
    f_z_min: f64,
    /// N.
    f_max: f64,
    /// m.
    step_height: f64,
    /// m.
    step_length: f64,
    /// Swing frequency, Hz.
    trot: f64,
}

impl Scaled {
    /// - `mass`: kg.
    /// - `height`: of the base above the ground, m.
    fn new(mass: f64, height: f64) -> Self {
        let wbc = WbcParams::default();
        let (force, size) = (mass / HYQ_MASS, height / HYQ_HEIGHT);
        Scaled {
            f_z_min: two_digits(wbc.f_z_min * force),
            // Not below HyQ's: a light robot needs the same margin above its weight.
            f_max: two_digits(wbc.f_z_max * force.max(1.0)),
            step_height: two_digits(SwingParams::default().height * size),
            step_length: two_digits(FootholdParams::default().max_step_length * size),
            // The time constant of an inverted pendulum grows with the square root of its height.
            trot: two_digits(HYQ_TROT / size.sqrt()),
        }
    }
}

/// Rounds to two significant digits.
fn two_digits(x: f64) -> f64 {
    let text = format!("{x:.1e}");
    text.parse().expect("a formatted number parses")
}

/// The text of the parameter file.
fn write(
    name: &str,
    urdf: &str,
    tree: &UrdfTree,
    model: &Model,
    found: &FoundLegs,
    stance: &Posture,
    scaled: &Scaled,
) -> String {
    let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
    let link = |link: usize| quoted(&tree.links[link].name);
    let feet = found.legs.iter().map(|leg| link(leg.foot)).collect::<Vec<_>>().join(", ");
    let (mass, height) = (model.total_mass(), stance.height);
    let mut text = format!(
        "# Parameters of {name} that its URDF does not contain. A first guess by `hoof robot init`. Keys that are left out have their defaults;\n\
         # `hoof robot info {name}.toml --params` lists them.\n\n\
         [robot]\nname = {}\nurdf = {}\nfeet = [{feet}]\nfoot_radius = {}\nimu_link = {}\n\n\
         # Hips {:.3} m above the centres of the feet, 85 % of the length of the shortest leg.\n[robot.posture]\n",
        quoted(name),
        quoted(urdf),
        found.foot_radius,
        link(found.imu),
        0.85 * stance.leg_length,
    );
    for leg in &found.legs {
        for &j in &leg.joints {
            text += &format!("{} = {:?}\n", toml_key(&model.joints[j].name), stance.q[j]);
        }
    }
    let Scaled { f_z_min, f_max, step_height, step_length, trot } = scaled;
    text + &format!(
        "\n# HyQ's forces, scaled by mass: {mass:.1} kg.\n[wbc]\nf_z_min = {f_z_min:?}\nf_z_max = {f_max:?}\nf_xy_max = {f_max:?}\n\n\
         # HyQ's steps, scaled by height: {height:.3} m.\n[swing]\nheight = {step_height:?}\n\n[foothold]\nmax_step_length = {step_length:?}\n\n\
         [gait.trot]\nduty = 0.55\nswing_frequency = {trot:?}\nlift_off_phase = [0.0, 0.5, 0.5, 0.0]\n"
    )
}

/// A TOML key, quoted if it must be.
fn toml_key(name: &str) -> String {
    let bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
    if bare { name.to_owned() } else { toml::Value::String(name.to_owned()).to_string() }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_two_significant_digits() {
        assert_eq!([7.1744, 0.0537, 1000.0, 123.4, 4.0].map(two_digits), [7.2, 0.054, 1000.0, 120.0, 4.0]);
    }

    #[test]
    fn scaling_by_one_gives_the_values_of_hyq() {
        let scaled = Scaled::new(HYQ_MASS, HYQ_HEIGHT);
        let found = [scaled.f_z_min, scaled.f_max, scaled.step_height, scaled.trot];
        assert_eq!(found, [20.0, 1000.0, 0.1, 4.0]);
    }
}
