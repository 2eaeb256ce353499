//! `hoof robot init`: a first TOML file for a quadruped of which there is only the URDF.

use super::{legs, posture, read};
use crate::{Outcome, say, say_json};
use analysis::table::{Column, Table};
use anyhow::Context;
use controller::model::{Model, UrdfTree};
use controller::params::Params;
use controller::quadruped::Quadruped;
use controller::quadruped::leg::Leg;
use controller::quadruped::params::{FootholdParams, SwingParams, WbcParams};
use legs::Found;
use posture::Posture;
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "Example: hoof robot init my_dog.urdf --out robots/my_dog\n         \
    hoof sim --robot robots/my_dog/my_dog.toml --scenario scenarios/flat_trot.toml --log run.mcap\n\n\
    Finds legs, feet and IMU in the tree, the order of the legs by their places, and a standing posture inside the limits; forces, \
    step and swing frequency are those of HyQ, scaled by mass and height. Says what it guessed, why, and what must be looked at.")]
pub struct Args {
    /// URDF of a robot with four legs of three joints
    urdf: PathBuf,
    /// Name of the robot, instead of the URDF's
    #[arg(long)]
    name: Option<String>,
    /// Folder to write to, made if need be; the URDF is copied there. Default: beside the URDF
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace a file that is there
    #[arg(long)]
    force: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Mass, kg, and height of base over feet, m, of HyQ: what the defaults of the parameters are made for.
const HYQ_MASS: f64 = 86.8;
const HYQ_HEIGHT: f64 = 0.6;
/// Swing frequency of its trot, Hz.
const HYQ_TROT: f64 = 4.0;

/// A guess, and why it is so.
#[derive(Serialize)]
struct Guess {
    what: &'static str,
    value: String,
    because: String,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let text = read(&args.urdf)?;
    let file = args.urdf.display().to_string();
    let tree = UrdfTree::parse(&text, &file)?;
    let model = legs::model(&tree)?;
    let mut found = legs::find(&tree, &model).with_context(|| file.clone())?;
    let stance = posture::stand(&tree, &model, &found.legs).with_context(|| file.clone())?;
    let name = args.name.clone().unwrap_or_else(|| file_name(&tree.name));
    anyhow::ensure!(
        !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c)),
        "--name {name}: expected letters, digits, _ and -"
    );
    let urdf_name = args.urdf.file_name().context("the URDF has no file name")?.to_string_lossy().into_owned();
    let scaled = Scaled::new(model.total_mass(), stance.height + found.foot_radius);
    let toml = write(&name, &urdf_name, &tree, &model, &found, &stance, &scaled);
    // The controller's own checks: posture, legs, stack at home.
    Quadruped::new(&text, &toml).context("what was guessed makes no robot")?;
    let params = Params::from_toml(&toml, &name)?;

    let folder = args.out.clone().unwrap_or_else(|| args.urdf.parent().map(Path::to_owned).unwrap_or_default());
    if !folder.as_os_str().is_empty() {
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    let path = folder.join(format!("{name}.toml"));
    anyhow::ensure!(args.force || !path.exists(), "{} is there already; --force replaces it", path.display());
    let urdf = folder.join(&urdf_name);
    if args.out.is_some() && urdf.canonicalize().ok() != args.urdf.canonicalize().ok() {
        std::fs::write(&urdf, &text).with_context(|| urdf.display().to_string())?;
    }
    std::fs::write(&path, &toml).with_context(|| path.display().to_string())?;

    if stance.either_way {
        found.look_at.push("robot.posture: the knees may be bent either way; here they point to the middle".to_owned());
    }
    if found.legs.iter().flat_map(|leg| leg.joints).any(|j| !model.joints[j].effort.is_finite()) {
        found.look_at.push("the URDF limits no effort: torques are not clamped".to_owned());
    }
    found.look_at.extend(tree.warnings.iter().chain(&model.warnings).map(ToString::to_string));
    let guesses = guesses(&params, &found, &stance, &scaled);
    if args.json {
        say_json(&serde_json::json!({ "toml": path, "guesses": guesses, "look_at": found.look_at }))?;
        return Ok(Outcome::Good);
    }
    say(format!("{name}: {:.3} kg, {} joints\n", model.total_mass(), model.nj()))?;
    let mut table = Table::new(["parameter", "value", "derived from"].map(Column::left));
    for Guess { what, value, because } in &guesses {
        table.row([what.to_string(), value.to_string(), because.to_string()]);
    }
    say(table)?;
    for (leg, of) in Leg::ALL.into_iter().zip(&found.legs) {
        let joints: Vec<_> =
            of.joints.iter().map(|&j| format!("{} {:.4}", model.joints[j].name, stance.q[j])).collect();
        say(format!("posture {:<8} {}", leg.name(), joints.join(", ")))?;
    }
    say(if found.look_at.is_empty() { "\nnothing odd was seen; look at:" } else { "\nlook at:" })?;
    for remark in &found.look_at {
        say(format!("- {remark}"))?;
    }
    say("- the gains, [posture] and [trunk]: they are HyQ's")?;
    say(format!("\nwrote {}", path.display()))?;
    say(format!("try: hoof sim --robot {} --scenario scenarios/flat_trot.toml --log run.mcap", path.display()))?;
    Ok(Outcome::Good)
}

