//! Normal force and contact flag of each leg: estimate against truth.

use super::canvas::Drawing;
use super::panel::{Frame, Labels, Panel, Range};
use super::style::{
    BLUE, BOTTOM_MARGIN, ESTIMATED_LINE, LEFT_MARGIN, Mark, PAGE_WIDTH, RIGHT_MARGIN, SWING, TOP_MARGIN, TRUE_LINE,
    VERMILLION, legend,
};
use super::{Figure, Lacking, airborne, series, spans, times, window_text, within};
use crate::run::{LEGS, Run};

const NAME: &str = "contact_forces";
const TITLE: &str = "Contact forces";
const PANEL_HEIGHT: f64 = 92.0;
/// Room above a panel for its two flags.
const FLAGS: f64 = 11.0;
const GAP: f64 = 10.0;
const ESTIMATED: &str = "estimate";
const TRUE: &str = "truth";

pub(super) fn draw(run: &Run, window: Range) -> Result<Figure, Lacking> {
    let (estimated, known) = (run.has("CONTACT_ESTIMATE"), run.has("GROUND_TRUTH"));
    if !estimated && !known {
        return Err(Lacking { name: NAME, title: TITLE, needs: "CONTACT_ESTIMATE or GROUND_TRUTH" });
    }
    let ticks = within(run, window);
    let xs = times(ticks);
    let mut drawing = Drawing::new(PAGE_WIDTH, TOP_MARGIN + 4.0 * (FLAGS + PANEL_HEIGHT) + 3.0 * GAP + BOTTOM_MARGIN);
    for (leg, name) in LEGS.into_iter().enumerate() {
        let estimate = series(ticks, |t| t.contact.as_ref().map(|c| c.f_normal[leg]));
        let truth = series(ticks, |t| t.true_normal_force(leg));
        let frame = Frame {
            left: LEFT_MARGIN,
            top: TOP_MARGIN + FLAGS + leg as f64 * (PANEL_HEIGHT + FLAGS + GAP),
            width: drawing.width() - LEFT_MARGIN - RIGHT_MARGIN,
            height: PANEL_HEIGHT,
        };
        let panel = Panel::new(frame, window, Range::covering(estimate.iter().chain(&truth), 50.0));
        for (from, to) in spans(ticks, |tick| airborne(tick, leg)) {
            panel.shade(&mut drawing, from, to, SWING);
        }
        panel.grid(&mut drawing);
        panel.line(&mut drawing, &xs, &truth, TRUE_LINE);
        panel.line(&mut drawing, &xs, &estimate, ESTIMATED_LINE);
        for span in spans(ticks, |t| t.truth.as_ref().is_some_and(|w| w.contact[leg])) {
            panel.strip(&mut drawing, span, (frame.top - 9.0, 3.0), BLUE);
        }
        for span in spans(ticks, |t| t.contact.as_ref().is_some_and(|c| c.contact[leg])) {
            panel.strip(&mut drawing, span, (frame.top - 5.0, 3.0), VERMILLION);
        }
        let label = format!("{name} force [N]");
        panel.axes(&mut drawing, Labels { x: (leg == 3).then_some("time [s]"), y: Some(&label) });
    }
    let mut entries = Vec::new();
    if known {
        entries.push((TRUE, Mark::Line(TRUE_LINE)));
    }
    if estimated {
        entries.push((ESTIMATED, Mark::Line(ESTIMATED_LINE)));
    }
    if run.has("LEG_STATE") {
        entries.push(("leg commanded to swing", Mark::Fill(SWING)));
    }
    entries.push(("in contact", Mark::Bars(BLUE, VERMILLION)));
    legend(&mut drawing, LEFT_MARGIN, 14.0, &entries);
    let caption = format!(
        "Force of the ground on each foot along the terrain normal, {}. Bars above each panel: contact flag, in the colours of the lines.",
        window_text(window)
    );
    Ok(Figure { name: NAME, title: TITLE, caption, drawing })
}
