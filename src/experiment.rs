//! `hoof experiment`: reproduce an experiment of the source documents, measured beside published.

mod bench;
mod impedance;
mod limit;
mod recipes;
mod scenario_edit;
mod states;
mod table;

use crate::{Outcome, say, say_json};
use anyhow::Context;
use bench::Bench;
use clap::Subcommand;
use std::path::PathBuf;
use std::time::Instant;
use table::{Row, Tables};

#[derive(Subcommand)]
pub enum Command {
    /// The experiments there are: what each does, with which robot, how long it takes
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Run some: simulates, keeps and replays the logs, prints published, wanted and measured
    #[command(
        after_help = "Example: hoof experiment run A3 --seeds 20\n         hoof experiment run A2 A4 --markdown tables.md\n         \
        hoof experiment run all --markdown docs/experiments.md\n\n\
        Every run is kept as a log with the scenario that made it beside it, and is replayed bit for bit before the table is printed. \
        Exit code 1 if a row fails."
    )]
    Run {
        /// Their numbers, such as A3; `limits`; or `all`
        #[arg(required = true)]
        ids: Vec<String>,
        /// Name of a robot in robots/, or its TOML file, instead of the experiment's own
        #[arg(long)]
        robot: Option<String>,
        /// Number of seeds, where the experiment has several, instead of its own
        #[arg(long, value_parser = clap::value_parser!(i64).range(1..=10_000))]
        seeds: Option<i64>,
        /// Folder for logs, scenarios and figures; made if need be
        #[arg(long, value_name = "DIR", default_value = "logs/runs/experiments")]
        out: PathBuf,
        /// Write the tables as Markdown too
        #[arg(long, value_name = "FILE")]
        markdown: Option<PathBuf>,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// The largest value of a key of a scenario that a robot survives
    Limit(limit::Args),
}

/// An experiment: what it is and how it is run.
pub struct Experiment {
    /// Number, as in the papers' list.
    pub id: &'static str,
    /// What is done.
    pub title: &'static str,
    /// What the source says of it.
    pub published: &'static str,
    /// Robot that it is run on unless the user says otherwise.
    pub robot: &'static str,
    /// Seeds that it takes unless the user says otherwise; 1 = it knows no seeds.
    pub seeds: i64,
    /// How long it takes on two cores, min.
    pub minutes: f64,
    /// Runs it.
    pub run: fn(&Bench) -> anyhow::Result<Vec<Row>>,
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::List { json } => list(*json).map(|()| Outcome::Good),
        Command::Run { ids, robot, seeds, out, markdown, json } => {
            let experiments = find(ids)?;
            let mut all = Vec::with_capacity(experiments.len());
            for experiment in experiments {
                let robot = robot.as_deref().unwrap_or(experiment.robot);
                let bench = Bench::new(
                    robot,
                    seeds.unwrap_or(experiment.seeds),
                    &out.join(experiment.id).join(robot_name(robot)),
                )?;
                let begin = Instant::now();
                let mut rows = (experiment.run)(&bench).with_context(|| format!("experiment {}", experiment.id))?;
                rows.extend(bench.replays());
                let tables = Tables::new(experiment, &bench, rows, begin.elapsed().as_secs_f64());
                if !json {
                    say(tables.text())?;
                }
                all.push(tables);
                if let Some(path) = markdown {
                    std::fs::write(path, table::markdown(&all)).with_context(|| path.display().to_string())?;
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

/// The experiments of these numbers, in the order of the list for `all`.
fn find(ids: &[String]) -> anyhow::Result<Vec<&'static Experiment>> {
    if ids.iter().any(|id| id.eq_ignore_ascii_case("all")) {
        return Ok(recipes::ALL.iter().collect());
    }
    let one = |id: &String| {
        recipes::ALL.iter().find(|e| e.id.eq_ignore_ascii_case(id)).with_context(|| {
            let known: Vec<_> = recipes::ALL.iter().map(|e| e.id).collect();
            format!("no experiment \"{id}\", there are: {}, all", known.join(", "))
        })
    };
    ids.iter().map(one).collect()
}

/// The name of a robot, also of one given by its file.
fn robot_name(robot: &str) -> String {
    std::path::Path::new(robot).file_stem().map_or(robot.to_owned(), |stem| stem.to_string_lossy().into_owned())
}

fn list(json: bool) -> anyhow::Result<()> {
    if json {
        let entry = |e: &Experiment| {
            let Experiment { id, title, published, robot, seeds, minutes, .. } = e;
            serde_json::json!({
                "id": id, "title": title, "published": published, "robot": robot, "seeds": seeds, "minutes": minutes,
            })
        };
        return say_json(&recipes::ALL.iter().map(entry).collect::<Vec<_>>());
    }
    let width = recipes::ALL.iter().map(|experiment| experiment.id.len()).max().unwrap_or(0) + 2;
    for Experiment { id, title, published, robot, seeds, minutes, .. } in recipes::ALL {
        let seeds = if *seeds > 1 { format!(", {seeds} seeds") } else { String::new() };
        say(format!(
            "{id:<width$}{title}\n{:width$}published: {published}\n{:width$}{robot}{seeds}, about {minutes} min",
            "", ""
        ))?;
    }
    Ok(())
}
