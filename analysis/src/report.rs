//! The report of one log or several: a folder with figures, tables, metrics and an HTML page.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::figures::{self, Figure, Named, NotDrawn};
use crate::html::{Content, Part};
use crate::metrics::Metrics;
use crate::numeric_table::NumericTable;
use crate::plots::Plots;
use crate::run::Run;
use crate::timeline::{self, TimelineEntry};
use crate::{Error, Progress, Stage, animation, html, tables};

/// A report that was written.
#[derive(Clone, Debug)]
pub struct Report {
    /// Path of the page, `report.html`.
    pub html: PathBuf,
    /// Path of `metrics.json`.
    pub metrics_json: PathBuf,
    /// All files written, including the two above.
    pub files: Vec<PathBuf>,
    /// Metrics of the first log.
    pub metrics: Metrics,
    /// Names and metrics of all logs.
    pub runs: Vec<(String, Metrics)>,
    /// Timeline of each log.
    pub timelines: Vec<Vec<TimelineEntry>>,
    /// Figures that could not be drawn.
    pub not_drawn: Vec<NotDrawn>,
}

/// Options of a report.
#[derive(Clone, Debug, Default)]
pub struct ReportOptions {
    /// Figures to draw.
    pub plots: Plots,
    /// Names of the logs in figures and tables; missing names are the file names.
    pub names: Vec<String>,
    /// Further files that were read. A report overwrites none of them, nor a log.
    pub inputs: Vec<PathBuf>,
}

/// Writes the report of a log into a folder, which is created if missing: `report.html` (self-contained), `metrics.json`, `happenings.json` (the timeline),
/// tables as text, CSV, LaTeX and JSON, each figure as SVG, PDF and PNG, and the animation `walk.svg`.
///
/// A log with missing channels, a cut or damage is reported as far as possible, and the report lists what is missing. Equal logs give equal bytes.
///
/// # Errors
/// [`Error::Log`] if the log cannot be read, [`Error::NothingToReport`] if it has no tick, [`Error::Write`] or [`Error::Figure`] if a file cannot be
/// written.
pub fn report(log: &Path, out_dir: &Path, progress: &mut dyn FnMut(Progress)) -> Result<Report, Error> {
    report_with(&[log.to_owned()], out_dir, &ReportOptions::default(), progress)
}

/// As [`report`], with options, for one log or several. Several logs are overlaid in figures and compared in tables, and `metrics.json` has a list `runs`.
///
/// # Errors
/// As [`report`]; [`Error::NoLog`] without a log.
pub fn report_with(
    logs: &[PathBuf],
    out_dir: &Path,
    options: &ReportOptions,
    progress: &mut dyn FnMut(Progress),
) -> Result<Report, Error> {
    let mut runs: Vec<Run> = Vec::new();
    for log in logs {
        runs.push(Run::read_with(log, &options.plots.fields(), progress)?);
    }
    let names = names_of(&runs, &options.names);
    let numbers: Vec<(String, Metrics)> = names.iter().cloned().zip(runs.iter().map(Metrics::of)).collect();
    let Some(metrics) = numbers.first().map(|(_, metrics)| metrics.clone()) else { return Err(Error::NoLog) };
    let timelines: Vec<Vec<TimelineEntry>> = runs.iter().map(timeline::entries).collect();
    let mut out = Output::new(out_dir, logs.iter().chain(&options.inputs).cloned().collect())?;
    let (drawn, not_drawn) = draw(&runs, &names, options, &mut out, progress)?;

    let metrics_json = match &runs[..] {
        [_] => out.write("metrics.json", metrics.to_json())?,
        _ => {
            let each: Vec<_> =
                numbers.iter().map(|(name, metrics)| json!({ "name": name, "metrics": metrics })).collect();
            out.write_json("metrics.json", &json!({ "schema": metrics.schema, "runs": each }))?
        }
    };
    let each: Vec<_> =
        names.iter().zip(&timelines).map(|(name, timeline)| json!({ "name": name, "happenings": timeline })).collect();
    out.write_json("happenings.json", &json!({ "runs": each }))?;
    let mut text = String::new();
    for (run, (name, metrics)) in runs.iter().zip(&numbers) {
        let of = |table: &str| if runs.len() == 1 { table.to_owned() } else { format!("{table}_{name}") };
        out.write_table(&of("tracking"), &tables::tracking(metrics), run)?;
        out.write_table(&of("timing"), &tables::timing(metrics), run)?;
        if runs.len() > 1 {
            text.push_str(&format!("{name}\n\n"));
        }
        text.push_str(&tables::text(metrics));
        text.push('\n');
    }
    if runs.len() > 1 {
        let table = tables::comparison(&borrowed(&numbers));
        text.push_str(&format!("{}\n{}", table.caption, table.text()));
        out.write_table("comparison", &table, &runs[0])?;
    }
    out.write("tables.txt", text)?;
    let walk = animation::side_view(&runs[0]);
    if let Some(walk) = &walk {
        out.write("walk.svg", walk.clone())?;
    }
    let parts: Vec<Part> = runs
        .iter()
        .zip(&numbers)
        .zip(&timelines)
        .map(|((run, (name, metrics)), timeline)| Part {
            name: name.clone(),
            path: run.path.display().to_string(),
            metrics,
            channels: &run.channels,
            timeline,
        })
        .collect();
    let content = Content {
        figures: &drawn,
        formats: &options.plots.formats,
        not_drawn: &not_drawn,
        walk: walk.as_deref(),
        files: &out.tables,
    };
    let page = html::page(&parts, &content);
    let html = out.write("report.html", page)?;
    Ok(Report { html, metrics_json, files: out.files, metrics, runs: numbers, timelines, not_drawn })
}

