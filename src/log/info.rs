//! `hoof log info`: a log at a glance.

use super::{LogTypes, loss};
use crate::{Outcome, say, say_json};
use replay::log::LogSummary;
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(
    after_help = "Example: hoof log info run.mcap\n         hoof log info other.lcmlog --lcm-types ~/other/lcmtypes --json"
)]
pub struct Args {
    /// Log, LCM event log or MCAP; told apart by content
    log: PathBuf,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let summary = LogSummary::read_with(&args.log, args.types.read()?)?;
    if args.json {
        say_json(&summary)?
    } else {
        say(text(&summary))?
    }
    Ok(loss(summary.damaged > 0 || summary.cut))
}

fn text(s: &LogSummary) -> String {
    let mut text = format!("{:?}, {} events, {:.3} s, {:.1} MB", s.format, s.events, s.duration_s, megabytes(s.bytes));
    if s.damaged > 0 {
        text += &format!("\ndamaged in {} places, {} bytes skipped", s.damaged, s.bytes_skipped);
    }
    if s.cut {
        text += "\ncut: the file stops inside a record";
    }
    text +=
        &format!("\n\n{:<21} {:<31} {:>8} {:>10} {:>9} {:>6}", "channel", "type", "count", "rate (Hz)", "MB", "lost");
    for c in &s.channels {
        let lost = c.lost.map_or("-".to_owned(), |n| n.to_string());
        text += &format!(
            "\n{:<21} {:<31} {:>8} {:>10.1} {:>9.3} {lost:>6}",
            c.name,
            c.type_name.as_deref().unwrap_or("?"),
            c.count,
            c.rate_hz,
            megabytes(c.bytes)
        );
    }
    text
}

#[expect(clippy::cast_precision_loss, reason = "a size for a person to read")]
fn megabytes(bytes: u64) -> f64 {
    bytes as f64 * 1e-6
}
