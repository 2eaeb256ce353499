//! `hoof corpus`: golden logs that today's controller must repeat bit for bit.

use crate::progress::Progress;
use crate::replay_log::divergence_text;
use crate::{Outcome, say, say_json};
use clap::Subcommand;
use replay::corpus::{self, CorpusResult};
use std::path::PathBuf;

#[derive(Subcommand)]
pub enum Command {
    /// Replay every golden log and compare every bit
    #[command(after_help = "Example: hoof corpus check")]
    Check {
        /// Folder of the corpus
        #[arg(long, default_value = "logs/golden")]
        dir: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Record a golden log anew: its inputs, today's outputs
    #[command(after_help = "Example: hoof corpus accept flat_trot --why \"swing height 0.08 m\"")]
    Accept {
        /// Name in the corpus
        name: String,
        /// Why its outputs may change
        #[arg(long)]
        why: String,
        /// Folder of the corpus
        #[arg(long, default_value = "logs/golden")]
        dir: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Make a golden log of a run: trimmed to inputs, digests and snapshots
    #[command(
        after_help = "Example: hoof corpus add run.mcap --name stumble_on_wet_ramp --why \"the field bug of March\""
    )]
    Add {
        /// Log of the run
        log: PathBuf,
        /// Name in the corpus
        #[arg(long)]
        name: String,
        /// What it is for
        #[arg(long)]
        why: String,
        /// Folder of the corpus
        #[arg(long, default_value = "logs/golden")]
        dir: PathBuf,
    },
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Check { dir, json } => {
            let bar = Progress::new("corpus");
            let jobs = std::thread::available_parallelism().map_or(1, usize::from);
            let logs = corpus::check(dir, jobs)?;
            drop(bar);
            anyhow::ensure!(!logs.is_empty(), "{}: no golden log, so nothing was checked", dir.display());
            if *json {
                say_json(&serde_json::json!({ "logs": logs }))?;
            } else {
                for log in &logs {
                    say(line(log))?;
                }
            }
            Ok(Outcome::failed_if(logs.iter().any(|log| !log.identical)))
        }
        Command::Accept { name, why, dir, json } => {
            let accepted = corpus::accept(dir, name, why)?;
            if *json {
                say_json(&accepted)?;
            } else {
                say(format!("before: {}", line(&accepted.before)))?;
                say(format!("recorded anew: {} bytes, {} before", accepted.bytes, accepted.bytes_before))?;
            }
            Ok(Outcome::Good)
        }
        Command::Add { log, name, why, dir } => {
            let bytes = corpus::add(dir, log, name, why, &[])?;
            say(format!("{}: {bytes} bytes", dir.join(format!("{name}.mcap")).display()))?;
            Ok(Outcome::Good)
        }
    }
}

fn line(log: &CorpusResult) -> String {
    match log {
        CorpusResult { name, error: Some(error), .. } => format!("{name}: cannot be replayed: {error}"),
        CorpusResult { name, first_divergence: Some(d), .. } => format!("{name}: {}", divergence_text(d)),
        CorpusResult { name, identical: true, ticks, .. } => format!("{name}: identical: {ticks} ticks"),
        CorpusResult { name, .. } => format!("{name}: nothing to compare"),
    }
}
