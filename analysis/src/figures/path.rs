//! The way of the base from above, with the places where feet were set down.

use lcmtypes::LegState;

use super::canvas::{Align, Drawing, Stroke};
use super::panel::{Frame, Labels, Panel, Range};
use super::style::{
    BLUE, BOTTOM_MARGIN, LABEL_EM, LEFT_MARGIN, LEG_COLORS, Mark, PAGE_WIDTH, RIGHT_MARGIN, TEXT, TOP_MARGIN,
    TRUE_LINE, legend,
};
use super::{Figure, Lacking};
use crate::run::{LEGS, Run};

const NAME: &str = "path";
const TITLE: &str = "Path from above";
const HEIGHTS: std::ops::RangeInclusive<f64> = 110.0..=420.0;
/// Free space around the data, m.
const MARGIN: f64 = 0.15;

pub(super) fn draw(run: &Run) -> Result<Figure, Lacking> {
    let positions: Vec<[f64; 3]> = run.ticks.iter().filter_map(|t| t.truth.as_ref().map(|w| w.p_WB)).collect();
    let (Some(&first), Some(&last)) = (positions.first(), positions.last()) else {
        return Err(Lacking { name: NAME, title: TITLE, needs: "GROUND_TRUTH" });
    };
    let footholds: Vec<(usize, [f64; 3])> =
        (0..4).flat_map(|leg| footholds(run, leg).into_iter().map(move |p| (leg, p))).collect();
    let extent = |k: usize| {
        let values = positions.iter().chain(footholds.iter().map(|(_, p)| p)).map(|p| p[k]);
        let (min, max) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        (0.5 * (min + max), max - min + 2.0 * MARGIN)
    };
    let ((x_middle, x_span), (y_middle, y_span)) = (extent(0), extent(1));

    // One scale for both axes: the wider need decides, the other axis shows more ground.
    let width = PAGE_WIDTH - LEFT_MARGIN - RIGHT_MARGIN;
    let height = (width * y_span / x_span).clamp(*HEIGHTS.start(), *HEIGHTS.end());
    let metres_per_unit = (x_span / width).max(y_span / height);
    let around = |middle: f64, units: f64| Range {
        min: middle - 0.5 * units * metres_per_unit,
        max: middle + 0.5 * units * metres_per_unit,
    };
    let mut drawing = Drawing::new(PAGE_WIDTH, TOP_MARGIN + height + BOTTOM_MARGIN);
    let frame = Frame { left: LEFT_MARGIN, top: TOP_MARGIN, width, height };
    let panel = Panel::new(frame, around(x_middle, width), around(y_middle, height));

    panel.grid(&mut drawing);
    for &(leg, p) in &footholds {
        drawing.dot(panel.at(p[0], p[1]), 2.1, LEG_COLORS[leg]);
    }
    drawing.line(apart(positions.iter().map(|p| panel.at(p[0], p[1]))), Stroke { width: 1.3, ..TRUE_LINE });
    for (p, name, align, shift) in [(first, "start", Align::Right, -6.0), (last, "end", Align::Left, 6.0)] {
        let (x, y) = panel.at(p[0], p[1]);
        drawing.dot((x, y), 3.2, BLUE);
        drawing.text((x + shift, y + 0.36 * LABEL_EM), name, LABEL_EM, align, TEXT);
    }
    panel.axes(&mut drawing, Labels { x: Some("x [m]"), y: Some("y [m]") });

    let mut entries = vec![("base", Mark::Line(TRUE_LINE))];
    if !footholds.is_empty() {
        entries.extend(LEGS.into_iter().zip(LEG_COLORS).map(|(name, color)| (name, Mark::Dot(color))));
    }
    legend(&mut drawing, LEFT_MARGIN, 14.0, &entries);
    let caption =
        "True path of the base in the world, and the foothold of each step; both axes have one scale.".to_owned();
    Ok(Figure { name: NAME, title: TITLE, caption, drawing })
}

/// True contact point at each change of a leg from swing to stance.
fn footholds(run: &Run, leg: usize) -> Vec<[f64; 3]> {
    let state = |i: usize| run.ticks[i].legs.as_ref().map(|l| l.state[leg]);
    (1..run.ticks.len())
        .filter(|&i| {
            state(i) == Some(LegState::STATE_STANCE) && state(i - 1).is_some_and(|s| s != LegState::STATE_STANCE)
        })
        .filter_map(|i| run.ticks[i].truth.as_ref().map(|w| w.p_WF[leg]))
        .collect()
}

/// Points at least half a unit apart: more cannot be seen.
fn apart(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut out: Vec<(f64, f64)> = Vec::new();
    for p in points {
        if out.last().is_none_or(|last| (p.0 - last.0).hypot(p.1 - last.1) >= 0.5) {
            out.push(p);
        }
    }
    out
}
