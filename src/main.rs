//! The command `hoof`: one file per subcommand, which parses arguments and prints; the crates compute.
//!
//! Exit codes: 0 good, 1 the check failed, 2 usage or input error, 3 done, with data loss.
#![allow(non_snake_case, reason = "names carry frames, as in p_WF = p_WB + R_WB * p_BF: see ARCHITECTURE.md")]

mod bridge;
mod corpus;
mod debug;
mod demo;
mod doctor;
mod experiment;
mod install_files;
mod live;
mod log;
mod outcome;
mod progress;
mod replay_log;
mod report;
mod robot;
mod run_info;
mod sim;
mod solve;
mod spy;
mod task;
mod teleop;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use outcome::{Outcome, note, say, say_json};
use std::process::ExitCode;

/// Log-centric whole-body control for legged robots: every run is a log, every log replays bit for bit.
#[derive(Parser)]
#[command(name = "hoof", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Simulate a trot of HyQ over rough terrain, log it, replay the log bit for bit, and write a report
    Demo(demo::Args),
    /// Simulate a robot in lockstep with its controller, and log every message
    Sim(sim::Args),
    /// Run live: start recorder, driver and controller as processes over LCM, and write one log
    Run(live::RunArgs),
    /// Run the controller in real time against a driver on LCM
    Controller(live::ControllerArgs),
    Component(live::ComponentArgs),
    /// Simulate a robot in real time, in place of its driver process on LCM
    Driver(live::DriverArgs),
    /// Start or stop a controller of a live run
    Ctl(live::CtlArgs),
    Set(live::SetArgs),
    /// Feed the inputs of a log to its controller again, and compare every bit of every output
    Replay(Box<replay_log::Args>),
    Teleop(teleop::Args),
    Doctor(doctor::Args),
    /// Step through a log tick by tick in the terminal: legs, forces, tasks, quadratic programs, events
    Debug(debug::Args),
    /// Write figures, tables, metrics.json and report.html of logs, or check metrics against limits
    Report(report::Args),
    /// Reproduce experiments of the source documents, and compare measured with published values
    #[command(subcommand, after_help = "Example: hoof experiment list\n         hoof experiment run A3 --seeds 20")]
    Experiment(experiment::Command),
    Spy(Box<spy::Args>),
    Task(task::Args),
    /// Connect a live run to other middleware
    #[command(
        subcommand,
        after_help = "Example: hoof bridge ros2\n         hoof bridge ros2 --allow-commands --domain 7"
    )]
    Bridge(bridge::Command),
    /// Inspect, convert, record and play logs
    #[command(
        subcommand,
        after_help = "Example: hoof log info run.mcap\n         hoof log trim run.mcap part.mcap --from 10 --to 20\n         hoof log cat run.mcap --channels EVENT"
    )]
    Log(log::Command),
    /// Check and extend the regression corpus: golden logs that must replay bit for bit
    #[command(
        subcommand,
        after_help = "Example: hoof corpus check\n         hoof corpus add run.mcap --name flat_trot --why \"HyQ trots on flat ground\""
    )]
    Corpus(corpus::Command),
    /// Inspect robots, evaluate their models, and write a first parameter file
    #[command(
        subcommand,
        after_help = "Example: hoof robot info hyq --params\n         hoof robot init my_robot.urdf --out robots/my_robot"
    )]
    Robot(robot::Command),
    Solve(solve::Args),
    /// Write shell completions and manual pages
    #[command(hide = true)]
    InstallFiles(install_files::Args),
}

fn main() -> ExitCode {
    // A closed pipe (`hoof log cat run.mcap | head`) ends the program quietly, as it does for every Unix tool.
    let matches = with_negative_numbers(Cli::command()).get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let result = match cli.command {
        Command::Demo(args) => demo::run(&args),
        Command::Sim(args) => sim::run(&args),
        Command::Run(args) => live::run(&args),
        Command::Controller(args) => live::controller(&args),
        Command::Component(args) => live::component(&args),
        Command::Driver(args) => live::driver(&args),
        Command::Ctl(args) => live::ctl(&args),
        Command::Set(args) => live::set(&args),
        Command::Replay(args) => replay_log::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Teleop(args) => teleop::run(&args),
        Command::Debug(args) => debug::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Experiment(command) => experiment::run(&command),
        Command::Task(args) => task::run(&args),
        Command::Spy(args) => spy::run(&args),
        Command::Bridge(command) => bridge::run(&command),
        Command::Log(command) => log::run(&command),
        Command::Corpus(command) => corpus::run(&command),
        Command::Robot(command) => robot::run(&command),
        Command::Solve(args) => solve::run(&args),
        Command::InstallFiles(args) => install_files::run(&args, Cli::command()),
    };
    match result {
        Ok(Outcome::Good) => ExitCode::SUCCESS,
        Ok(Outcome::Failed) => ExitCode::from(1),
        Ok(Outcome::DataLoss) => ExitCode::from(3),
        Err(error) if is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            note(format!("error: {}", message(&error)));
            ExitCode::from(2)
        }
    }
}

/// The command and its subcommands, whose options take negative numbers as values: `--from -1` is a value out of range, not an unknown option.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let takes_values = |argument: &clap::Arg| argument.get_action().takes_values();
    command
        .mut_args(|argument| if takes_values(&argument) { argument.allow_negative_numbers(true) } else { argument })
        .mut_subcommands(with_negative_numbers)
}

/// The error and its causes, each once: some messages contain their cause.
fn message(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if text.contains(&cause) {
            continue;
        }
        // "cannot read log a.mcap" and "a.mcap: not found" name the file once.
        let shared = cause.match_indices(": ").map(|(end, _)| end).filter(|end| text.ends_with(&cause[..*end])).last();
        text = match shared {
            Some(end) => format!("{text}{}", &cause[end..]),
            None => format!("{text}: {cause}"),
        };
    }
    text
}

fn is_closed_pipe(error: &anyhow::Error) -> bool {
    let closed = |error: &std::io::Error| error.kind() == std::io::ErrorKind::BrokenPipe;
    error.downcast_ref().is_some_and(closed)
}
