//! Figures: each a function of one run or several, laid out for a width, written as SVG, PDF and PNG.
//!
//! What a report draws is a list of [`FigureSpec`]s, from a `plots.toml` ([`crate::plots`]). Base, power, timing and path show the whole run. Feet, joints,
//! contact forces and gait show a window of a few seconds, since a step of half a second cannot be seen in a minute: around the change of gait, before a fall,
//! or in the middle of the walk.
//!
//! | module              | what it holds                                                |
//! |---------------------|--------------------------------------------------------------|
//! | `canvas`            | a drawing as data                                            |
//! | `svg`, `pdf`, `png` | its renderings                                               |
//! | `panel`             | axes, ticks, lines thinned to the width they are drawn at    |
//! | `chart`             | panels with layers, laid out for a width                     |
//! | `trace`             | quantities over time, of one run or of several               |
//! | `style`             | colours, widths, type sizes, legend                          |
//! | `text`              | the embedded font: widths and pixels                         |
//! | `ask`               | what is asked for, and the window that it shows              |
//! | the rest            | one figure each, or two that belong together                 |

mod base;
mod canvas;
mod chart;
mod contact;
mod curve;
mod custom;
mod estimation;
mod feet;
mod figure_spec;
mod gait;
mod joints;
mod panel;
mod path;
mod pdf;
mod png;
mod power;
mod qp;
mod slip;
mod style;
mod svg;
mod text;
mod timing;
mod trace;
mod what_if;

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::Error;
use crate::run::Run;
use canvas::{Drawing, Stroke};
use chart::Chart;
pub use curve::Curves;
pub use figure_spec::{FigureSpec, Kind, PAGE_MM, Quantity, Several};
use panel::Range;
use style::UNITS_PER_MM;
pub(crate) use svg::escape;
pub(crate) use text::FONT;
use trace::Traces;
pub use what_if::what_if;

/// Density of bitmaps outside reports.
const FILE_DPI: f64 = 288.0;
/// What a figure calls a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named(pub String);

/// A figure, drawn.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name of its files, without ending.
    pub name: String,
    /// Title, a few words.
    pub title: String,
    /// What is to be seen, one or two sentences.
    pub caption: String,
    drawing: Drawing,
    metadata: Vec<(&'static str, String)>,
}

/// A figure that these logs cannot give.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lacking {
    /// Name of the figure.
    pub name: String,
    /// Its title.
    pub title: String,
    /// What the log would have to hold.
    pub needs: String,
}

/// A kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// For screens.
    Svg,
    /// For LaTeX.
    Pdf,
    /// For everything else.
    Png,
}

impl Format {
    /// Ending of its files.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Pdf => "pdf",
            Self::Png => "png",
        }
    }
}

impl Figure {
    /// A figure that is of no run in particular, across the page.
    fn of_chart(name: &str, title: &str, chart: &Chart) -> Self {
        let (name, title) = (name.to_owned(), title.to_owned());
        let drawing = chart.draw(PAGE_MM * UNITS_PER_MM);
        let metadata = vec![("Title", title.clone()), ("Description", chart.caption.clone()), ("Software", software())];
        Self { name, title, caption: chart.caption.clone(), drawing, metadata }
    }

    /// The figure as an SVG document. The same run gives the same bytes.
    pub fn svg(&self) -> String {
        svg::svg(&self.drawing, &self.metadata)
    }

    /// Whether another figure has the same lines, areas and words, whatever log it is of.
    pub fn looks_like(&self, other: &Figure) -> bool {
        svg::svg(&self.drawing, &[]) == svg::svg(&other.drawing, &[])
    }

    /// The figure as a file: title, hash of the log, revision and caption are in its metadata.
    ///
    /// # Errors
    /// [`Error::Figure`] if a bitmap cannot be drawn.
    pub fn bytes(&self, format: Format, dpi: f64) -> Result<Vec<u8>, Error> {
        match format {
            Format::Svg => Ok(self.svg().into_bytes()),
            Format::Pdf => Ok(pdf::pdf(&self.drawing, &self.metadata)),
            Format::Png => png::png(&self.drawing, dpi, &self.metadata)
                .map_err(|reason| Error::Figure { figure: self.name.clone(), reason }),
        }
    }

