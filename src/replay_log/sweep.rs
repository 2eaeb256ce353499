//! `hoof replay LOG --sweep KEY=FROM:TO:COUNT`: what-if replays of one log with several values of a parameter, on all cores.

use crate::progress::Progress;
use crate::robot::check_overrides;
use crate::{Outcome, say, say_json};
use analysis::table::{Column, Table};
use anyhow::{Context, ensure};
use replay::engine::{Options, Replay, ReplayReport, WhatIf};
use serde::Serialize;
use std::path::Path;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// Largest number of values in a sweep.
const MOST: usize = 200;

/// A line of the table.
#[derive(Serialize)]
struct Row {
    value: String,
    identical: bool,
    first_tick: Option<i64>,
    first_stage: Option<String>,
    #[serde(flatten)]
    what_if: WhatIf,
}

pub fn run(
    replay: &Replay,
    options: &Options,
    sweep: &str,
    plot_file: Option<&Path>,
    json: bool,
) -> anyhow::Result<Outcome> {
    let (key, spec) = sweep
        .split_once('=')
        .with_context(|| format!("--sweep {sweep}: found no =, expected KEY=FROM:TO:COUNT or KEY=VALUE|VALUE"))?;
    let values = values(spec).with_context(|| format!("--sweep {sweep}"))?;
    let params = replay.info().params();
    let as_found = |value: &String| filled(params, key, value);
    let settings: Vec<String> = values.iter().map(as_found).collect();
    for value in &settings {
        check_overrides("--sweep", params, &[format!("{key}={value}")])?;
    }
    let reports = replay_all(replay, options, key, &settings, plot_file.is_some())?;
    let mut rows = Vec::new();
    for (value, report) in values.iter().zip(reports) {
        let what_if = report.what_if.context("a replay with another parameter is a what-if")?;
        let first = report.first_divergence;
        rows.push(Row {
            value: value.clone(),
            identical: report.identical,
            first_tick: first.as_ref().map(|first| first.tick),
            first_stage: first.map(|first| first.stage),
            what_if,
        });
    }
    if let Some(path) = plot_file {
        let curves: Vec<(String, &WhatIf)> = rows.iter().map(|row| (row.value.clone(), &row.what_if)).collect();
        plot(path, &curves)?;
    }
    if json {
        say_json(&serde_json::json!({ "key": key, "bound": rows[0].what_if.bound, "rows": rows }))?;
    } else {
        say(table(key, &rows))?;
    }
    Ok(Outcome::Good)
}

/// `300:700:5` gives 300, 400, …, 700; `a|b` gives a and b.
fn values(spec: &str) -> anyhow::Result<Vec<String>> {
    let parts: Vec<&str> = spec.split(':').collect();
    let values: Vec<String> = match parts[..] {
        [from, to, count] => {
            let number =
                |text: &str| text.trim().parse::<f64>().with_context(|| format!("\"{text}\": expected a number"));
            let (from, to) = (number(from)?, number(to)?);
            let count: u16 =
                count.trim().parse().with_context(|| format!("\"{count}\": expected a number of values"))?;
            ensure!(count >= 2, "COUNT is {count}, expected 2 to {MOST}");
            let step = (to - from) / f64::from(count - 1);
            // Rounded, so that 0.1 + 0.2 is shown as 0.3.
            (0..count).map(|i| format!("{:?}", ((from + step * f64::from(i)) * 1e9).round() / 1e9)).collect()
        }
        _ => spec.split('|').map(|value| value.trim().to_owned()).collect(),
    };
    ensure!(values.len() <= MOST, "{} values, expected at most {MOST}", values.len());
    ensure!(values.iter().all(|value| !value.is_empty()), "expected FROM:TO:COUNT, or values separated by |");
    Ok(values)
}

/// Expands one number to all elements if the parameter is an array.
fn filled(params: &str, key: &str, value: &str) -> String {
    let table: toml::Table = params.parse().unwrap_or_default();
    let (mut path, mut at) = (key.split('.'), None);
    if let Some(first) = path.next() {
        at = table.get(first);
    }
    match path.fold(at, |at, name| at?.get(name)) {
        Some(toml::Value::Array(items)) if value.parse::<f64>().is_ok() => {
            format!("[{}]", vec![value; items.len()].join(", "))
        }
        _ => value.to_owned(),
    }
}

