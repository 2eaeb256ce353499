//! Quantities over time, of one log or of several.
//!
//! A figure of this kind provides the panels of one run: curves of reference, truth and estimate. One run is drawn with all its curves. Several runs are drawn
//! with one curve each, ground truth if present, else measurement, else estimate; or as their mean with a band.

use std::rc::Rc;

use super::canvas::{RGBAColor, Stroke};
use super::chart::{Chart, Layer, Plot, Section, Spans};
use super::figure_spec::{FigureSpec, Named, Several};
use super::panel::Range;
use super::style::{ESTIMATED_LINE, Mark, REFERENCE_LINE, RUN_COLORS, TRUE_LINE, pale};
use crate::run::{Run, Tick};
use crate::stats::mean_and_std;

/// A step between ticks longer than this many periods is a gap. Lines are interrupted at gaps.
const GAP_PERIODS: f64 = 2.5;
/// The same for ticks with consecutive numbers: there the live run skipped ticks, and no message is missing in the log.
const STILL_PERIODS: f64 = 25.0;

/// The ticks of a run inside a window, and its gaps.
pub struct Timeline<'a> {
    /// The ticks.
    pub ticks: &'a [Tick],
    /// Indices of the ticks that follow a gap.
    after_gap: Vec<usize>,
    xs: Rc<[f64]>,
}

impl<'a> Timeline<'a> {
    /// The part of a run inside a window.
    pub fn new(run: &'a Run, window: Range) -> Self {
        let from = run.ticks.partition_point(|tick| tick.t_s < window.min);
        let to = run.ticks.partition_point(|tick| tick.t_s <= window.max);
        let ticks = &run.ticks[from..to];
        let longest = |i: usize| if ticks[i].follows(&ticks[i - 1]) { STILL_PERIODS } else { GAP_PERIODS };
        let is_gap = |i: &usize| ticks[*i].t_s - ticks[i - 1].t_s > longest(*i) * run.period_s();
        let after_gap: Vec<usize> = (1..ticks.len()).filter(is_gap).collect();
        let timeline = Self { ticks, after_gap, xs: Rc::new([]) };
        let xs = timeline.with_gaps(|tick| Some(tick.t_s), |i| 0.5 * (ticks[i - 1].t_s + ticks[i].t_s));
        Self { xs: xs.into(), ..timeline }
    }

    /// Times of the samples of [`Timeline::series`], s.
    pub fn xs(&self) -> Rc<[f64]> {
        Rc::clone(&self.xs)
    }

    /// One value per tick; NaN if the log has none, and one NaN in the middle of each gap.
    pub fn series(&self, value: impl Fn(&Tick) -> Option<f64>) -> Vec<f64> {
        self.with_gaps(value, |_| f64::NAN)
    }

    fn with_gaps(&self, value: impl Fn(&Tick) -> Option<f64>, in_gap: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.ticks.len() + self.after_gap.len());
        let mut gaps = self.after_gap.iter().copied().peekable();
        for (i, tick) in self.ticks.iter().enumerate() {
            if gaps.next_if_eq(&i).is_some() {
                out.push(in_gap(i));
            }
            out.push(value(tick).unwrap_or(f64::NAN));
        }
        out
    }

    /// Begin and end of each interval in which a condition holds, s. A gap ends an interval.
    pub fn spans(&self, holds: impl Fn(&Tick) -> bool) -> Spans {
        let mut spans = Vec::new();
        let mut begin: Option<f64> = None;
        let mut gaps = self.after_gap.iter().copied().peekable();
        let mut last = 0.0;
        for (i, tick) in self.ticks.iter().enumerate() {
            if gaps.next_if_eq(&i).is_some() {
                spans.extend(begin.take().map(|from| (from, last)));
            }
            match (holds(tick), begin) {
                (true, None) => begin = Some(tick.t_s),
                (false, Some(from)) => {
                    spans.push((from, tick.t_s));
                    begin = None;
                }
                _ => {}
            }
            last = tick.t_s;
        }
        spans.extend(begin.map(|from| (from, last)));
        spans
    }

    /// A curve of one value per tick.
    pub fn curve(&self, role: Role, name: &str, value: impl Fn(&Tick) -> Option<f64>) -> Curve {
        Curve { role, name: name.to_owned(), xs: self.xs(), ys: self.series(value) }
    }
}

