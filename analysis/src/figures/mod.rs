//! Figures of one run or several, laid out for a paper width and written as SVG, PDF and PNG.
//!
//! A report draws a list of [`FigureSpec`]s, read from a `plots.toml` ([`crate::plots`]). Figures of base, power, timing and path show the whole run. Figures
//! of feet, joints, contact forces and gait show a window of a few seconds, because single steps are not visible in a minute: the window is around a fall, a
//! change of gait, or the middle of the walk.
//!
//! A new figure is a new module beside this file and one line in the table [`KINDS`]. To draw it in every report, add it to `plots.toml`.
//!
//! | module              | content                                                       |
//! |---------------------|---------------------------------------------------------------|
//! | `canvas`            | a drawing as a list of shapes and texts                       |
//! | `svg`, `pdf`, `png` | renderers of a drawing                                        |
//! | `panel`             | axes, ticks, lines thinned to the width at which they appear  |
//! | `chart`             | panels with layers, laid out for a width                      |
//! | `trace`             | quantities over time, of one run or of several                |
//! | `style`             | colors, line widths, font sizes, legend                       |
//! | `text`              | the embedded font: widths and pixels                          |
//! | `figure_spec`       | what to draw, and the window shown                            |
//! | `bars`, `curve`, `what_if` | figures that do not show one run: comparisons, sweeps, what-if replays |
//! | other modules       | one figure each, or two related ones                          |

mod bars;
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
mod orientation;
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
pub use bars::Bars;
use canvas::Drawing;
use chart::Chart;
pub use curve::Curves;
pub use figure_spec::{FigureSpec, Kind, Named, PAGE_MM, Quantity, Several};
use style::UNITS_PER_MM;
pub(crate) use svg::escape;
pub(crate) use text::FONT;
pub use what_if::what_if;

/// Resolution of bitmaps outside reports, dots per inch.
const FILE_DPI: f64 = 288.0;

/// Defines a constant for each kind of figure, and the list of all of them. Columns: constant, name, title, layout.
macro_rules! kinds {
    ($($kind:ident, $name:literal, $title:literal, $chart:expr;)*) => {
        $(#[doc = $title] pub static $kind: Kind = Kind { name: $name, title: $title, chart: $chart };)*

        /// Every kind of figure.
        pub static KINDS: &[&Kind] = &[$(&$kind),*];
    };
}

kinds! {
    BASE_TRACKING, "base_tracking", "Base orientation and height", |runs, spec| trace::chart(base::traces, runs, spec);
    FEET_TRACKING, "feet_tracking", "Swing feet", |runs, spec| trace::chart(feet::traces, runs, spec);
    FIGURE_9, "figure9", "Base and feet", |runs, spec| trace::chart(base::with_feet, runs, spec);
    FIGURE_10, "figure10", "Base orientation and pushes", |runs, spec| trace::chart(orientation::traces, runs, spec);
    JOINT_TRACKING, "joint_tracking", "Joints", |runs, spec| trace::chart(joints::traces, runs, spec);
    CONTACT_FORCES, "contact_forces", "Contact forces", |runs, spec| trace::chart(contact::forces, runs, spec);
    FRICTION_USE, "friction_use", "Friction cone use", |runs, spec| trace::chart(contact::friction, runs, spec);
    CONTACT_ESTIMATION, "contact_estimation", "Contact estimation", estimation::chart;
    GAIT, "gait", "Gait diagram", gait::chart;
    PATH, "path", "Path from above", path::chart;
    FOOT_SLIP, "foot_slip", "Foot slip", |runs, spec| trace::chart(slip::traces, runs, spec);
    POWER, "power", "Torque and power", |runs, spec| trace::chart(power::traces, runs, spec);
    QP, "qp", "Quadratic program", |runs, spec| trace::chart(qp::traces, runs, spec);
    TIMING, "timing", "Period and computation time", timing::over_time;
    TIMING_DISTRIBUTION, "timing_distribution", "Distribution of times", timing::distribution;
    FIELDS, "fields", "Fields", |runs, spec| trace::chart(custom::traces, runs, spec);
}

/// Kinds that show the legs of a quadruped.
const OF_FEET: [&str; 7] =
    ["feet_tracking", "figure9", "contact_forces", "friction_use", "contact_estimation", "gait", "foot_slip"];

/// A figure that was drawn.
#[derive(Clone, Debug)]
pub struct Figure {
    /// File name without extension.
    pub name: String,
    /// Title, a few words.
    pub title: String,
    /// One or two sentences about the content.
    pub caption: String,
    drawing: Drawing,
    metadata: Vec<(&'static str, String)>,
}

/// A figure that cannot be drawn from these logs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotDrawn {
    /// Name of the figure.
    pub name: String,
    /// Title of the figure.
    pub title: String,
    /// Channels or fields that are missing in the log.
    pub needs: String,
}

/// A file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// Scalable Vector Graphics.
    Svg,
    /// Portable Document Format, one page.
    Pdf,
    /// Portable Network Graphics.
    Png,
}

