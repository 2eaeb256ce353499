//! The result of an experiment: its rows, as text, JSON and Markdown.

use crate::row::Row;
use analysis::table::{Column, Table};
use replay::engine::Build;
use serde::Serialize;
use std::path::PathBuf;

/// The result of one experiment on one robot.
#[derive(Serialize)]
pub struct Tables {
    /// Identifier of the experiment.
    pub id: &'static str,
    /// What was done.
    pub title: &'static str,
    /// What the source reports.
    pub published: &'static str,
    /// The robot.
    pub robot: String,
    /// The measured quantities.
    pub rows: Vec<Row>,
    /// Remarks, such as what was compared or which parameters differ between two robots.
    pub notes: Vec<String>,
    /// Figures that were written.
    pub figures: Vec<PathBuf>,
    /// Folder of the logs.
    pub logs: PathBuf,
    /// Duration of the experiment, s of wall time.
    pub seconds: f64,
    /// No row misses its target.
    pub pass: bool,
}

impl Tables {
    /// Text for a terminal.
    pub fn text(&self) -> String {
        let [published, wanted, measured] = ["published", "wanted", "measured"].map(Column::right);
        let mut table =
            Table::new([Column::left(""), published, wanted, measured, Column::left("unit"), Column::left("pass")]);
        for row in &self.rows {
            let [published, wanted, measured, pass] = row.cells();
            table.row([row.name.clone(), published, wanted, measured, row.unit.to_owned(), pass]);
        }
        let mut text = format!("{}, {}: {}\n{table}", self.id, self.robot, self.title);
        for note in &self.notes {
            text += &format!("\n\n{note}");
        }
        for figure in &self.figures {
            text += &format!("\nfigure: {}", figure.display());
        }
        // An experiment without runs writes no file.
        let has_logs = std::fs::read_dir(&self.logs).is_ok_and(|mut files| files.next().is_some());
        let logs = if has_logs { format!("logs: {}, ", self.logs.display()) } else { String::new() };
        text + &format!("\n{logs}{:.0} s\n", self.seconds)
    }

    fn markdown(&self) -> String {
        let Tables { id, title, published, robot, rows, notes, .. } = self;
        let mut text = format!("## {id}, {robot}: {title}\n\nPublished: {published}.\n\n");
        text += "| | published | wanted | measured | unit | pass |\n|---|---|---|---|---|---|\n";
        for row in rows {
            let [published, wanted, measured, pass] = row.cells();
            let pass = if pass == "NO" { "**no**".to_owned() } else { pass };
            let name = row.name.replace('|', "\\|");
            text += &format!("| {name} | {published} | {wanted} | {measured} | {} | {pass} |\n", row.unit);
        }
        for note in notes {
            text += &format!("\n```text\n{note}\n```\n");
        }
        text
    }
}

/// All tables as Markdown, after a summary that lists the rows that miss their target.
pub fn markdown(all: &[Tables], build: &Build) -> String {
    let mut text = "# Experiments\n\nThe experiments of Raiola et al. 2020: published and measured values. Written by `hoof experiment run all \
                    --markdown docs/experiments.md`.\nA row that is not judged has no target.\n\n"
        .to_owned();
    text += &format!("Build {}, {}.\n\n", build.revision, build.toolchain);
    text += "| experiment | robot | rows that pass | rows that fail |\n|---|---|---|---|\n";
    for tables in all {
        let judged = tables.rows.iter().filter(|row| row.pass.is_some());
        let failed: Vec<&str> =
            judged.clone().filter(|row| row.pass == Some(false)).map(|row| row.name.as_str()).collect();
        let (n, failed_n) = (judged.count(), failed.len());
        let Tables { id, title, robot, .. } = tables;
        text += &format!("| {id}: {title} | {robot} | {} of {n} | {} |\n", n - failed_n, failed.join("; "));
    }
    for tables in all {
        text += &format!("\n{}", tables.markdown());
    }
    text
}
