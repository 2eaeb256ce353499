//! Slip: travel of feet in contact with the ground.

use super::figure_spec::FigureSpec;
use super::trace::{Role, Timeline, Trace, Traces};
use crate::run::{LEGS, Run};

pub(super) fn traces(run: &Run, spec: &FigureSpec) -> Result<Traces, String> {
    if !run.has("GROUND_TRUTH") {
        return Err("GROUND_TRUTH".to_owned());
    }
    let window = spec.whole(run);
    let timeline = Timeline::new(run, window);
    let period_s = run.period_s();
    let (mut speeds, mut travels) = (Vec::new(), Vec::new());
    for &leg in &spec.legs {
        let speed = timeline.curve(Role::Number(leg), LEGS[leg], |t| t.truth.as_ref().and_then(|w| w.slip_speed(leg)));
        let mut travel = speed.clone();
        let mut sum = 0.0;
        for y in &mut travel.ys {
            sum += if y.is_finite() { *y * period_s } else { 0.0 };
            *y = sum;
        }
        speeds.push(speed);
        travels.push(travel);
    }
    let panels = vec![Trace::new("slip [m/s]", 0.1, speeds), Trace::new("travel [m]", 0.05, travels)];
    let caption =
        "Horizontal speed of the center of each foot during true contact, and its time integral. Rolling of the foot is included.".to_owned();
    Ok(Traces { sections: vec![(1, panels)], window, caption, marks: Vec::new() })
}
