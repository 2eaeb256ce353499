//! Orientation of the base and its error over the whole run, with the pushes. Source: Raiola et al. 2020, Figure 10 and section 5.

use super::base;
use super::figure_spec::FigureSpec;
use super::trace::{Role, Timeline, Trace, Traces};
use crate::metrics::{Reference, orientation_error};
use crate::run::{Run, Tick};
use crate::stats::ErrorStats;

/// Minimum range of the axis of the error, rad.
const LEAST_ERROR_SPAN: f64 = 0.002;

pub(super) fn traces(run: &Run, spec: &FigureSpec) -> Result<Traces, String> {
    if !run.has("BASE_TRACKING") {
        return Err("BASE_TRACKING".to_owned());
    }
    let against = Reference::of(run);
    let mut figure = base::traces(run, spec)?;
    let timeline = Timeline::new(run, figure.window);
    let error = |tick: &Tick| orientation_error(tick, against).filter(|_| tick.balances());
    let measured = match against {
        Reference::GroundTruth => "ground truth",
        Reference::Estimate => "the estimate",
    };
    figure.caption = format!(
        "Roll, pitch and yaw of the base, and the angle between reference and {measured}. The quantities of Figure 10 of Raiola et al. 2020."
    );
    let (_, panels) = &mut figure.sections[0];
    // The last panel is the height.
    panels.truncate(3);
    let mut trace = Trace::new("error [rad]", LEAST_ERROR_SPAN, vec![timeline.curve(Role::Number(2), "error", error)]);
    trace.includes = vec![0.0];
    trace.shades.clone_from(&panels[0].shades);
    if let Some(e) = ErrorStats::of(timeline.ticks.iter().filter_map(error)) {
        figure.caption.push_str(&format!(" Error: mean {:.4} rad, standard deviation {:.4} rad.", e.mean, e.std));
    }
    panels.push(trace);
    Ok(figure)
}
