//! Without the terrain estimator and without tasks for roll and pitch, the posture alone aligns the base with the ground under the feet.

use super::shared::{falls, speed};
use crate::bench::{Bench, RunSpec};
use crate::experiment::Experiment;
use crate::row::Row;
use analysis::tables::tracking_rows;
use controller::stack::S1;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "posture",
    title: "no terrain estimator, no task for roll and pitch of the trunk: the posture adapts",
    published: "section 3.4, no number",
    robot: "hyq",
    seeds: 10,
    minutes: 3.0,
    run,
};

fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let spec = |scenario: &str| {
        let formula = S1.replace("trunk", "trunk[2]");
        let spec = RunSpec::of(scenario).named(format!("{scenario}_posture")).set("terrain.estimator", "false");
        spec.set("stack.formula", format!("{formula:?}"))
    };
    let scenarios = ["flat_trot", "flat_crawl", "base_motion", "slope", "rough_trot"];
    let samples = bench.all("posture alone", scenarios.map(spec).to_vec())?;
    let mut rows = Vec::new();
    for (scenario, sample) in scenarios.iter().zip(&samples) {
        rows.push(falls(&format!("{scenario}: "), std::slice::from_ref(sample)));
        // On a slope the base follows the ground, but its reference stays level.
        if *scenario != "slope" {
            for row in
                tracking_rows(&sample.metrics).into_iter().filter(|row| ["roll", "pitch"].contains(&row.name.as_str()))
            {
                let rms = row.measured.map_or(f64::NAN, |measured| measured.rms);
                rows.push(Row::info(format!("{scenario}: {}, rms", row.name), rms, row.unit));
            }
        }
        if scenario.starts_with("flat") {
            rows.extend(speed(&format!("{scenario}: "), std::slice::from_ref(sample)));
        }
    }
    let tracks =
        bench.all("posture alone, rough", bench.seeds().map(|seed| spec("rough_track").seed(seed)).collect())?;
    rows.push(falls("rough_track: ", &tracks));
    Ok(rows)
}
