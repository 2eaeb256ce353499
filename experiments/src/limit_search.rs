//! The largest value of a scenario's key that a robot survives.

use crate::bench::{Bench, RunSpec, Sample, count};
use crate::scenario_edit::Change;
use std::ops::Range;

/// A search along one key of a scenario.
pub struct Sweep<'a> {
    /// The run, without the key.
    pub spec: RunSpec,
    /// Key of the scenario, such as `terrain.step_height_m`.
    pub key: &'a str,
    /// First value; the robot should survive it.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// Resolution of the search, with the sign of `to - from`.
    pub step: f64,
    /// Displacement from its start that the robot must reach, m.
    pub min_displacement: f64,
    /// Seeds of the runs with one value.
    pub seeds: Range<i64>,
    /// A further change per seed, such as the time of a push, so that it acts in different phases of the gait.
    pub vary: Option<&'a (dyn Fn(i64) -> Change + Sync)>,
}

/// A value that was tried.
#[derive(Debug, serde::Serialize)]
pub struct Tried {
    /// The value.
    pub value: f64,
    /// Fraction of the seeds that survived it.
    pub survived: f64,
}

/// Finds the largest value that the robot survives with every seed.
///
/// Returns NaN if `from` is not survived; the second value lists all tries, by value. The search doubles the distance from `from`
/// until a value fails, then bisects. It starts at the safe end because survival is not monotonic: a lucky value beyond the first
/// failure would mislead a search from the other end.
///
/// # Errors
/// A run that cannot be simulated, such as an invalid key or value; see [`Bench::all`].
pub fn largest(bench: &Bench, sweep: &Sweep) -> anyhow::Result<(f64, Vec<Tried>)> {
    let mut tried = Vec::new();
    let mut survives = |value: f64| -> anyhow::Result<bool> {
        let one = |seed: i64| {
            let name = format!("{}_{}", sweep.spec.name, toml_float(value).replace('-', "minus"));
            let spec = sweep.spec.clone().named(name).with(sweep.key, toml_float(value)).seed(seed);
            match sweep.vary {
                Some(vary) => {
                    let (key, value) = vary(seed);
                    spec.with(&key, value)
                }
                None => spec,
            }
        };
        let samples = bench.all(&format!("{} {value:.3}", sweep.key), sweep.seeds.clone().map(one).collect())?;
        let reached = |displacement: Option<f64>| displacement.is_some_and(|d| d >= sweep.min_displacement);
        let survives = |sample: &Sample| !sample.failed() && reached(sample.metrics.locomotion.displacement_m);
        let survivors = samples.iter().filter(|sample| survives(sample)).count();
        tried.push(Tried { value, survived: count(survivors) / count(samples.len()) });
        Ok(survivors == samples.len())
    };
    // Values are whole steps from `from`, so that searches with different ends try the same values.
    let end = ((sweep.to - sweep.from) / sweep.step).abs().max(1.0);
    let value = |steps: f64| if steps == end { sweep.to } else { sweep.from + steps * sweep.step };
    if !survives(sweep.from)? {
        return Ok((f64::NAN, tried));
    }
    let (mut good, mut bad) = (0.0, 1.0);
    while survives(value(bad))? {
        good = bad;
        if good == end {
            break;
        }
        bad = (2.0 * bad).min(end);
    }
    while bad - good > 1.5 {
        let middle = (0.5 * (good + bad)).round();
        *(if survives(value(middle))? { &mut good } else { &mut bad }) = middle;
    }
    tried.sort_by(|a, b| a.value.total_cmp(&b.value));
    Ok((value(good), tried))
}

/// A value as a TOML float, rounded to 1e-6.
pub fn toml_float(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    if rounded == rounded.trunc() { format!("{rounded:.1}") } else { format!("{rounded}") }
}
