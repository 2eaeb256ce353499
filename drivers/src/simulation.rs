//! A complete lockstep simulation: from the files of a robot and a scenario to a finished log.

use crate::components::{self, CommonParams, ComponentEntry};
use crate::lockstep::LockstepOthers;
use crate::robot_files::{RobotFiles, read};
use crate::run_info::{self, Run};
use crate::{DriverError, MujocoSim, Scenario, SimParams, Terrain, lockstep};
use controller::params::Params;
use lcmtypes::ComponentInfo;
use replay::engine::Build;
use replay::record::{RingOptions, RingWriter};
use robot_model::UrdfTree;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What to simulate, by file names.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// Name of a robot in `robots/`, or its TOML file.
    pub robot: &'a str,
    /// Scenario file.
    pub scenario: &'a Path,
    /// Length of the run, s, instead of the scenario's.
    pub seconds: Option<f64>,
    /// Seed, instead of the scenario's.
    pub seed: Option<i64>,
    /// Preset of the robot's parameters; see [`RobotFiles::find_changed`].
    pub preset: Option<&'a str>,
    /// Gait files: further gaits of the run.
    pub gaits: &'a [PathBuf],
    /// Parameters to change, each `KEY=VALUE`.
    pub set: &'a [String],
    /// The components of a run file.
    pub components: Components<'a>,
}

/// The components of a run file.
#[derive(Clone, Copy, Debug, Default)]
pub struct Components<'a> {
    /// Name and kind of the first one; `None`: the controller of the scenario.
    pub first: Option<(&'a str, &'a str)>,
    /// Channels that the first one listens to.
    pub receives: &'a [String],
    /// Which controllers of a sequence run, one bit each; `None`: the first one.
    pub running: Option<i64>,
    /// Preset of the parameters of the others, unless they have their own.
    pub preset: Option<&'a str>,
    /// Parameters to change in the others, before their own.
    pub set: &'a [String],
    /// The others.
    pub others: &'a [ComponentEntry],
}

/// What to simulate, with all files read.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Name of the robot.
    pub robot: String,
    /// Robot as the user gave it (name or file); used in errors.
    pub robot_source: String,
    /// Text of its URDF.
    pub urdf: String,
    /// Where the URDF comes from; used in errors.
    pub urdf_source: String,
    /// Every parameter, as TOML.
    pub params: String,
    /// Name and kind of the first component.
    pub first: (String, String),
    /// Channels that the first component listens to.
    pub receives: Vec<String>,
    /// Which controllers of a sequence run, one bit each.
    pub running: i64,
    /// Entries of the other components, and their descriptions.
    pub others: (Vec<ComponentEntry>, Vec<ComponentInfo>),
    /// The scenario, with seed and length of this run.
    pub scenario: Scenario,
    /// Its text, for RUN_INFO.
    pub scenario_text: String,
    /// Where the scenario comes from; used in errors.
    pub scenario_source: String,
    /// Files that were read; none of them is the log to write.
    pub inputs: Vec<PathBuf>,
    /// Replay the log before it is finished, and append the verdict as an EVENT. The value is the number of threads.
    pub prove: Option<usize>,
}

/// Result of a simulation; the JSON of `hoof sim --json`.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// The log.
    pub log: PathBuf,
    /// Name of the robot.
    pub robot: String,
    /// Name of the scenario.
    pub scenario: String,
    /// Seed of terrain and noise.
    pub seed: i64,
    /// Control ticks.
    pub ticks: i64,
    /// Simulated time, s.
    pub sim_seconds: f64,
    /// Wall time, s.
    pub wall_seconds: f64,
    /// `sim_seconds / wall_seconds`.
    pub real_time_factor: f64,
    /// The robot fell.
    pub fell: bool,
    /// Time of the fall, s.
    pub fell_at_s: Option<f64>,
    /// Distance walked by the base, m; see [`lockstep::Outcome::distance_m`].
    pub distance_m: f64,
    /// Time and reason of the controller's safe state, if it entered it.
    pub safe_state: Option<String>,
    /// The log replays bit for bit; only with [`Setup::prove`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proved: Option<bool>,
}

impl Summary {
    /// The robot fell, or the controller entered its safe state.
    pub fn failed(&self) -> bool {
        self.fell || self.safe_state.is_some()
    }
}

