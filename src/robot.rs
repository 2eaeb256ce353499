//! `hoof robot`: what is known of a robot, model quantities at a state, and a first file for a new one.

mod init;
mod legs;
mod posture;

use crate::{Outcome, say, say_json};
use anyhow::{Context, bail};
use clap::Subcommand;
use controller::model::UrdfTree;
use controller::model::eval::{EvalRequest, RobotInfo, eval};
use controller::params::{Params, ParamsError, apply_overrides};
use std::path::{Path, PathBuf};

#[derive(Subcommand)]
pub enum Command {
    /// Degrees of freedom, masses, limits, feet, warnings
    #[command(after_help = "Example: hoof robot info hyq\n         hoof robot info my_robot.urdf --json")]
    Info {
        /// Name of a robot in robots/, its TOML file, or any URDF file
        robot: String,
        /// Print every parameter of the controller with its value instead, as TOML
        #[arg(long)]
        params: bool,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Model quantities at a state, as JSON: mass matrix, bias force, gravity, centre of mass, frames and Jacobians
    #[command(
        after_help = "Example: echo '{\"base\": null, \"q\": {\"lf_haa_joint\": -0.2, ...}, \"qd\": {...}}' | hoof robot eval robots/hyq/hyq.urdf --state -\n\n\
        The state: {base: {position_m, quaternion_wxyz, linear_velocity, angular_velocity} or null, q: {joint: rad}, qd: {joint: rad/s}}; \
        velocities of the base are expressed in the base frame. Out: Jacobians are world-aligned, linear rows first; velocity_order names the \
        rows of the mass matrix."
    )]
    Eval {
        /// Name of a robot in robots/, its TOML file, or any URDF file
        robot: String,
        /// JSON file with the state, or - for standard input
        #[arg(long, value_name = "FILE")]
        state: PathBuf,
    },
    /// Write a first TOML file for a quadruped from its URDF: feet, posture, forces and steps by size
    Init(init::Args),
}

/// A robot's files, read.
pub struct RobotFiles {
    /// Text of the URDF.
    pub urdf: String,
    /// Where it was read.
    pub urdf_path: PathBuf,
    /// Parameters as TOML, complete; `None` for a URDF on its own.
    pub params: Option<String>,
}

impl RobotFiles {
    /// Finds a robot by name (`robots/NAME/NAME.toml` below the working directory or the source tree), TOML file or URDF file.
    pub fn find(robot: &str) -> anyhow::Result<Self> {
        let path = Path::new(robot);
        match path.extension().and_then(|e| e.to_str()) {
            Some("urdf" | "xml") => Self::urdf_alone(path),
            Some("toml") => Self::with_params(path),
            _ => Self::with_params(&by_name(robot)?),
        }
    }

    /// [`RobotFiles::find`], with parameters.
    pub fn find_with_params(robot: &str) -> anyhow::Result<(Self, String)> {
        let mut files = Self::find(robot)?;
        match files.params.take() {
            Some(params) => Ok((files, params)),
            None => bail!("{robot}: a URDF alone has no feet, posture and gains: name a robot or its TOML file"),
        }
    }

    fn urdf_alone(path: &Path) -> anyhow::Result<Self> {
        Ok(RobotFiles { urdf: read(path)?, urdf_path: path.to_owned(), params: None })
    }

    fn with_params(path: &Path) -> anyhow::Result<Self> {
        let text = read(path)?;
        let params = parse_params(&text, path)?;
        let urdf_path = path.with_file_name(&params.robot.urdf);
        Ok(RobotFiles { urdf: read(&urdf_path)?, urdf_path, params: Some(params.to_toml()) })
    }

    /// The URDF, checked.
    pub fn tree(&self) -> anyhow::Result<UrdfTree> {
        Ok(UrdfTree::parse(&self.urdf, &self.urdf_path.display().to_string())?)
    }
}

fn by_name(name: &str) -> anyhow::Result<PathBuf> {
    if let Some(path) = drivers::shipped::find(&Path::new("robots").join(name).join(format!("{name}.toml"))) {
        return Ok(path);
    }
    let mut known: Vec<String> = drivers::shipped::folders()
        .iter()
        .filter_map(|folder| std::fs::read_dir(folder.join("robots")).ok())
        .flatten()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    known.sort();
    known.dedup();
    bail!(
        "no robot \"{name}\": there is no robots/{name}/{name}.toml, and it is no .toml or .urdf file; known: {}",
        known.join(", ")
    )
}

