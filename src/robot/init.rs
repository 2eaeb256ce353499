//! `hoof robot init`: arguments and output. [`controller::robot_init`] computes.

use super::read;
use crate::{Outcome, say, say_json};
use analysis::table::{Column, Table};
use anyhow::Context;
use controller::robot_init::{Guess, Proposal, propose};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "Example: hoof robot init my_dog.urdf --out robots/my_dog\n         \
    hoof sim --robot robots/my_dog/my_dog.toml --scenario scenarios/flat_trot.toml --log run.mcap\n\n\
    Finds legs, feet and IMU in the tree of links, orders the legs by position, and solves for a standing posture within the joint\n\
    limits. Forces, step and swing frequency are HyQ's, scaled by mass and height. Prints each guess with its reason, and what to check.")]
pub struct Args {
    /// URDF of a robot with four legs of three joints each
    urdf: PathBuf,
    /// Name of the robot, instead of the URDF's
    #[arg(long)]
    name: Option<String>,
    /// Folder to write to, with a copy of the URDF; created if missing. Default: the folder of the URDF
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let text = read(&args.urdf)?;
    let file = args.urdf.display().to_string();
    let urdf_name = args.urdf.file_name().context("the URDF has no file name")?.to_string_lossy().into_owned();
    let proposal = propose(&text, &file, &urdf_name, args.name.as_deref()).with_context(|| file.clone())?;
    let path = write(args, &text, &urdf_name, &proposal)?;
    if args.json {
        let Proposal { guesses, look_at, .. } = &proposal;
        say_json(&serde_json::json!({ "toml": path, "guesses": guesses, "look_at": look_at }))?;
    } else {
        print(&proposal, &path)?;
    }
    Ok(Outcome::Good)
}

/// Writes the parameter file, and a copy of the URDF into another folder.
fn write(args: &Args, urdf: &str, urdf_name: &str, proposal: &Proposal) -> anyhow::Result<PathBuf> {
    let folder = args.out.clone().unwrap_or_else(|| args.urdf.parent().map(Path::to_owned).unwrap_or_default());
    if !folder.as_os_str().is_empty() {
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    let path = folder.join(format!("{}.toml", proposal.name));
    anyhow::ensure!(args.force || !path.exists(), "{} exists; --force replaces it", path.display());
    let copy = folder.join(urdf_name);
    if args.out.is_some() && copy.canonicalize().ok() != args.urdf.canonicalize().ok() {
        std::fs::write(&copy, urdf).with_context(|| copy.display().to_string())?;
    }
    std::fs::write(&path, &proposal.toml).with_context(|| path.display().to_string())?;
    Ok(path)
}

fn print(proposal: &Proposal, path: &Path) -> anyhow::Result<()> {
    let Proposal { name, total_mass, joints, posture, guesses, look_at, .. } = proposal;
    say(format!("{name}: {total_mass:.3} kg, {joints} joints\n"))?;
    let mut table = Table::new(["parameter", "value", "derived from"].map(Column::left));
    for Guess { what, value, because } in guesses {
        table.row([(*what).to_owned(), value.clone(), because.clone()]);
    }
    say(table)?;
    for (leg, joints) in posture {
        let joints: Vec<_> = joints.iter().map(|(joint, q)| format!("{joint} {q:.4}")).collect();
        say(format!("posture {:<8} {}", leg.name(), joints.join(", ")))?;
    }
    say("\ncheck:")?;
    for remark in look_at {
        say(format!("- {remark}"))?;
    }
    say("- the gains, [posture] and [trunk]: they are HyQ's")?;
    say(format!("\nwrote {}", path.display()))?;
    say(format!("try: hoof sim --robot {} --scenario scenarios/flat_trot.toml --log run.mcap", path.display()))
}
