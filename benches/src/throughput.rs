//! Times complete replays: read, decode, step, compare every message. A call is one log, so a line has one sample.

use crate::sample::Line;
use anyhow::{Result, ensure};
use replay::engine::{Options, Replay};
use std::path::Path;

/// Replays a log and prints the mean wall time per tick, ns.
pub fn time(log: &Path, jobs: usize) -> Result<()> {
    let report = Replay::open(log)?.run(&Options { jobs, ..Options::default() }, &mut |_| ())?;
    ensure!(report.identical, "{}: the replay differs: {:?}", log.display(), report.first_divergence);
    let calls = usize::try_from(report.ticks)?;
    let per_tick_ns = report.wall_seconds * 1e9 / calls as f64;
    Line {
        case: "replay".to_owned(),
        calls,
        min_ns: per_tick_ns,
        median_ns: per_tick_ns,
        p99_ns: per_tick_ns,
        off: None,
        unsolved: 0,
        allocations: None,
        real_time_factor: Some(report.real_time_factor),
    }
    .print()
}
