//! `hoof replay`: runs the controller of a log on its recorded inputs and compares every output bit; also what-if replays, sweeps,
//! closed-loop simulation and bisection.

pub mod bisect;
mod break_at;
mod resim;
mod revision;
mod sweep;
mod text;
mod timed_overrides;

use crate::progress::Progress;
use crate::robot::{check_overrides, overrides, read};
use crate::sim::Stack;
use crate::{Outcome, run_info, say, say_json};
use analysis::robot::Robot;
use anyhow::Context;
use replay::engine::{DEFAULT_BOUND, Options, Replay, ReplayReport};
use replay::printable;
use std::path::{Path, PathBuf};

pub use break_at::tree as moment_tree;
pub use text::{divergence_text, text};

#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Example: hoof replay run.mcap\n         hoof replay run.mcap --from 12 --to 15 --json\n         \
    hoof replay run.mcap --set wbc.friction=0.6 --out what_if.mcap\n         \
    hoof replay run.mcap --break 4812\n         \
    hoof replay run.mcap --component arms --set motion.velocity=0.3\n         \
    hoof replay run.mcap --sweep posture.stance_kp=300:700:5 --plot sweep.svg\n         \
    hoof replay run.mcap --set trunk.kp='[800, 800, 800]' --resim closed_loop.mcap\n         \
    hoof replay old.mcap --revision --repo ~/hoofprint\n         \
    hoof replay bisect run.mcap --good v1 --bad HEAD\n\n\
    Exit code 0: every recorded output is identical; 1: one differs, none is recorded, or a result of a component was delivered at another time than its latency says; 2: the log cannot be replayed; 3: nothing differs, but messages are missing, \
    late, doubled or cannot be decoded."
)]
pub struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Log to replay
    #[arg(required = true)]
    log: Option<PathBuf>,
    #[command(flatten)]
    one_run: crate::log::OneRun,
    /// Replay only this component of a run with several; --set, --changes, --urdf, --out, --sweep and --break change or show this one [default: replay all;
    /// these options: the first one]
    #[arg(long, value_name = "NAME", conflicts_with_all = ["resim", "revision"])]
    component: Option<String>,
    /// Replay with another value of a parameter, on the recorded inputs; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Change parameters during the replay: TOML file of `[[change]]` tables, each with `tick` or `t_s` and a table `set`
    #[arg(long, value_name = "FILE")]
    changes: Option<PathBuf>,
    /// Replay with another stack of tasks
    #[arg(long, value_enum)]
    stack: Option<Stack>,
    /// Replay with another QP solver
    #[arg(long, value_enum)]
    solver: Option<Solver>,
    /// Replay with another URDF; it must have the joints of the log's URDF
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Replay once for each value of a parameter, on all cores: FROM:TO:COUNT, or values separated by |
    #[arg(long, value_name = "KEY=FROM:TO:COUNT", conflicts_with_all = ["out", "resim"])]
    sweep: Option<String>,
    /// Plot the torques of what-if replays over the recorded ones, grey after the tick at which --bound is exceeded (.svg or .png)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Largest torque difference of a joint for which a what-if replay is valid, N m
    #[arg(long, value_name = "NM", default_value_t = DEFAULT_BOUND)]
    bound: f64,
    /// Simulate the run again in closed loop, with the log's scenario, seed and operator commands and the changes above, and write this log
    #[arg(long, value_name = "LOG2", conflicts_with = "changes")]
    resim: Option<PathBuf>,
    /// Print every quantity of a tick: inputs, results of each stage, and the conflicting constraints if the solver failed
    #[arg(long = "break", value_name = "TICK", conflicts_with_all = ["sweep", "resim", "out", "plot", "changes", "from", "to"])]
    at: Option<i64>,
    /// Start after the last snapshot before this time, s since the run's first tick
    #[arg(long, value_name = "S", value_parser = crate::log::seconds)]
    from: Option<f64>,
    /// Stop after the last tick at or before this time, s since the run's first tick
    #[arg(long, value_name = "S", value_parser = crate::log::seconds)]
    to: Option<f64>,
    /// Number of threads, 1 to 256 [default: all cores]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: Option<u16>,
    /// Write a copy of the log with the replayed outputs instead of the recorded ones
    #[arg(long, value_name = "LOG2")]
    out: Option<PathBuf>,
    /// Replay with the build of another revision, made from the source tree and kept [default REV: the revision that wrote the log]
    #[arg(long, value_name = "REV", num_args = 0..=1, default_missing_value = "", conflicts_with_all = ["set", "changes", "stack", "solver", "urdf", "sweep", "plot", "resim", "at", "from", "to", "out"])]
    revision: Option<String>,
    /// Root of the source tree, for --revision
    #[arg(long, value_name = "DIR", default_value = ".", requires = "revision")]
    repo: PathBuf,
    /// Directory for the builds of --revision
    #[arg(long, value_name = "DIR", default_value = "target/bisect", requires = "revision")]
    work: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
