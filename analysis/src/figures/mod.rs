//! The figures of a report: each a function of the run, drawn once and written as SVG and PNG.
//!
//! Base, timing and path show the whole run. Feet, contact forces and gait show a window of a few seconds, since a step of half a
//! second cannot be seen in a minute: around the change of gait, before a fall, or in the middle of the walk.
//!
//! | module    | what it holds                                                |
//! |-----------|--------------------------------------------------------------|
//! | `canvas`  | a drawing as data, and its rendering through plotters        |
//! | `panel`   | axes, ticks, lines thinned to the width they are drawn at    |
//! | `style`   | colours, widths, type sizes, legend                          |
//! | `text`    | the embedded font: widths and pixels                         |
//! | the rest  | one figure each                                              |

mod base;
mod canvas;
mod contact;
mod curve;
mod feet;
mod figure9;
mod gait;
mod panel;
mod path;
mod style;
mod text;
mod timing;
mod what_if;

use std::path::Path;

use lcmtypes::LegState;

use crate::Error;
use crate::run::{Run, Tick};
use canvas::Drawing;
pub use curve::Curves;
pub use figure9::figure9;
use panel::Range;
pub(crate) use text::FONT;
pub use what_if::what_if;

/// Length of the window of detailed figures, s.
const DETAIL_S: f64 = 5.0;

/// A figure, drawn.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name of its files, without ending.
    pub name: &'static str,
    /// Title, a few words.
    pub title: &'static str,
    /// What is to be seen, one or two sentences.
    pub caption: String,
    drawing: Drawing,
}

/// A figure that this log cannot give.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lacking {
    /// Name of the figure.
    pub name: &'static str,
    /// Its title.
    pub title: &'static str,
    /// What the log would have to hold.
    pub needs: &'static str,
}

/// What to draw.
#[derive(Clone, Copy, Debug, Default)]
pub struct FigureOptions {
    /// Begin and end of the window of detailed figures, s since the start of the run; chosen from the run if `None`.
    pub detail_s: Option<(f64, f64)>,
}

impl Figure {
    /// The figure as an SVG document. The same run gives the same bytes.
    pub fn svg(&self) -> Result<String, Error> {
        self.drawing.svg().map_err(|reason| self.error(reason))
    }

    /// Writes `NAME.svg` and `NAME.png` (288 dpi) into a directory.
    pub fn write(&self, dir: &Path) -> Result<(), Error> {
        let svg = dir.join(format!("{}.svg", self.name));
        std::fs::write(&svg, self.svg()?).map_err(|source| Error::Write { path: svg, source })?;
        self.drawing.write_png(&dir.join(format!("{}.png", self.name))).map_err(|reason| self.error(reason))
    }

    /// Writes one file, SVG or PNG by the name's ending.
    pub fn write_file(&self, path: &Path) -> Result<(), Error> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("png") => self.drawing.write_png(path).map_err(|reason| self.error(reason)),
            Some("svg") => {
                std::fs::write(path, self.svg()?).map_err(|source| Error::Write { path: path.to_owned(), source })
            }
            _ => Err(self.error(format!("{}: the name of a figure ends with .svg or .png", path.display()))),
        }
    }

    fn error(&self, reason: String) -> Error {
        Error::Figure { figure: self.name.to_owned(), reason }
    }
}

/// Every figure of the report in its order, or what it lacks.
pub fn all(run: &Run, options: FigureOptions) -> Vec<Result<Figure, Lacking>> {
    let detail = options.detail_s.map_or_else(|| detail_window(run), |(min, max)| Range { min, max });
    vec![
        base::draw(run),
        feet::draw(run, detail),
        contact::draw(run, detail),
        gait::draw(run, detail),
        path::draw(run),
        timing::draw(run),
    ]
}

/// The part of the run that detailed figures show.
fn detail_window(run: &Run) -> Range {
    let end = whole(run).max;
    let metrics = crate::metrics::Metrics::of(run);
    let walking: Vec<f64> =
        run.ticks.iter().filter(|tick| (0..4).any(|leg| tick.swings(leg))).map(|tick| tick.t_s).collect();
    let middle = match (metrics.safety.fell_at_s, gait_change(run), walking.first().zip(walking.last())) {
        (Some(fall), _, _) => fall - 0.4 * DETAIL_S,
        (_, Some(change), _) => change,
        (_, _, Some((first, last))) => 0.5 * (first + last),
        _ => 0.5 * end,
    };
    let from = (middle - 0.5 * DETAIL_S).clamp(0.0, (end - DETAIL_S).max(0.0));
    Range { min: from, max: (from + DETAIL_S).min(end) }
}

/// The whole run, its last tick included.
fn whole(run: &Run) -> Range {
    Range { min: 0.0, max: (run.duration_s() + run.period_s()).max(1e-3) }
}

/// Time of the first change of gait during a run.
fn gait_change(run: &Run) -> Option<f64> {
    let gaits: Vec<(f64, i8)> =
        run.ticks.iter().filter_map(|tick| tick.legs.as_ref().map(|l| (tick.t_s, l.gait))).collect();
    gaits.windows(2).find(|pair| pair[0].1 != pair[1].1).map(|pair| pair[1].0)
}

/// The ticks inside a range of time.
fn within(run: &Run, time: Range) -> &[Tick] {
    let from = run.ticks.partition_point(|tick| tick.t_s < time.min);
    let to = run.ticks.partition_point(|tick| tick.t_s <= time.max);
    &run.ticks[from..to]
}

/// One value a tick, NaN where the log has none.
fn series(ticks: &[Tick], value: impl Fn(&Tick) -> Option<f64>) -> Vec<f64> {
    ticks.iter().map(|tick| value(tick).unwrap_or(f64::NAN)).collect()
}

fn times(ticks: &[Tick]) -> Vec<f64> {
    ticks.iter().map(|tick| tick.t_s).collect()
}

/// Begin and end of every stretch of ticks for which a condition holds, s.
fn spans(ticks: &[Tick], holds: impl Fn(&Tick) -> bool) -> Vec<(f64, f64)> {
    let mut spans = Vec::new();
    let mut begin = None;
    for tick in ticks {
        match (holds(tick), begin) {
            (true, None) => begin = Some(tick.t_s),
            (false, Some(from)) => {
                spans.push((from, tick.t_s));
                begin = None;
            }
            _ => {}
        }
    }
    if let (Some(from), Some(last)) = (begin, ticks.last()) {
        spans.push((from, last.t_s));
    }
    spans
}

/// The leg is off the ground by command: swinging, reaching or holding.
fn airborne(tick: &Tick, leg: usize) -> bool {
    tick.legs.as_ref().is_some_and(|l| l.state[leg] != LegState::STATE_STANCE)
}

/// " from 12.0 s to 17.0 s", for captions of detailed figures.
fn window_text(window: Range) -> String {
    format!("{:.1} s to {:.1} s of the run", window.min, window.max)
}
