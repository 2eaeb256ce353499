//! How long things take, and how long the peers take for the same, in the same minutes: `make bench`.
//!
//! Every figure comes from a process of its own that times single calls and prints one line of JSON a case: `bench one ...` for ours, the
//! programs that `scripts/bench_peers.sh` builds of `benches/peers/` for the others. `bench run` calls them in turn, round after round, so
//! that what else the machine does meets all of them alike; of each case it takes the median of the rounds' medians, and of each
//! ratio the median of the rounds' ratios. What both sides are given, and what is compared, is in the files of [`export`].
//!
//! Where to read on: [`run`] has the rounds, [`rigid_body`], [`programs`], [`ticks`] and [`throughput`] what is timed, [`table`] the result.
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

/// Times the controller beside its peers.
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
    /// All of it, in rounds: prints the tables as Markdown.
    Run(run::Args),
    /// Writes states and quadratic programs for the peers.
    Export(export::Args),
    /// Times one thing of ours and prints a line of JSON a case.
    #[command(subcommand)]
    One(One),
}

#[derive(Subcommand)]
enum One {
    /// The quantities of the rigid-body model.
    RigidBody {
        /// File of states, written by `bench export`.
        states: PathBuf,
        /// URDF of the robot.
        urdf: PathBuf,
        /// How often each state is used.
        passes: usize,
    },
    /// The back-ends on quadratic programs.
    Programs {
        /// File of programs, written by `bench export`.
        programs: PathBuf,
        /// How often each program is solved.
        passes: usize,
    },
    /// Whole ticks and their stages, fed with the inputs of a log.
    Ticks {
        /// The log.
        log: PathBuf,
        /// Stack of tasks.
        #[arg(value_enum)]
        stack: inputs::Stack,
        /// How often the log is fed.
        passes: usize,
    },
    /// A replay, digests compared.
    Replay {
        /// The log.
        log: PathBuf,
        /// Threads.
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
