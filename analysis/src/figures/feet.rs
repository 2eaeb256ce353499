//! Two feet relative to the base: swing reference against truth.

use super::canvas::{Align, Drawing, Stroke};
use super::panel::{Frame, Labels, Panel, Range};
use super::style::{
    BOTTOM_MARGIN, ESTIMATED_LINE, LABEL_EM, LEFT_MARGIN, Mark, PAGE_WIDTH, REFERENCE_LINE, RIGHT_MARGIN, SWING, TEXT,
    TOP_MARGIN, TRUE_LINE, legend,
};
use super::{Figure, Lacking, airborne, series, spans, times, window_text, within};
use crate::run::{LEGS, Run};

const NAME: &str = "feet_tracking";
const TITLE: &str = "Swing feet";
/// LF and RH, the feet of Figure 9 of Raiola et al. 2020.
const SHOWN: [usize; 2] = [0, 3];
const AXES: [&str; 3] = ["x [m]", "y [m]", "z [m]"];
const PANEL_HEIGHT: f64 = 96.0;
const GAP: f64 = 12.0;
const COLUMN_GAP: f64 = 66.0;

pub(super) fn draw(run: &Run, window: Range) -> Result<Figure, Lacking> {
    if !run.has("LEG_STATE") {
        return Err(Lacking { name: NAME, title: TITLE, needs: "LEG_STATE" });
    }
    let ticks = within(run, window);
    let xs = times(ticks);
    let known = run.has("GROUND_TRUTH");
    // Here the reference lies over it, and nothing else.
    let measured_line = Stroke { width: 1.3, ..if known { TRUE_LINE } else { ESTIMATED_LINE } };
    let mut drawing = Drawing::new(PAGE_WIDTH, TOP_MARGIN + 14.0 + 3.0 * PANEL_HEIGHT + 2.0 * GAP + BOTTOM_MARGIN);
    let width = 0.5 * (drawing.width() - LEFT_MARGIN - RIGHT_MARGIN - COLUMN_GAP);
    for (column, leg) in SHOWN.into_iter().enumerate() {
        let left = LEFT_MARGIN + column as f64 * (width + COLUMN_GAP);
        drawing.text(
            (left + 0.5 * width, TOP_MARGIN + 8.0),
            format!("{} foot", LEGS[leg]),
            LABEL_EM,
            Align::Middle,
            TEXT,
        );
        let swings = spans(ticks, |tick| airborne(tick, leg));
        for (k, label) in AXES.into_iter().enumerate() {
            let reference =
                series(ticks, |t| t.legs.as_ref().filter(|_| airborne(t, leg)).map(|l| l.p_BF_H_des[leg][k]));
            let measured = if known {
                series(ticks, |t| t.truth.as_ref().map(|w| w.p_BF_H(leg)[k]))
            } else {
                series(ticks, |t| t.legs.as_ref().map(|l| l.p_BF_H_est[leg][k]))
            };
            let top = TOP_MARGIN + 14.0 + k as f64 * (PANEL_HEIGHT + GAP);
            let frame = Frame { left, top, width, height: PANEL_HEIGHT };
            let panel = Panel::new(frame, window, Range::covering(reference.iter().chain(&measured), 0.04));
            for &(from, to) in &swings {
                panel.shade(&mut drawing, from, to, SWING);
            }
            panel.grid(&mut drawing);
            panel.line(&mut drawing, &xs, &measured, measured_line);
            panel.dashed(&mut drawing, &xs, &reference, REFERENCE_LINE);
            panel.axes(&mut drawing, Labels { x: (k == 2).then_some("time [s]"), y: Some(label) });
        }
    }
    let measured =
        if known { ("truth", Mark::Line(measured_line)) } else { ("estimate (encoders)", Mark::Line(measured_line)) };
    let entries = [("swing reference", Mark::Dashed(REFERENCE_LINE)), measured, ("swing", Mark::Fill(SWING))];
    legend(&mut drawing, LEFT_MARGIN, 14.0, &entries);
    let caption = format!(
        "Contact points of the left front and the right hind foot relative to the base, in the horizontal frame, {}.",
        window_text(window)
    );
    Ok(Figure { name: NAME, title: TITLE, caption, drawing })
}
