//! Figures: each a function of one run or several, laid out for a width, written as SVG, PDF and PNG.
//!
//! What a report draws is a list of [`Ask`]s, from a `plots.toml` ([`crate::plots`]). Base, power, timing and path show the whole run. Feet, joints,
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
//! | the rest            | one figure each, or two that belong together                 |

mod base;
mod canvas;
mod chart;
mod contact;
mod curve;
mod custom;
mod estimation;
mod feet;
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
use crate::fields::Field;
use crate::run::Run;
use canvas::{Drawing, Stroke};
use chart::Chart;
pub use curve::Curves;
use panel::Range;
use style::{POINTS_PER_UNIT, UNITS_PER_MM};
pub(crate) use svg::escape;
pub(crate) use text::FONT;
use trace::Traces;
pub use what_if::what_if;

/// Length of the window of detailed figures, s.
const DETAIL_S: f64 = 5.0;
/// Density of bitmaps outside reports.
const FILE_DPI: f64 = 288.0;
/// Width of a figure across a page, mm.
pub const PAGE_MM: f64 = 180.0;

/// What a figure shows; its name in a `plots.toml` and the name of its files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Orientation and height of the base.
    BaseTracking,
    /// Feet relative to the base.
    FeetTracking,
    /// Base and feet as in Figure 9 of Raiola et al. 2020.
    Figure9,
    /// Position, velocity or torque of joints.
    JointTracking,
    /// Contact forces: estimate, truth, command.
    ContactForces,
    /// Tangential over normal force, and the friction coefficient.
    FrictionUse,
    /// Contact flags against truth: confusion, delays of touchdowns.
    ContactEstimation,
    /// Stance and contact as bars.
    Gait,
    /// The way from above.
    Path,
    /// Travel of feet that touch the ground.
    FootSlip,
    /// Torque and power.
    Power,
    /// The quadratic programs.
    Qp,
    /// Period and computation time over the run, as in Figure 4.2 of Laurenzi 2020.
    Timing,
    /// Histogram and cumulated share of tick, solve and wake-up times.
    TimingDistribution,
    /// Fields that the file names.
    Fields,
}

impl Kind {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::BaseTracking => "base_tracking",
            Self::FeetTracking => "feet_tracking",
            Self::Figure9 => "figure9",
            Self::JointTracking => "joint_tracking",
            Self::ContactForces => "contact_forces",
            Self::FrictionUse => "friction_use",
            Self::ContactEstimation => "contact_estimation",
            Self::Gait => "gait",
            Self::Path => "path",
            Self::FootSlip => "foot_slip",
            Self::Power => "power",
            Self::Qp => "qp",
            Self::Timing => "timing",
            Self::TimingDistribution => "timing_distribution",
            Self::Fields => "fields",
        }
    }

    /// A few words for a reader.
    pub fn title(self) -> &'static str {
        match self {
            Self::BaseTracking => "Base orientation and height",
            Self::FeetTracking => "Swing feet",
            Self::Figure9 => "Base and feet",
            Self::JointTracking => "Joints",
            Self::ContactForces => "Contact forces",
            Self::FrictionUse => "Friction cone use",
            Self::ContactEstimation => "Contact estimation",
            Self::Gait => "Gait diagram",
            Self::Path => "Path from above",
            Self::FootSlip => "Foot slip",
            Self::Power => "Torque and power",
            Self::Qp => "Quadratic program",
            Self::Timing => "Period and computation time",
            Self::TimingDistribution => "Distribution of times",
            Self::Fields => "Fields",
        }
    }
}

/// Which signal of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Position.
    #[default]
    Position,
    /// Velocity.
    Velocity,
    /// Torque.
    Torque,
}

/// How several logs share a panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Several {
    /// A line each.
    #[default]
    Lines,
    /// Their mean, its standard deviation and the extremes.
    Band,
}

/// A figure that is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Ask {
    /// What it shows.
    pub kind: Kind,
    /// Name of its files, without ending.
    pub name: String,
    /// Title; that of its kind if `None`.
    pub title: Option<String>,
    /// Width on paper, mm.
    pub width_mm: f64,
    /// Size of its words on paper, points.
    pub font_pt: f64,
    /// Begin and end of what is shown, s since the start of the run; chosen from the run if `None`.
    pub window_s: Option<(f64, f64)>,
    /// Legs shown, 0 to 3.
    pub legs: Vec<usize>,
    /// Joints shown, by name; all if empty.
    pub joints: Vec<String>,
    /// Signal of joints.
    pub quantity: Quantity,
    /// Fields shown.
    pub fields: Vec<Field>,
    /// Words beside the vertical axis of a figure of fields.
    pub label: String,
    /// How several logs share a panel.
    pub several: Several,
}