/// Replays once for each value, in parallel on all threads.
///
/// - `plots`: keep the samples for a figure.
fn replay_all(
    replay: &Replay,
    options: &Options,
    key: &str,
    settings: &[String],
    plots: bool,
) -> anyhow::Result<Vec<ReplayReport>> {
    let next = AtomicUsize::new(0);
    // Parts of a million of each replay that are done.
    let done: Vec<AtomicU64> = settings.iter().map(|_| AtomicU64::new(0)).collect();
    let bar = Progress::new(format!("{} replays", settings.len()));
    let threads = options.jobs.clamp(1, settings.len());
    let work = || {
        let mut found = Vec::new();
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(value) = settings.get(i) else { return Ok(found) };
            let mut options = Options { jobs: 1, ..options.clone() };
            options.set.push((key.to_owned(), value.clone()));
            #[expect(
                clippy::cast_precision_loss,
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "fraction for a progress bar"
            )]
            let mut progress = |part: f64| {
                done[i].store((part.clamp(0.0, 1.0) * 1e6) as u64, Ordering::Relaxed);
                let all: u64 = done.iter().map(|part| part.load(Ordering::Relaxed)).sum();
                bar.set(all as f64 * 1e-6 / settings.len() as f64);
            };
            let mut report = replay.run(&options, &mut progress)?;
            progress(1.0);
            if let Some(what_if) = report.what_if.as_mut().filter(|_| !plots) {
                what_if.samples = Vec::new();
            }
            found.push((i, report));
        }
    };
    let mut reports = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let mut reports: Vec<(usize, ReplayReport)> = Vec::new();
        for thread in threads {
            let found: Result<Vec<_>, replay::Error> =
                thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            reports.extend(found?);
        }
        Ok::<_, replay::Error>(reports)
    })?;
    reports.sort_by_key(|(i, _)| *i);
    Ok(reports.into_iter().map(|(_, report)| report).collect())
}

fn table(key: &str, rows: &[Row]) -> String {
    let bound = rows[0].what_if.bound;
    let numbers = [
        "value",
        "valid to (s)",
        "ticks",
        "max (N m)",
        "rms (N m)",
        "tau rms",
        "QP it.",
        "contact",
        "trunk",
        "posture",
        "no sol.",
    ];
    let mut table = Table::new(numbers.into_iter().map(Column::right).chain([Column::left("first difference")]));
    for Row { value, identical, first_tick, first_stage, what_if } in rows {
        let leaves = what_if.departure.map_or("-".to_owned(), |d| format!("{:.3}", d.t_s));
        let first = match (first_tick, first_stage) {
            (Some(tick), Some(stage)) => format!("tick {tick}, {stage}"),
            _ if *identical => "none".to_owned(),
            _ => "nothing to compare".to_owned(),
        };
        let [contact, trunk, posture] = what_if.residuals;
        table.row([
            value.clone(),
            leaves,
            what_if.ticks.to_string(),
            format!("{:.3}", what_if.tau_difference_max),
            format!("{:.3}", what_if.tau_difference_rms),
            format!("{:.3}", what_if.tau_rms),
            format!("{:.1}", what_if.qp_iterations),
            format!("{contact:.2e}"),
            format!("{trunk:.2e}"),
            format!("{posture:.2e}"),
            what_if.qp_failed_ticks.to_string(),
            first,
        ]);
    }
    format!(
        "{key}: statistics up to the first tick at which a torque differs from the recorded one by more than {bound} N m\n\n{table}"
    )
}

/// Plots named what-if replays to a file.
pub fn plot(path: &Path, replays: &[(String, &WhatIf)]) -> anyhow::Result<()> {
    Ok(analysis::figures::what_if(replays).write_file(path)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_evenly_spaced_and_lists_unchanged() {
        assert_eq!(values("300:700:5").unwrap(), ["300.0", "400.0", "500.0", "600.0", "700.0"]);
        assert_eq!(values("0.1:0.3:3").unwrap(), ["0.1", "0.2", "0.3"]);
        assert_eq!(values("true|false").unwrap(), ["true", "false"]);
        for wrong in ["1:2:1", "1:x:3", "1:2:x", "", "1:2:300", "a|"] {
            assert!(values(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn one_number_fills_an_array() {
        let params = "[posture]\nstance_kp = [500.0, 500.0, 500.0]\n[wbc]\nfriction = 0.8";
        assert_eq!(filled(params, "posture.stance_kp", "300.0"), "[300.0, 300.0, 300.0]");
        assert_eq!(filled(params, "wbc.friction", "0.6"), "0.6");
        assert_eq!(filled(params, "posture.stance_kp", "[1, 2, 3]"), "[1, 2, 3]");
    }
}
