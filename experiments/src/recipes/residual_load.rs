//! A12: force on the leg diagonally opposite to the swing leg, with and without force ramps and residual load.

use crate::bench::{Bench, RunSpec, count};
use crate::experiment::Experiment;
use crate::row::Row;
use analysis::Run;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A12",
    title: "crawl with and without force ramps and residual load of the leg opposite to the swing",
    published: "discussion: without them the opposite leg unloads and the robot tips over; minimum force 20 N",
    robot: "hyq",
    seeds: 3,
    minutes: 3.0,
    run,
};

fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    for (on, label) in [(true, "ramps and residual load"), (false, "neither")] {
        for frequency in [2.0, 1.0] {
            let spec = |seed| {
                let mut spec =
                    RunSpec::of("noisy_crawl").named(format!("crawl_{frequency}_{}", if on { "on" } else { "off" }));
                spec = spec.set("gait.crawl.swing_frequency", format!("{frequency:.1}"));
                // With swings at 1 Hz a stride takes 5 s; half the speed keeps its length within reach of the legs.
                spec = spec.with("operator[2].v_x", if frequency < 1.5 { "0.04" } else { "0.08" });
                if !on {
                    spec = spec.set("gait.crawl.ramp", "0.0").set("gait.crawl.residual_load", "0.0");
                }
                spec.seed(seed)
            };
            let samples =
                bench.all_with(&format!("crawl, {label}"), bench.seeds().map(spec).collect(), opposite_loads)?;
            let mut loads: Vec<f64> = samples.iter().flat_map(|s| s.measured.iter().copied()).collect();
            loads.sort_by(f64::total_cmp);
            let name = |what| format!("{frequency} Hz, {label}: {what}");
            let least = Row::info(name("least opposite force"), loads.first().copied().unwrap_or(f64::NAN), "N");
            let tips = 100.0 * count(samples.iter().filter(|s| s.failed()).count()) / count(samples.len());
            let tips = Row::info(name("runs that tip over"), tips, "%");
            rows.push(if on { least.at_least(20.0) } else { least });
            let low = loads.get(loads.len() / 20).copied().unwrap_or(f64::NAN);
            rows.push(Row::info(name("opposite force, 5th percentile of swings"), low, "N"));
            rows.push(if on { tips.exactly(0.0) } else { tips });
        }
    }
    Ok(rows)
}

/// For each swing of a crawl, the smallest true vertical force on the opposite leg during the swing, N.
pub(super) fn opposite_loads(run: &Run) -> Vec<f64> {
    let mut least = Vec::new();
    for leg in 0..4 {
        let mut swing: Option<f64> = None;
        for tick in run.ticks.iter().filter(|tick| tick.balances()) {
            match (&tick.truth, tick.swings(leg)) {
                (Some(truth), true) => {
                    let load = truth.f_F_W[3 - leg][2];
                    swing = Some(swing.map_or(load, |least| least.min(load)));
                }
                (_, true) => {}
                (_, false) => least.extend(swing.take()),
            }
        }
    }
    least
}
