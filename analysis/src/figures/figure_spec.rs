//! Specification of a figure: kind, size, and the part of a run that it shows.

use super::chart::Chart;
use super::panel::Range;
use super::style::{self, POINTS_PER_UNIT, UNITS_PER_MM};
use crate::fields::Field;
use crate::run::Run;
use serde::Deserialize;

/// Length of the window of detailed figures, s.
const DETAIL_S: f64 = 5.0;
/// Width of a figure that is as wide as a page, mm.
pub const PAGE_MM: f64 = 180.0;

/// Name of a run in legends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named(pub String);

/// Lays out a figure of one run or several; the error names the channels that are missing.
pub(super) type ChartFn = fn(&[(Named, &Run)], &FigureSpec) -> Result<Chart, String>;

/// A kind of figure: one line of the table in [`crate::figures`].
#[derive(Debug)]
pub struct Kind {
    /// Name in a `plots.toml` and default name of the files.
    pub name: &'static str,
    /// Default title.
    pub title: &'static str,
    pub(super) chart: ChartFn,
}

impl PartialEq for Kind {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

/// Signal of a joint.
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

/// How the curves of several logs are drawn in one panel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Several {
    /// One line per log.
    #[default]
    Lines,
    /// Mean, standard deviation and extremes.
    Band,
}

/// What to draw, and how large.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureSpec {
    /// Kind of figure.
    pub kind: &'static Kind,
    /// File name without extension.
    pub name: String,
    /// Title; `None`: the title of the kind.
    pub title: Option<String>,
    /// Width on paper, mm.
    pub width_mm: f64,
    /// Font size on paper, points.
    pub font_pt: f64,
    /// Begin and end of the window shown, s since the first tick; `None`: chosen from the run.
    pub window_s: Option<(f64, f64)>,
    /// Legs shown, 0 to 3.
    pub legs: Vec<usize>,
    /// Names of the joints shown; empty: all joints.
    pub joints: Vec<String>,
    /// Signal shown in figures of joints.
    pub quantity: Quantity,
    /// Fields shown in figures of fields.
    pub fields: Vec<Field>,
    /// Label of the vertical axis in figures of fields.
    pub label: String,
    /// How the curves of several logs are drawn in one panel.
    pub several: Several,
}

impl FigureSpec {
    /// A figure as wide as a page, with default choices.
    pub fn new(kind: &'static Kind) -> Self {
        Self {
            kind,
            name: kind.name.to_owned(),
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

    pub(super) fn title(&self) -> String {
        self.title.clone().unwrap_or_else(|| self.kind.title.to_owned())
    }

    /// Size on paper divided by size in the layout.
    pub(super) fn scale(&self) -> f64 {
        self.font_pt / (style::LABEL_EM * POINTS_PER_UNIT)
    }

    /// Width of the layout, in drawing units.
    pub(super) fn sheet(&self) -> f64 {
        self.width_mm * UNITS_PER_MM / self.scale()
    }

    /// The window of the specification, or the whole run.
    pub(super) fn whole(&self, run: &Run) -> Range {
        self.window_s.map_or_else(|| whole(run), |(min, max)| Range { min, max })
    }

    /// The window of the specification, or the most informative part of the run.
    pub(super) fn detail(&self, run: &Run) -> Range {
        self.window_s.map_or_else(|| detail_window(run), |(min, max)| Range { min, max })
    }
}

/// The part of the run shown by detailed figures: around a fall, else a change of gait, else the middle of the walk.
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
    let begin = run.begin_s();
    let from = (middle - 0.5 * DETAIL_S).clamp(begin, (end - DETAIL_S).max(begin));
    Range { min: from, max: (from + DETAIL_S).min(end) }
}

/// The whole run, including the period of its last tick.
pub(super) fn whole(run: &Run) -> Range {
    let begin = run.begin_s();
    Range { min: begin, max: (run.end_s() + run.period_s()).max(begin + 1e-3) }
}

/// Time of the first change of gait after the first swing, s. Earlier changes only select the gait.
fn gait_change(run: &Run) -> Option<f64> {
    let walking = run.ticks.iter().skip_while(|tick| !(0..4).any(|leg| tick.swings(leg)));
    let mut gaits = walking.filter_map(|tick| tick.legs.as_ref().map(|l| (tick.t_s, l.gait)));
    let first = gaits.next()?.1;
    gaits.find(|(_, gait)| *gait != first).map(|(t_s, _)| t_s)
}

/// "12.0 s to 17.0 s of the run", for captions of detailed figures.
pub(super) fn window_text(window: Range) -> String {
    format!("{:.1} s to {:.1} s of the run", window.min, window.max)
}
