//! `hoof log convert`: a log in another format.

use super::{Channels, LogTypes, say_copied};
use crate::progress::Progress;
use crate::{Outcome, say, say_json};
use clap::ValueEnum;
use replay::log::{CopyOptions, Selection};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log convert run.lcmlog run.mcap\n         \
    hoof log convert run.mcap --to csv --out run_csv --channels 'ROBOT_STATE|EVENT'\n         \
    hoof log convert run.mcap --to parquet\n         hoof log convert run.mcap run.mat\n         \
    hoof log convert run.mcap --to mcap --encoding ros2\n\n\
    .lcmlog and .mcap (encoding lcm) hold the same: events, bytes, times and numbers survive both ways; only an .lcmlog has whole \
    microseconds. CSV and Parquet make one file a channel in a folder, one row a message, one column a field. MATLAB (Level 5): one \
    struct a channel, one matrix a field. Encoding ros2: CDR messages with ros2msg schemas, and beside them /robot_description, /tf, \
    /joint_states, /imu and /contact/FOOT, so that Foxglove, PlotJuggler and rerun show the robot.")]
pub struct Args {
    /// Log to read
    log: PathBuf,
    /// What to write: a file, for csv and parquet a folder; without it, the name of the log with another ending
    #[arg(long = "out", value_name = "OUT")]
    out_option: Option<PathBuf>,
    /// The same, without --out
    #[arg(conflicts_with = "out_option", value_name = "OUT")]
    out: Option<PathBuf>,
    /// Format to write; without it, what the name of OUT ends with
    #[arg(long)]
    to: Option<To>,
    /// How messages are encoded in an MCAP
    #[arg(long, default_value = "lcm")]
    encoding: Encoding,
    #[command(flatten)]
    channels: Channels,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum To {
    Lcmlog,
    Mcap,
    Csv,
    Parquet,
    Mat,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Encoding {
    /// The LCM bytes, with the `.lcm` text as schema: loses nothing
    Lcm,
    /// ROS 2's, for viewers
    Ros2,
}

impl To {
    fn name(self) -> &'static str {
        match self {
            To::Lcmlog => "lcmlog",
            To::Mcap => "mcap",
            To::Csv => "csv",
            To::Parquet => "parquet",
            To::Mat => "mat",
        }
    }

    fn of_name(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?;
        Self::value_variants().iter().copied().find(|to| to.name() == ending)
    }
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let (to, out) = target(args)?;
    let selection = || {
        let Channels { channels, exclude } = &args.channels;
        Selection::new(channels.as_deref(), exclude.as_deref(), None, None)
    };
    let (selection, types) = (selection()?, args.types.read()?);
    let bar = Progress::new("convert");
    let mut progress = |part| bar.set(part);
    if matches!(to, To::Lcmlog | To::Mcap) {
        let options = CopyOptions { selection, types, ..CopyOptions::default() };
        let copied = replay::log::copy(&args.log, &out, options, &mut progress)?;
        drop(bar);
        return say_copied(&copied, args.json);
    }
    anyhow::bail!("not yet")
}

fn target(args: &Args) -> anyhow::Result<(To, PathBuf)> {
    let out = args.out.as_ref().or(args.out_option.as_ref());
    let Some(to) = args.to.or_else(|| out.and_then(|out| To::of_name(out))) else {
        anyhow::bail!(
            "{}: to what? expected --to FORMAT, or a name that ends with .lcmlog, .mcap or .mat",
            out.unwrap_or(&args.log).display()
        );
    };
    anyhow::ensure!(to == To::Mcap || args.encoding == Encoding::Lcm, "--encoding ros2 is of an MCAP: add --to mcap");
    let stem = args.log.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = match (to, args.encoding) {
        (To::Csv | To::Parquet, _) => format!("{stem}_{}", to.name()),
        (To::Mcap, Encoding::Ros2) => format!("{stem}_ros2.mcap"),
        _ => format!("{stem}.{}", to.name()),
    };
    Ok((to, out.cloned().unwrap_or_else(|| args.log.with_file_name(name))))
}
