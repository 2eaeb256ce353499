//! `hoof experiment`: reproduce an experiment of the source documents, measured beside published.

mod bench;
mod recipes;

use crate::{Outcome, say, say_json};
use bench::Bench;
use clap::Subcommand;
use serde::Serialize;
use std::path::PathBuf;

#[derive(Subcommand)]
pub enum Command {
    /// The experiments there are
    List {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Run one: simulates, keeps the logs, prints published, measured and pass
    #[command(after_help = "Example: hoof experiment run A3 --seeds 20")]
    Run {
        /// Its number, such as A3
        id: String,
        /// Name of a robot in robots/, or its TOML file
        #[arg(long, default_value = "hyq")]
        robot: String,
        /// Number of seeds, where the experiment has several
        #[arg(long, default_value_t = 20)]
        seeds: i64,
        /// Folder for logs and reports; made if need be
        #[arg(long, value_name = "DIR", default_value = "logs/runs/experiments")]
        out: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
}

/// An experiment: what it is and how it is run.
pub struct Experiment {
    /// Number, as in the papers' list.
    pub id: &'static str,
    /// What is done.
    pub title: &'static str,
    /// What the source says of it.
    pub published: &'static str,
    /// Runs it.
    pub run: fn(&Bench) -> anyhow::Result<Vec<Row>>,
}

/// One figure of an experiment.
#[derive(Debug, Serialize)]
pub struct Row {
    /// What.
    pub name: String,
    /// What the source prints, if it prints a figure.
    pub published: Option<f64>,
    /// What this run gave.
    pub measured: f64,
    /// Of both.
    pub unit: &'static str,
    /// Whether the measured figure is good enough; `None` where there is no limit.
    pub pass: Option<bool>,
}

impl Row {
    /// A figure that must be at most the published one.
    pub fn at_most(name: impl Into<String>, published: f64, measured: f64, unit: &'static str) -> Self {
        Row { name: name.into(), published: Some(published), measured, unit, pass: Some(measured <= published) }
    }

    /// A figure with a limit of our own, where the source prints none.
    pub fn limited(name: impl Into<String>, measured: f64, unit: &'static str, pass: bool) -> Self {
        Row { name: name.into(), published: None, measured, unit, pass: Some(pass) }
    }

    /// A figure to know.
    pub fn noted(name: impl Into<String>, measured: f64, unit: &'static str) -> Self {
        Row { name: name.into(), published: None, measured, unit, pass: None }
    }
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::List { json } => {
            list(*json)?;
            Ok(Outcome::Good)
        }
        Command::Run { id, robot, seeds, out, json } => {
            let Some(experiment) = recipes::ALL.iter().find(|e| e.id.eq_ignore_ascii_case(id)) else {
                let known: Vec<_> = recipes::ALL.iter().map(|e| e.id).collect();
                anyhow::bail!("no experiment \"{id}\", there are: {}", known.join(", "));
            };
            anyhow::ensure!(*seeds > 0, "--seeds {seeds}: expected at least 1");
            let bench = Bench::new(robot, *seeds, &out.join(experiment.id).join(robot_name(robot)))?;
            let rows = (experiment.run)(&bench)?;
            let pass = rows.iter().all(|row| row.pass != Some(false));
            if *json {
                let (id, logs) = (experiment.id, bench.dir());
                say_json(&serde_json::json!({ "id": id, "robot": robot, "rows": rows, "pass": pass, "logs": logs }))?;
            } else {
                say(table(experiment, robot, &rows))?;
                say(format!("\nlogs: {}", bench.dir().display()))?;
            }
            Ok(Outcome::failed_if(!pass))
        }
    }
}

/// The name of a robot, also of one given by its file.
fn robot_name(robot: &str) -> String {
    std::path::Path::new(robot).file_stem().map_or(robot.to_owned(), |stem| stem.to_string_lossy().into_owned())
}

fn list(json: bool) -> anyhow::Result<()> {
    if json {
        let list: Vec<_> = recipes::ALL
            .iter()
            .map(|e| serde_json::json!({ "id": e.id, "title": e.title, "published": e.published }))
            .collect();
        return say_json(&list);
    }
    for e in recipes::ALL {
        say(format!("{:<4} {}\n     published: {}", e.id, e.title, e.published))?;
    }
    Ok(())
}

fn table(experiment: &Experiment, robot: &str, rows: &[Row]) -> String {
    let mut text = format!("{}, {robot}: {}\n", experiment.id, experiment.title);
    text += &format!("{:<38} {:>10} {:>10} {:<6} pass", "", "published", "measured", "unit");
    for row in rows {
        let published = row.published.map_or("-".to_owned(), number);
        let pass = row.pass.map_or("", |pass| if pass { "yes" } else { "NO" });
        text += &format!("\n{:<38} {published:>10} {:>10} {:<6} {pass}", row.name, number(row.measured), row.unit);
    }
    text
}

/// Four digits after the point for small figures, fewer for large ones.
fn number(x: f64) -> String {
    if x == x.trunc() && x.abs() < 1e6 {
        format!("{x:.0}")
    } else if x.abs() < 10.0 {
        format!("{x:.4}")
    } else {
        format!("{x:.1}")
    }
}
