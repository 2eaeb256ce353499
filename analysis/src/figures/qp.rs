//! The quadratic program: active constraints, iterations, clamped torques, residuals.

use super::figure_spec::FigureSpec;
use super::trace::{Role, Timeline, Trace, Traces};
use crate::run::{Run, Tick};

pub(super) fn traces(run: &Run, spec: &FigureSpec) -> Result<Traces, String> {
    if !run.has("WBC_SOLUTION") {
        return Err("WBC_SOLUTION".to_owned());
    }
    let window = spec.whole(run);
    let timeline = Timeline::new(run, window);
    let count = |label: &str, name: &str, value: fn(&crate::run::Wbc) -> i32| {
        let curve = timeline.curve(Role::Number(0), name, |t| t.wbc.as_ref().map(|w| f64::from(value(w))));
        Trace::new(label, 4.0, vec![curve])
    };
    // A residual of 0 has no logarithm and is not drawn.
    let log10 = |value: f64| (value > 0.0).then(|| value.log10());
    let residual = |k: usize, name: &str| {
        timeline.curve(Role::Number(k), name, move |t: &Tick| t.wbc.as_ref().and_then(|w| log10(w.residual[k])))
    };
    let residuals = vec![
        residual(0, "contact [m/s²]"),
        residual(1, "trunk [rad/s²]"),
        residual(2, "posture [rad/s²]"),
        timeline
            .curve(Role::Number(3), "base dynamics [N, N m]", |t| t.wbc.as_ref().and_then(|w| log10(w.base_residual))),
    ];
    let panels = vec![
        count("active rows", "", |w| w.n_active),
        count("iterations", "", |w| w.iterations),
        count("clamped torques", "", |w| w.n_clamped),
        Trace { height: 130.0, ..Trace::new("log10 residual", 1.0, residuals) },
    ];
    let caption = "Active inequality rows, iterations of the solver, torques clamped after the solve, and residuals of each task and of the floating-base dynamics."
        .to_owned();
    Ok(Traces { sections: vec![(1, panels)], window, caption, marks: Vec::new() })
}