/// Borrows the metrics.
fn borrowed(numbers: &[(String, Metrics)]) -> Vec<(String, &Metrics)> {
    numbers.iter().map(|(name, metrics)| (name.clone(), metrics)).collect()
}

fn draw(
    runs: &[Run],
    names: &[String],
    options: &ReportOptions,
    out: &mut Output,
    progress: &mut dyn FnMut(Progress),
) -> Result<(Vec<Figure>, Vec<NotDrawn>), Error> {
    let named: Vec<(Named, &Run)> = names.iter().map(|name| Named(name.clone())).zip(runs).collect();
    let (mut drawn, mut not_drawn) = (Vec::new(), Vec::new());
    let total = options.plots.figures.len() as u64;
    for (done, spec) in (0..).zip(&options.plots.figures) {
        progress(Progress { stage: Stage::Draw, done, total });
        match figures::draw(spec, &named) {
            Ok(figure) => {
                for format in &options.plots.formats {
                    out.path(&figure.file_name(*format))?;
                }
                out.files.extend(figure.write(&out.dir, &options.plots.formats, options.plots.png_dpi)?);
                drawn.push(figure);
            }
            Err(missing) => not_drawn.push(missing),
        }
    }
    progress(Progress { stage: Stage::Draw, done: total, total });
    Ok((drawn, not_drawn))
}

/// The given names, else file names without extension. Equal names get a number appended.
fn names_of(runs: &[Run], given: &[String]) -> Vec<String> {
    let own = |run: &Run| run.path.file_stem().map_or_else(|| run.name(), |stem| stem.to_string_lossy().into_owned());
    let names: Vec<String> =
        runs.iter().enumerate().map(|(k, run)| given.get(k).cloned().unwrap_or_else(|| own(run))).collect();
    let is_duplicate = |name: &String| names.iter().filter(|other| *other == name).count() > 1;
    names
        .iter()
        .enumerate()
        .map(|(k, name)| if is_duplicate(name) { format!("{name} {}", k + 1) } else { name.clone() })
        .collect()
}

/// The folder of a report.
struct Output {
    dir: PathBuf,
    files: Vec<PathBuf>,
    /// Files that were read: none of them is overwritten.
    inputs: Vec<PathBuf>,
    /// Names of the files that the page links to, without figures.
    tables: Vec<String>,
}

impl Output {
    fn new(dir: &Path, inputs: Vec<PathBuf>) -> Result<Self, Error> {
        std::fs::create_dir_all(dir).map_err(|source| Error::Write { path: dir.to_owned(), source })?;
        Ok(Self { dir: dir.to_owned(), files: Vec::new(), inputs, tables: Vec::new() })
    }

    /// Path of a file of this name.
    fn path(&self, name: &str) -> Result<PathBuf, Error> {
        let path = self.dir.join(name);
        for input in &self.inputs {
            let same = |source| Error::Log { path: input.clone(), source };
            replay::Error::check_distinct_files(input, &path).map_err(same)?;
        }
        Ok(path)
    }

    fn write(&mut self, name: &str, text: String) -> Result<PathBuf, Error> {
        let path = self.path(name)?;
        std::fs::write(&path, text).map_err(|source| Error::Write { path: path.clone(), source })?;
        self.files.push(path.clone());
        self.tables.push(name.to_owned());
        Ok(path)
    }

    fn write_json(&mut self, name: &str, value: &serde_json::Value) -> Result<PathBuf, Error> {
        self.write(name, format!("{value:#}\n"))
    }

    /// Writes a table as CSV, LaTeX and JSON. A table without rows is not written.
    fn write_table(&mut self, name: &str, table: &NumericTable, run: &Run) -> Result<(), Error> {
        if table.rows.is_empty() {
            return Ok(());
        }
        let plain = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '.') { c } else { '_' };
        let name: String = name.chars().map(plain).collect();
        let origin = format!("log {}, SHA-256 {}", run.name(), run.sha256);
        self.write(&format!("{name}.csv"), table.csv())?;
        self.write(&format!("{name}.tex"), table.latex(&origin))?;
        self.write(&format!("{name}.json"), table.json()).map(drop)
    }
}
