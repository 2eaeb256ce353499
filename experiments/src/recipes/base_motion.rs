//! A2: tracking of base and feet while base orientation and height change. Source: Raiola et al. 2020, Table 3 and Figure 9.

use super::shared::{falls, note_departures, speed};
use crate::bench::{Bench, RunSpec};
use crate::experiment::Experiment;
use crate::row::Row;
use analysis::figures::{FIGURE_9, FigureSpec, Named, draw};
use analysis::tables::tracking_rows;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A2",
    title: "flat ground, crawl, then trot after 15 s, while base orientation and height change (Figure 9, Table 3)",
    published: "Table 3; compared by rms, which does not depend on how its mean is defined",
    robot: "hyq",
    seeds: 1,
    minutes: 0.5,
    run: |bench| {
        note_departures(bench)?;
        table3(bench, "", &|spec| spec)
    },
};

/// Judges the rms of every quantity of Table 3, and draws Figure 9.
///
/// - `variant`: changes the run.
pub(super) fn table3(bench: &Bench, prefix: &str, variant: &dyn Fn(RunSpec) -> RunSpec) -> anyhow::Result<Vec<Row>> {
    let spec = variant(RunSpec::of("base_motion"));
    let figure = FigureSpec { name: spec.name.replace("base_motion", "figure9"), ..FigureSpec::new(&FIGURE_9) };
    let sample = bench.one_with(spec, |run| draw(&figure, &[(Named("run".to_owned()), run)]))?;
    let mut rows = Vec::new();
    for row in tracking_rows(&sample.metrics) {
        // Feet that Table 3 does not list have no row.
        let Some(published) = row.published else { continue };
        let [rms, mean, std] = row.measured.map_or([f64::NAN; 3], |e| [e.rms, e.mean_abs, e.std]);
        let info = |what, value| Row::info(format!("{prefix}{}, {what}", row.name), value, row.unit);
        rows.push(info("rms", rms).published(published.rms()).at_most(published.rms()));
        rows.push(info("mean |e|", mean).published(published.mean));
        rows.push(info("std", std).published(published.std));
    }
    match &sample.measured {
        Ok(figure) => bench.write(figure)?,
        Err(missing) => bench.note(format!("Figure 9 is not drawn: the log lacks {}", missing.needs)),
    }
    rows.push(falls(prefix, std::slice::from_ref(&sample)));
    rows.extend(speed(prefix, std::slice::from_ref(&sample)));
    Ok(rows)
}