/// Finds a file that ships with the command, such as `scenarios/flat_trot.toml`.
pub fn shipped(name: &str) -> anyhow::Result<PathBuf> {
    drivers::shipped::find(Path::new(name)).with_context(|| {
        let folders = drivers::shipped::folders();
        let folders: Vec<_> = folders[1..].iter().map(|folder| folder.display().to_string()).collect();
        format!("{name} not found; searched the working directory, {}", folders.join(", "))
    })
}

/// Sets parameters by `KEY=VALUE` in a complete TOML text.
pub fn with_overrides(params: &str, set: &[String]) -> anyhow::Result<String> {
    Ok(apply_overrides(params, &overrides(set)?)?)
}

/// Splits `KEY=VALUE`.
pub fn overrides(set: &[String]) -> anyhow::Result<Vec<(String, String)>> {
    set.iter()
        .map(|text| {
            let (key, value) = text.split_once('=').with_context(|| format!("parameter {text}: expected KEY=VALUE"))?;
            Ok((key.trim().to_owned(), value.trim().to_owned()))
        })
        .collect()
}

/// Reads parameters; every error names the file.
fn parse_params(text: &str, path: &Path) -> anyhow::Result<Params> {
    let file = path.display().to_string();
    Params::from_toml(text, &file).map_err(|error| match error {
        ParamsError::Parse { .. } => error.into(),
        _ => anyhow::Error::new(error).context(file),
    })
}

/// Reads a text file; the error names it.
pub fn read(path: &Path) -> anyhow::Result<String> {
    std::fs::read_to_string(path).with_context(|| path.display().to_string())
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Info { robot, params, json } => info(robot, *params, *json)?,
        Command::Init(args) => return init::run(args),
        Command::Eval { robot, state } => {
            let files = RobotFiles::find(robot)?;
            let text = if state.as_os_str() == "-" { std::io::read_to_string(std::io::stdin())? } else { read(state)? };
            let of_file =
                || if state.as_os_str() == "-" { "standard input".to_owned() } else { state.display().to_string() };
            let request: EvalRequest = serde_json::from_str(&text).with_context(of_file)?;
            say_json(&eval(&files.tree()?, &request).with_context(of_file)?)?;
        }
    }
    Ok(Outcome::Good)
}

fn info(robot: &str, params: bool, json: bool) -> anyhow::Result<()> {
    if params {
        return say(RobotFiles::find_with_params(robot)?.1.trim_end());
    }
    let files = RobotFiles::find(robot)?;
    let mut info = RobotInfo::new(&files.tree()?)?;
    if let Some(text) = &files.params {
        let params = Params::from_toml(text, robot)?;
        controller::quadruped::Quadruped::new(&files.urdf, text).with_context(|| robot.to_owned())?;
        info.feet = params.robot.feet.to_vec();
    }
    if json {
        return say_json(&info);
    }
    say(format!("{}  ({})", info.name, files.urdf_path.display()))?;
    say(format!("mass {:.3} kg, {} joints, feet: {}", info.mass_kg, info.dof, info.feet.join(" ")))?;
    say(format!("\n{:<20} {:<11} {:>8} {:>8} {:>8} {:>9}", "joint", "kind", "lower", "upper", "effort", "velocity"))?;
    let number = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.3}"));
    for j in &info.joints {
        let (lower, upper, effort, velocity) = (number(j.lower), number(j.upper), number(j.effort), number(j.velocity));
        say(format!("{:<20} {:<11} {lower:>8} {upper:>8} {effort:>8} {velocity:>9}", j.name, j.kind))?;
    }
    say(format!("\n{:<20} {:<20} {:>9}", "link", "parent", "mass (kg)"))?;
    for link in &info.links {
        say(format!("{:<20} {:<20} {:>9.3}", link.name, link.parent.as_deref().unwrap_or("-"), link.mass_kg))?;
    }
    for warning in &info.warnings {
        say(format!("\nwarning: {warning}"))?;
    }
    Ok(())
}
