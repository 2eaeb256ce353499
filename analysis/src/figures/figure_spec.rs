//! What a figure is asked for: kind, size, and which part of a run it shows.

use super::panel::Range;
use super::style::{self, POINTS_PER_UNIT, UNITS_PER_MM};
use crate::fields::Field;
use crate::run::Run;
use serde::Deserialize;

/// Length of the window of detailed figures, s.
const DETAIL_S: f64 = 5.0;
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
pub struct FigureSpec {
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

impl FigureSpec {
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

    pub(super) fn title(&self) -> String {
        self.title.clone().unwrap_or_else(|| self.kind.title().to_owned())
    }

    /// How much larger than the layout the paper is.
    pub(super) fn scale(&self) -> f64 {
        self.font_pt / (style::LABEL_EM * POINTS_PER_UNIT)
    }

    /// Width of the layout, in units of a drawing.
    pub(super) fn sheet(&self) -> f64 {
        self.width_mm * UNITS_PER_MM / self.scale()
    }

    /// The window, or the whole run.
    pub(super) fn whole(&self, run: &Run) -> Range {
        self.window_s.map_or_else(|| whole(run), |(min, max)| Range { min, max })
    }

    /// The window, or the part of the run where most is to be seen.
    pub(super) fn detail(&self, run: &Run) -> Range {
        self.window_s.map_or_else(|| detail_window(run), |(min, max)| Range { min, max })
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
    let begin = run.begin_s();
    let from = (middle - 0.5 * DETAIL_S).clamp(begin, (end - DETAIL_S).max(begin));
    Range { min: from, max: (from + DETAIL_S).min(end) }
}

/// The whole run, its last tick included.
pub(super) fn whole(run: &Run) -> Range {
    let begin = run.begin_s();
    Range { min: begin, max: (run.end_s() + run.period_s()).max(begin + 1e-3) }
}

/// Time of the first change of gait after the first swing: before it, the gait is only being chosen.
fn gait_change(run: &Run) -> Option<f64> {
    let walking = run.ticks.iter().skip_while(|tick| !(0..4).any(|leg| tick.swings(leg)));
    let mut gaits = walking.filter_map(|tick| tick.legs.as_ref().map(|l| (tick.t_s, l.gait)));
    let first = gaits.next()?.1;
    gaits.find(|(_, gait)| *gait != first).map(|(t_s, _)| t_s)
}
