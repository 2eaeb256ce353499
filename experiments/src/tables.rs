//! Results of an experiment: judged rows, as text, JSON and Markdown.

use crate::Experiment;
use crate::bench::Bench;
use analysis::table::{Column, Table};
use replay::engine::Build;
use serde::Serialize;
use std::path::PathBuf;

/// [`Row::wanted`] of a row without a target.
pub const NOT_JUDGED: &str = "not judged";

/// One measured quantity of an experiment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Name of the quantity.
    pub name: String,
    /// Value that the source reports, if any.
    pub published: Option<f64>,
    /// Target, such as "<= 10"; [`NOT_JUDGED`] if there is none.
    pub wanted: String,
    /// Measured value; NaN (`null` in JSON) if there was nothing to measure, which misses every target.
    pub measured: f64,
    /// Unit of all values; empty for counts and ratios.
    pub unit: &'static str,
    /// Whether the measured value meets the target; `None` for a row that is not judged.
    pub pass: Option<bool>,
}

impl Row {
    /// A row that is not judged.
    pub fn info(name: impl Into<String>, measured: f64, unit: &'static str) -> Self {
        Row { name: name.into(), published: None, wanted: NOT_JUDGED.to_owned(), measured, unit, pass: None }
    }

    /// Adds the value that the source reports.
    pub fn published(self, published: f64) -> Self {
        Row { published: Some(published), ..self }
    }

    /// Judges the row: passes up to and including `limit`.
    pub fn at_most(self, limit: f64) -> Self {
        Row { wanted: format!("<= {}", number(limit)), pass: Some(self.measured <= limit), ..self }
    }

    /// Judges the row: passes from `limit` on, inclusive.
    pub fn at_least(self, limit: f64) -> Self {
        Row { wanted: format!(">= {}", number(limit)), pass: Some(self.measured >= limit), ..self }
    }

    /// Removes the target.
    pub fn not_judged(self) -> Self {
        Row { wanted: NOT_JUDGED.to_owned(), pass: None, ..self }
    }

    /// Judges the row: passes within 1e-9 of `value`.
    pub fn exactly(self, value: f64) -> Self {
        let close = (self.measured - value).abs() < 1e-9;
        Row { wanted: number(value), pass: Some(close), ..self }
    }
}

/// The result of one experiment on one robot.
#[derive(Serialize)]
pub struct Tables {
    id: &'static str,
    title: &'static str,
    published: &'static str,
    robot: String,
    rows: Vec<Row>,
    /// Remarks, such as what was compared or which parameters differ between two robots.
    notes: Vec<String>,
    figures: Vec<PathBuf>,
    logs: PathBuf,
    seconds: f64,
    /// No row misses its target.
    pub pass: bool,
}

impl Tables {
    /// Collects rows, remarks and figures of a finished experiment.
    pub fn new(experiment: &Experiment, bench: &Bench, rows: Vec<Row>, seconds: f64) -> Self {
        let pass = rows.iter().all(|row| row.pass != Some(false));
        let Experiment { id, title, published, .. } = experiment;
        let (notes, figures) = bench.remarks();
        let (robot, logs) = (bench.robot().to_owned(), bench.dir().to_owned());
        Tables { id, title, published, robot, rows, notes, figures, logs, seconds, pass }
    }

    /// The rows.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

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
        text + &format!("\nlogs: {}, {:.0} s\n", self.logs.display(), self.seconds)
    }

    fn markdown(&self) -> String {
        let Tables { id, title, published, robot, rows, notes, .. } = self;
        let mut text = format!("## {id}, {robot}: {title}\n\nPublished: {published}.\n\n");
        text += "| | published | wanted | measured | unit | pass |\n|---|---|---|---|---|---|\n";
        for row in rows {
            let [published, wanted, measured, pass] = row.cells();
            let pass = if pass == "NO" { "**no**".to_owned() } else { pass };
            text += &format!("| {} | {published} | {wanted} | {measured} | {} | {pass} |\n", row.name, row.unit);
        }
        for note in notes {
            text += &format!("\n```text\n{note}\n```\n");
        }
        text
    }
}

impl Row {
    /// Cells of the columns published, wanted, measured, pass.
    fn cells(&self) -> [String; 4] {
        let pass = self.pass.map_or("", |pass| if pass { "yes" } else { "NO" });
        [self.published.map_or(String::new(), number), self.wanted.clone(), number(self.measured), pass.to_owned()]
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

/// A value for a table: four decimals below 10, one from there on, a power of ten below 5e-4, none for whole numbers; `-` for NaN.
fn number(x: f64) -> String {
    if x.is_nan() {
        "-".to_owned()
    } else if x == x.trunc() && x.abs() < 1e6 {
        format!("{x:.0}")
    } else if x.abs() < 5e-4 {
        format!("{x:.1e}")
    } else if x.abs() < 10.0 {
        format!("{x:.4}")
    } else {
        format!("{x:.1}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_inclusive_and_nan_never_passes() {
        let row = |measured| Row::info("delay", measured, "ms");
        assert_eq!([row(10.0).at_most(10.0).pass, row(10.1).at_most(10.0).pass], [Some(true), Some(false)]);
        assert_eq!([row(20.0).at_least(20.0).pass, row(19.9).at_least(20.0).pass], [Some(true), Some(false)]);
        let nothing = [row(f64::NAN).at_most(1.0), row(f64::NAN).at_least(1.0), row(f64::NAN).exactly(0.0)];
        assert!(nothing.iter().all(|row| row.pass == Some(false)));
        assert_eq!(row(f64::NAN).cells(), ["", NOT_JUDGED, "-", ""]);
        assert_eq!(row(1.0).exactly(2.0).not_judged(), row(1.0));
        assert_eq!(row(0.012_34).published(0.0101).at_most(0.0101).cells(), ["0.0101", "<= 0.0101", "0.0123", "NO"]);
    }

    #[test]
    fn values_are_printed_with_few_digits() {
        assert_eq!([3.0, 1.25, 1180.44, 3.2e-14].map(number), ["3", "1.2500", "1180.4", "3.2e-14"]);
    }
}