#[value(rename_all = "snake_case")]
enum Solver {
    /// Dual active-set method of Goldfarb and Idnani, the default
    ActiveSet,
    /// Interior-point method of Clarabel
    Clarabel,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Find the first revision that changes an output bit of a log, and which of its changes did
    Bisect(bisect::Args),
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if let Some(Command::Bisect(args)) = &args.command {
        return bisect::run(args);
    }
    let Some(log) = &args.log else { anyhow::bail!("no log given: expected hoof replay LOG") };
    let log = &args.one_run.of(log);
    if let Some(revision) = &args.revision {
        return revision::run(log, revision, &args.repo, &args.work, args.json);
    }
    run_log(args, log, &options(args)?).map_err(|error| revision::name(log, name_files(args, error)))
}

/// Adds the files given on the command line to an error of building the controller: the cause may be in them and not in the log.
fn name_files(args: &Args, error: anyhow::Error) -> anyhow::Error {
    let given = [("--urdf", &args.urdf), ("--changes", &args.changes)];
    let given: Vec<String> =
        given.iter().filter_map(|(name, file)| Some(format!("{name} {}", file.as_ref()?.display()))).collect();
    match error.downcast_ref() {
        Some(replay::Error::Load { .. }) if !given.is_empty() => error.context(format!("with {}", given.join(" and "))),
        _ => error,
    }
}

fn run_log(args: &Args, log: &Path, options: &Options) -> anyhow::Result<Outcome> {
    let inputs = [Some(log), args.urdf.as_deref(), args.changes.as_deref()];
    for (option, out) in [("--out", &args.out), ("--resim", &args.resim), ("--plot", &args.plot)] {
        let Some(out) = out else { continue };
        let mut inputs = inputs.iter().flatten();
        inputs.try_for_each(|input| replay::Error::check_distinct_files(input, out)).context(option)?;
    }
    let component = args.component.as_deref();
    let replay = open(log, component)?;
    check_overrides("--set", replay.info().params(), &args.set)?;
    if let Some(tick) = args.at {
        return break_at::run(&replay, options, tick, args.json);
    }
    if let Some(sweep) = &args.sweep {
        return sweep::run(&replay, options, sweep, args.plot.as_deref(), args.json);
    }
    if let Some(out) = &args.resim {
        return resim::run(log, options, out, args.json);
    }
    let report = with_bar(&replay, options)?;
    if let (Some(path), Some(what_if)) = (&args.plot, &report.what_if) {
        sweep::plot(path, &[("replayed".to_owned(), what_if)])?;
    }
    anyhow::ensure!(
        args.plot.is_none() || report.what_if.is_some(),
        "--plot: needs a what-if replay: --set, --changes, --stack, --solver, --urdf or --sweep"
    );
    if args.json {
        say_json(&report)?
    } else {
        let (joints, first) = (joints(&replay), replay.info().component());
        let part = match component {
            None if replay.is_in_part(options) => {
                format!("component {} only; --component selects another one\n", printable(first))
            }
            _ => String::new(),
        };
        say(part + &text(&report, &joints))?
    }
    Ok(outcome(&report))
}

fn options(args: &Args) -> anyhow::Result<Options> {
    if let (Some(from), Some(to)) = (args.from, args.to) {
        anyhow::ensure!(from <= to, "--from {from} is after --to {to}");
    }
    anyhow::ensure!(args.bound > 0.0, "--bound {}: expected a torque above 0 N m", args.bound);
    let mut set = overrides(&args.set)?;
    if let Some(stack) = args.stack {
        set.insert(0, ("stack.formula".to_owned(), stack.formula().to_owned()));
    }
    if let Some(solver) = args.solver {
        let name = match solver {
            Solver::ActiveSet => "active_set",
            Solver::Clarabel => "clarabel",
        };
        set.insert(0, ("qp.solver".to_owned(), name.to_owned()));
    }
    Ok(Options {
        set,
        timed_overrides: args.changes.as_deref().map(timed_overrides::read_file).transpose()?.unwrap_or_default(),
        urdf: args.urdf.as_deref().map(read).transpose()?,
        bound: Some(args.bound),
        here: Some(run_info::build()),
        from_s: args.from,
        to_s: args.to,
        jobs: args.jobs.map_or_else(threads, usize::from),
        out: args.out.clone(),
    })
}

/// Number of threads of this machine.
pub fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Opens a log for the replay of one component, or of all of them.
pub fn open(log: &Path, component: Option<&str>) -> anyhow::Result<Replay<'static>> {
    let replay = Replay::open(log)?;
    Ok(match component {
        Some(name) => replay.of_component(name)?,
        None => replay,
    })
}

/// Replays with a progress bar.
pub fn replay(log: &Path, options: &Options) -> anyhow::Result<ReplayReport> {
    with_bar(&Replay::open(log)?, options)
}

fn with_bar(replay: &Replay, options: &Options) -> anyhow::Result<ReplayReport> {
    let bar = Progress::new("replay");
    Ok(replay.run(options, &mut |part| bar.set(part))?)
}

/// Names of the joints, URDF order.
fn joints(replay: &Replay) -> Vec<String> {
    let robot = Robot::parse(&replay.info().urdf);
    robot.iter().flat_map(Robot::joint_names).map(str::to_owned).collect()
}

/// Exit code of a replay: a difference comes before data loss.
pub fn outcome(report: &ReplayReport) -> Outcome {
    if report.first_divergence.is_some() || report.release_violations.count > 0 {
        Outcome::Failed
    } else if !report.complete {
        Outcome::DataLoss
    } else {
        Outcome::failed_if(!report.identical)
    }
}
