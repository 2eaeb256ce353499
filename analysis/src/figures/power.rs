//! Use of torque limits, mechanical power and positive work.

use super::figure_spec::FigureSpec;
use super::trace::{Role, Timeline, Trace, Traces};
use crate::metrics::{joint_powers, torque_use};
use crate::run::Run;

pub(super) fn traces(run: &Run, spec: &FigureSpec) -> Result<Traces, String> {
    if !run.has("CONTROLLER_INPUT") && !run.has("ROBOT_STATE") {
        return Err("CONTROLLER_INPUT or ROBOT_STATE".to_owned());
    }
    let window = spec.whole(run);
    let timeline = Timeline::new(run, window);
    let sum = |t: &_, part: fn(f64) -> f64| Some(joint_powers(run, t)?.map(part).sum());
    let positive = timeline.curve(Role::Measured, "", |t| sum(t, |p| p.max(0.0)));
    let mut work = positive.clone();
    let (mut joules, period_s) = (0.0, run.period_s());
    for y in &mut work.ys {
        joules += if y.is_finite() { *y * period_s } else { 0.0 };
        *y = joules;
    }
    let mut panels = Vec::new();
    let used = timeline.curve(Role::Measured, "", |t| torque_use(run, t).map(|share| 100.0 * share));
    if used.ys.iter().any(|y| y.is_finite()) {
        let mut trace = Trace::new("torque [% of limit]", 20.0, vec![used]);
        trace.includes = vec![0.0];
        trace.levels = vec![100.0];
        panels.push(trace);
    }
    let total = timeline.curve(Role::Measured, "", |t| sum(t, |p| p));
    panels.push(Trace::new("power [W]", 10.0, vec![total]));
    panels.push(Trace::new("positive work [J]", 10.0, vec![work]));
    let caption =
        "Largest ratio of torque to torque limit of any joint; mechanical power of all joints; time integral of the positive power of each joint."
            .to_owned();
    Ok(Traces { sections: vec![(1, panels)], window, caption, marks: Vec::new() })
}