impl Format {
    /// File name extension, without a dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Pdf => "pdf",
            Self::Png => "png",
        }
    }
}

impl Figure {
    /// A figure that does not show one run, as wide as a page.
    fn of_chart(name: &str, title: &str, chart: &Chart) -> Self {
        Self::of_drawing(name, title, chart.caption.clone(), chart.draw(PAGE_MM * UNITS_PER_MM))
    }

    fn of_drawing(name: &str, title: &str, caption: String, drawing: Drawing) -> Self {
        let (name, title) = (name.to_owned(), title.to_owned());
        let metadata = vec![("Title", title.clone()), ("Description", caption.clone()), ("Software", software())];
        Self { name, title, caption, drawing, metadata }
    }

    /// The figure as an SVG document. Equal logs give equal bytes.
    pub fn svg(&self) -> String {
        svg::svg(&self.drawing, &self.metadata)
    }

    /// True if another figure has the same shapes and texts; metadata is not compared.
    pub fn looks_like(&self, other: &Figure) -> bool {
        svg::svg(&self.drawing, &[]) == svg::svg(&other.drawing, &[])
    }

    /// The figure as the bytes of a file. Its metadata contains title, caption, revision and the hash of the log.
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

    /// Writes one file in the format of the extension of `path`.
    ///
    /// # Errors
    /// As [`Figure::bytes`], [`Error::Write`], or [`Error::Figure`] for an unknown extension.
    pub fn write_file(&self, path: &Path) -> Result<(), Error> {
        let extension = path.extension().and_then(|e| e.to_str());
        let format = [Format::Svg, Format::Pdf, Format::Png].into_iter().find(|f| Some(f.extension()) == extension);
        let format = format.ok_or_else(|| Error::Figure {
            figure: self.name.clone(),
            reason: format!("file {}: unknown extension, expected .svg, .pdf or .png", path.display()),
        })?;
        let bytes = self.bytes(format, FILE_DPI)?;
        std::fs::write(path, bytes).map_err(|source| Error::Write { path: path.to_owned(), source })
    }

    /// Name of its file in a format: `NAME.EXTENSION`.
    pub fn file_name(&self, format: Format) -> String {
        format!("{}.{}", self.name, format.extension())
    }

    /// Writes `NAME.EXTENSION` into a directory for each format, and returns the paths.
    ///
    /// # Errors
    /// As [`Figure::bytes`], or [`Error::Write`].
    pub fn write(&self, dir: &Path, formats: &[Format], dpi: f64) -> Result<Vec<PathBuf>, Error> {
        let mut files = Vec::new();
        for &format in formats {
            let path = dir.join(self.file_name(format));
            let bytes = self.bytes(format, dpi)?;
            std::fs::write(&path, bytes).map_err(|source| Error::Write { path: path.clone(), source })?;
            files.push(path);
        }
        Ok(files)
    }
}

/// Draws a figure of one run or several, such as a run and its replay with other parameters. The legend contains the names of the runs.
///
/// # Errors
/// [`NotDrawn`] with the channels or fields that are missing.
pub fn draw(spec: &FigureSpec, runs: &[(Named, &Run)]) -> Result<Figure, NotDrawn> {
    let not_drawn = |needs| NotDrawn { name: spec.name.clone(), title: spec.title(), needs };
    if OF_FEET.contains(&spec.kind.name) && !runs.iter().all(|(_, run)| run.has_feet()) {
        return Err(not_drawn("a quadruped (robot.feet)".to_owned()));
    }
    let chart = (spec.kind.chart)(runs, spec).map_err(not_drawn)?;
    let drawing = chart.draw(spec.sheet()).scaled(spec.scale());
    let mut metadata = vec![("Title", spec.title()), ("Description", chart.caption.clone()), ("Software", software())];
    let of_each =
        |value: &dyn Fn(&Run) -> String| runs.iter().map(|(_, run)| value(run)).collect::<Vec<_>>().join(", ");
    metadata.push(("Log", of_each(&Run::name)));
    metadata.push(("LogSHA256", of_each(&|run| run.sha256.clone())));
    let revision = |run: &Run| {
        let info = run.info.as_ref();
        info.map_or("unknown".to_owned(), |i| format!("{}{}", i.revision, if i.dirty { " with changes" } else { "" }))
    };
    metadata.push(("Revision", of_each(&revision)));
    Ok(Figure { name: spec.name.clone(), title: spec.title(), caption: chart.caption, drawing, metadata })
}

/// Name and version of this program, for metadata.
fn software() -> String {
    format!("hoofprint {}", env!("CARGO_PKG_VERSION"))
}
