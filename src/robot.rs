//! `hoof robot`: properties of a robot, model quantities at a state, and a first parameter file for a new robot.

mod ik;
mod init;

use crate::{Outcome, say, say_json};
use analysis::table::{Column, Table};
use anyhow::Context;
use clap::Subcommand;
use controller::model::eval::{EvalRequest, RobotInfo, eval};
use controller::model::{Base, untouchable};
use controller::params::{Params, ParamsError, apply_overrides, bounds};
use controller::quadruped::{Implausible, implausible};
pub use drivers::robot_files::{RobotFiles, find_shipped, overrides, read, read_urdf};
use std::path::PathBuf;

#[derive(Subcommand)]
pub enum Command {
    /// Print joints, masses, limits, feet or contacts, and warnings of a robot
    #[command(
        after_help = "Example: hoof robot info hyq\n         hoof robot info centauro\n         hoof robot info my_robot.urdf --json"
    )]
    Info {
        /// Name of a robot in robots/, its TOML file, or any URDF file
        robot: String,
        /// Print every parameter of the controller with value, allowed range and unit instead, as TOML
        #[arg(long)]
        params: bool,
        /// With --params: the parameters with this preset, as `hoof sim --preset`
        #[arg(long, value_name = "NAME", requires = "params")]
        preset: Option<String>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Compute model quantities at a state: mass matrix, bias force, gravity, centre of mass, frames and Jacobians; as JSON
    #[command(
        after_help = "Example: echo '{\"base\": null, \"q\": {\"lf_haa_joint\": -0.2, ...}, \"qd\": {...}}' | hoof robot eval robots/hyq/hyq.urdf --state -\n\n\
        State: {base: {position_m, quaternion_wxyz, linear_velocity, angular_velocity} or null, q: {joint: rad}, qd: {joint: rad/s}}. \
        linear_velocity and angular_velocity of the state are expressed in base axes.\n\
        Result: base rows of the mass matrix, bias force, gravity and Jacobians are in world axes, linear rows first; velocity_order names the rows. \
        The result is always JSON."
    )]
    Eval {
        /// Name of a robot in robots/, its TOML file, or any URDF file
        robot: String,
        /// JSON file with the state; - reads standard input
        #[arg(long, value_name = "FILE")]
        state: PathBuf,
        /// Print JSON, which is the only format
        #[arg(long)]
        json: bool,
    },
    /// Find joint positions for poses of links: one-shot inverse kinematics
    Ik(ik::Args),
    /// Write a first parameter file for a quadruped from its URDF: feet, posture, and forces and steps by size
    Init(init::Args),
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Info { robot, params: true, preset, .. } => {
            say(with_bounds(&RobotFiles::find_changed(robot, preset.as_deref(), &[], &[])?.1))?;
        }
        Command::Info { robot, json, .. } => info(robot, *json)?,
        Command::Init(args) => return init::run(args),
        Command::Ik(args) => return ik::run(args),
        Command::Eval { robot, state, json: _ } => {
            let files = RobotFiles::find(robot)?;
            let text =
                if state.as_os_str() == "-" { replay::text_file::text_of(std::io::stdin())? } else { read(state)? };
            let of_file =
                || if state.as_os_str() == "-" { "standard input".to_owned() } else { state.display().to_string() };
            let request: EvalRequest = serde_json::from_str(&text).with_context(of_file)?;
            say_json(&eval(&files.tree()?, &request).with_context(of_file)?)?;
        }
    }
    Ok(Outcome::Good)
}

