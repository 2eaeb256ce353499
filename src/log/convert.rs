//! `hoof log convert`: a log in another format.

use super::{Channels, LogTypes, loss, print_copy_report};
use crate::progress::Progress;
use crate::{Outcome, say, say_json};
use analysis::export::{Exported, Table, export};
use clap::ValueEnum;
use replay::log::ros2::{self, BaseSource};
use replay::log::{CopyOptions, EventFilter};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log convert run.lcmlog run.mcap\n         \
    hoof log convert run.mcap --to csv --out run_csv --channels 'ROBOT_STATE|EVENT'\n         \
    hoof log convert run.mcap --to parquet\n         hoof log convert run.mcap ticks.parquet --to ticks\n         hoof log convert run.mcap run.mat\n         \
    hoof log convert run.mcap --to mcap --encoding ros2\n\n\
    .lcmlog and .mcap (encoding lcm) hold the same: events, bytes, times and numbers survive both ways; only an .lcmlog has whole \
    microseconds. CSV and Parquet make one file a channel in a folder, one row a message, one column a field; Parquet \
    carries their units as JSON under the metadata key `units`, and `ticks` makes one Parquet file of the controller's channels side by side, one row \
    a tick. MATLAB (Level 5): one \
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
    /// One Parquet file, one row a tick
    Ticks,
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
            To::Ticks => "ticks",
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
    let Channels { channels, exclude } = &args.channels;
    let filter = EventFilter::new(channels.as_deref(), exclude.as_deref(), None, None)?;
    let types = args.types.read()?;
    let bar = Progress::new("convert");
    let mut progress = |part| bar.set(part);
    let table = match to {
        To::Csv => Table::Csv,
        To::Parquet => Table::Parquet,
        To::Ticks => Table::Ticks,
        To::Mat => Table::Mat,
        To::Mcap if args.encoding == Encoding::Ros2 => {
            let exported = ros2::to_ros2(&args.log, &out, filter, types, &mut progress)?;
            drop(bar);
            return say_ros2(&exported, args.json);
        }
        To::Lcmlog | To::Mcap => {
            let options = CopyOptions { filter, types, ..CopyOptions::default() };
            let copied = replay::log::copy(&args.log, &out, options, &mut progress)?;
            drop(bar);
            return print_copy_report(&copied, args.json);
        }
    };
    let mut progress = |p: analysis::Progress| bar.set(p.done as f64 / p.total.max(1) as f64);
    let wanted = |channel: &str| filter.matches(channel);
    let exported = export(&args.log, &out, table, types, wanted, &mut progress)?;
    drop(bar);
    say_tables(&exported, args.json)
}

fn say_tables(exported: &Exported, json: bool) -> anyhow::Result<Outcome> {
    if json {
        say_json(exported)?;
    } else {
        let files: Vec<_> = exported.files.iter().map(|file| file.display().to_string()).collect();
        let mut text = format!("{} messages in\n  {}", exported.messages, files.join("\n  "));
        text += &losses(exported.unreadable, exported.damaged, exported.cut);
        say(text)?;
    }
    Ok(loss(!exported.is_lossless()))
}

fn say_ros2(exported: &ros2::Exported, json: bool) -> anyhow::Result<Outcome> {
    if json {
        say_json(exported)?;
    } else {
        let mut text = format!("{} messages in {}", exported.messages, exported.out.display());
        text += match exported.base {
            None => "\nno robot: the log has no RUN_INFO with a URDF",
            Some(BaseSource::GroundTruth) => "\n/tf has the base from the simulator's truth",
            Some(BaseSource::Estimate) => {
                "\n/tf has the base's orientation and height as estimated; it does not travel"
            }
            Some(BaseSource::Imu) => "\n/tf has the base's orientation by the IMU; it does not travel",
        };
        text += &losses(exported.unreadable, exported.damaged, exported.cut);
        say(text)?;
    }
    Ok(loss(!exported.is_lossless()))
}

fn losses(unreadable: u64, damaged: u64, cut: bool) -> String {
    let mut text = String::new();
    for (n, what) in [
        (unreadable, "messages of no known type (see --lcm-types), or malformed, left out"),
        (damaged, "stretches of the log are damaged"),
        (u64::from(cut), "cut: the log stops inside a record"),
    ] {
        if n > 0 {
            text += &format!("\n{n} {what}");
        }
    }
    text
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
        (To::Ticks, _) => format!("{stem}_ticks.parquet"),
        (To::Mcap, Encoding::Ros2) => format!("{stem}_ros2.mcap"),
        _ => format!("{stem}.{}", to.name()),
    };
    Ok((to, out.cloned().unwrap_or_else(|| args.log.with_file_name(name))))
}
