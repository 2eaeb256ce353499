//! `hoof log info`: summarizes a log.

use super::{LogTypes, OneRun, loss};
use crate::{Outcome, say, say_json};
use analysis::table::{Column, Table};
use replay::log::{LogSummary, RunSummary};
use replay::printable;
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(
    after_help = "Example: hoof log info run.mcap\n         hoof log info other.lcmlog --lcm-types ~/other/lcmtypes --json"
)]
pub struct Args {
    /// LCM event log or MCAP; the format is detected from the content
    log: PathBuf,
    #[command(flatten)]
    one_run: OneRun,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let summary = LogSummary::read_with(args.one_run.of(&args.log), args.types.read()?)?;
    if args.json {
        say_json(&summary)?
    } else {
        say(text(&summary))?
    }
    Ok(loss(summary.damaged > 0 || summary.cut))
}

fn text(s: &LogSummary) -> String {
    let mut text =
        format!("{}, {} events, {:.3} s, {:.1} MB", s.format.name(), s.events, s.duration_s, megabytes(s.bytes));
    if let Some(first_t_ns) = s.first_t_ns {
        #[expect(clippy::cast_precision_loss, reason = "a time for display")]
        let first_s = first_t_ns.saturating_sub(s.zero_t_ns) as f64 * 1e-9;
        text += &format!("\ntimes: s since {}; the first event is at {first_s:.3} s", s.zero.text());
    }
    if s.damaged > 0 {
        text += &format!("\n{} damaged ranges, {} bytes skipped", s.damaged, s.bytes_skipped);
    }
    if s.cut {
        text += "\ncut: the file ends inside a record";
    }
    for run in s.runs.iter().filter(|_| s.runs.len() > 1) {
        let RunSummary { number, robot, scenario, ticks, first_tick, last_tick, .. } = run;
        let text_of = |text: &Option<String>| printable(text.as_deref().unwrap_or("unknown")).into_owned();
        let tick = |tick: &Option<i64>| tick.map_or("-".to_owned(), |tick| tick.to_string());
        text += &format!(
            "\nrun {number}: {}, scenario {}, {ticks} ticks, {} to {}; select it with --run {number}",
            text_of(robot),
            text_of(scenario),
            tick(first_tick),
            tick(last_tick)
        );
    }
    // The table escapes control characters in names.
    let mut table = Table::new([
        Column::left("channel"),
        Column::left("type"),
        Column::right("count"),
        Column::right("rate (Hz)"),
        Column::right("MB"),
        Column::right("lost"),
    ]);
    for c in &s.channels {
        table.row([
            c.name.clone(),
            c.type_name.clone().unwrap_or_else(|| "?".to_owned()),
            c.count.to_string(),
            format!("{:.1}", c.rate_hz),
            format!("{:.3}", megabytes(c.bytes)),
            c.lost.map_or("-".to_owned(), |n| n.to_string()),
        ]);
    }
    format!("{text}\n\n{table}")
}

#[expect(clippy::cast_precision_loss, reason = "a size for display")]
fn megabytes(bytes: u64) -> f64 {
    bytes as f64 * 1e-6
}
