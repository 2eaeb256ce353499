//! Path of the base from above, with footholds. For several logs, the paths only.

use lcmtypes::LegState;

use super::canvas::Stroke;
use super::chart::{Chart, Layer, Plot, Section};
use super::figure_spec::{FigureSpec, Named};
use super::panel::Range;
use super::style::{BLUE, LEFT_MARGIN, LEG_COLORS, Mark, RIGHT_MARGIN, TRUE_LINE};
use super::trace::run_stroke;
use crate::run::{LEGS, Run};

/// Valid heights of the panel.
const HEIGHTS: std::ops::RangeInclusive<f64> = 110.0..=420.0;
/// Free space around the data, m.
const MARGIN: f64 = 0.15;

pub(super) fn chart(runs: &[(Named, &Run)], spec: &FigureSpec) -> Result<Chart, String> {
    let paths: Vec<Vec<(f64, f64)>> = runs
        .iter()
        .map(|(_, run)| {
            let window = spec.whole(run);
            let inside = run.ticks.iter().filter(|t| t.t_s >= window.min && t.t_s <= window.max);
            inside.filter_map(|t| t.truth.as_ref().map(|w| (w.p_WB[0], w.p_WB[1]))).collect()
        })
        .collect();
    if paths.iter().any(Vec::is_empty) {
        return Err("GROUND_TRUTH".to_owned());
    }
    let alone = runs.len() == 1;
    let footholds: Vec<Vec<(f64, f64)>> = match runs {
        [(_, run)] => (0..4).map(|leg| footholds(run, leg)).collect(),
        _ => Vec::new(),
    };
    let extent = |axis: fn(&(f64, f64)) -> f64| {
        let values = paths.iter().chain(&footholds).flatten().map(axis);
        let (min, max) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        (0.5 * (min + max), max - min + 2.0 * MARGIN)
    };
    let ((x_middle, x_span), (y_middle, y_span)) = (extent(|p| p.0), extent(|p| p.1));
    // Both axes have one scale, so that the larger extent fits.
    let width = spec.sheet() - LEFT_MARGIN - RIGHT_MARGIN;
    let height = (width * y_span / x_span).clamp(*HEIGHTS.start(), *HEIGHTS.end());
    let metres_per_unit = (x_span / width).max(y_span / height);
    let around = |middle: f64, units: f64| Range {
        min: middle - 0.5 * units * metres_per_unit,
        max: middle + 0.5 * units * metres_per_unit,
    };
    let mut legend = Vec::new();
    let mut layers = Vec::new();
    for ((points, color), name) in footholds.into_iter().zip(LEG_COLORS).zip(LEGS) {
        if !points.is_empty() {
            legend.push((name.to_owned(), Mark::Dot(color)));
            layers.push(Layer::Dots(points, 2.1, color));
        }
    }
    for (k, (path_points, (name, _))) in paths.into_iter().zip(runs).enumerate() {
        let stroke = if alone { Stroke { width: 1.3, ..TRUE_LINE } } else { run_stroke(k) };
        legend.insert(k, (if alone { "base (disc: end)".to_owned() } else { name.0.clone() }, Mark::Line(stroke)));
        let end = path_points.last().copied().into_iter().collect();
        layers.push(Layer::Path(apart(path_points, 0.5 * metres_per_unit), stroke));
        layers.push(Layer::Dots(end, 3.2, if alone { BLUE } else { stroke.color }));
    }
    let plot = Plot {
        x_label: "x [m]".to_owned(),
        y_label: "y [m]".to_owned(),
        x: around(x_middle, width),
        y: around(y_middle, height),
        height,
        layers,
        ..Plot::default()
    };
    let caption = "True path of the base in the world, and for a single log the foothold of each step. Both axes have the same scale.";
    Ok(Chart { caption: caption.to_owned(), sections: vec![Section::column(vec![plot])], legend })
}

/// True contact point at each touchdown of a leg.
fn footholds(run: &Run, leg: usize) -> Vec<(f64, f64)> {
    let state = |i: usize| run.ticks[i].legs.as_ref().map(|l| l.state[leg]);
    (1..run.ticks.len())
        .filter(|&i| {
            state(i) == Some(LegState::STATE_STANCE) && state(i - 1).is_some_and(|s| s != LegState::STATE_STANCE)
        })
        .filter_map(|i| run.ticks[i].truth.as_ref().map(|w| (w.p_WF[leg][0], w.p_WF[leg][1])))
        .collect()
}

/// Removes points closer than a distance to the last one kept.
fn apart(points: Vec<(f64, f64)>, distance: f64) -> Vec<(f64, f64)> {
    let mut out: Vec<(f64, f64)> = Vec::new();
    for p in points {
        if out.last().is_none_or(|last| (p.0 - last.0).hypot(p.1 - last.1) >= distance) {
            out.push(p);
        }
    }
    out
}
