//! Orientation and height of the base over the whole run (reference, ground truth, estimate), alone or above two feet.

use super::feet;
use super::figure_spec::FigureSpec;
use super::style::{DAMPING, Mark, PUSH};
use super::trace::{Role, Timeline, Trace, Traces};
use crate::math::unwrap_angles;
use crate::run::{Run, Tick};
use lcmtypes::BaseTracking;

/// LF and RH, the feet of Figure 9 of Raiola et al. 2020.
const FEET_OF_FIGURE_9: [usize; 2] = [0, 3];
/// Minimum range of the vertical axes, rad and m.
const LEAST_SPAN: f64 = 0.04;

pub(super) fn traces(run: &Run, spec: &FigureSpec) -> Result<Traces, String> {
    if !run.has("BASE_TRACKING") && !run.has("GROUND_TRUTH") {
        return Err("BASE_TRACKING or GROUND_TRUTH".to_owned());
    }
    let window = spec.whole(run);
    let timeline = Timeline::new(run, window);
    let mut panels = vec![
        angle(&timeline, "roll [rad]", 0),
        angle(&timeline, "pitch [rad]", 1),
        angle(&timeline, "yaw [rad]", 2),
        Trace::new(
            "height [m]",
            LEAST_SPAN,
            vec![
                timeline.curve(Role::Truth, "truth", Tick::true_height),
                timeline.curve(Role::Estimate, "estimate", |t| estimated(t).map(|b| b.height_est)),
                timeline.curve(Role::Reference, "reference", |t| estimated(t).map(|b| b.height_des)),
            ],
        ),
    ];
    let damped = timeline.spans(|tick| !tick.balances());
    let pushed = timeline.spans(|tick| tick.truth.as_ref().is_some_and(|w| w.pushed));
    let mut marks = Vec::new();
    for (spans, color, name) in [(damped, DAMPING, "no whole-body control"), (pushed, PUSH, "push")] {
        if !spans.is_empty() {
            marks.push((name.to_owned(), Mark::Fill(color)));
            panels.iter_mut().for_each(|panel| panel.shades.push((spans.clone(), color)));
        }
    }
    let caption =
        "Roll, pitch and yaw of the base, and height of the base above the mean contact point of the stance feet."
            .to_owned();
    Ok(Traces { sections: vec![(1, panels)], window, caption, marks })
}

/// Figure of base and feet in the same window. Source: Raiola et al. 2020, Figure 9.
pub(super) fn with_feet(run: &Run, spec: &FigureSpec) -> Result<Traces, String> {
    let mut base = traces(run, spec)?;
    let legs = if spec.legs.len() == 4 { FEET_OF_FIGURE_9.to_vec() } else { spec.legs.clone() };
    let window_s = Some((base.window.min, base.window.max));
    let feet = feet::traces(run, &FigureSpec { legs, window_s, ..spec.clone() })?;
    for trace in &mut base.sections[0].1 {
        trace.height = 66.0;
    }
    let columns = base.sections[0].1.len() / 2;
    base.sections[0].0 = columns;
    base.sections.extend(feet.sections.into_iter().map(|(columns, mut panels)| {
        for panel in &mut panels {
            panel.height = 66.0;
            // In a whole walk there are too many swings to distinguish.
            panel.shades.clear();
        }
        (columns, panels)
    }));
    base.caption = "Base: orientation and height. Feet: contact points relative to the base, in the horizontal frame, with the reference of each swing. \
                    The quantities of Figure 9 of Raiola et al. 2020."
        .to_owned();
    Ok(base)
}

/// Estimates and references; the message contains zeros while the controller estimates nothing.
fn estimated(tick: &Tick) -> Option<&BaseTracking> {
    tick.base.as_ref().filter(|_| tick.estimates())
}

fn angle(timeline: &Timeline, label: &str, k: usize) -> Trace {
    let mut curves = vec![
        timeline.curve(Role::Truth, "truth", |t| t.truth.as_ref().map(|w| w.rpy[k])),
        timeline.curve(Role::Estimate, "estimate", |t| estimated(t).map(|b| b.rpy_est[k])),
        timeline.curve(Role::Reference, "reference", |t| estimated(t).map(|b| b.rpy_des[k])),
    ];
    curves.iter_mut().for_each(|curve| unwrap_angles(&mut curve.ys));
    Trace::new(label, LEAST_SPAN, curves)
}
