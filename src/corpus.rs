//! `hoof corpus`: golden logs that the controller must replay bit for bit.

use crate::progress::Progress;
use crate::replay_log::{divergence_text, threads};
use crate::{Outcome, say, say_json};
use analysis::replay_comparison;
use anyhow::Context;
use clap::Subcommand;
use lcmtypes::channels;
use replay::corpus::{self, Corpus, CorpusResult, Part};
use std::path::{Path, PathBuf};

#[derive(Subcommand)]
pub enum Command {
    /// Replay every golden log and compare every bit
    #[command(
        after_help = "Example: hoof corpus check\n         hoof corpus check --html changed && xdg-open changed/index.html"
    )]
    Check {
        /// Directory of the corpus
        #[arg(long, default_value = "logs/golden")]
        dir: PathBuf,
        /// Write an HTML page into this directory: the first change in each log, its size, and figures before and after
        #[arg(long, value_name = "DIR")]
        html: Option<PathBuf>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Record a golden log again: same inputs, outputs of this build
    #[command(after_help = "Example: hoof corpus accept flat_trot --why \"swing height 0.08 m\"")]
    Accept {
        /// Name in the corpus
        name: String,
        /// Reason for the changed outputs, for the manifest
        #[arg(long)]
        why: String,
        /// Directory of the corpus
        #[arg(long, default_value = "logs/golden")]
        dir: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Make a golden log from a run or a part of it: inputs, digests and snapshots of every tick, other outputs of every twentieth tick
    #[command(
        after_help = "Example: hoof corpus add run.mcap --name flat_trot --why \"HyQ trots on flat ground\"\n         \
        hoof corpus add field.mcap --around 132.4 --name stumble_on_wet_ramp --why \"the field bug of March\""
    )]
    Add {
        /// Log of the run
        log: PathBuf,
        #[command(flatten)]
        one_run: crate::log::OneRun,
        /// Name in the corpus
        #[arg(long)]
        name: String,
        /// Purpose of the log, for the manifest
        #[arg(long)]
        why: String,
        /// Keep only the ticks around this time, s since the run's first tick, starting at the snapshot before them
        #[arg(long, value_name = "T")]
        around: Option<f64>,
        /// Length of that part, s
        #[arg(long, value_name = "S", default_value_t = 2.0, requires = "around")]
        span: f64,
        /// Keep this channel of every tick, such as LEG_STATE; may be repeated; `all` keeps every output of the controller
        #[arg(long, value_name = "CHANNEL")]
        keep: Vec<String>,
        /// Directory of the corpus
        #[arg(long, default_value = "logs/golden")]
        dir: PathBuf,
    },
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Check { dir, html, json } => {
            let bar = Progress::new("corpus");
            let corpus = Corpus::open_with(dir, controller::load)?;
            let logs = corpus.check(threads());
            drop(bar);
            anyhow::ensure!(!logs.is_empty(), "{}: contains no golden log", dir.display());
            let page = html.as_deref().map(|out| page(&corpus, &logs, out)).transpose()?;
            if *json {
                say_json(&serde_json::json!({ "logs": logs, "page": page }))?;
            } else {
                for log in &logs {
                    say(line(log))?;
                }
                if let Some(page) = page {
                    say(format!("page: {}", page.display()))?;
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
                say(format!("recorded again: {} bytes, {} before", accepted.bytes, accepted.bytes_before))?;
            }
            Ok(Outcome::Good)
        }
        Command::Add { log, one_run, name, why, around, span, keep, dir } => {
            let log = &one_run.of(log);
            let keep = kept(keep)?;
            let bytes = match around {
                None => corpus::add(dir, log, name, why, &keep)?,
                Some(around) => {
                    anyhow::ensure!(
                        *around >= 0.0 && *span > 0.0,
                        "--around {around} --span {span}: expected --around at least 0 s and --span above 0 s"
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

/// Writes the HTML page. The logs that the figures are made from are temporary.
fn page(corpus: &Corpus, logs: &[CorpusResult], out: &Path) -> anyhow::Result<PathBuf> {
    let bar = Progress::new("page");
    let sides = out.join("sides");
    std::fs::create_dir_all(&sides).with_context(|| sides.display().to_string())?;
    let mut shown = Vec::new();
    for log in logs {
        let CorpusResult { name, identical, first_divergence, .. } = log;
        let of_log = ["before", "after"].map(|side| sides.join(format!("{name}_{side}.mcap")));
        if first_divergence.is_some() {
            corpus.sides(name, &of_log[0], &of_log[1])?;
        }
        shown.push(replay_comparison::Log {
            name: name.clone(),
            why: corpus.why(name).unwrap_or_default().to_owned(),
            identical: *identical,
            verdict: line(log).trim_start_matches(name).trim_start_matches(": ").to_owned(),
            sides: first_divergence.is_some().then_some(of_log),
        });
    }
    let page = replay_comparison::write(&shown, out, &mut |p| bar.set(p.done as f64 / p.total.max(1) as f64))?;
    std::fs::remove_dir_all(&sides).with_context(|| sides.display().to_string())?;
    Ok(page)
}

/// Channels to keep in addition to those of every golden log.
fn kept(names: &[String]) -> anyhow::Result<Vec<&'static str>> {
    let outputs = || channels::CHANNELS.iter().filter(|channel| channel.stage.is_some()).map(|channel| channel.name);
    let mut kept = Vec::new();
    for name in names {
        match channels::find(name) {
            _ if name == "all" => kept.extend(outputs()),
            Some(channel) => kept.push(channel.name),
            None => anyhow::bail!(
                "--keep {name}: unknown channel, expected one of: all, {}",
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
            let ulp =
                largest_ulp.map_or(String::new(), |ulp| format!("\n  largest difference of two floats: {ulp} ulp"));
            let altered = if *altered {
                "\n  the file was changed after it was accepted: its SHA-256 differs from the manifest"
            } else {
                ""
            };
            format!("{name}: {}{ulp}{altered}", divergence_text(d))
        }
        CorpusResult { name, identical: true, ticks, .. } => format!("{name}: identical: {ticks} ticks"),
        CorpusResult { name, .. } => format!("{name}: nothing to compare: the log contains no outputs"),
    }
}
