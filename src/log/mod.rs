//! `hoof log`: record, play, inspect, copy, convert and compare logs.

mod arguments;
mod cat;
mod convert;
mod copies;
mod diff;
mod info;
mod play;
mod record;
mod verify;

use crate::Outcome;
use arguments::{Channels, Part, check_names, loss, print_copy_report};
pub use arguments::{LogTypes, OneRun, seconds};
use clap::Subcommand;
pub use record::default_name as record_name;

#[derive(Subcommand)]
pub enum Command {
    Record(record::Args),
    Play(play::Args),
    /// Show channels, types, counts and rates, and report damage and losses
    Info(info::Args),
    /// Print messages with every field decoded, as text or JSON lines; can follow a log that is being written
    Cat(cat::Args),
    /// Convert to .lcmlog, .mcap, CSV, Parquet, MATLAB, or an MCAP with ROS 2 messages for Foxglove, PlotJuggler and rerun
    Convert(convert::Args),
    /// Copy selected channels or a time range
    Filter(copies::FilterArgs),
    /// Copy a time range, or a short excerpt that replays on its own
    Trim(copies::TrimArgs),
    /// Merge several logs into one, sorted by time
    Merge(copies::MergeArgs),
    /// Copy every recoverable event of a damaged log
    Recover(copies::RecoverArgs),
    /// Check a log: damage, lost messages with their position, and whether its run can be replayed
    Verify(verify::Args),
    /// Compare two logs channel by channel, down to the first differing field
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