/// A name for files.
fn file_name(name: &str) -> String {
    name.to_lowercase().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// What goes with mass and size.
struct Scaled {
    f_z_min: f64,
    f_max: f64,
    step_height: f64,
    step_length: f64,
    trot: f64,
}

impl Scaled {
    fn new(mass: f64, height: f64) -> Self {
        let wbc = WbcParams::default();
        let (force, size) = (mass / HYQ_MASS, height / HYQ_HEIGHT);
        Scaled {
            f_z_min: two_digits(wbc.f_z_min * force),
            // A light robot needs no less room above its weight.
            f_max: two_digits(wbc.f_z_max * force.max(1.0)),
            step_height: two_digits(SwingParams::default().height * size),
            step_length: two_digits(FootholdParams::default().max_step_length * size),
            // A pendulum of a fraction of the height falls in the root of the fraction of the time.
            trot: two_digits(HYQ_TROT / size.sqrt()),
        }
    }
}

/// Two digits, as a person would write them.
fn two_digits(x: f64) -> f64 {
    let text = format!("{x:.1e}");
    text.parse().expect("a formatted number parses")
}

/// The file. Keys that come out as their defaults are written too: they are the first to be tuned.
fn write(
    name: &str,
    urdf: &str,
    tree: &UrdfTree,
    model: &Model,
    found: &Found,
    stance: &Posture,
    scaled: &Scaled,
) -> String {
    let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
    let link = |link: usize| quoted(&tree.links[link].name);
    let feet = found.legs.iter().map(|leg| link(leg.foot)).collect::<Vec<_>>().join(", ");
    let (mass, height) = (model.total_mass(), stance.height);
    let mut text = format!(
        "# {name}: what its URDF does not say. A first guess by `hoof robot init`; every key that is left out has its default, listed by\n\
         # `hoof robot info {name}.toml --params`.\n\n\
         [robot]\nname = {}\nurdf = {}\nfeet = [{feet}]\nfoot_radius = {}\nimu_link = {}\n\n\
         # Hips {:.3} m over the feet's centres, 85 % of the shortest leg.\n[robot.posture]\n",
        quoted(name),
        quoted(urdf),
        found.foot_radius,
        link(found.imu),
        0.85 * stance.leg_length,
    );
    for leg in &found.legs {
        for &j in &leg.joints {
            text += &format!("{} = {:?}\n", quoted_key(&model.joints[j].name), stance.q[j]);
        }
    }
    let Scaled { f_z_min, f_max, step_height, step_length, trot } = scaled;
    text + &format!(
        "\n# HyQ's forces by mass: {mass:.1} kg.\n[wbc]\nf_z_min = {f_z_min:?}\nf_z_max = {f_max:?}\nf_xy_max = {f_max:?}\n\n\
         # HyQ's steps by height: {height:.3} m.\n[swing]\nheight = {step_height:?}\n\n[foothold]\nmax_step_length = {step_length:?}\n\n\
         [gait.trot]\nduty = 0.55\nswing_frequency = {trot:?}\nlift_off_phase = [0.0, 0.5, 0.5, 0.0]\n"
    )
}

/// A key of TOML, bare where it may be.
fn quoted_key(name: &str) -> String {
    let bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
    if bare { name.to_owned() } else { toml::Value::String(name.to_owned()).to_string() }
}

fn guesses(params: &Params, found: &Found, stance: &Posture, scaled: &Scaled) -> Vec<Guess> {
    let guess = |what, value: String, because: &str| Guess { what, value, because: because.to_owned() };
    let robot = &params.robot;
    vec![
        guess("feet LF RF LH RH", robot.feet.join(" "), "ends of the chains of three joints, by where their hips are"),
        guess("foot radius", format!("{} m", robot.foot_radius), found.radius_because),
        guess("IMU", robot.imu_link.clone(), found.imu_because),
        guess(
            "height",
            format!("{:.3} m of the base over the feet's centres", stance.height),
            "feet below the hips at 85 % of the shortest leg",
        ),
        guess(
            "step",
            format!("{} m high, {} m long at most", scaled.step_height, scaled.step_length),
            "HyQ's, by height",
        ),
        guess("trot", format!("swings of {:.3} s", 1.0 / scaled.trot), "HyQ's, by the root of the height"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_a_person_would() {
        assert_eq!([7.1744, 0.0537, 1000.0, 123.4, 4.0].map(two_digits), [7.2, 0.054, 1000.0, 120.0, 4.0]);
    }

    #[test]
    fn hyq_gets_its_own_numbers_back() {
        let scaled = Scaled::new(HYQ_MASS, HYQ_HEIGHT);
        let found = [scaled.f_z_min, scaled.f_max, scaled.step_height, scaled.trot];
        assert_eq!(found, [20.0, 1000.0, 0.1, 4.0]);
    }
}
