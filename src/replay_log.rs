//! `hoof replay`: the log's inputs through the log's controller, every bit compared.

use crate::progress::Progress;
use crate::robot::overrides;
use crate::{Outcome, say, say_json};
use replay::engine::{Divergence, Options, Replay, ReplayReport};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(
    after_help = "Example: hoof replay run.mcap\n         hoof replay run.mcap --from 12 --to 15 --json\n         \
    hoof replay run.mcap --set wbc.friction=0.6 --out what_if.mcap"
)]
pub struct Args {
    /// Log to replay
    log: PathBuf,
    /// Change a parameter: what would the controller have done on the same inputs? May be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Begin at the last snapshot at or before this time, s since the log's first tick
    #[arg(long, value_name = "S")]
    from: Option<f64>,
    /// End behind the last tick at or before this time
    #[arg(long, value_name = "S")]
    to: Option<f64>,
    /// Threads, 1 to 256; the result does not depend on it
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    /// Write a log with the replayed outputs in the place of the recorded ones
    #[arg(long, value_name = "LOG2")]
    out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    for (name, time) in [("--from", args.from), ("--to", args.to)] {
        if let Some(t) = time {
            anyhow::ensure!((0.0..1e9).contains(&t), "{name} {t}: expected a time in s from 0 to 1e9");
        }
    }
    if let (Some(from), Some(to)) = (args.from, args.to) {
        anyhow::ensure!(from <= to, "--from {from} is after --to {to}");
    }
    let options = Options {
        set: overrides(&args.set)?,
        from_s: args.from,
        to_s: args.to,
        jobs: args.jobs.into(),
        out: args.out.clone(),
    };
    let report = replay(&args.log, &options)?;
    if args.json {
        say_json(&report)?
    } else {
        say(text(&report))?
    }
    Ok(outcome(&report))
}

/// Replays with a progress bar.
pub fn replay(log: &Path, options: &Options) -> anyhow::Result<ReplayReport> {
    let replay = Replay::open(log)?;
    let bar = Progress::new("replay");
    Ok(replay.run(options, &mut |part| bar.set(part))?)
}

/// How a replay counts: differences before losses.
pub fn outcome(report: &ReplayReport) -> Outcome {
    if !report.identical {
        Outcome::Failed
    } else if report.damaged > 0 || report.cut || report.missing_input_ticks > 0 {
        Outcome::DataLoss
    } else {
        Outcome::Good
    }
}

/// The report in words.
pub fn text(report: &ReplayReport) -> String {
    let ReplayReport { ticks, messages_compared, real_time_factor, wall_seconds, .. } = report;
    let mut text = match &report.first_divergence {
        None if report.identical => format!("identical: {ticks} ticks"),
        None => format!("nothing to compare: {ticks} ticks, and the log holds none of their outputs"),
        Some(divergence) => divergence_text(divergence),
    };
    text += &format!(
        "\n{messages_compared} messages compared, {wall_seconds:.1} s ({real_time_factor:.1} times real time)"
    );
    let mut note = |n: u64, what: &str| {
        if n > 0 {
            text += &format!("\n{n} {what}");
        }
    };
    note(report.messages_different, "messages differ");
    note(report.unverifiable_ticks, "ticks have no output in the log");
    note(report.missing_input_ticks, "ticks have no input in the log");
    note(report.skipped_ticks, "ticks were not computed: the state before them is unknown");
    note(report.late_messages, "messages were too late or came twice");
    note(report.damaged, "stretches of the log are damaged");
    note(u64::from(report.cut), "cut: the log stops inside a record");
    text
}

/// Where record and replay part, in words.
pub fn divergence_text(d: &Divergence) -> String {
    let index = match &d.index {
        None => String::new(),
        Some(index) => {
            serde_json::to_string(index).map_or(String::new(), |i| format!("[{}]", i.trim_matches(['[', ']'])))
        }
    };
    let ulp = d.ulp.map_or(String::new(), |ulp| format!(", {ulp} ulp apart"));
    #[expect(clippy::cast_precision_loss, reason = "a time for a person to read")]
    let t_s = d.t_ns as f64 * 1e-9;
    format!(
        "differs from tick {} (t = {t_s:.3} s) on, first in stage {}: {} {}{index}{ulp}\n  recorded {}\n  replayed {}",
        d.tick, d.stage, d.channel, d.field, d.recorded, d.replayed
    )
}