/// Origin of a curve. It determines line style, and which curve represents a run in a figure of several runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Reference or command.
    Reference,
    /// Ground truth of the simulator.
    Truth,
    /// Estimate of the controller.
    Estimate,
    /// Sensor measurement.
    Measured,
    /// One of several equal quantities, with its index.
    Number(usize),
}

impl Role {
    fn line(self) -> (Stroke, bool) {
        match self {
            Self::Reference => (REFERENCE_LINE, true),
            Self::Truth => (TRUE_LINE, false),
            Self::Estimate => (ESTIMATED_LINE, false),
            Self::Measured => (Stroke { width: 1.3, ..TRUE_LINE }, false),
            Self::Number(k) => (Stroke { color: RUN_COLORS[k % RUN_COLORS.len()], width: 1.0 }, false),
        }
    }

    /// The curve with the lowest rank represents a run.
    fn rank(self) -> usize {
        match self {
            Self::Truth => 0,
            Self::Measured => 1,
            Self::Estimate => 2,
            Self::Number(k) => 3 + k,
            Self::Reference => usize::MAX,
        }
    }
}

/// Values over time.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Origin.
    pub role: Role,
    /// Text in the legend; empty: no entry.
    pub name: String,
    /// Times, s.
    pub xs: Rc<[f64]>,
    /// Values.
    pub ys: Vec<f64>,
}

/// A panel of a run.
#[derive(Clone, Debug)]
pub struct Trace {
    /// Text above the panel.
    pub heading: Option<String>,
    /// Label of the vertical axis.
    pub label: String,
    /// Minimum range of the vertical axis, so that noise does not fill the panel.
    pub least_span: f64,
    /// Values that the vertical axis includes.
    pub includes: Vec<f64>,
    /// Height of the panel.
    pub height: f64,
    /// Curves in drawing order. The reference is last, on top of the others.
    pub curves: Vec<Curve>,
    /// Shaded intervals behind the curves.
    pub shades: Vec<(Spans, RGBAColor)>,
    /// Bars above the panel.
    pub strips: Vec<(Spans, RGBAColor)>,
    /// Values of dashed horizontal lines.
    pub levels: Vec<f64>,
}

impl Trace {
    /// A panel of curves.
    pub fn new(label: impl Into<String>, least_span: f64, curves: Vec<Curve>) -> Self {
        Self {
            heading: None,
            label: label.into(),
            least_span,
            includes: Vec::new(),
            height: 92.0,
            curves,
            shades: Vec::new(),
            strips: Vec::new(),
            levels: Vec::new(),
        }
    }
}

/// All panels of a run.
pub struct Traces {
    /// Groups of panels, with the number of columns of each.
    pub sections: Vec<(usize, Vec<Trace>)>,
    /// Window of time.
    pub window: Range,
    /// One or two sentences about the content.
    pub caption: String,
    /// Legend entries in addition to those of the curves.
    pub marks: Vec<(String, Mark)>,
}

/// Lays out one run with all its curves, or several runs with one curve each.
pub fn chart(
    traces: fn(&Run, &FigureSpec) -> Result<Traces, String>,
    runs: &[(Named, &Run)],
    spec: &FigureSpec,
) -> Result<Chart, String> {
    let each = runs.iter().map(|(name, run)| traces(run, spec).map(|traces| (name.clone(), traces)));
    let mut each: Vec<(Named, Traces)> = each.collect::<Result<_, _>>()?;
    if each.len() > 1 {
        return Ok(overlay(each, spec.several));
    }
    Ok(each.pop().map(|(_, traces)| single(traces)).unwrap_or_default())
}

