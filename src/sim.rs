//! `hoof sim`: a lockstep run.

use crate::progress::Progress;
use crate::robot::{RobotFiles, read, with_overrides};
use crate::run_info::{self, Run};
use crate::{Outcome, say, say_json};
use anyhow::Context;
use controller::model::UrdfTree;
use controller::params::Params;
use drivers::{DriverError, MujocoSim, Scenario, SimParams, Terrain, lockstep};
use replay::record::{RingOptions, RingWriter};
use serde::Serialize;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(
    after_help = "Example: hoof sim --robot hyq --scenario scenarios/rough_trot.toml --seed 3 --log run.mcap\n         \
    hoof sim --robot hyq --scenario scenarios/flat_trot.toml --log run.lcmlog --set gait.trot.swing_frequency=3.5"
)]
pub struct Args {
    /// Name of a robot in robots/, or its TOML file
    #[arg(long)]
    robot: String,
    /// Scenario: terrain, operator commands, pushes, faults (TOML)
    #[arg(long, value_parser = drivers::shipped::argument)]
    scenario: PathBuf,
    /// Log to write: LCM event log (.lcmlog) or MCAP (.mcap); one that is there is replaced
    #[arg(long)]
    log: PathBuf,
    /// Stack of tasks, instead of the robot's; `--set stack.formula=...` for any other
    #[arg(long, value_enum)]
    stack: Option<Stack>,
    /// Length of the run, s, instead of the scenario's
    #[arg(long)]
    seconds: Option<f64>,
    /// Seed of terrain and noise, instead of the scenario's
    #[arg(long)]
    seed: Option<i64>,
    /// Set a parameter of the controller (`hoof robot info ROBOT --params` lists them); may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Replay the log before it is completed, and append the verdict to it as an EVENT
    #[arg(long)]
    prove: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Stacks of tasks there are.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub enum Stack {
    /// Weighted: contact, trunk and posture in one quadratic program
    S1,
    /// Hierarchical: contact before trunk before posture, three quadratic programs
    S3,
}

impl Stack {
    /// Its formula.
    pub fn formula(self) -> &'static str {
        match self {
            Stack::S1 => controller::stack::S1,
            Stack::S3 => controller::stack::S3,
        }
    }
}

/// What to simulate.
pub struct Job<'a> {
    /// Robot, as on the command line.
    pub robot: &'a str,
    /// File of the scenario.
    pub scenario: &'a Path,
    /// Log to write.
    pub log: &'a Path,
    /// Length of the run, s, instead of the scenario's.
    pub seconds: Option<f64>,
    /// Seed, instead of the scenario's.
    pub seed: Option<i64>,
    /// Parameters to change.
    pub set: &'a [String],
}

/// What to simulate, all of it read.
pub struct Setup {
    /// Name of the robot.
    pub robot: String,
    /// What errors call it: its name or file, as it was given.
    pub called: String,
    /// Text of its URDF.
    pub urdf: String,
    /// What errors call it.
    pub urdf_name: String,
    /// Every parameter, as TOML.
    pub params: String,
    /// The scenario, seed and length included.
    pub scenario: Scenario,
    /// Its text.
    pub scenario_text: String,
    /// Replay the log before it is completed.
    pub prove: bool,
}

/// How it went; the JSON of `hoof sim --json`.
#[derive(Serialize)]
pub struct Summary {
    log: PathBuf,
    robot: String,
    scenario: String,
    seed: i64,
    ticks: i64,
    sim_seconds: f64,
    wall_seconds: f64,
    real_time_factor: f64,
    /// The robot fell.
    pub fell: bool,
    fell_at_s: Option<f64>,
    /// Length of the base's way, m.
    pub distance_m: f64,
    /// When and why the controller went to its safe state, if it did.
    pub safe_state: Option<String>,
    /// The log replays bit for bit; only with `--prove`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proved: Option<bool>,
}

impl Summary {
    /// One sentence for a person.
    pub fn text(&self) -> String {
        let Summary { robot, scenario, ticks, sim_seconds, wall_seconds, real_time_factor, distance_m, log, .. } = self;
        let how = match (&self.fell_at_s, &self.safe_state) {
            (Some(t), _) => format!("fell after {t:.3} s"),
            (None, Some(why)) => format!("did not fall, but went to its safe state at {why}"),
            (None, None) => "did not fall".to_owned(),
        };
        let proof = match self.proved {
            Some(true) => "\nproved: the log replays bit for bit",
            Some(false) => "\nNOT proved: the log does not replay; its last EVENT says where",
            None => "",
        };
        format!(
            "{robot} on {scenario}, seed {}: {how}, {distance_m:.2} m in {sim_seconds:.1} s\n{ticks} ticks in {wall_seconds:.1} s of wall time \
             ({real_time_factor:.1} times real time), log {}{proof}",
            self.seed,
            log.display()
        )
    }
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let stack = args.stack.map(|stack| format!("stack.formula={}", stack.formula()));
    let set: Vec<String> = stack.into_iter().chain(args.set.iter().cloned()).collect();
    let job = Job {
        robot: &args.robot,
        scenario: &args.scenario,
        log: &args.log,
        seconds: args.seconds,
        seed: args.seed,
        set: &set,
    };
    let bar = Progress::new(format!("{} on {}", args.robot, args.scenario.display()));
    let setup = Setup { prove: args.prove, ..setup(&job)? };
    let summary =
        simulate_setup(setup, job.log, &mut |part| bar.set(part)).map_err(|error| in_scenario(error, &job))?;
    drop(bar);
    if args.json {
        say_json(&summary)?
    } else {
        say(summary.text())?
    }
    Ok(Outcome::failed_if(summary.fell || summary.safe_state.is_some() || summary.proved == Some(false)))
}

