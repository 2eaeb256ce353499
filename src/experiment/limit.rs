//! `hoof experiment limit`: arguments and output.

use crate::robot::overrides;
use crate::{Outcome, say, say_json};
use analysis::table::{Column, Table};
use experiments::bench::RunSpec;
use experiments::limit_search::{Sweep, Tried, largest, toml_float};
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(
    after_help = "Example: hoof experiment limit --scenario scenarios/push_trot.toml --key 'push[0].force_W[1]' --from 0 --to 400 --step 10\n\n\
    A robot survives a value if, with every seed, it does not fall, does not enter its safe state, and reaches the distance --way.\n\
    The search doubles the distance from --from until a value fails, then bisects between the last success and the first failure.\n\
    Exit code 1 if --from itself fails."
)]
pub struct Args {
    /// Scenario file (TOML)
    #[arg(long, value_parser = drivers::shipped::argument)]
    scenario: PathBuf,
    /// Key to vary, such as `terrain.step_height_m` or `push[0].force_W[1]`; list entries count from 0
    #[arg(long)]
    key: String,
    /// First value; the robot should survive it
    #[arg(long, allow_hyphen_values = true)]
    from: f64,
    /// Last value to try
    #[arg(long, allow_hyphen_values = true)]
    to: f64,
    /// Resolution of the search
    #[arg(long)]
    step: f64,
    /// Name of a robot in robots/, or its TOML file
    #[arg(long, default_value = "hyq")]
    robot: String,
    /// Number of seeds for terrain and noise
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(i64).range(1..=1000))]
    seeds: i64,
    /// Distance from its start that the robot must reach, m; a robot that stops before a step has not climbed it
    #[arg(long, value_name = "M", default_value_t = 0.0)]
    way: f64,
    /// Change another key of the scenario; can be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    with: Vec<String>,
    /// Set a parameter of the controller; can be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Folder for logs and scenarios; created if missing
    #[arg(long, value_name = "DIR", default_value = "logs/runs/experiments/limit")]
    out: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let Args { scenario, key, from, to, step, robot, seeds, way, with, set, out, json } = args;
    anyhow::ensure!(*step > 0.0, "--step {step}: expected a positive number");
    anyhow::ensure!(
        from.is_finite() && to.is_finite() && from != to,
        "--from {from} --to {to}: expected two different finite numbers"
    );
    let bench = super::bench(robot, *seeds, None, out)?;
    let mut spec = RunSpec::of(&scenario.display().to_string());
    for change in with {
        let Some((key, value)) = change.split_once('=') else { anyhow::bail!("--with {change}: expected KEY=VALUE") };
        spec = spec.with(key.trim(), value.trim());
    }
    for (key, value) in overrides(set)? {
        spec = spec.set(&key, value);
    }
    let sweep = Sweep {
        spec,
        key,
        from: *from,
        to: *to,
        step: step.copysign(to - from),
        min_displacement: *way,
        seeds: bench.seeds(),
        vary: None,
    };
    let (limit, tried) = largest(&bench, &sweep)?;
    if *json {
        say_json(&serde_json::json!({ "key": key, "limit": (!limit.is_nan()).then_some(limit), "tried": tried }))?;
    } else {
        print(&sweep, limit, &tried)?;
    }
    Ok(Outcome::failed_if(limit.is_nan()))
}

fn print(sweep: &Sweep, limit: f64, tried: &[Tried]) -> anyhow::Result<()> {
    let (key, seeds) = (sweep.key, sweep.seeds.end);
    let mut table = Table::new([Column::right(key), Column::right(format!("survived, % of {seeds} seeds"))]);
    for Tried { value, survived } in tried {
        table.row([toml_float(*value), format!("{:.0}", 100.0 * survived)]);
    }
    say(table)?;
    let limit_text = toml_float(limit);
    say(if limit.is_nan() {
        format!("\n{key}: the first value, {}, is not survived", toml_float(sweep.from))
    } else if limit == sweep.to {
        format!("\n{key}: the last value, {limit_text}, is survived; the limit is beyond it")
    } else {
        format!("\n{key}: the limit is {limit_text}, found in steps of {}", toml_float(sweep.step.abs()))
    })
}