impl Ask {
    /// A figure of a kind, across the page.
    pub fn new(kind: Kind) -> Self {
        Self {
            kind,
            name: kind.name().to_owned(),
            title: None,
            width_mm: PAGE_MM,
            font_pt: style::LABEL_EM * POINTS_PER_UNIT,
            window_s: None,
            legs: (0..4).collect(),
            joints: Vec::new(),
            quantity: Quantity::default(),
            fields: Vec::new(),
            label: String::new(),
            several: Several::default(),
        }
    }

    fn title(&self) -> String {
        self.title.clone().unwrap_or_else(|| self.kind.title().to_owned())
    }

    /// How much larger than the layout the paper is.
    fn scale(&self) -> f64 {
        self.font_pt / (style::LABEL_EM * POINTS_PER_UNIT)
    }

    /// Width of the layout, in units of a drawing.
    fn sheet(&self) -> f64 {
        self.width_mm * UNITS_PER_MM / self.scale()
    }

    /// The window, or the whole run.
    fn whole(&self, run: &Run) -> Range {
        self.window_s.map_or_else(|| whole(run), |(min, max)| Range { min, max })
    }

    /// The window, or the part of the run where most is to be seen.
    fn detail(&self, run: &Run) -> Range {
        self.window_s.map_or_else(|| detail_window(run), |(min, max)| Range { min, max })
    }
}

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
        let metadata =
            vec![("Title", title.clone()), ("Description", chart.caption.clone()), ("Software", software())];
        Self { name, title, caption: chart.caption.clone(), drawing, metadata }
    }

    /// The figure as an SVG document. The same run gives the same bytes.
    pub fn svg(&self) -> String {
        svg::svg(&self.drawing, &self.metadata)
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
pub fn draw(ask: &Ask, runs: &[(Named, &Run)]) -> Result<Figure, Lacking> {
    let chart = chart_of(ask, runs).map_err(|needs| Lacking { name: ask.name.clone(), title: ask.title(), needs })?;
    let drawing = chart.draw(ask.sheet()).scaled(ask.scale());
    let mut metadata = vec![
        ("Title", ask.title()),
        ("Description", chart.caption.clone()),
        ("Software", software()),
    ];
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

fn chart_of(ask: &Ask, runs: &[(Named, &Run)]) -> Result<Chart, String> {
    let traced = |traces: fn(&Run, &Ask) -> Result<Traces, String>| {
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

/// The part of the run that detailed figures show.
fn detail_window(run: &Run) -> Range {
    let end = whole(run).max;
    let fell_at_s = crate::metrics::Safety::of_run(run).fell_at_s;
    let swings = |tick: &&crate::run::Tick| (0..4).any(|leg| tick.swings(leg));
    let (first, last) = (run.ticks.iter().find(swings), run.ticks.iter().rev().find(swings));
    let middle = match (fell_at_s, gait_change(run), first.zip(last)) {
        (Some(fall), _, _) => fall - 0.4 * DETAIL_S,
        (_, Some(change), _) => change,
        (_, _, Some((first, last))) => 0.5 * (first.t_s + last.t_s),
        _ => 0.5 * end,
    };
    let from = (middle - 0.5 * DETAIL_S).clamp(0.0, (end - DETAIL_S).max(0.0));
    Range { min: from, max: (from + DETAIL_S).min(end) }
}

/// The whole run, its last tick included.
fn whole(run: &Run) -> Range {
    Range { min: 0.0, max: (run.duration_s() + run.period_s()).max(1e-3) }
}

/// Time of the first change of gait after the first swing: before it, the gait is only being chosen.
fn gait_change(run: &Run) -> Option<f64> {
    let walking = run.ticks.iter().skip_while(|tick| !(0..4).any(|leg| tick.swings(leg)));
    let mut gaits = walking.filter_map(|tick| tick.legs.as_ref().map(|l| (tick.t_s, l.gait)));
    let first = gaits.next()?.1;
    gaits.find(|(_, gait)| *gait != first).map(|(t_s, _)| t_s)
}

/// "12.0 s to 17.0 s of the run", for captions of detailed figures.
fn window_text(window: Range) -> String {
    format!("{:.1} s to {:.1} s of the run", window.min, window.max)
}
