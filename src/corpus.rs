//! `hoof corpus`: golden logs that today's controller must repeat bit for bit.

use crate::progress::Progress;
use crate::replay_log::divergence_text;
use crate::{Outcome, say, say_json};
use clap::Subcommand;
use lcmtypes::channels;
use replay::corpus::{self, CorpusResult, Part};
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
    /// Make a golden log of a run, or of a part of it: trimmed to inputs, digests and snapshots
    #[command(
        after_help = "Example: hoof corpus add run.mcap --name flat_trot --why \"HyQ trots on flat ground\"\n         \
        hoof corpus add field.mcap --around 132.4 --name stumble_on_wet_ramp --why \"the field bug of March\""
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
        /// Only the ticks around this time, s since the log's first tick, from the recorded state before them on
        #[arg(long, value_name = "T")]
        around: Option<f64>,
        /// How much of the log lies around that time, s
        #[arg(long, value_name = "S", default_value_t = 2.0, requires = "around")]
        span: f64,
        /// Keep one more channel, such as LEG_STATE; may be repeated, `all` is every output of the controller
        #[arg(long, value_name = "CHANNEL")]
        keep: Vec<String>,
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
        Command::Add { log, name, why, around, span, keep, dir } => {
            let keep = kept(keep)?;
            let bytes = match around {
                None => corpus::add(dir, log, name, why, &keep)?,
                Some(around) => {
                    anyhow::ensure!(
                        *around >= 0.0 && *span > 0.0,
                        "--around {around} --span {span}: expected times in s"
                    );
                    let part = Part { around_s: *around, span_s: *span };
                    corpus::add_part(dir, log, part, name, why, &keep)?
                }
            };
            say(format!("{}: {bytes} bytes", dir.join(format!("{name}.mcap")).display()))?;
            Ok(Outcome::Good)
        }
    }
}

/// Channels to be kept besides those that a golden log keeps anyway.
fn kept(names: &[String]) -> anyhow::Result<Vec<&'static str>> {
    let outputs = || channels::CHANNELS.iter().filter(|channel| channel.stage.is_some()).map(|channel| channel.name);
    let mut kept = Vec::new();
    for name in names {
        match channels::find(name) {
            _ if name == "all" => kept.extend(outputs()),
            Some(channel) => kept.push(channel.name),
            None => anyhow::bail!(
                "--keep {name}: no such channel; there are: all, {}",
                outputs().collect::<Vec<_>>().join(", ")
            ),
        }
    }
    Ok(kept)
}

fn line(log: &CorpusResult) -> String {
    match log {
        CorpusResult { name, error: Some(error), .. } => format!("{name}: cannot be replayed: {error}"),
        CorpusResult { name, first_divergence: Some(d), largest_ulp, altered, .. } => {
            let ulp = largest_ulp.map_or(String::new(), |ulp| format!("\n  largest distance of two floats: {ulp} ulp"));
            let altered =
                if *altered { "\n  the file is not the one that was accepted: its hash is another" } else { "" };
            format!("{name}: {}{ulp}{altered}", divergence_text(d))
        }
        CorpusResult { name, identical: true, ticks, .. } => format!("{name}: identical: {ticks} ticks"),
        CorpusResult { name, .. } => format!("{name}: nothing to compare"),
    }
}
