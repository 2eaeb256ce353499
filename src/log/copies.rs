//! `hoof log filter`, `trim`, `merge`, `recover`: copies of logs.

use super::{Channels, LogTypes, Part, print_copy_report, seconds};
use crate::Outcome;
use crate::progress::Progress;
use replay::log::{CopyOptions, EventFilter, ExcerptWindow};
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(
    after_help = "Example: hoof log filter run.mcap small.mcap --channels 'RUN_INFO|CONTROLLER_.*' --from 10 --to 12\n         \
    hoof log filter run.lcmlog quiet.lcmlog --exclude 'TIMING|GROUND_TRUTH'"
)]
pub struct FilterArgs {
    /// Log to read
    log: PathBuf,
    /// Log to write, .lcmlog or .mcap
    out: PathBuf,
    #[command(flatten)]
    part: Part,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn filter(args: &FilterArgs) -> anyhow::Result<Outcome> {
    let options = CopyOptions { filter: args.part.filter()?, types: args.types.read()?, ..CopyOptions::default() };
    let bar = Progress::new("filter");
    let copied = replay::log::copy(&args.log, &args.out, options, &mut |part| bar.set(part))?;
    drop(bar);
    print_copy_report(&copied, args.json)
}

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log trim run.mcap stumble.mcap --around 41.2s --before 2 --after 1\n         \
    hoof replay stumble.mcap\n         hoof log trim run.mcap part.mcap --from 10 --to 20\n\n\
    ExcerptWindow a moment the copy begins at the last snapshot of the controller that leaves --before seconds, so that it replays from \
    there; RUN_INFO with parameters, URDF and types is always in it.")]
pub struct TrimArgs {
    /// Log to read
    log: PathBuf,
    /// Log to write, .lcmlog or .mcap
    out: PathBuf,
    #[command(flatten)]
    part: Part,
    /// A bundle around this time, s since the log's first tick, as for `hoof replay --from`
    #[arg(long, value_name = "S", value_parser = seconds, conflicts_with_all = ["from", "to"])]
    around: Option<f64>,
    /// At least so much before it, s
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "1", requires = "around")]
    before: f64,
    /// So much behind it, s
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "1", requires = "around")]
    after: f64,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn trim(args: &TrimArgs) -> anyhow::Result<Outcome> {
    let (filter, types) = (args.part.filter()?, args.types.read()?);
    let bar = Progress::new("trim");
    let mut progress = |part| bar.set(part);
    let copied = match args.around {
        Some(around_s) => {
            let window = ExcerptWindow { around_s, before_s: args.before, after_s: args.after };
            replay::log::copy_excerpt(&args.log, &args.out, window, filter, types, &mut progress)?
        }
        None => {
            anyhow::ensure!(
                args.part.from.is_some() || args.part.to.is_some(),
                "nothing to trim: expected --from, --to or --around"
            );
            let options = CopyOptions { filter: filter.keep_run_info(), types, ..CopyOptions::default() };
            replay::log::copy(&args.log, &args.out, options, &mut progress)?
        }
    };
    drop(bar);
    print_copy_report(&copied, args.json)
}

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log merge robot.lcmlog operator.lcmlog --out both.mcap")]
pub struct MergeArgs {
    /// Logs to read
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Log to write, .lcmlog or .mcap
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn merge(args: &MergeArgs) -> anyhow::Result<Outcome> {
    let types = args.types.read()?;
    let bar = Progress::new("merge");
    let copied = replay::log::merge(&args.logs, &args.out, types, &mut |part| bar.set(part))?;
    drop(bar);
    print_copy_report(&copied, args.json)
}

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log recover damaged.mcap whole.mcap --json\n\n\
    Exit code 0: nothing was damaged; 3: what could be had is in the copy.")]
pub struct RecoverArgs {
    /// Log to read
    log: PathBuf,
    /// Log to write, .lcmlog or .mcap
    out: PathBuf,
    /// Also events of damaged MCAP chunks, as far as they can be had: some of their bytes may not be what was written
    #[arg(long)]
    unchecked: bool,
    #[command(flatten)]
    channels: Channels,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn recover(args: &RecoverArgs) -> anyhow::Result<Outcome> {
    let Channels { channels, exclude } = &args.channels;
    let filter = EventFilter::new(channels.as_deref(), exclude.as_deref(), None, None)?;
    let options = CopyOptions { filter, types: args.types.read()?, keep_unchecked: args.unchecked };
    let bar = Progress::new("recover");
    let copied = replay::log::copy(&args.log, &args.out, options, &mut |part| bar.set(part))?;
    drop(bar);
    print_copy_report(&copied, args.json)
}
