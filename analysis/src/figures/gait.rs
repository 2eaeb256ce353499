//! Gait diagram: commanded stance, estimated and true contact of each leg.

use super::canvas::{Align, Drawing};
use super::panel::{Frame, Labels, Panel, Range};
use super::style::{
    BLUE, BOTTOM_MARGIN, FRAME, LABEL_EM, LEFT_MARGIN, Mark, PAGE_WIDTH, RIGHT_MARGIN, TEXT, TOP_MARGIN, VERMILLION,
    legend,
};
use super::{Figure, Lacking, spans, window_text, within};
use crate::run::{LEGS, Run, Tick};

const NAME: &str = "gait";
const TITLE: &str = "Gait diagram";
const ROW: f64 = 40.0;
const BAR: f64 = 8.0;

pub(super) fn draw(run: &Run, window: Range) -> Result<Figure, Lacking> {
    if !run.has("LEG_STATE") {
        return Err(Lacking { name: NAME, title: TITLE, needs: "LEG_STATE" });
    }
    let ticks = within(run, window);
    let mut drawing = Drawing::new(PAGE_WIDTH, TOP_MARGIN + 4.0 * ROW + BOTTOM_MARGIN);
    let frame = Frame {
        left: LEFT_MARGIN,
        top: TOP_MARGIN,
        width: drawing.width() - LEFT_MARGIN - RIGHT_MARGIN,
        height: 4.0 * ROW,
    };
    let panel = Panel::new(frame, window, Range { min: 0.0, max: 4.0 });
    type Holds = fn(&Tick, usize) -> bool;
    let bars: [(&str, &str, Holds, _); 3] = [
        ("LEG_STATE", "commanded stance", |t, leg| t.stands(leg) == Some(true), FRAME.color),
        (
            "CONTACT_ESTIMATE",
            "estimated contact",
            |t, leg| t.contact.as_ref().is_some_and(|c| c.contact[leg]),
            VERMILLION,
        ),
        ("GROUND_TRUTH", "true contact", |t, leg| t.truth.as_ref().is_some_and(|w| w.contact[leg]), BLUE),
    ];
    let shown: Vec<_> = bars.iter().filter(|(channel, ..)| run.has(channel)).collect();
    for (leg, name) in LEGS.into_iter().enumerate() {
        let top = TOP_MARGIN + leg as f64 * ROW;
        let first = top + 0.5 * (ROW - shown.len() as f64 * (BAR + 2.0) + 2.0);
        for (k, (_, _, holds, color)) in shown.iter().enumerate() {
            for span in spans(ticks, |tick| holds(tick, leg)) {
                panel.strip(&mut drawing, span, (first + k as f64 * (BAR + 2.0), BAR), *color);
            }
        }
        drawing.text((LEFT_MARGIN - 8.0, top + 0.5 * ROW + 0.36 * LABEL_EM), name, LABEL_EM, Align::Right, TEXT);
    }
    panel.axes(&mut drawing, Labels { x: Some("time [s]"), y: None });
    let entries: Vec<_> = shown.iter().map(|(_, name, _, color)| (*name, Mark::Fill(*color))).collect();
    legend(&mut drawing, LEFT_MARGIN, 14.0, &entries);
    let caption = format!("Stance as commanded, and contact as estimated and as it was, {}.", window_text(window));
    Ok(Figure { name: NAME, title: TITLE, caption, drawing })
}