fn info(robot: &str, json: bool) -> anyhow::Result<()> {
    let files = RobotFiles::find(robot)?;
    let tree = files.tree()?;
    let mut info = RobotInfo::new(&tree)?;
    let description = files.description(&tree)?;
    let params = files.params.as_ref().map(|text| Params::from_toml(text, robot)).transpose()?;
    let is_quadruped = params.as_ref().is_some_and(|params| params.robot.is_quadruped());
    if let Some(description) = &description {
        info.differences = description.differences(&tree);
        info.contacts = description.contacts.iter().map(|contact| contact.name.clone()).collect();
        info.groups = description.groups.iter().map(|group| group.name.clone()).collect();
        info.postures = description.postures.keys().cloned().collect();
        info.disabled_collisions = description.disabled_collisions.iter().cloned().collect();
        info.feet.clear();
    }
    if let (Some(text), Some(params), true) = (&files.params, &params, is_quadruped) {
        controller::quadruped::Quadruped::new(&files.urdf, text).with_context(|| robot.to_owned())?;
        info.feet = params.robot.feet.to_vec();
        let implausible = implausible(&files.urdf, text).with_context(|| robot.to_owned())?;
        info.warnings.extend(implausible.iter().map(ToString::to_string));
    }
    if files.toml.is_none() {
        let links = untouchable(&tree, &info.feet);
        if !links.is_empty() {
            info.warnings.push(Implausible::TouchNothing { links }.to_string());
        }
    }
    if json {
        return say_json(&info);
    }
    say(format!("{}  ({})", info.name, files.urdf_path.display()))?;
    let touching = match &description {
        Some(robot) if !is_quadruped => {
            let (base, postures) =
                (if robot.base == Base::Fixed { "fixed" } else { "floating" }, info.postures.join(" "));
            let (contacts, groups) = (info.contacts.join(" "), info.groups.join(" "));
            format!("{base} base, contacts: {contacts}, groups: {groups}, postures: {postures}")
        }
        _ => format!("feet: {}", info.feet.join(" ")),
    };
    let touching = match info.disabled_collisions.len() {
        0 => touching,
        pairs => format!("{touching}, {pairs} disabled collisions"),
    };
    say(format!("mass {:.3} kg, {} joints, {touching}", info.mass_kg, info.dof))?;
    let [lower, upper, effort, velocity] = ["lower", "upper", "effort", "velocity"].map(Column::right);
    let mut joints = Table::new([Column::left("joint"), Column::left("kind"), lower, upper, effort, velocity]);
    let number = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.3}"));
    for j in &info.joints {
        let [lower, upper, effort, velocity] = [j.lower, j.upper, j.effort, j.velocity].map(number);
        joints.row([j.name.clone(), j.kind.to_string(), lower, upper, effort, velocity]);
    }
    say(format!("\n{joints}"))?;
    let mut links = Table::new([Column::left("link"), Column::left("parent"), Column::right("mass (kg)")]);
    for link in &info.links {
        links.row([link.name.as_str(), link.parent.as_deref().unwrap_or("-"), &format!("{:.3}", link.mass_kg)]);
    }
    say(format!("\n{links}"))?;
    if !info.differences.is_empty() {
        let (urdf, used) = (Column::right("URDF"), Column::right("used"));
        let mut differences =
            Table::new([Column::left("limit set by the TOML file"), Column::left("joint"), urdf, used]);
        for found in &info.differences {
            let [urdf, used] = [found.urdf, found.description].map(|x| format!("{x:.3}"));
            differences.row([found.quantity.clone(), found.joint.clone(), urdf, used]);
        }
        say(format!("\n{differences}"))?;
    }
    for warning in &info.warnings {
        say(format!("\nwarning: {warning}"))?;
    }
    Ok(())
}

/// Parameters as TOML. A comment after each number has its range and unit; that of a table is after the header of the table.
fn with_bounds(params: &str) -> String {
    let mut table = String::new();
    let line = |line: &str| {
        let key = if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            table = name.to_owned();
            table.clone()
        } else {
            format!("{table}.{}", line.split(" =").next().unwrap_or_default())
        };
        let bound = bounds().find(|bound| bound.key == key);
        bound.map_or(line.to_owned(), |bound| format!("{line}  # {}", bound.text()))
    };
    params.trim_end().lines().map(line).collect::<Vec<_>>().join("\n")
}

/// Checks each `KEY=VALUE` of an option by itself, so that an error names the argument and not the log.
pub fn check_overrides(option: &str, params: &str, set: &[String]) -> anyhow::Result<()> {
    for text in set {
        let one = overrides(std::slice::from_ref(text))?;
        // Two values that are valid only together are judged together, by the replay.
        match apply_overrides(params, &one) {
            Err(error) if set.len() == 1 || !matches!(error, ParamsError::OutOfRange { .. }) => {
                return Err(anyhow::Error::new(error).context(option.to_owned()));
            }
            _ => {}
        }
    }
    Ok(())
}
