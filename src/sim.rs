//! `hoof sim`: arguments and output of a lockstep run.

use crate::live::RunFile;
use crate::progress::Progress;
use crate::replay_log::threads;
use crate::{Outcome, note, run_info, say, say_json};
use anyhow::Context;
use controller::params::Params;
use controller::quadruped::implausible;
use drivers::components::EXTERNAL;
use drivers::robot_files::RobotFiles;
use drivers::simulation::{Components, Job, Setup, Summary};
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(
    after_help = "Example: hoof sim --robot hyq --scenario scenarios/rough_trot.toml --seed 3 --log run.mcap\n         \
    hoof sim --robot hyq --scenario scenarios/flat_trot.toml --log run.lcmlog --set gait.trot.swing_frequency=3.5\n         \
    hoof sim --robot hyq --gait gaits/crawl_orders.toml --scenario scenarios/further_gaits.toml --log gaits.mcap\n         \
    hoof sim runs/centauro_components.toml\n\n\
    Exit code 1 if the robot falls or the controller enters its safe state, or if --prove finds a difference."
)]
pub struct Args {
    /// Run file (TOML) with robot, scenario, log and components, instead of --robot, --scenario and --log
    #[arg(value_parser = drivers::shipped::argument)]
    run_file: Option<PathBuf>,
    /// Name of a robot in robots/, or its TOML file
    #[arg(long, required_unless_present = "run_file", conflicts_with = "run_file")]
    robot: Option<String>,
    /// Scenario file with terrain, operator commands, pushes and faults (TOML)
    #[arg(long, required_unless_present = "run_file", value_parser = drivers::shipped::argument)]
    scenario: Option<PathBuf>,
    /// Log to write: LCM event log (.lcmlog) or MCAP (.mcap); replaces an existing file
    #[arg(long, required_unless_present = "run_file")]
    log: Option<PathBuf>,
    /// Stack of tasks, instead of the robot's; use `--set stack.formula=...` for other stacks
    #[arg(long, value_enum)]
    stack: Option<Stack>,
    /// Length of the run, s, instead of the scenario's
    #[arg(long)]
    seconds: Option<f64>,
    /// Seed of terrain and noise, instead of the scenario's
    #[arg(long)]
    seed: Option<i64>,
    /// Set of parameters from a file beside the robot's, such as `printed` (robots/hyq/printed.toml): the controller as Raiola et al. 2020 print it
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
    /// File with further gaits, such as gaits/pace.toml; the scenario changes to them by name. Can be repeated
    #[arg(long, value_name = "FILE", value_parser = drivers::shipped::argument)]
    gait: Vec<PathBuf>,
    /// Set a parameter of the controller (`hoof robot info ROBOT --params` lists them); can be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Replay the log before it is finished, and append the verdict as an EVENT
    #[arg(long)]
    prove: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The predefined stacks of tasks.
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

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if let Some(seconds) = args.seconds {
        anyhow::ensure!(
            (0.001..=36_000.0).contains(&seconds),
            "--seconds {seconds}: expected at least 0.001 and at most 36000"
        );
    }
    let stack = args.stack.map(|stack| format!("stack.formula={}", stack.formula()));
    let set: Vec<String> = stack.into_iter().chain(args.set.iter().cloned()).collect();
    let file = args.run_file.as_deref().map(RunFile::load).transpose()?;
    let missing = || anyhow::anyhow!("the run file has no [simulation] with a scenario: add --scenario FILE");
    let of_file = |file: &RunFile| file.simulation.as_ref().map(|simulation| simulation.scenario.clone());
    let robot = file.as_ref().map(|file| &file.robot).or(args.robot.as_ref()).context("--robot")?;
    let scenario = args.scenario.clone().or_else(|| of_file(file.as_ref()?)).ok_or_else(missing)?;
    let log = args.log.as_ref().or(file.as_ref().map(|file| &file.log)).context("--log")?;
    let set = [file.as_ref().map(RunFile::set_of_first).unwrap_or_default(), set].concat();
    let gaits = [file.as_ref().map(|file| file.gait.clone()).unwrap_or_default(), args.gait.clone()].concat();
    if let Some(flag) = args.stack.map(|_| "--stack").or((!gaits.is_empty()).then_some("--gait")) {
        let (_, params) = RobotFiles::find_with_params(robot)?;
        anyhow::ensure!(
            Params::from_toml(&params, robot)?.robot.is_quadruped(),
            "{flag}: {robot} is not a quadruped (it has no robot.feet); gaits and stacks are of the controller quadruped"
        );
    }
    let first = file.as_ref().map(RunFile::first);
    let components = file.as_ref().map_or_else(Components::default, |file| Components {
        first: first.as_ref().map(|(name, kind)| (&**name, &**kind)),
        receives: file.receives(),
        running: Some(file.running()),
        preset: file.preset.as_deref(),
        others: file.others(),
        set: &file.set,
    });
    let job = Job {
        robot,
        scenario: &scenario,
        seconds: args.seconds,
        seed: args.seed,
        preset: args.preset.as_deref().or(file.as_ref().and_then(RunFile::preset_of_first)),
        gaits: &gaits,
        set: &set,
        components,
    };
    let bar = Progress::new(format!("{robot} on {}", scenario.display()));
    let setup = Setup { prove: args.prove.then(threads), ..Setup::read(&job)? };
    // A robot that is not a quadruped has no such checks.
    for warning in implausible(&setup.urdf, &setup.params).into_iter().flatten() {
        note(format!("warning: {warning}"));
    }
    for component in setup.others.0.iter().filter(|component| component.kind == EXTERNAL) {
        note(format!(
            "warning: component {} is external: it takes no part in a simulation in lockstep",
            component.name
        ));
    }
    let summary = setup.simulate(log, &run_info::build(), &mut |fraction| bar.set(fraction))?;
    drop(bar);
    if args.json {
        say_json(&summary)?
    } else {
        say(text(&summary))?
    }
    Ok(Outcome::failed_if(summary.failed() || summary.proved == Some(false)))
}

/// The result of a simulation for a terminal.
pub fn text(summary: &Summary) -> String {
    let Summary { robot, scenario, seed, ticks, sim_seconds, wall_seconds, real_time_factor, distance_m, log, .. } =
        summary;
    let result = match (&summary.fell_at_s, &summary.safe_state) {
        (Some(t), Some(why)) => format!("fell after {t:.3} s; the controller entered its safe state at {why}"),
        (Some(t), None) => format!("fell after {t:.3} s"),
        (None, Some(why)) => format!("did not fall; the controller entered its safe state at {why}"),
        (None, None) => "did not fall".to_owned(),
    };
    let proof = match summary.proved {
        Some(true) => "\nproved: the log replays bit for bit",
        Some(false) => {
            "\nNOT proved: the log does not replay bit for bit; its last EVENT contains the first difference"
        }
        None => "",
    };
    format!(
        "{robot} on {scenario}, seed {seed}: {result}, walked {distance_m:.2} m in {sim_seconds:.1} s\n{ticks} ticks in {wall_seconds:.1} s of wall \
         time ({real_time_factor:.1} times real time), log {}{proof}",
        log.display()
    )
}
