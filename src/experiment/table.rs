//! What an experiment found: rows of figures, as text, JSON and Markdown.

use super::Experiment;
use super::bench::Bench;
use serde::Serialize;
use std::path::PathBuf;

/// One figure of an experiment.
#[derive(Debug, Serialize)]
pub struct Row {
    /// What.
    pub name: String,
    /// What the source prints, if it prints a figure.
    pub published: Option<f64>,
    /// What it is to be, such as "<= 10"; empty where there is no limit.
    pub wanted: String,
    /// What this run gave; not a number where there was nothing to measure.
    pub measured: f64,
    /// Of all of them.
    pub unit: &'static str,
    /// Whether the measured figure is good enough; `None` where there is no limit.
    pub pass: Option<bool>,
}

impl Row {
    /// A figure to know.
    pub fn noted(name: impl Into<String>, measured: f64, unit: &'static str) -> Self {
        Row { name: name.into(), published: None, wanted: String::new(), measured, unit, pass: None }
    }

    /// The same, with what the source prints.
    pub fn published(self, published: f64) -> Self {
        Row { published: Some(published), ..self }
    }

    /// The same, with a largest value that passes.
    pub fn at_most(self, limit: f64) -> Self {
        Row { wanted: format!("<= {}", number(limit)), pass: Some(self.measured <= limit), ..self }
    }

    /// The same, with a smallest value that passes.
    pub fn at_least(self, limit: f64) -> Self {
        Row { wanted: format!(">= {}", number(limit)), pass: Some(self.measured >= limit), ..self }
    }

    /// The same, with the one value that passes.
    pub fn exactly(self, value: f64) -> Self {
        let close = (self.measured - value).abs() < 1e-9;
        Row { wanted: number(value), pass: Some(close), ..self }
    }
}

/// All that came of an experiment.
#[derive(Serialize)]
pub struct Tables {
    id: &'static str,
    title: &'static str,
    published: &'static str,
    robot: String,
    rows: Vec<Row>,
    /// Remarks: what was compared, what differs between two robots.
    notes: Vec<String>,
    figures: Vec<PathBuf>,
    logs: PathBuf,
    seconds: f64,
    /// No row fails.
    pub pass: bool,
}

impl Tables {
    pub fn new(experiment: &Experiment, bench: &Bench, rows: Vec<Row>, seconds: f64) -> Self {
        let pass = rows.iter().all(|row| row.pass != Some(false));
        let Experiment { id, title, published, .. } = experiment;
        let (notes, figures) = bench.remarks();
        let (robot, logs) = (bench.robot().to_owned(), bench.dir().to_owned());
        Tables { id, title, published, robot, rows, notes, figures, logs, seconds, pass }
    }

    /// For a terminal.
    pub fn text(&self) -> String {
        let width = self.rows.iter().map(|row| row.name.len()).max().unwrap_or(0).max(30);
        let mut text = format!("{}, {}: {}\n", self.id, self.robot, self.title);
        text += &format!("{:<width$} {:>10} {:>10} {:>10} {:<6} pass", "", "published", "wanted", "measured", "unit");
        for row in &self.rows {
            let [published, wanted, measured, pass] = row.cells();
            text +=
                &format!("\n{:<width$} {published:>10} {wanted:>10} {measured:>10} {:<6} {pass}", row.name, row.unit);
        }
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
    /// Published, wanted, measured, pass.
    fn cells(&self) -> [String; 4] {
        let pass = self.pass.map_or("", |pass| if pass { "yes" } else { "NO" });
        [self.published.map_or(String::new(), number), self.wanted.clone(), number(self.measured), pass.to_owned()]
    }
}

/// The tables one below the other, with what failed on top.
pub fn markdown(all: &[Tables]) -> String {
    let mut text = "# Experiments\n\nThe experiments of Raiola et al. 2020, measured beside published; made by `hoof experiment run all --markdown \
                    docs/experiments.md`.\nA row without a wanted figure is there to know.\n\n"
        .to_owned();
    text += &format!("Build {}, {}.\n\n", env!("HOOF_REVISION"), env!("HOOF_TOOLCHAIN"));
    text += "| experiment | robot | rows that pass | what does not |\n|---|---|---|---|\n";
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

/// Four digits after the point for small figures, fewer for large ones, powers of ten for tiny ones.
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
    fn a_row_passes_on_its_limit_and_never_without_a_measurement() {
        let row = |measured| Row::noted("delay", measured, "ms");
        assert_eq!([row(10.0).at_most(10.0).pass, row(10.1).at_most(10.0).pass], [Some(true), Some(false)]);
        assert_eq!([row(20.0).at_least(20.0).pass, row(19.9).at_least(20.0).pass], [Some(true), Some(false)]);
        let nothing = [row(f64::NAN).at_most(1.0), row(f64::NAN).at_least(1.0), row(f64::NAN).exactly(0.0)];
        assert!(nothing.iter().all(|row| row.pass == Some(false)));
        assert_eq!(row(f64::NAN).cells(), ["", "", "-", ""]);
        assert_eq!(row(0.012_34).published(0.0101).at_most(0.0101).cells(), ["0.0101", "<= 0.0101", "0.0123", "NO"]);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([3.0, 1.25, 1180.44, 3.2e-14].map(number), ["3", "1.2500", "1180.4", "3.2e-14"]);
    }
}
