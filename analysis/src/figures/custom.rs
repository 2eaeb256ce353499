//! Fields of any channels, selected in a `plots.toml`, in one panel.

use super::figure_spec::FigureSpec;
use super::trace::{Curve, Role, Trace, Traces};
use crate::run::Run;

pub(super) fn traces(run: &Run, spec: &FigureSpec) -> Result<Traces, String> {
    let mut curves = Vec::new();
    for (k, field) in spec.fields.iter().enumerate() {
        let name = field.to_string();
        let samples = run.fields.get(&name).ok_or_else(|| format!("field {name}"))?;
        curves.push(Curve { role: Role::Number(k), name, xs: samples.t_s.clone().into(), ys: samples.values.clone() });
    }
    let label = if spec.label.is_empty() {
        spec.fields.first().map(|f| f.path.clone()).unwrap_or_default()
    } else {
        spec.label.clone()
    };
    let trace = Trace { height: 150.0, ..Trace::new(label, 1e-9, curves) };
    let caption = spec.fields.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ") + ".";
    Ok(Traces { sections: vec![(1, vec![trace])], window: spec.whole(run), caption, marks: Vec::new() })
}
