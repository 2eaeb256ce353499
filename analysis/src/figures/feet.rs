//! Feet relative to the base: swing reference, and ground truth or estimate.

use lcmtypes::LegState;

use super::figure_spec::{FigureSpec, window_text};
use super::style::{Mark, SWING};
use super::trace::{Role, Timeline, Trace, Traces};
use crate::run::{LEGS, Run, Tick};

const AXES: [&str; 3] = ["x [m]", "y [m]", "z [m]"];

pub(super) fn traces(run: &Run, spec: &FigureSpec) -> Result<Traces, String> {
    if !run.has("LEG_STATE") {
        return Err("LEG_STATE".to_owned());
    }
    let window = spec.detail(run);
    let timeline = Timeline::new(run, window);
    let known = run.has("GROUND_TRUTH");
    let mut panels = Vec::new();
    for &leg in &spec.legs {
        let swings = timeline.spans(|tick| airborne(tick, leg));
        for (k, label) in AXES.into_iter().enumerate() {
            // Role::Measured is a thinner line than Role::Truth: only the reference is drawn on top of it.
            let measured = if known {
                timeline.curve(Role::Measured, "truth", |t| t.truth.as_ref().map(|w| w.p_BF_H(leg)[k]))
            } else {
                let encoders = |t: &Tick| t.legs.as_ref().map(|l| l.p_BF_H_est[leg][k]);
                timeline.curve(Role::Estimate, "estimate (encoders)", encoders)
            };
            let reference = |t: &Tick| t.legs.as_ref().filter(|_| airborne(t, leg)).map(|l| l.p_BF_H_des[leg][k]);
            let curves = vec![measured, timeline.curve(Role::Reference, "reference", reference)];
            let mut trace = Trace::new(label, 0.04, curves);
            trace.heading = (k == 0).then(|| format!("{} foot", LEGS[leg]));
            trace.shades = vec![(swings.clone(), SWING)];
            panels.push(trace);
        }
    }
    let caption = format!("Contact points relative to the base, in the horizontal frame, {}.", window_text(window));
    let marks = vec![("swing".to_owned(), Mark::Fill(SWING))];
    // Two legs per row.
    let sections = panels.chunks(2 * AXES.len()).map(|rows| (rows.len() / AXES.len(), rows.to_vec()));
    Ok(Traces { sections: sections.collect(), window, caption, marks })
}

/// The leg is in a state other than `STANCE`.
pub(super) fn airborne(tick: &Tick, leg: usize) -> bool {
    tick.legs.as_ref().is_some_and(|l| l.state[leg] != LegState::STATE_STANCE)
}
