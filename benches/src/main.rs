//! Execution times of this project and of peer libraries for the same problems: `make bench`.
//!
//! Each figure comes from a separate process that times single calls and prints one line of JSON per case: `bench one ...` for this
//! project, the programs that `scripts/bench_peers.sh` builds from `benches/peers/` for the peers. `bench run` starts the processes in turn,
//! in rounds, so that other load on the machine affects all of them equally. For each case it reports the median of the rounds' medians, for
//! each ratio the median of the rounds' ratios. The files of [`export`] contain the inputs of both sides and the results to compare.
//!
//! Rounds: [`run`]. Timed code: [`rigid_body`], [`programs`], [`ticks`], [`throughput`]. Result: [`table`].
#![allow(non_snake_case, reason = "names carry frames: see ARCHITECTURE.md")]

mod export;
mod inputs;
mod programs;
mod rigid_body;
mod run;
mod sample;
mod table;
mod throughput;
mod ticks;

use anyhow::Result;
use clap::{Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;

/// Measures execution times of the controller and of peer libraries.
///
/// Example: scripts/bench_peers.sh && cargo run --release -p benches --bin bench -- run
#[derive(Parser)]
#[command(name = "bench")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run all processes in rounds and print the tables as Markdown.
    Run(run::Args),
    /// Write states and quadratic programs for the peers.
    Export(export::Args),
    /// Time one part of this project and print one line of JSON per case.
    #[command(subcommand)]
    One(One),
}

#[derive(Subcommand)]
enum One {
    /// Time the quantities of the rigid-body model.
    RigidBody {
        /// File of states, written by `bench export`.
        states: PathBuf,
        /// URDF of the robot.
        urdf: PathBuf,
        /// Number of passes over the states.
        passes: usize,
    },
    /// Time the solver back-ends on quadratic programs.
    Programs {
        /// File of programs, written by `bench export`.
        programs: PathBuf,
        /// Number of passes over the programs.
        passes: usize,
    },
    /// Time ticks and their stages with the inputs of a log.
    Ticks {
        /// Log.
        log: PathBuf,
        /// Stack of tasks.
        #[arg(value_enum)]
        stack: inputs::Stack,
        /// Number of passes over the log.
        passes: usize,
    },
    /// Time a replay.
    Replay {
        /// Log.
        log: PathBuf,
        /// Number of threads.
        jobs: usize,
    },
}

fn main() -> ExitCode {
    match dispatch(Cli::parse().command) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn dispatch(command: Command) -> Result<ExitCode> {
    match command {
        Command::Run(args) => return run::run(&args),
        Command::Export(args) => export::export(&args)?,
        Command::One(One::RigidBody { states, urdf, passes }) => rigid_body::time(&states, &urdf, passes)?,
        Command::One(One::Programs { programs, passes }) => programs::time(&programs, passes)?,
        Command::One(One::Ticks { log, stack, passes }) => ticks::time(&log, stack, passes)?,
        Command::One(One::Replay { log, jobs }) => throughput::time(&log, jobs)?,
    }
    Ok(ExitCode::SUCCESS)
}
