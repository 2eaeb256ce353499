//! Travel of feet while they touch the ground.

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
    let (mut speeds, mut ways) = (Vec::new(), Vec::new());
    for &leg in &spec.legs {
        let speed = timeline.curve(Role::Number(leg), LEGS[leg], |t| t.truth.as_ref().and_then(|w| w.slip_speed(leg)));
        let mut way = speed.clone();
        let mut sum = 0.0;
        for y in &mut way.ys {
            sum += if y.is_finite() { *y * period_s } else { 0.0 };
            *y = sum;
        }
        speeds.push(speed);
        ways.push(way);
    }
    let panels = vec![Trace::new("slip [m/s]", 0.1, speeds), Trace::new("travel [m]", 0.05, ways)];
    let caption =
        "Horizontal speed of each foot's centre while the foot truly touches the ground, and its sum over time. Rolling of the foot counts.".to_owned();
    Ok(Traces { sections: vec![(1, panels)], window, caption, marks: Vec::new() })
}
