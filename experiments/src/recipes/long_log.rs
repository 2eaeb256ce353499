//! One hour of walking: memory and time of a report, speed of a replay, time to a place in the log.

use crate::bench::{Bench, RunSpec, Sample, count};
use crate::experiment::Experiment;
use crate::limit_search::toml_float;
use crate::row::Row;
use anyhow::Context;
use replay::engine::{Options, Replay};
use std::path::Path;
use std::time::Instant;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "long_log",
    title: "one hour of trot and crawl: report, replay, replay from any time",
    published: "no number",
    robot: "hyq",
    seeds: 1,
    minutes: 30.0,
    run,
};

/// Lengths of the two logs, min: the time of a report must grow with the length, not faster.
const MINUTES: [u32; 2] = [15, 60];
/// Places that are looked for, as a part of the log.
const PLACES: [f64; 5] = [0.001, 0.25, 0.5, 0.75, 0.9999];
/// Threads of the replay.
const JOBS: usize = 2;

fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    let mut us_per_tick = Vec::new();
    let mut last = None;
    for minutes in MINUTES {
        let sample = bench.one(walk(minutes))?;
        let bar = bench.bar(format!("report of {minutes} min"));
        forget_peak_memory()?;
        let start = Instant::now();
        let folder = bench.dir().join(format!("report_{minutes}"));
        analysis::report(&sample.log, &folder, &mut |p| bar(count(p.done as usize) / count(p.total.max(1) as usize)))?;
        let seconds = start.elapsed().as_secs_f64();
        us_per_tick.push(seconds / count(sample.metrics.run.ticks as usize) * 1e6);
        let memory = peak_memory_gib()?;
        rows.push(Row::info(format!("report of {minutes} min: peak memory"), memory, "GiB").at_most(2.0));
        rows.push(Row::info(format!("report of {minutes} min: time"), seconds, "s"));
        last = Some(sample);
    }
    rows.push(
        Row::info("report: time per tick of 60 min / of 15 min", us_per_tick[1] / us_per_tick[0], "").at_most(1.3),
    );
    let sample = last.context("two logs were written")?;
    rows.extend(replays(bench, &sample)?);
    Ok(rows)
}

/// Speed of the replay, and time until a replay from anywhere has computed a tick.
fn replays(bench: &Bench, sample: &Sample) -> anyhow::Result<Vec<Row>> {
    let bar = bench.bar("replay of 60 min");
    let start = Instant::now();
    let report =
        Replay::open(&sample.log)?.run(&Options { jobs: JOBS, ..Options::default() }, &mut |part| bar(part))?;
    let seconds = start.elapsed().as_secs_f64();
    let length_s = sample.metrics.run.duration_s;
    let mut longest = 0.0_f64;
    for place in PLACES {
        let from_s = place * length_s;
        let start = Instant::now();
        let options = Options { from_s: Some(from_s), to_s: Some(from_s + 0.01), ..Options::default() };
        let part = Replay::open(&sample.log)?.run(&options, &mut |_| {})?;
        anyhow::ensure!(part.identical && part.ticks > 0, "from {from_s} s: {part:?}");
        longest = longest.max(start.elapsed().as_secs_f64());
    }
    Ok(vec![
        Row::info(format!("replay with {JOBS} threads, times real time"), length_s / seconds, "").at_least(100.0),
        Row::info("replay is identical", count(usize::from(report.identical && report.complete)), "").exactly(1.0),
        Row::info("replay from a time, the longest of five places", longest, "s").at_most(2.0),
    ])
}

/// Each minute: trot forward or backward, sideways and turning, then a crawl, then a trot in a curve.
fn walk(minutes: u32) -> RunSpec {
    let mut operator =
        vec!["{ t_s = 0.0, mode = \"stand\", gait = \"trot\" }, { t_s = 1.0, mode = \"walk\" }".to_owned()];
    for minute in 0..minutes {
        let begin = f64::from(60 * minute);
        let sign = if minute % 2 == 0 { 1.0 } else { -1.0 };
        for (after_s, what) in [
            (3.0, format!("v_x = {:?}", 0.3 * sign)),
            (12.0, "v_x = 0.0, v_y = 0.1".to_owned()),
            (16.0, "v_y = 0.0, yaw_rate = 0.2".to_owned()),
            (21.0, "yaw_rate = 0.0".to_owned()),
            (24.0, "gait = \"crawl\"".to_owned()),
            (27.0, format!("v_x = {:?}", 0.08 * sign)),
            (45.0, "v_x = 0.0".to_owned()),
            (48.0, "gait = \"trot\"".to_owned()),
            (51.0, format!("v_x = {:?}, v_y = -0.1", 0.2 * sign)),
            (55.0, "v_x = 0.0, v_y = 0.0".to_owned()),
        ] {
            operator.push(format!("{{ t_s = {:?}, {what} }}", begin + after_s));
        }
    }
    let spec = RunSpec::of("flat_trot").named(format!("walk_{minutes}_min"));
    spec.with("operator", format!("[{}]", operator.join(", "))).with("duration_s", toml_float(f64::from(60 * minutes)))
}

/// Sets the peak of the resident memory of this process to its present value.
fn forget_peak_memory() -> anyhow::Result<()> {
    let path = Path::new("/proc/self/clear_refs");
    std::fs::write(path, "5").with_context(|| path.display().to_string())
}

/// The largest resident memory of this process since then, GiB.
fn peak_memory_gib() -> anyhow::Result<f64> {
    let status = std::fs::read_to_string("/proc/self/status").context("/proc/self/status")?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).context("no VmHWM in /proc/self/status")?;
    let kib: f64 = line.trim().trim_end_matches("kB").trim().parse().context("VmHWM in /proc/self/status")?;
    Ok(kib / f64::from(1 << 20))
}