fn single(traces: Traces) -> Chart {
    let mut legend: Vec<(String, Mark)> = Vec::new();
    for curve in traces.sections.iter().flat_map(|(_, panels)| panels).flat_map(|trace| &trace.curves) {
        let mark = match curve.role.line() {
            (stroke, true) => Mark::Dashed(stroke),
            (stroke, false) => Mark::Line(stroke),
        };
        let drawn = curve.ys.iter().any(|y| y.is_finite());
        if drawn && !curve.name.is_empty() && !legend.iter().any(|(name, _)| *name == curve.name) {
            legend.push((curve.name.clone(), mark));
        }
    }
    legend.extend(traces.marks);
    let window = traces.window;
    let sections = traces.sections.into_iter().map(|(columns, panels)| {
        let plots = panels.into_iter().map(|trace| {
            let y = extent(&trace, trace.curves.iter().map(|curve| &curve.ys));
            let mut layers = backdrop(&trace);
            layers.extend(trace.levels.iter().map(|&level| Layer::Level(level, REFERENCE_LINE)));
            layers.extend(trace.curves.into_iter().map(|Curve { role, xs, ys, .. }| {
                let (stroke, dashed) = role.line();
                Layer::Line { xs, ys, stroke, dashed }
            }));
            Plot {
                heading: trace.heading,
                y_label: trace.label,
                x: window,
                y,
                height: trace.height,
                layers,
                ..Plot::default()
            }
        });
        Section { columns: vec![1.0; columns], plots: plots.collect(), shared_x: true }
    });
    Chart { caption: traces.caption, sections: sections.collect(), legend }
}

fn overlay(runs: Vec<(Named, Traces)>, several: Several) -> Chart {
    let (names, mut all): (Vec<Named>, Vec<Traces>) = runs.into_iter().unzip();
    let window =
        all.iter().fold(all[0].window, |w, t| Range { min: w.min.min(t.window.min), max: w.max.max(t.window.max) });
    let mut referenced = false;
    let mut sections = Vec::new();
    for s in 0..all[0].sections.len() {
        let mut plots = Vec::new();
        for p in 0..all[0].sections[s].1.len() {
            let mut first = all[0].sections[s].1[p].clone();
            let reference =
                first.curves.iter().position(|c| c.role == Role::Reference).map(|k| first.curves.swap_remove(k));
            let best = |traces: &mut Traces| {
                let curves = &mut traces.sections.get_mut(s)?.1.get_mut(p)?.curves;
                let finite = |curve: &Curve| curve.ys.iter().any(|y| y.is_finite());
                let at = (0..curves.len()).filter(|&k| finite(&curves[k])).min_by_key(|&k| curves[k].role.rank())?;
                Some(curves.swap_remove(at))
            };
            let curves: Vec<Option<Curve>> = all.iter_mut().map(best).collect();
            let y = extent(&first, curves.iter().flatten().map(|c| &c.ys).chain(reference.iter().map(|c| &c.ys)));
            let mut layers = backdrop(&first);
            layers.extend(first.levels.iter().map(|&level| Layer::Level(level, REFERENCE_LINE)));
            match several {
                Several::Lines => layers.extend(curves.into_iter().enumerate().filter_map(|(k, curve)| {
                    let Curve { xs, ys, .. } = curve?;
                    Some(Layer::Line { xs, ys, stroke: run_stroke(k), dashed: false })
                })),
                Several::Band => layers.extend(band(curves.into_iter().flatten().collect())),
            }
            if let Some(Curve { xs, ys, .. }) = reference {
                referenced = true;
                layers.push(Layer::Line { xs, ys, stroke: REFERENCE_LINE, dashed: true });
            }
            plots.push(Plot {
                heading: first.heading,
                y_label: first.label,
                x: window,
                y,
                height: first.height,
                layers,
                ..Plot::default()
            });
        }
        sections.push(Section { columns: vec![1.0; all[0].sections[s].0], plots, shared_x: true });
    }
    let mut legend: Vec<(String, Mark)> = match several {
        Several::Lines => names.iter().enumerate().map(|(k, n)| (n.0.clone(), Mark::Line(run_stroke(k)))).collect(),
        Several::Band => vec![
            (format!("mean of {} logs", names.len()), Mark::Line(run_stroke(0))),
            ("± standard deviation".to_owned(), Mark::Fill(pale(RUN_COLORS[0], 0.35))),
            ("smallest to largest".to_owned(), Mark::Fill(pale(RUN_COLORS[0], 0.15))),
        ],
    };
    if referenced {
        legend.push((format!("reference of {}", names[0].0), Mark::Dashed(REFERENCE_LINE)));
    }
    let first = all.swap_remove(0);
    legend.extend(first.marks.into_iter().filter(|(_, mark)| matches!(mark, Mark::Fill(_))));
    let caption =
        format!("{} Shown for each log: ground truth if present, else measurement, else estimate.", first.caption);
    Chart { caption, sections, legend }
}