/// Simulates and logs; `progress` is told which part of the run is done, 0 to 1.
pub fn simulate(job: &Job, progress: &mut dyn FnMut(f64)) -> anyhow::Result<Summary> {
    simulate_setup(setup(job)?, job.log, progress).map_err(|error| in_scenario(error, job))
}

/// What a scenario names and the robot lacks is an error of the scenario's file.
fn in_scenario(error: anyhow::Error, job: &Job) -> anyhow::Error {
    match error.downcast_ref() {
        Some(DriverError::Unknown { .. }) => error.context(job.scenario.display().to_string()),
        _ => error,
    }
}

/// Reads what a job names.
fn setup(job: &Job) -> anyhow::Result<Setup> {
    let (files, params_text) = RobotFiles::find_with_params(job.robot)?;
    let params_text = with_overrides(&params_text, job.set)?;
    let params = Params::from_toml(&params_text, job.robot)?;
    let scenario_text = read(job.scenario)?;
    let mut scenario = Scenario::parse(&scenario_text, &job.scenario.display().to_string())?;
    if let Some(seconds) = job.seconds {
        anyhow::ensure!(
            (0.001..=36_000.0).contains(&seconds),
            "--seconds {seconds}: expected at least 0.001 and at most 36000"
        );
        scenario.duration_s = seconds;
    }
    scenario.seed = job.seed.unwrap_or(scenario.seed);
    Ok(Setup {
        robot: params.robot.name,
        called: job.robot.to_owned(),
        urdf_name: files.urdf_path.display().to_string(),
        urdf: files.urdf,
        params: params_text,
        scenario,
        scenario_text,
        prove: false,
    })
}

/// As [`simulate`], of what has been read before.
pub fn simulate_setup(setup: Setup, log_path: &Path, progress: &mut dyn FnMut(f64)) -> anyhow::Result<Summary> {
    let Setup { robot, called, urdf, urdf_name, params: params_text, scenario, scenario_text, prove } = setup;
    let params = Params::from_toml(&params_text, &robot)?;
    let seed = scenario.seed;
    let info = run_info::of(&Run {
        controller: controller::quadruped::NAME,
        robot: &robot,
        urdf: &urdf,
        params: &params_text,
        scenario: (&scenario.name, &scenario_text),
        seed,
    });
    let terrain = Terrain::new(&scenario.terrain, seed);
    let tree = UrdfTree::parse(&urdf, &urdf_name)?;
    let mut controller = controller::load(&info).context(called)?;
    let mut sim = MujocoSim::new(&tree, &params.robot, terrain, SimParams::of(&scenario))?;
    if let Some(folder) = log_path.parent() {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    let mut log = RingWriter::create(log_path, &RingOptions::lockstep())?;
    let outcome = lockstep::run(&scenario, &info, &mut sim, controller.as_mut(), &mut log, &mut |t_s| {
        progress(t_s / scenario.duration_s);
    });
    let outcome = match outcome {
        // The thread that writes the log has met something: it says what.
        Err(error @ DriverError::Log(replay::Error::WriterFailed { .. })) => {
            log.finish()?;
            return Err(error.into());
        }
        outcome => outcome?,
    };
    let proved = if prove {
        Some(replay::prove::is_proof(&replay::prove::prove(log_path, &mut log, crate::replay_log::threads())?))
    } else {
        None
    };
    log.finish()?;
    Ok(Summary {
        log: log_path.to_owned(),
        robot,
        scenario: scenario.name.clone(),
        seed,
        ticks: outcome.ticks,
        sim_seconds: outcome.sim_seconds,
        wall_seconds: outcome.wall_seconds,
        real_time_factor: outcome.sim_seconds / outcome.wall_seconds,
        fell: outcome.fell_at_s.is_some(),
        fell_at_s: outcome.fell_at_s,
        distance_m: outcome.distance_m,
        safe_state: outcome.safe_state,
        proved,
    })
}
