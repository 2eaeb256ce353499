//! `hoof experiment`: arguments and output. The crate `experiments` computes.

mod limit;

use crate::progress::Progress;
use crate::{Outcome, run_info, say, say_json};
use analysis::table::{Column, Table};
use anyhow::Context;
use clap::Subcommand;
use experiments::bench::{Bar, file_stem};
use experiments::tables::markdown;
use experiments::{ALL, Bench, Experiment, find};
use std::path::{Path, PathBuf};

#[derive(Subcommand)]
pub enum Command {
    /// List the experiments with robot, number of seeds and duration
    #[command(after_help = "Example: hoof experiment list --json")]
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Run experiments and print a table of published, wanted and measured values
    #[command(
        after_help = "Example: hoof experiment run A3 --seeds 20 --seed 100\n         hoof experiment run A2 A4 --markdown tables.md\n         \
        hoof experiment run all --markdown docs/experiments.md\n\n\
        Each run is kept as a log beside its scenario and is replayed bit for bit before the table is printed. A row without a target\n\
        is marked \"not judged\". Exit code 1 if a row misses its target."
    )]
    Run {
        /// Identifiers, such as A3 or limits; `all` runs every experiment
        #[arg(required = true)]
        ids: Vec<String>,
        /// Name of a robot in robots/, or its TOML file, instead of the experiment's own
        #[arg(long)]
        robot: Option<String>,
        /// Number of seeds, instead of the experiment's own; ignored by experiments without seeds
        #[arg(long, value_parser = clap::value_parser!(i64).range(1..=10_000))]
        seeds: Option<i64>,
        /// First seed; experiments without seeds run all their scenarios with it. Default: 0, and the seeds of the scenarios
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(i64).range(0..=1_000_000_000))]
        seed: Option<i64>,
        /// Folder for logs, scenarios and figures; created if missing
        #[arg(long, value_name = "DIR", default_value = "logs/runs/experiments")]
        out: PathBuf,
        /// Also write the tables to a Markdown file
        #[arg(long, value_name = "FILE")]
        markdown: Option<PathBuf>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Find the largest value of a scenario key that a robot survives
    Limit(limit::Args),
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::List { json } => list(*json).map(|()| Outcome::Good),
        Command::Run { ids, robot, seeds, seed, out, markdown: file, json } => {
            let experiments = find(ids)?;
            let mut all = Vec::with_capacity(experiments.len());
            for experiment in experiments {
                let robot = robot.as_deref().unwrap_or(experiment.robot);
                let dir = out.join(experiment.id).join(file_stem(robot));
                let tables = experiment.measure(&bench(robot, seeds.unwrap_or(experiment.seeds), *seed, &dir)?)?;
                if !json {
                    say(tables.text())?;
                }
                all.push(tables);
                if let Some(path) = file {
                    let text = markdown(&all, &run_info::build());
                    std::fs::write(path, text).with_context(|| path.display().to_string())?;
                }
            }
            if *json {
                match &all[..] {
                    [one] => say_json(one)?,
                    several => say_json(&several)?,
                }
            }
            Ok(Outcome::failed_if(all.iter().any(|tables| !tables.pass)))
        }
        Command::Limit(args) => limit::run(args),
    }
}

/// A bench of this build, with progress bars on standard error.
fn bench(robot: &str, seeds: i64, first_seed: Option<i64>, dir: &Path) -> anyhow::Result<Bench> {
    let new_bar = |title: String| -> Bar {
        let bar = Progress::new(title);
        Box::new(move |fraction| bar.set(fraction))
    };
    Ok(Bench::new(robot, seeds, dir, run_info::build(), Box::new(new_bar))?.starting_at(first_seed))
}

fn list(json: bool) -> anyhow::Result<()> {
    if json {
        let entry = |e: &Experiment| {
            let Experiment { id, title, published, robot, seeds, minutes, .. } = e;
            serde_json::json!({
                "id": id, "title": title, "published": published, "robot": robot, "seeds": seeds, "minutes": minutes,
            })
        };
        return say_json(&ALL.iter().map(entry).collect::<Vec<_>>());
    }
    let mut table = Table::new([
        Column::left("id"),
        Column::left("title"),
        Column::left("robot"),
        Column::right("seeds"),
        Column::right("minutes"),
    ]);
    for Experiment { id, title, published, robot, seeds, minutes, .. } in ALL {
        table.row([(*id).to_owned(), (*title).to_owned(), (*robot).to_owned(), seeds.to_string(), minutes.to_string()]);
        table.row(["", &format!("published: {published}")]);
    }
    say(table)
}
