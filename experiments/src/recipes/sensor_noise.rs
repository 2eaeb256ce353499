//! A5: orientation error of a trot with noisy sensors, lagging drives, a torque error and pushes, as on the real robot.

use super::shared::{falls, note_departures};
use crate::bench::{Bench, RunSpec, mean};
use crate::experiment::Experiment;
use crate::row::Row;
use analysis::Run;
use analysis::figures::{FIGURE_10, FigureSpec, Named, draw};
use analysis::metrics::{Reference, orientation_error};
use analysis::stats::ErrorStats;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A5",
    title: "2 Hz trot with orientation references, noisy sensors, lagging drives and a push (Figure 10)",
    published: "orientation error 0.0101 rad in the mean, 0.0102 rad std, on the real HyQ",
    robot: "hyq",
    seeds: 5,
    minutes: 1.5,
    run,
};

/// The source does not say whether "2 Hz" is the frequency of strides or of swings. Both are run, and Figure 10 is drawn of the first run of each; strides
/// are judged.
fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    note_departures(bench)?;
    let mut rows = Vec::new();
    // Strides at 2 Hz: T_sw = (1 - 0.55) 0.5 s.
    for (name, frequency, judged) in [("2 Hz strides", "4.444", true), ("2 Hz swings", "2.0", false)] {
        let spec = |seed| {
            let spec = RunSpec::of("noisy_trot").named(format!("noisy_trot_{}", name.replace(' ', "_")));
            spec.set("gait.trot.swing_frequency", frequency).seed(seed)
        };
        let figure = FigureSpec { name: format!("figure10_{}", name.replace(' ', "_")), ..FigureSpec::new(&FIGURE_10) };
        let samples = bench.all_with(name, bench.seeds().map(spec).collect(), |run| {
            (orientation_errors(run), draw(&figure, &[(Named("run".to_owned()), run)]))
        })?;
        match samples.first().map(|sample| &sample.measured.1) {
            Some(Ok(figure)) => bench.write(figure)?,
            Some(Err(missing)) => bench.note(format!("Figure 10 is not drawn: the log lacks {}", missing.needs)),
            None => {}
        }
        let of = |value: fn(&ErrorStats) -> f64| mean(samples.iter().filter_map(|s| s.measured.0.as_ref()).map(value));
        let row = |what: &str, value| Row::info(format!("{name}: orientation error, {what}"), value, "rad");
        let published = |row: Row, limit: f64| {
            let row = row.published(limit);
            if judged { row.at_most(limit) } else { row }
        };
        rows.push(published(row("mean", of(|e| e.mean)), 0.0101));
        rows.push(published(row("std", of(|e| e.std)), 0.0102));
        rows.push(row("largest", of(|e| e.max_abs)));
        let fallen = falls(&format!("{name}: "), &samples);
        rows.push(if judged { fallen } else { fallen.not_judged() });
    }
    Ok(rows)
}

/// Angle between reference and true orientation of the base, rad, in the ticks in which the controller balances.
pub(super) fn orientation_errors(run: &Run) -> Option<ErrorStats> {
    let balancing = run.ticks.iter().filter(|tick| tick.balances());
    ErrorStats::of(balancing.filter_map(|tick| orientation_error(tick, Reference::GroundTruth)))
}
