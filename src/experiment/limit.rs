//! How much a robot survives: a search over a key of a scenario.

use super::bench::{Bench, Sample, Spec, count};
use super::scenario_edit::Change;
use crate::{Outcome, say, say_json};
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(
    after_help = "Example: hoof experiment limit --scenario scenarios/push_trot.toml --key 'push[0].force_W[1]' --from 0 --to 400 --step 10\n\n\
    A value is survived if the robot neither falls nor gives up with any seed, and comes as far as --way asks. What is tried doubles its distance from\n\
    --from until a value is not survived; bisection finds the limit between that and the last that was."
)]
pub struct Args {
    /// Scenario (TOML)
    #[arg(long, value_parser = drivers::shipped::argument)]
    scenario: PathBuf,
    /// Key to vary, such as `terrain.step_height_m` or `push[0].force_W[1]`
    #[arg(long)]
    key: String,
    /// Value that should be survived
    #[arg(long, allow_hyphen_values = true)]
    from: f64,
    /// Value at which the search ends
    #[arg(long, allow_hyphen_values = true)]
    to: f64,
    /// How exactly the limit is to be known
    #[arg(long)]
    step: f64,
    /// Name of a robot in robots/, or its TOML file
    #[arg(long, default_value = "hyq")]
    robot: String,
    /// Seeds of terrain and noise that a value is tried with
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(i64).range(1..=1000))]
    seeds: i64,
    /// Distance from its start that the robot must come to, m: a step before which it stops is not climbed
    #[arg(long, value_name = "M", default_value_t = 0.0)]
    way: f64,
    /// Change another key of the scenario; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    with: Vec<String>,
    /// Set a parameter of the controller; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Folder for logs and scenarios; made if need be
    #[arg(long, value_name = "DIR", default_value = "logs/runs/experiments/limit")]
    out: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A search along one key.
pub struct Sweep<'a> {
    /// The run, but for the key.
    pub spec: Spec,
    /// Key of the scenario.
    pub key: &'a str,
    /// Value that should be survived.
    pub from: f64,
    /// Value at which the search ends.
    pub to: f64,
    /// How exactly the limit is to be known.
    pub step: f64,
    /// Distance from its start that the robot must come to, m.
    pub way: f64,
    /// What is changed besides from seed to seed, such as the time of a push, so that it meets the gait in other phases.
    pub vary: Option<&'a (dyn Fn(i64) -> Change + Sync)>,
}

/// A value that was tried.
#[derive(Debug, serde::Serialize)]
pub struct Tried {
    /// The value.
    pub value: f64,
    /// Part of the seeds that survived it.
    pub survived: f64,
}

/// The largest value that every seed survives, not a number if `from` is not survived; and all that was tried, in the order of the values. It comes from
/// below, by doubled distances and then by bisection: a value that is survived by luck beyond one that is not would mislead a search from the far end.
pub fn largest(bench: &Bench, sweep: &Sweep) -> anyhow::Result<(f64, Vec<Tried>)> {
    let mut tried = Vec::new();
    let mut survives = |value: f64| -> anyhow::Result<bool> {
        let one = |seed: i64| {
            let name = format!("{}_{}", sweep.spec.name, text(value).replace('-', "minus"));
            let spec = sweep.spec.clone().named(name).with(sweep.key, text(value)).seed(seed);
            match sweep.vary {
                Some(vary) => {
                    let (key, value) = vary(seed);
                    spec.with(&key, value)
                }
                None => spec,
            }
        };
        let samples = bench.all(&format!("{} {value:.3}", sweep.key), bench.seeds().map(one).collect())?;
        let arrived = |distance: Option<f64>| distance.is_some_and(|distance| distance >= sweep.way);
        let survives = |sample: &Sample| !sample.failed() && arrived(sample.metrics.locomotion.distance_m);
        let survivors = samples.iter().filter(|sample| survives(sample)).count();
        tried.push(Tried { value, survived: count(survivors) / count(samples.len()) });
        Ok(survivors == samples.len())
    };
    // In steps from `from`, so that the same values turn up again.
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

/// A TOML float, short.
fn text(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    if rounded == rounded.trunc() { format!("{rounded:.1}") } else { format!("{rounded}") }
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let Args { scenario, key, from, to, step, robot, seeds, way, with, set, out, json } = args;
    anyhow::ensure!(*step > 0.0, "--step {step}: expected a positive number");
    anyhow::ensure!(from.is_finite() && to.is_finite() && from != to, "--from {from} --to {to}: expected two numbers");
    let bench = Bench::new(robot, *seeds, out)?;
    let mut spec = Spec::of(&scenario.display().to_string());
    for change in with {
        let Some((key, value)) = change.split_once('=') else { anyhow::bail!("--with {change}: expected KEY=VALUE") };
        spec = spec.with(key.trim(), value.trim());
    }
    for (key, value) in crate::robot::overrides(set)? {
        spec = spec.set(&key, value);
    }
    let sweep = Sweep { spec, key, from: *from, to: *to, step: step.copysign(to - from), way: *way, vary: None };
    let (limit, tried) = largest(&bench, &sweep)?;
    if *json {
        say_json(&serde_json::json!({ "key": key, "limit": (!limit.is_nan()).then_some(limit), "tried": tried }))?;
    } else {
        for Tried { value, survived } in &tried {
            say(format!("{key} = {:<10} {:>4.0} % of {seeds} seeds survive", text(*value), 100.0 * survived))?;
        }
        if limit.is_nan() {
            say(format!("\n{key}: not even {} is survived", text(*from)))?;
        } else if limit == *to {
            say(format!("\n{key}: {} is survived too, the limit lies beyond", text(limit)))?;
        } else {
            say(format!("\n{key}: {} is survived, {} beyond it is not", text(limit), text(step.abs())))?;
        }
    }
    Ok(Outcome::failed_if(limit.is_nan()))
}
