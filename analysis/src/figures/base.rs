//! Base orientation and height over the whole run: reference, truth, estimate.

use super::canvas::Drawing;
use super::panel::{Frame, Labels, Panel, Range};
use super::style::{
    BOTTOM_MARGIN, DAMPING, ESTIMATED_LINE, LEFT_MARGIN, Mark, PAGE_WIDTH, PUSH, REFERENCE_LINE, RIGHT_MARGIN,
    TOP_MARGIN, TRUE_LINE, legend,
};
use super::{Figure, Lacking, series, spans, times, whole};
use crate::math::unwrap_angles;
use crate::run::{Run, Tick};

const NAME: &str = "base_tracking";
const TITLE: &str = "Base orientation and height";
const PANEL_HEIGHT: f64 = 92.0;
const GAP: f64 = 12.0;

type Value = fn(&Tick) -> Option<f64>;

struct Row {
    label: &'static str,
    /// Least extent of the vertical axis, so that noise does not fill the panel.
    least_span: f64,
    angle: bool,
    reference: Value,
    truth: Value,
    estimate: Value,
}

const ROWS: [Row; 4] = [
    Row {
        label: "roll [rad]",
        least_span: 0.04,
        angle: true,
        reference: |t| t.base.as_ref().map(|b| b.rpy_des[0]),
        truth: |t| t.truth.as_ref().map(|w| w.rpy[0]),
        estimate: |t| t.base.as_ref().map(|b| b.rpy_est[0]),
    },
    Row {
        label: "pitch [rad]",
        least_span: 0.04,
        angle: true,
        reference: |t| t.base.as_ref().map(|b| b.rpy_des[1]),
        truth: |t| t.truth.as_ref().map(|w| w.rpy[1]),
        estimate: |t| t.base.as_ref().map(|b| b.rpy_est[1]),
    },
    Row {
        label: "yaw [rad]",
        least_span: 0.04,
        angle: true,
        reference: |t| t.base.as_ref().map(|b| b.rpy_des[2]),
        truth: |t| t.truth.as_ref().map(|w| w.rpy[2]),
        estimate: |t| t.base.as_ref().map(|b| b.rpy_est[2]),
    },
    Row {
        label: "height [m]",
        least_span: 0.04,
        angle: false,
        reference: |t| t.base.as_ref().map(|b| b.height_des),
        truth: |t| t.true_height(),
        estimate: |t| t.base.as_ref().map(|b| b.height_est),
    },
];

pub(super) fn draw(run: &Run) -> Result<Figure, Lacking> {
    if !run.has("BASE_TRACKING") && !run.has("GROUND_TRUTH") {
        return Err(Lacking { name: NAME, title: TITLE, needs: "BASE_TRACKING or GROUND_TRUTH" });
    }
    let rows = ROWS.len() as f64;
    let mut drawing = Drawing::new(PAGE_WIDTH, TOP_MARGIN + rows * PANEL_HEIGHT + (rows - 1.0) * GAP + BOTTOM_MARGIN);
    let xs = times(&run.ticks);
    let time = whole(run);
    let pushes = spans(&run.ticks, |tick| tick.truth.as_ref().is_some_and(|w| w.pushed));
    let damped = spans(&run.ticks, |tick| !tick.balances());

    for (k, row) in ROWS.iter().enumerate() {
        let values = [row.reference, row.truth, row.estimate].map(|value| {
            let mut ys = series(&run.ticks, value);
            if row.angle {
                unwrap_angles(&mut ys);
            }
            ys
        });
        let [reference, truth, estimate] = &values;
        let frame = Frame {
            left: LEFT_MARGIN,
            top: TOP_MARGIN + k as f64 * (PANEL_HEIGHT + GAP),
            width: drawing.width() - LEFT_MARGIN - RIGHT_MARGIN,
            height: PANEL_HEIGHT,
        };
        let panel = Panel::new(frame, time, Range::covering(values.iter().flatten(), row.least_span));
        for &(from, to) in &damped {
            panel.shade(&mut drawing, from, to, DAMPING);
        }
        for &(from, to) in &pushes {
            panel.shade(&mut drawing, from, to, PUSH);
        }
        panel.grid(&mut drawing);
        panel.line(&mut drawing, &xs, truth, TRUE_LINE);
        panel.line(&mut drawing, &xs, estimate, ESTIMATED_LINE);
        panel.dashed(&mut drawing, &xs, reference, REFERENCE_LINE);
        let x = (k + 1 == ROWS.len()).then_some("time [s]");
        panel.axes(&mut drawing, Labels { x, y: Some(row.label) });
    }

    let mut entries = Vec::new();
    if run.has("BASE_TRACKING") {
        entries.push(("reference", Mark::Dashed(REFERENCE_LINE)));
        entries.push(("estimate", Mark::Line(ESTIMATED_LINE)));
    }
    if run.has("GROUND_TRUTH") {
        entries.push(("truth", Mark::Line(TRUE_LINE)));
    }
    if !pushes.is_empty() {
        entries.push(("push", Mark::Fill(PUSH)));
    }
    if !damped.is_empty() {
        entries.push(("idle or damping", Mark::Fill(DAMPING)));
    }
    legend(&mut drawing, LEFT_MARGIN, 14.0, &entries);
    let caption =
        "Roll, pitch and yaw of the base, and its height above the mean contact point of the stance feet.".to_owned();
    Ok(Figure { name: NAME, title: TITLE, caption, drawing })
}