impl Setup {
    /// Reads the files of a job and applies its changes.
    ///
    /// # Errors
    /// Missing or invalid files and parameters; the message names file and key.
    pub fn read(job: &Job) -> Result<Self, DriverError> {
        let (mut files, params_text) = RobotFiles::find_changed(job.robot, job.preset, job.gaits, job.set)?;
        let params = Params::from_toml(&params_text, job.robot)?;
        let (scenario_text, scenario_source) = (read(job.scenario)?, job.scenario.display().to_string());
        let mut scenario = Scenario::parse(&scenario_text, &scenario_source, &params.gait)?;
        scenario.duration_s = job.seconds.unwrap_or(scenario.duration_s);
        scenario.seed = job.seed.unwrap_or(scenario.seed);
        files.read.push(job.scenario.to_owned());
        let Components { first, receives, running, preset, set, others } = job.components;
        let kind = first.map_or(&*scenario.controller, |(_, kind)| kind).to_owned();
        let name = first.map_or(kind.split('(').next().unwrap_or_default(), |(name, _)| name).to_owned();
        if kind == controller::quadruped::NAME && !params.robot.is_quadruped() {
            return Err(DriverError::NoFeet { robot: params.robot.name });
        }
        let common = CommonParams { robot: job.robot, preset, gaits: job.gaits, set };
        let infos = components::resolve(others, (&name, receives), common)?;
        Ok(Setup {
            first: (name, kind),
            receives: receives.to_vec(),
            running: running.unwrap_or(1),
            others: (others.to_vec(), infos),
            robot: params.robot.name,
            robot_source: job.robot.to_owned(),
            urdf_source: files.urdf_path.display().to_string(),
            urdf: files.urdf,
            params: params_text,
            scenario,
            scenario_text,
            scenario_source,
            inputs: files.read,
            prove: None,
        })
    }

    /// Simulates and logs.
    ///
    /// - `log_path`: log to write (`.lcmlog` or `.mcap`); an existing file is replaced, a missing folder is created.
    /// - `build`: this build, for RUN_INFO.
    /// - `progress`: called with the completed fraction, 0 to 1.
    ///
    /// # Errors
    /// A robot, parameters and scenario that do not fit each other, a simulation that diverges, a log that cannot be written.
    pub fn simulate(
        &self,
        log_path: &Path,
        build: &Build,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Summary, DriverError> {
        self.inputs.iter().try_for_each(|input| replay::Error::check_distinct_files(input, log_path))?;
        // An unknown or ambiguous name, and too many floors, are errors of the scenario file.
        self.run(log_path, build, progress).map_err(|error| match error {
            DriverError::Unknown { .. } | DriverError::ObjectNamedAsLink { .. } | DriverError::TooManyFloors { .. } => {
                DriverError::InScenario { file: self.scenario_source.clone(), source: Box::new(error) }
            }
            error => error,
        })
    }

    fn run(&self, log_path: &Path, build: &Build, progress: &mut dyn FnMut(f64)) -> Result<Summary, DriverError> {
        let Setup { robot, robot_source, urdf, urdf_source, params: params_text, scenario, scenario_text, .. } = self;
        let params = Params::from_toml(params_text, robot)?;
        let seed = scenario.seed;
        let run = Run {
            first: (&self.first.0, &self.first.1),
            others: &self.others.1,
            robot,
            urdf,
            params: params_text,
            scenario: (&scenario.name, scenario_text),
            objects: &scenario.objects,
            seed,
        };
        let info = run_info::describe(&run, build);
        let terrain = Terrain::new(&scenario.terrain, seed);
        let tree = UrdfTree::parse(urdf, urdf_source)?;
        let mut controller = controller::load(&info)
            .map_err(Box::new)
            .map_err(|source| DriverError::Controller { robot: robot_source.clone(), source })?;
        let others = LockstepOthers::build(&info, &self.others.0, &self.receives)?.with_running(self.running);
        let mut sim = MujocoSim::new(&tree, &params.robot, terrain, SimParams::of(scenario))?;
        if let Some(folder) = log_path.parent() {
            std::fs::create_dir_all(folder)
                .map_err(|source| DriverError::Folder { path: folder.to_owned(), source })?;
        }
        let mut log = RingWriter::create(log_path, &RingOptions::lockstep())?;
        let outcome = lockstep::run(scenario, &info, &mut sim, &mut controller, others, &mut log, &mut |t_s| {
            progress(t_s / scenario.duration_s);
        });
        let outcome = match outcome {
            // The writer thread failed; `finish` returns its error, which has the reason.
            Err(error @ DriverError::Log(replay::Error::WriterFailed { .. })) => {
                log.finish()?;
                return Err(error);
            }
            outcome => outcome?,
        };
        let proved = match self.prove {
            Some(threads) => Some(replay::prove::is_proof(&replay::prove::prove(log_path, &mut log, threads)?)),
            None => None,
        };
        log.finish()?;
        Ok(Summary {
            log: log_path.to_owned(),
            robot: robot.clone(),
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
}