    /// Writes one file, its kind chosen by the name's ending.
    ///
    /// # Errors
    /// As [`Figure::bytes`], [`Error::Write`], or [`Error::Figure`] for another ending.
    pub fn write_file(&self, path: &Path) -> Result<(), Error> {
        let ending = path.extension().and_then(|e| e.to_str());
        let format = [Format::Svg, Format::Pdf, Format::Png].into_iter().find(|f| Some(f.ending()) == ending);
        let format = format.ok_or_else(|| Error::Figure {
            figure: self.name.clone(),
            reason: format!("{}: the name of a figure ends with .svg, .pdf or .png", path.display()),
        })?;
        let bytes = self.bytes(format, FILE_DPI)?;
        std::fs::write(path, bytes).map_err(|source| Error::Write { path: path.to_owned(), source })
    }

    /// Writes `NAME.ENDING` into a directory for each format, and returns the files.
    ///
    /// # Errors
    /// As [`Figure::bytes`], or [`Error::Write`].
    pub fn write(&self, dir: &Path, formats: &[Format], dpi: f64) -> Result<Vec<PathBuf>, Error> {
        let mut files = Vec::new();
        for &format in formats {
            let path = dir.join(format!("{}.{}", self.name, format.ending()));
            let bytes = self.bytes(format, dpi)?;
            std::fs::write(&path, bytes).map_err(|source| Error::Write { path: path.clone(), source })?;
            files.push(path);
        }
        Ok(files)
    }
}

/// Draws a figure of one run or several, such as a run and its replay with other parameters. Runs are named in the legend.
///
/// # Errors
/// What the runs would have to hold.
pub fn draw(ask: &FigureSpec, runs: &[(Named, &Run)]) -> Result<Figure, Lacking> {
    let chart = chart_of(ask, runs).map_err(|needs| Lacking { name: ask.name.clone(), title: ask.title(), needs })?;
    let drawing = chart.draw(ask.sheet()).scaled(ask.scale());
    let mut metadata = vec![("Title", ask.title()), ("Description", chart.caption.clone()), ("Software", software())];
    let of_each = |what: &dyn Fn(&Run) -> String| runs.iter().map(|(_, run)| what(run)).collect::<Vec<_>>().join(", ");
    metadata.push(("Log", of_each(&Run::name)));
    metadata.push(("LogSHA256", of_each(&|run| run.sha256.clone())));
    let revision = |run: &Run| {
        let info = run.info.as_ref();
        info.map_or("unknown".to_owned(), |i| format!("{}{}", i.revision, if i.dirty { " with changes" } else { "" }))
    };
    metadata.push(("Revision", of_each(&revision)));
    Ok(Figure { name: ask.name.clone(), title: ask.title(), caption: chart.caption, drawing, metadata })
}

/// What made a figure.
fn software() -> String {
    format!("hoofprint {}", env!("CARGO_PKG_VERSION"))
}

fn chart_of(ask: &FigureSpec, runs: &[(Named, &Run)]) -> Result<Chart, String> {
    let traced = |traces: fn(&Run, &FigureSpec) -> Result<Traces, String>| {
        let each = runs.iter().map(|(name, run)| traces(run, ask).map(|t| (name.clone(), t)));
        Ok(trace::chart(each.collect::<Result<_, String>>()?, ask.several))
    };
    match ask.kind {
        Kind::BaseTracking => traced(base::traces),
        Kind::FeetTracking => traced(feet::traces),
        Kind::Figure9 => traced(base::with_feet),
        Kind::JointTracking => traced(joints::traces),
        Kind::ContactForces => traced(contact::forces),
        Kind::FrictionUse => traced(contact::friction),
        Kind::FootSlip => traced(slip::traces),
        Kind::Power => traced(power::traces),
        Kind::Qp => traced(qp::traces),
        Kind::Fields => traced(custom::traces),
        Kind::ContactEstimation => estimation::chart(runs),
        Kind::Gait => gait::chart(runs, ask),
        Kind::Path => path::chart(runs, ask),
        Kind::Timing => timing::over_time(runs, ask),
        Kind::TimingDistribution => timing::distribution(runs),
    }
}

/// "12.0 s to 17.0 s of the run", for captions of detailed figures.
fn window_text(window: Range) -> String {
    format!("{:.1} s to {:.1} s of the run", window.min, window.max)
}
