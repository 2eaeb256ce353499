//! `hoof robot init`: arguments and output. [`controller::robot_init`] computes.

use super::read_urdf;
use crate::{Outcome, say, say_json};
use analysis::table::{Column, Table};
use anyhow::Context;
use controller::model::Base;
use controller::robot_init::{Guess, Options, Proposal, propose, propose_any};
use drivers::{mesh, shipped};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "Example: hoof robot init my_dog.urdf --out robots/my_dog\n         \
    hoof sim --robot robots/my_dog/my_dog.toml --scenario scenarios/flat_trot.toml --log run.mcap\n         \
    hoof robot init my_arm.urdf --base fixed --out robots/my_arm\n         \
    hoof sim --robot robots/my_arm/my_arm.toml --scenario scenarios/hold.toml --log run.mcap\n         \
    hoof robot init hyq.urdf --srdf hyq.srdf --out robots/my_hyq\n\n\
    Finds legs, feet and IMU in the tree of links, orders the legs by position, and solves for a standing posture within the joint\n\
    limits and for a lying one. Forces, steps, swing frequency and gains are HyQ's, scaled by mass, height of the hips and inertia.\n\
    Where controller or simulator cannot use the URDF as it is (meshes, joints outside of the legs, a root that is not the trunk, effort\n\
    limits above those of a motor), it writes a changed copy. Prints each guess with its reason, and what to check.")]
pub struct Args {
    /// URDF of a robot with four legs of three joints each, or of any robot with --base
    urdf: PathBuf,
    /// Describe a robot that is not such a quadruped, with a root that can move or not: posture, soles and gains for the controllers hold and posture
    #[arg(long, value_name = "BASE")]
    base: Option<BaseArg>,
    /// Take groups, named postures, passive joints and disabled collision pairs from an SRDF
    #[arg(long, value_name = "FILE")]
    srdf: Option<PathBuf>,
    /// Name of the robot, instead of the URDF's
    #[arg(long)]
    name: Option<String>,
    /// Folder to write to, with a copy of the URDF; created if missing. Default: the folder of the URDF
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Fix JOINT, which is not part of a leg, at a position in rad or m instead of 0; repeatable
    #[arg(long, value_name = "JOINT=POSITION", value_parser = position)]
    fix: Vec<(String, f64)>,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Whether the root of a robot can move.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum BaseArg {
    /// The root can move: a humanoid, a robot on wheels
    Floating,
    /// The root is fixed to the world: an arm
    Fixed,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let text = read_urdf(&args.urdf)?;
    let file = args.urdf.display().to_string();
    let urdf_name = args.urdf.file_name().context("the URDF has no file name")?.to_string_lossy().into_owned();
    let srdf = args.srdf.as_ref().map(|path| Ok::<_, anyhow::Error>((read_urdf(path)?, path.display().to_string())));
    let srdf = srdf.transpose()?;
    let options = Options {
        urdf_file: &urdf_name,
        beside: args.out.is_none(),
        srdf: srdf.as_ref().map(|(text, file)| (text.as_str(), file.as_str())),
        name: args.name.as_deref(),
        fixed: &args.fix,
        bounds: &|name| mesh::bounds(name, &args.urdf),
    };
    let proposal = match args.base {
        None => propose(&text, &file, &options),
        Some(BaseArg::Floating) => propose_any(&text, &file, Base::Floating, &options),
        Some(BaseArg::Fixed) => propose_any(&text, &file, Base::Fixed, &options),
    };
    let mut proposal = proposal.with_context(|| file.clone())?;
    let path = write(args, &text, &proposal)?;
    let Proposal { name, look_at, .. } = &mut proposal;
    if args.name.is_none()
        && shipped::find(&Path::new("robots").join(&*name)).is_some_and(|other| !same(&other, path.parent()))
    {
        look_at.push(format!(
            "robot.name: {name}, as in the URDF, is the name of another robot in robots/; set another one with --name"
        ));
    }
    if args.json {
        let Proposal { guesses, look_at, .. } = &proposal;
        let urdf = path.with_file_name(&proposal.urdf_file);
        say_json(&serde_json::json!({ "toml": path, "urdf": urdf, "guesses": guesses, "look_at": look_at }))?;
    } else {
        print(&proposal, &path)?;
    }
    Ok(Outcome::Good)
}

/// A `JOINT=POSITION`.
fn position(text: &str) -> Result<(String, f64), String> {
    let (joint, q) = text.split_once('=').ok_or("expected JOINT=POSITION")?;
    match q.trim().parse::<f64>() {
        Ok(q) if q.abs() <= 1e3 => Ok((joint.trim().to_owned(), q)),
        _ => Err(format!("found {q}, expected a position of -1000 to 1000 rad or m")),
    }
}

/// Whether two files or folders exist and are the same, by device and inode: a file may have several names.
fn same(a: &Path, b: Option<&Path>) -> bool {
    let identity = |path: &Path| std::fs::metadata(path).map(|file| (file.dev(), file.ino())).ok();
    b.is_some_and(|b| identity(a).is_some_and(|a| Some(a) == identity(b)))
}

/// Writes the parameter file, and the URDF if it is changed or goes into another folder.
fn write(args: &Args, urdf: &str, proposal: &Proposal) -> anyhow::Result<PathBuf> {
    let folder = args.out.clone().unwrap_or_else(|| args.urdf.parent().map(Path::to_owned).unwrap_or_default());
    if !folder.as_os_str().is_empty() {
        std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    let path = folder.join(format!("{}.toml", proposal.name));
    anyhow::ensure!(args.force || !path.exists(), "{} exists; --force replaces it", path.display());
    anyhow::ensure!(!same(&path, Some(&args.urdf)), "{} is the URDF; give another --out or --name", path.display());
    let copy = folder.join(&proposal.urdf_file);
    if same(&copy, Some(&args.urdf)) {
        anyhow::ensure!(
            proposal.urdf.is_none(),
            "{} would be replaced by a changed copy; give another --out or --name",
            copy.display()
        );
    } else {
        let content = proposal.urdf.as_deref().unwrap_or(urdf);
        let is_same = || std::fs::read(&copy).is_ok_and(|existing| existing == content.as_bytes());
        anyhow::ensure!(
            args.force || !copy.exists() || is_same(),
            "{} exists with another content; --force replaces it",
            copy.display()
        );
        std::fs::write(&copy, content).with_context(|| copy.display().to_string())?;
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
    let (gains, scenario) = match posture.is_empty() {
        false => ("- the gains, [posture] and [trunk]: they are HyQ's, scaled by the inertia of the legs", "flat_trot"),
        true => ("- the gains of the drives, [robot.joints], and the posture", "hold"),
    };
    say(gains)?;
    say(format!("\nwrote {}", path.display()))?;
    say(format!("try: hoof sim --robot {} --scenario scenarios/{scenario}.toml --log run.mcap", path.display()))
}
