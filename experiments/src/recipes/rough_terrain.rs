//! A3: blind omnidirectional walk on rough terrain.

use super::shared::{falls, speed};
use crate::bench::{Bench, RunSpec, mean};
use crate::experiment::Experiment;
use crate::row::Row;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A3",
    title: "rough terrain, blind, omnidirectional",
    published: "no number: \"ruins and cobble-stones\", step height 0.1 m",
    robot: "hyq",
    seeds: 20,
    minutes: 4.0,
    run: |bench| rough(bench, "", &|spec| spec),
};

/// Judges falls and forward speed over all seeds.
///
/// - `variant`: changes each run.
pub(super) fn rough(bench: &Bench, prefix: &str, variant: &dyn Fn(RunSpec) -> RunSpec) -> anyhow::Result<Vec<Row>> {
    let specs = bench.seeds().map(|seed| variant(RunSpec::of("rough_track")).seed(seed)).collect();
    let samples = bench.all("rough terrain", specs)?;
    let mut rows = vec![falls(prefix, &samples)];
    let distance = mean(samples.iter().map(|s| s.summary.distance_m));
    rows.push(Row::info(format!("{prefix}distance walked, mean"), distance, "m"));
    rows.extend(speed(prefix, &samples));
    let tilt = samples.iter().filter_map(|s| s.metrics.safety.max_tilt_rad).fold(0.0, f64::max);
    rows.push(Row::info(format!("{prefix}largest tilt of any seed"), tilt, "rad"));
    Ok(rows)
}
