//! `hoof log`: make logs and look at them.

mod play;
mod record;

use crate::{Outcome, say, say_json};
use clap::Subcommand;
use replay::log::LogSummary;
use std::path::PathBuf;

#[derive(Subcommand)]
pub enum Command {
    Record(record::Args),
    Play(play::Args),
    /// Channels, types, counts, rates, and whether anything is damaged or lost
    #[command(after_help = "Example: hoof log info run.mcap")]
    Info {
        /// Log, LCM event log or MCAP; told apart by content
        log: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Record(args) => record::run(args),
        Command::Play(args) => play::run(args),
        Command::Info { log, json } => info(log, *json),
    }
}

fn info(log: &std::path::Path, json: bool) -> anyhow::Result<Outcome> {
    let summary = LogSummary::read(log)?;
    if json {
        say_json(&summary)?
    } else {
        say(text(&summary))?
    }
    let loss = summary.damaged > 0 || summary.cut;
    Ok(if loss { Outcome::DataLoss } else { Outcome::Good })
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
