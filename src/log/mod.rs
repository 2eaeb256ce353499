//! `hoof log`: make logs, look at them, cut them, repair them, take them elsewhere.

mod cat;
mod convert;
mod copies;
mod diff;
mod info;
mod play;
mod record;
mod verify;

use crate::{Outcome, say, say_json};
use clap::Subcommand;
pub use record::default_name as record_name;
use replay::log::{CopyReport, EventFilter, Types};
use std::path::PathBuf;

#[derive(Subcommand)]
pub enum Command {
    Record(record::Args),
    Play(play::Args),
    /// Channels, types, counts, rates, and whether anything is damaged or lost
    Info(info::Args),
    /// Print messages with every field decoded, as text or JSON lines; follow a log that is being written
    Cat(cat::Args),
    /// Another format: .lcmlog, .mcap, CSV, Parquet, MATLAB, or an MCAP in ROS 2's encoding for Foxglove, PlotJuggler and rerun
    Convert(convert::Args),
    /// Copy only some channels, or a stretch of time
    Filter(copies::FilterArgs),
    /// Copy a stretch of time, or a small bundle around a moment that replays by itself
    Trim(copies::TrimArgs),
    /// Several logs as one, by time
    Merge(copies::MergeArgs),
    /// Copy every event that can be had of a damaged log
    Recover(copies::RecoverArgs),
    /// The account of a log: what is there, what is lost and where, whether its run can be replayed
    Verify(verify::Args),
    /// Compare two logs channel by channel, down to the first field that differs
    Diff(diff::Args),
}

pub fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Record(args) => record::run(args),
        Command::Play(args) => play::run(args),
        Command::Info(args) => info::run(args),
        Command::Cat(args) => cat::run(args),
        Command::Convert(args) => convert::run(args),
        Command::Filter(args) => copies::filter(args),
        Command::Trim(args) => copies::trim(args),
        Command::Merge(args) => copies::merge(args),
        Command::Recover(args) => copies::recover(args),
        Command::Verify(args) => verify::run(args),
        Command::Diff(args) => diff::run(args),
    }
}

/// Types of other projects.
#[derive(clap::Args)]
pub struct LogTypes {
    /// `.lcm` file, or folder with `.lcm` files, of types that the log does not know itself. May be repeated
    #[arg(long, value_name = "DIR|FILE")]
    lcm_types: Vec<PathBuf>,
}

impl LogTypes {
    /// Reads them.
    pub fn read(&self) -> anyhow::Result<Types> {
        Ok(Types::from_files(&self.lcm_types)?)
    }
}

/// Channels of a log.
#[derive(clap::Args)]
struct Channels {
    /// Only channels whose whole name matches this regular expression
    #[arg(long, value_name = "REGEX")]
    channels: Option<String>,
    /// No channels whose whole name matches this regular expression
    #[arg(long, value_name = "REGEX")]
    exclude: Option<String>,
}

/// Part of a log.
#[derive(clap::Args)]
struct Part {
    #[command(flatten)]
    channels: Channels,
    /// From this time on, s since the log's first event
    #[arg(long, value_name = "S", value_parser = seconds)]
    from: Option<f64>,
    /// Up to this time, s since the log's first event
    #[arg(long, value_name = "S", value_parser = seconds)]
    to: Option<f64>,
}

impl Part {
    fn filter(&self) -> anyhow::Result<EventFilter> {
        if let (Some(from), Some(to)) = (self.from, self.to) {
            anyhow::ensure!(from <= to, "--from {from} is after --to {to}");
        }
        let Channels { channels, exclude } = &self.channels;
        Ok(EventFilter::new(channels.as_deref(), exclude.as_deref(), self.from, self.to)?)
    }
}

/// A time such as `41.2` or `41.2s`.
pub fn seconds(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix('s').unwrap_or(text).trim();
    let parsed = number.parse().ok().filter(|s| (0.0..1e9).contains(s));
    parsed.ok_or_else(|| "expected a time in s from 0 to 1e9, such as 41.2 or 41.2s".to_owned())
}

fn loss(loss: bool) -> Outcome {
    if loss { Outcome::DataLoss } else { Outcome::Good }
}

/// Says what was copied.
fn print_copy_report(copied: &CopyReport, json: bool) -> anyhow::Result<Outcome> {
    if json {
        say_json(copied)?;
    } else {
        say(copy_report_text(copied))?;
    }
    Ok(loss(!copied.is_lossless()))
}

fn copy_report_text(c: &CopyReport) -> String {
    let mut text = format!("{} events in {}", c.events, c.out.display());
    let mut note = |n: u64, what: &str| {
        if n > 0 {
            text += &format!("\n{n} {what}");
        }
    };
    note(c.left_out, "events left out");
    note(c.damaged, "stretches are damaged");
    note(u64::from(c.cut), "cut: the log stops inside a record");
    note(c.bytes_skipped, "bytes skipped");
    note(c.refused, "events with a negative time or an overlong channel name could not be written");
    note(c.times_rounded, "times rounded down to whole microseconds, as an LCM event log has them");
    text
}
