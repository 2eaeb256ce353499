//! A8: estimated height of the base compared with its true height.

use super::shared::falls;
use crate::bench::{Bench, RunSpec};
use crate::experiment::Experiment;
use crate::row::Row;
use analysis::Run;
use analysis::stats::ErrorStats;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A8",
    title: "height of the base estimated from the stance feet, on flat ground and on a ramp of 10 degrees",
    published: "eqs. (16)-(17), no number",
    robot: "hyq",
    seeds: 1,
    minutes: 1.0,
    run,
};

fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let ramp = RunSpec::of("flat_trot")
        .named("ramp")
        .with("duration_s", "14.0")
        .with("terrain", "{ kind = \"slope\", angle_rad = 0.1745, flat_radius_m = 0.8, extent_m = [12.0, 4.0] }")
        .with(
            "operator",
            "[{ t_s = 0.0, mode = \"stand\" }, { t_s = 1.0, mode = \"walk\" }, { t_s = 2.0, v_x = 0.25 }, { t_s = 13.0, mode = \"stand\", v_x = 0.0 }]",
        );
    let specs = vec![RunSpec::of("flat_trot"), RunSpec::of("flat_crawl"), ramp];
    let names = ["flat, trot", "flat, crawl", "ramp, trot"];
    let samples = bench.all_with("heights", specs, |run: &Run| {
        ErrorStats::of(run.ticks.iter().filter(|tick| tick.balances()).filter_map(|tick| {
            let estimate = tick.base.as_ref()?.height_est;
            Some(1e3 * (estimate - tick.true_height()?))
        }))
    })?;
    let mut rows = vec![falls("", &samples)];
    for (name, sample) in names.iter().zip(&samples) {
        let of = |value: fn(&ErrorStats) -> f64| sample.measured.as_ref().map_or(f64::NAN, value);
        let std = Row::info(format!("{name}: estimate - truth, std"), of(|e| e.std), "mm");
        rows.push(if name.starts_with("flat") { std.at_most(5.0) } else { std });
        rows.push(Row::info(format!("{name}: estimate - truth, mean"), of(|e| e.mean), "mm"));
        rows.push(Row::info(format!("{name}: estimate - truth, largest"), of(|e| e.max_abs), "mm"));
    }
    Ok(rows)
}
