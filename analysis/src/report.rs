//! The report of a log: a directory of figures, tables, numbers and one page that shows them.

use std::path::{Path, PathBuf};

use crate::figures::{self, FigureOptions, Lacking};
use crate::metrics::Metrics;
use crate::run::Run;
use crate::{Error, Progress, Stage, html, tables};

/// What was written, and what it says.
#[derive(Clone, Debug)]
pub struct Report {
    /// The page, `report.html`.
    pub html: PathBuf,
    /// `metrics.json`.
    pub metrics_json: PathBuf,
    /// Every file written, the two above included.
    pub files: Vec<PathBuf>,
    /// The numbers.
    pub metrics: Metrics,
    /// Figures that this log could not give.
    pub lacking: Vec<Lacking>,
}

/// Choices of a report.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReportOptions {
    /// What figures show.
    pub figures: FigureOptions,
}

/// Writes the report of a log into a directory, which is made if need be: `report.html` (self-contained), `metrics.json`, `tables.txt`,
/// `tracking.csv`, and each figure as SVG and PNG.
///
/// A log that lacks channels, is cut or damaged is reported as far as it goes, and the report says so. The same log gives the same bytes.
///
/// # Errors
/// [`Error::Log`] if it cannot be read, [`Error::NothingToReport`] if it holds no tick, [`Error::Write`] or [`Error::Figure`] if the
/// directory cannot be written.
pub fn report(log: &Path, out_dir: &Path, progress: &mut dyn FnMut(Progress)) -> Result<Report, Error> {
    report_with(log, out_dir, ReportOptions::default(), progress)
}

/// As [`report`], with choices.
pub fn report_with(
    log: &Path,
    out_dir: &Path,
    options: ReportOptions,
    progress: &mut dyn FnMut(Progress),
) -> Result<Report, Error> {
    let run = Run::read(log, progress)?;
    let metrics = Metrics::of(&run);
    std::fs::create_dir_all(out_dir).map_err(|source| Error::Write { path: out_dir.to_owned(), source })?;

    let (mut drawn, mut lacking, mut files) = (Vec::new(), Vec::new(), Vec::new());
    let drawings = figures::all(&run, options.figures);
    let total = drawings.len() as u64;
    for (done, drawing) in (0..).zip(drawings) {
        progress(Progress { stage: Stage::Draw, done, total });
        match drawing {
            Ok(figure) => {
                figure.write(out_dir)?;
                files.extend(["svg", "png"].map(|ending| out_dir.join(format!("{}.{ending}", figure.name))));
                drawn.push(figure);
            }
            Err(lack) => lacking.push(lack),
        }
    }
    progress(Progress { stage: Stage::Draw, done: total, total });

    let mut write = |name: &str, text: String| {
        let path = out_dir.join(name);
        std::fs::write(&path, text).map_err(|source| Error::Write { path: path.clone(), source })?;
        files.push(path.clone());
        Ok(path)
    };
    let metrics_json = write("metrics.json", metrics.to_json())?;
    write("tables.txt", tables::text(&metrics))?;
    write("tracking.csv", tables::tracking_csv(&metrics))?;
    let html = write("report.html", html::page(&run, &metrics, &drawn, &lacking)?)?;
    Ok(Report { html, metrics_json, files, metrics, lacking })
}
