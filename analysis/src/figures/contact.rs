//! Forces at the feet: estimate, ground truth and command, and use of the friction cone.

use super::feet::airborne;
use super::figure_spec::{FigureSpec, window_text};
use super::panel::Range;
use super::style::{BLUE, Mark, SWING, VERMILLION};
use super::trace::{Role, Timeline, Trace, Traces};
use crate::math::Vec3;
use crate::run::{LEGS, Run, Tick};

/// Normal force below which the ratio to it is not shown, N.
const LEAST_NORMAL: f64 = 20.0;

pub(super) fn forces(run: &Run, spec: &FigureSpec) -> Result<Traces, String> {
    let (window, timeline) = prepare(run, spec)?;
    let panels = spec.legs.iter().map(|&leg| {
        let curves = vec![
            timeline.curve(Role::Truth, "truth", |t| t.true_normal_force(leg)),
            timeline.curve(Role::Estimate, "estimate", |t| t.contact.as_ref().map(|c| c.f_normal[leg])),
            timeline.curve(Role::Reference, "command", |t| t.wbc.as_ref().map(|w| dot(w.f_F_W[leg], normal(t)))),
        ];
        let mut trace = Trace::new(format!("{} force [N]", LEGS[leg]), 50.0, curves);
        trace.shades = vec![(timeline.spans(|tick| airborne(tick, leg)), SWING)];
        trace.strips = vec![
            (timeline.spans(|t| t.contact.as_ref().is_some_and(|c| c.contact[leg])), VERMILLION),
            (timeline.spans(|t| t.truth.as_ref().is_some_and(|w| w.contact[leg])), BLUE),
        ];
        trace
    });
    let caption = format!(
        "Force of the ground on each foot along the terrain normal, {}. Bars above each panel: contact flags in the colors of the lines.",
        window_text(window)
    );
    let mut marks = vec![("in contact".to_owned(), Mark::Bars(BLUE, VERMILLION))];
    if run.has("LEG_STATE") {
        marks.push(("swing".to_owned(), Mark::Fill(SWING)));
    }
    Ok(Traces { sections: vec![(1, panels.collect())], window, caption, marks })
}

pub(super) fn friction(run: &Run, spec: &FigureSpec) -> Result<Traces, String> {
    let (window, timeline) = prepare(run, spec)?;
    let limit = run.parameter("wbc.friction");
    let panels = spec.legs.iter().map(|&leg| {
        let curves = vec![
            timeline.curve(Role::Truth, "truth", |t| use_of_cone(t.truth.as_ref()?.f_F_W[leg], normal(t))),
            timeline.curve(Role::Estimate, "estimate", |t| use_of_cone(t.contact.as_ref()?.f_F_W[leg], normal(t))),
            timeline.curve(Role::Reference, "command", |t| use_of_cone(t.wbc.as_ref()?.f_F_W[leg], normal(t))),
        ];
        let mut trace = Trace::new(LEGS[leg].to_owned(), 0.2, curves);
        trace.includes = vec![0.0];
        trace.levels = limit.into_iter().collect();
        trace.shades = vec![(timeline.spans(|tick| airborne(tick, leg)), SWING)];
        trace
    });
    let level =
        limit.map_or(String::new(), |mu| format!(" Dashed line: friction coefficient of the controller, {mu}."));
    let caption = format!(
        "Ratio of tangential to normal force of each foot if the normal force exceeds {LEAST_NORMAL} N, {}.{level}",
        window_text(window)
    );
    let marks = vec![("swing".to_owned(), Mark::Fill(SWING))];
    Ok(Traces { sections: vec![(1, panels.collect())], window, caption, marks })
}

fn prepare<'a>(run: &'a Run, spec: &FigureSpec) -> Result<(Range, Timeline<'a>), String> {
    if !["CONTACT_ESTIMATE", "GROUND_TRUTH", "WBC_SOLUTION"].iter().any(|channel| run.has(channel)) {
        return Err("CONTACT_ESTIMATE, GROUND_TRUTH or WBC_SOLUTION".to_owned());
    }
    let window = spec.detail(run);
    Ok((window, Timeline::new(run, window)))
}

/// Estimated terrain normal in W; vertical without CONTACT_ESTIMATE.
fn normal(tick: &Tick) -> Vec3 {
    tick.contact.as_ref().map_or([0.0, 0.0, 1.0], |c| c.n_W)
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `|f_t| / f_n`; `None` if the normal force is at most [`LEAST_NORMAL`].
fn use_of_cone(f: Vec3, n: Vec3) -> Option<f64> {
    let f_n = dot(f, n);
    let f_t = (dot(f, f) - f_n * f_n).max(0.0).sqrt();
    (f_n > LEAST_NORMAL).then(|| f_t / f_n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_use_is_the_ratio_of_tangential_to_normal_force() {
        let used = use_of_cone([30.0, 0.0, 40.0], [0.0, 0.0, 1.0]).unwrap();
        assert!((used - 0.75).abs() < 1e-12);
        assert_eq!(use_of_cone([30.0, 0.0, 10.0], [0.0, 0.0, 1.0]), None);
    }
}
