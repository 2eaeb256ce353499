//! Arguments and output that several log commands share.

use crate::{Outcome, say, say_json};
use replay::log::{CopyReport, EventFilter, Types};
use std::path::PathBuf;

/// Message types from `.lcm` files.
#[derive(clap::Args)]
pub struct LogTypes {
    /// File or folder with `.lcm` type definitions that the log itself does not contain; may be repeated
    #[arg(long, value_name = "DIR|FILE")]
    lcm_types: Vec<PathBuf>,
}

impl LogTypes {
    /// Reads the files.
    pub fn read(&self) -> anyhow::Result<Types> {
        Ok(Types::from_files(&self.lcm_types)?)
    }
}

/// Channels to select.
#[derive(clap::Args)]
pub struct Channels {
    /// Select only channels whose whole name matches this regular expression
    #[arg(long, value_name = "REGEX")]
    pub channels: Option<String>,
    /// Omit channels whose whole name matches this regular expression
    #[arg(long, value_name = "REGEX")]
    pub exclude: Option<String>,
}

/// Channels and time range to select.
#[derive(clap::Args)]
pub struct Part {
    #[command(flatten)]
    pub channels: Channels,
    /// Start time, s since the run's first tick, or since the first event of a log without a run
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub from: Option<f64>,
    /// End time, inclusive, s since the run's first tick, or since the first event of a log without a run
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub to: Option<f64>,
}

impl Part {
    pub fn filter(&self) -> anyhow::Result<EventFilter> {
        if let (Some(from), Some(to)) = (self.from, self.to) {
            anyhow::ensure!(from <= to, "--from {from} is later than --to {to}");
        }
        let Channels { channels, exclude } = &self.channels;
        Ok(EventFilter::new(channels.as_deref(), exclude.as_deref(), self.from, self.to)?)
    }
}

/// Parses a time such as `41.2` or `41.2s`.
pub fn seconds(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix('s').unwrap_or(text).trim();
    let parsed = number.parse().ok().filter(|s| (0.0..1e9).contains(s));
    parsed.ok_or_else(|| "expected a time in s from 0 to 1e9, such as 41.2 or 41.2s".to_owned())
}

/// `DataLoss` if something was lost.
pub fn loss(loss: bool) -> Outcome {
    if loss { Outcome::DataLoss } else { Outcome::Good }
}

/// Prints the result of a copy.
pub fn print_copy_report(copied: &CopyReport, json: bool) -> anyhow::Result<Outcome> {
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
    note(c.left_out, "events not selected");
    note(c.damaged, "damaged ranges");
    note(u64::from(c.cut), "cut: the log ends inside a record");
    note(c.bytes_skipped, "bytes skipped");
    note(c.refused, "events not written: negative time, or channel name longer than 63 bytes");
    note(c.times_rounded, "times rounded down to whole microseconds, the resolution of an LCM event log");
    text
}
