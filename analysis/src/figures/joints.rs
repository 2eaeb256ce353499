//! Joints: command and measurement, one panel per joint.

use super::figure_spec::{FigureSpec, Quantity, window_text};
use super::trace::{Role, Timeline, Trace, Traces};
use crate::run::{JointSample, Run};

/// Panels per row: the joints of one leg.
const COLUMNS: usize = 3;

pub(super) fn traces(run: &Run, spec: &FigureSpec) -> Result<Traces, String> {
    let names = &run.joints.names;
    let shown: Vec<usize> = match spec.joints.as_slice() {
        [] => (0..names.len()).collect(),
        wanted => {
            let place = |name: &String| {
                let known = names.join(", ");
                names.iter().position(|n| n == name).ok_or_else(|| format!("joint {name} (joints of the log: {known})"))
            };
            wanted.iter().map(place).collect::<Result<_, _>>()?
        }
    };
    if shown.is_empty() {
        return Err("CONTROLLER_INPUT, ROBOT_STATE or ROBOT_COMMAND".to_owned());
    }
    let (value, label, least_span): (fn(JointSample) -> f64, _, _) = match spec.quantity {
        Quantity::Position => (|s| s.q, "q [rad]", 0.05),
        Quantity::Velocity => (|s| s.qd, "dq/dt [rad/s]", 0.5),
        Quantity::Torque => (|s| s.tau, "torque [N m]", 5.0),
    };
    let window = spec.detail(run);
    let timeline = Timeline::new(run, window);
    let trace = |&joint: &usize| {
        let measured = timeline.curve(Role::Measured, "measured", |t| run.joints.measured(t, joint).map(value));
        let commanded = timeline.curve(Role::Reference, "command", |t| run.joints.commanded(t, joint).map(value));
        let mut trace = Trace::new(label, least_span, vec![measured, commanded]);
        trace.heading = Some(names[joint].clone());
        trace.height = 62.0;
        trace
    };
    // Panels are listed by column, joints by row.
    let columns = COLUMNS.min(shown.len());
    let panels = (0..columns).flat_map(|column| shown.iter().skip(column).step_by(columns)).map(trace).collect();
    let caption =
        format!("{} of each joint, measured and commanded, {}.", capitalized(spec.quantity), window_text(window));
    Ok(Traces { sections: vec![(columns, panels)], window, caption, marks: Vec::new() })
}

fn capitalized(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Position => "Position",
        Quantity::Velocity => "Velocity",
        Quantity::Torque => "Torque (feed-forward torque of the command)",
    }
}
