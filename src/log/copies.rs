//! `hoof log filter`, `trim`, `merge` and `recover`: copies of logs.

use super::{Channels, LogTypes, OneRun, Part, print_copy_report, seconds};
use crate::Outcome;
use crate::progress::Progress;
use replay::Error;
use replay::log::{CopyOptions, EventFilter, Excerpt, copy_excerpt};
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(
    after_help = "Example: hoof log filter run.mcap small.mcap --channels 'RUN_INFO|CONTROLLER_.*' --from 10 --to 12\n         \
    hoof log filter run.lcmlog quiet.lcmlog --exclude 'TIMING|GROUND_TRUTH'"
)]
pub struct FilterArgs {
    /// Log to read
    log: PathBuf,
    #[command(flatten)]
    one_run: OneRun,
    /// Log to write, .lcmlog or .mcap
    out: PathBuf,
    #[command(flatten)]
    part: Part,
    /// Copy only the selected channels. Without it, a selection with CONTROLLER_INPUT also keeps RUN_INFO, PARAMETER_CHANGE and CONTROLLER_SNAPSHOT, so
    /// that the copy replays; --exclude drops them
    #[arg(long)]
    only: bool,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn filter(args: &FilterArgs) -> anyhow::Result<Outcome> {
    let log = args.one_run.of(&args.log);
    args.part.channels.check(&[&log])?;
    let filter = args.part.filter()?;
    let filter = if args.only { filter } else { filter.keep_replay() };
    let options = CopyOptions { filter, types: args.types.read()?, ..CopyOptions::default() };
    let bar = Progress::new("filter");
    let copied = replay::log::copy(&log, &args.out, options, &mut |part| bar.set(part))?;
    drop(bar);
    print_copy_report(&copied, args.json)
}

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log trim run.mcap stumble.mcap --around 41.2s --before 2 --after 1\n         \
    hoof replay stumble.mcap\n         hoof log trim run.mcap part.mcap --from 10 --to 20\n\n\
    With --around, the copy starts at the last controller snapshot that is at least --before seconds earlier, so that it replays on its \
    own. RUN_INFO with parameters, URDF and types is always copied.")]
pub struct TrimArgs {
    /// Log to read
    log: PathBuf,
    #[command(flatten)]
    one_run: OneRun,
    /// Log to write, .lcmlog or .mcap
    out: PathBuf,
    #[command(flatten)]
    part: Part,
    /// Copy an excerpt around this time, s since the run's first tick
    #[arg(long, value_name = "S", value_parser = seconds, conflicts_with_all = ["from", "to"])]
    around: Option<f64>,
    /// Minimum time before --around, s
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "1", requires = "around")]
    before: f64,
    /// Time after --around, s
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "1", requires = "around")]
    after: f64,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn trim(args: &TrimArgs) -> anyhow::Result<Outcome> {
    let log = args.one_run.of(&args.log);
    let (filter, types) = (args.part.filter()?, args.types.read()?);
    args.part.channels.check(&[&log])?;
    let bar = Progress::new("trim");
    let mut progress = |part| bar.set(part);
    let excerpt = match args.around {
        Some(around_s) => Excerpt::Around { around_s, before_s: args.before, after_s: args.after },
        None => {
            anyhow::ensure!(
                args.part.from.is_some() || args.part.to.is_some() || args.one_run.run.is_some(),
                "no time range: expected --from, --to, --around or --run"
            );
            Excerpt::Range { from_s: args.part.from, to_s: args.part.to }
        }
    };
    let copied = match copy_excerpt(&log, &args.out, excerpt, filter.clone(), types, &mut progress) {
        // Without a run of this build's types, the times of the events decide.
        Err(Error::NoRunInfo { .. } | Error::NoInput { .. } | Error::OtherTypeVersion { .. })
            if args.around.is_none() =>
        {
            let options =
                CopyOptions { filter: filter.keep_replay(), types: args.types.read()?, ..CopyOptions::default() };
            replay::log::copy(&log, &args.out, options, &mut progress)?
        }
        copied => copied?,
    };
    drop(bar);
    print_copy_report(&copied, args.json)
}

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log merge robot.lcmlog operator.lcmlog --out both.mcap")]
pub struct MergeArgs {
    /// Logs to read; with --run, this run of each
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    #[command(flatten)]
    one_run: OneRun,
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
    let logs: Vec<PathBuf> = args.logs.iter().map(|log| args.one_run.of(log)).collect();
    let copied = replay::log::merge(&logs, &args.out, types, &mut |part| bar.set(part))?;
    drop(bar);
    print_copy_report(&copied, args.json)
}

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log recover damaged.mcap whole.mcap --json\n\n\
    Exit code 0: the log was undamaged; 3: the copy has every recoverable event.")]
pub struct RecoverArgs {
    /// Log to read
    log: PathBuf,
    #[command(flatten)]
    one_run: OneRun,
    /// Log to write, .lcmlog or .mcap
    out: PathBuf,
    /// Also copy the readable events of MCAP chunks with a wrong CRC; some of their bytes may be wrong
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
    let log = args.one_run.of(&args.log);
    let Channels { channels, exclude } = &args.channels;
    let filter = EventFilter::new(channels.as_deref(), exclude.as_deref(), None, None)?;
    args.channels.check(&[&log])?;
    let options = CopyOptions { filter, types: args.types.read()?, keep_unchecked: args.unchecked };
    let bar = Progress::new("recover");
    let copied = replay::log::copy(&log, &args.out, options, &mut |part| bar.set(part))?;
    drop(bar);
    print_copy_report(&copied, args.json)
}