/// Line style of run `k` in a figure of several runs.
pub fn run_stroke(k: usize) -> Stroke {
    Stroke { color: RUN_COLORS[k % RUN_COLORS.len()], width: 1.1 }
}

/// Mean over the runs, standard deviation and extremes, at the times of the first run.
fn band(curves: Vec<Curve>) -> Vec<Layer> {
    let Some(first) = curves.first() else { return Vec::new() };
    let xs = Rc::clone(&first.xs);
    let half_step = if xs.len() > 1 { 0.5 * (xs[xs.len() - 1] - xs[0]) / (xs.len() - 1) as f64 } else { 0.0 };
    let mut cursors = vec![0; curves.len()];
    let [mut mean, mut low, mut high, mut least, mut most] = std::array::from_fn(|_| Vec::with_capacity(xs.len()));
    for &x in xs.iter() {
        let at_x = curves.iter().zip(&mut cursors).filter_map(|(curve, at)| {
            while *at + 1 < curve.xs.len() && (curve.xs[*at + 1] - x).abs() <= (curve.xs[*at] - x).abs() {
                *at += 1;
            }
            let value = *curve.ys.get(*at)?;
            (value.is_finite() && (curve.xs[*at] - x).abs() <= half_step * 1.001).then_some(value)
        });
        let values: Vec<f64> = at_x.collect();
        let (m, s) = mean_and_std(&values).unwrap_or((f64::NAN, f64::NAN));
        mean.push(m);
        low.push(m - s);
        high.push(m + s);
        least.push(values.iter().copied().fold(f64::NAN, f64::min));
        most.push(values.iter().copied().fold(f64::NAN, f64::max));
    }
    vec![
        Layer::Band { xs: Rc::clone(&xs), low: least, high: most, color: pale(RUN_COLORS[0], 0.15) },
        Layer::Band { xs: Rc::clone(&xs), low, high, color: pale(RUN_COLORS[0], 0.35) },
        Layer::Line { xs, ys: mean, stroke: run_stroke(0), dashed: false },
    ]
}

fn backdrop(trace: &Trace) -> Vec<Layer> {
    let shades = trace.shades.iter().map(|(spans, color)| Layer::Shade(spans.clone(), *color));
    shades.chain(trace.strips.iter().map(|(spans, color)| Layer::Strip(spans.clone(), *color))).collect()
}

fn extent<'a>(trace: &'a Trace, series: impl Iterator<Item = &'a Vec<f64>>) -> Range {
    Range::covering(series.flatten().chain(&trace.includes).chain(&trace.levels), trace.least_span)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(xs: &[f64], ys: &[f64]) -> Curve {
        Curve { role: Role::Truth, name: String::new(), xs: xs.into(), ys: ys.to_vec() }
    }

    #[test]
    fn a_band_is_the_mean_and_deviation_of_the_finite_values() {
        let curves = vec![curve(&[0.0, 1.0, 2.0], &[1.0, 2.0, 3.0]), curve(&[0.1, 1.1], &[3.0, f64::NAN])];
        let layers = band(curves);
        let [Layer::Band { low: least, high: most, .. }, Layer::Band { low, high, .. }, Layer::Line { ys, .. }] =
            &layers[..]
        else {
            panic!("{layers:?}")
        };
        assert_eq!(*ys, [2.0, 2.0, 3.0]);
        assert_eq!((low[0], high[0], low[1], high[2]), (1.0, 3.0, 2.0, 3.0));
        assert_eq!((least[0], most[0]), (1.0, 3.0));
    }
}
