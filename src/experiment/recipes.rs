//! The experiments of Raiola et al. 2020, as recipes. Numbers as in the list of the paper's experiments, A1 to A12.

use super::bench::{Bench, Sample};
use super::{Experiment, Row};
use analysis::tables::tracking_rows;

/// Every experiment that can be run.
pub const ALL: &[Experiment] = &[
    Experiment {
        id: "A1",
        title: "time of a tick under the weighted stack S1 and the hierarchical S3",
        published: "S1 830 us, S3 1180 us, with qpOASES on an i5 of 3.1 GHz",
        run: solve_time,
    },
    Experiment {
        id: "A2",
        title: "flat ground, crawl, trot after 15 s, while base orientation and height change (Figure 9, Table 3)",
        published: "Table 3; compared by rms, which is the same however the mean is read",
        run: base_motion,
    },
    Experiment {
        id: "A3",
        title: "rough terrain of 2 to 4 cm, blind, omnidirectional, 20 s a seed",
        published: "no number: \"ruins and cobble-stones\", step height 0.1 m",
        run: rough_terrain,
    },
    Experiment {
        id: "A6",
        title: "haptic touchdown: how long after contact a foot counts as landed",
        published: "threshold 50 N along the terrain normal, ignored in the first half of the swing",
        run: touchdown,
    },
];

/// Mean time to build and solve, both stacks on the same scenario.
fn solve_time(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    for (stack, formula, published) in [("S1", controller::stack::S1, 830.0), ("S3", controller::stack::S3, 1180.0)] {
        let sample = bench.one("flat_trot", &[format!("stack.formula={formula}")])?;
        let Some(timing) = sample.metrics.timing else { continue };
        let stages = timing.stages.iter().filter(|stage| ["tasks", "QP"].contains(&stage.stage));
        let mean_us = stages.filter_map(|stage| stage.us).fold(0.0, |sum, us| sum + us.mean);
        rows.push(Row::at_most(format!("{stack}: build and solve, mean"), published, mean_us, "us"));
        if let Some(tick) = timing.tick_us {
            rows.push(Row::noted(format!("{stack}: whole tick, median"), tick.p50, "us"));
            rows.push(Row::noted(format!("{stack}: whole tick, p99.9"), tick.p999, "us"));
        }
    }
    Ok(rows)
}

/// Every rms of the paper's Table 3; the report beside the log draws its Figure 9.
fn base_motion(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let sample = bench.one("base_motion", &[])?;
    let mut rows = Vec::new();
    for row in tracking_rows(&sample.metrics) {
        let (Some(measured), Some(published)) = (row.measured, row.published) else { continue };
        rows.push(Row::at_most(format!("{}, rms", row.name), published.rms(), measured.rms, row.unit));
        rows.push(Row::noted(format!("{}, mean |e|", row.name), measured.mean_abs, row.unit));
        rows.push(Row::noted(format!("{}, std", row.name), measured.std, row.unit));
    }
    let fell = sample.summary.fell || sample.summary.safe_state.is_some();
    rows.push(Row::limited("falls", count(usize::from(fell)), "", !fell));
    rows.extend(speed(&[sample]));
    Ok(rows)
}

/// No fall with any seed, and the speed that was asked for.
fn rough_terrain(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let samples = bench.seeded("rough_trot", &[])?;
    let falls = samples.iter().filter(|s| s.summary.fell || s.summary.safe_state.is_some()).count();
    let mut rows = vec![Row::limited(format!("falls in {} seeds", bench.seeds()), count(falls), "", falls == 0)];
    rows.push(Row::noted("way, mean", mean(samples.iter().map(|s| s.summary.distance_m)), "m"));
    rows.extend(speed(&samples));
    let tilt = samples.iter().filter_map(|s| s.metrics.safety.max_tilt_rad).fold(0.0, f64::max);
    rows.push(Row::noted("largest tilt of any seed", tilt, "rad"));
    Ok(rows)
}

/// Median delay below 10 ms, no touchdown without contact.
fn touchdown(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    for scenario in ["flat_trot", "rough_trot"] {
        let sample = bench.one(scenario, &[])?;
        let Some(contact) = sample.metrics.contact else { continue };
        let of = &contact.touchdowns;
        rows.push(Row::noted(format!("{scenario}: touchdowns"), count(usize::try_from(of.count)?), ""));
        if let Some(delay) = of.delay_ms {
            rows.push(Row::limited(format!("{scenario}: delay, median"), delay.p50, "ms", delay.p50 < 10.0));
            rows.push(Row::noted(format!("{scenario}: delay, p99"), delay.p99, "ms"));
        }
        let none = of.false_count == 0;
        rows.push(Row::limited(
            format!("{scenario}: false touchdowns"),
            count(usize::try_from(of.false_count)?),
            "",
            none,
        ));
    }
    Ok(rows)
}

/// Commanded and true forward speed, means over the samples; good within 5 %.
fn speed(samples: &[Sample]) -> Vec<Row> {
    let forward = |of: fn(&Sample) -> Option<[f64; 2]>| mean(samples.iter().filter_map(of).map(|v| v[0]));
    let commanded = forward(|s| s.metrics.locomotion.commanded_velocity);
    let realised = forward(|s| s.metrics.locomotion.true_velocity);
    let good = (realised - commanded).abs() <= 0.05 * commanded.abs();
    vec![
        Row::noted("commanded forward speed, mean", commanded, "m/s"),
        Row::limited("true forward speed, mean", realised, "m/s", good),
    ]
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), x| (sum + x, n + 1.0));
    sum / n
}

#[expect(clippy::cast_precision_loss, reason = "a count for a table")]
fn count(n: usize) -> f64 {
    n as f64
}
