//! `hoof log convert`: writes a log in another format.

use super::{Channels, LogTypes, OneRun, loss, print_copy_report};
use crate::progress::Progress;
use crate::{Outcome, say, say_json};
use analysis::export::{ExportFormat, Exported, export};
use clap::ValueEnum;
use replay::Error;
use replay::log::ros2::{self, BaseSource};
use replay::log::{CopyOptions, EventFilter, FieldChange, FieldDifference, RetypeReport};
use replay::{printable, printable_path};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log convert run.lcmlog run.mcap\n         \
    hoof log convert run.mcap --to csv --out run_csv --channels 'ROBOT_STATE|EVENT'\n         \
    hoof log convert run.mcap --to parquet\n         hoof log convert run.mcap ticks.parquet --to ticks\n         hoof log convert run.mcap run.mat\n         \
    hoof log convert run.mcap --to mcap --encoding ros2\n         hoof log convert old.mcap new.mcap --to-types lcmtypes\n\n\
    .lcmlog and .mcap (encoding lcm) hold the same events, bytes, times and numbers, and convert into each other without loss; an \
        .lcmlog has a time resolution of 1 us. CSV and Parquet: a folder with one file per channel, one row per message, one column per \
        field; a Parquet file has the units as JSON under the metadata key `units`. Ticks: one Parquet file with the controller's channels \
        side by side, one row per tick. MATLAB (Level 5): one struct per channel, one matrix per field. Encoding ros2: CDR messages with \
        ros2msg schemas, and the topics /robot_description, /tf, /joint_states, /imu and /contact/FOOT, with which Foxglove, PlotJuggler \
        and rerun draw the robot. To-types: a field that is new has its default (0, false, empty); each difference is listed, and exit code 3 says that \
        values of removed or changed fields are lost.")]
pub struct Args {
    /// Log to read
    log: PathBuf,
    #[command(flatten)]
    one_run: OneRun,
    /// Output file, for csv and parquet a folder; default: the log's name with another extension
    #[arg(long = "out", value_name = "OUT")]
    out_option: Option<PathBuf>,
    /// Same as --out
    #[arg(conflicts_with = "out_option", value_name = "OUT")]
    out: Option<PathBuf>,
    /// Output format; default: from the extension of OUT
    #[arg(long)]
    to: Option<To>,
    /// Message encoding of an MCAP
    #[arg(long, default_value = "lcm")]
    encoding: Encoding,
    /// Rewrite messages with the types in this folder or file, matching fields by name; OUT is .lcmlog or .mcap
    #[arg(long, value_name = "DIR|FILE")]
    to_types: Option<PathBuf>,
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
    /// One Parquet file, one row per tick
    Ticks,
    Mat,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Encoding {
    /// LCM messages as recorded, with the `.lcm` text as schema; lossless
    Lcm,
    /// ROS 2 messages (CDR), for viewers
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
    let log = args.one_run.of(&args.log);
    let Channels { channels, exclude } = &args.channels;
    let filter = EventFilter::new(channels.as_deref(), exclude.as_deref(), None, None)?;
    args.to_types.iter().chain([&log]).try_for_each(|input| Error::check_distinct_files(input, &out))?;
    args.types.check_output(&out)?;
    let has_ending = |named| named == to || named == To::Parquet && to == To::Ticks;
    anyhow::ensure!(
        To::of_name(&out).is_none_or(has_ending),
        "--to {}: {} has the extension of another format",
        to.name(),
        out.display()
    );
    args.channels.check(&[&log])?;
    let types = args.types.read()?;
    if let Some(new) = &args.to_types {
        anyhow::ensure!(
            matches!(to, To::Lcmlog | To::Mcap) && args.encoding == Encoding::Lcm,
            "--to-types writes .lcmlog or .mcap with encoding lcm"
        );
        let bar = Progress::new("convert");
        let new = std::slice::from_ref(new);
        let report = replay::log::retype(&log, &out, new, &filter, types, &mut |part| bar.set(part))?;
        drop(bar);
        return say_retyped(&report, args.json);
    }
    let bar = Progress::new("convert");
    let mut progress = |part| bar.set(part);
    let table = match to {
        To::Csv => ExportFormat::Csv,
        To::Parquet => ExportFormat::Parquet,
        To::Ticks => ExportFormat::Ticks,
        To::Mat => ExportFormat::Mat,
        To::Mcap if args.encoding == Encoding::Ros2 => {
            let exported = ros2::to_ros2(&log, &out, filter, types, &mut progress)?;
            drop(bar);
            return say_ros2(&exported, args.json);
        }
        To::Lcmlog | To::Mcap => {
            let options = CopyOptions { filter, types, ..CopyOptions::default() };
            let copied = replay::log::copy(&log, &out, options, &mut progress)?;
            drop(bar);
            return print_copy_report(&copied, args.json);
        }
    };
    let mut progress = |p: analysis::Progress| bar.set(p.done as f64 / p.total.max(1) as f64);
    let wanted = |channel: &str| filter.matches(channel);
    let exported = export(&log, &out, table, types, wanted, &mut progress)?;
    drop(bar);
    say_tables(&exported, args.json)
}

fn say_tables(exported: &Exported, json: bool) -> anyhow::Result<Outcome> {
    if json {
        say_json(exported)?;
    } else {
        let files: Vec<_> = exported.files.iter().map(|file| printable_path(file)).collect();
        let mut text = match &files[..] {
            [] => "no file written".to_owned(),
            files => format!("{} messages in\n  {}", exported.messages, files.join("\n  ")),
        };
        text += &losses(exported.unreadable, exported.damaged, exported.cut);
        for (n, what) in [
            (exported.rounded, "integers rounded: a double holds integers up to 2^53"),
            (exported.deviating, "messages deviate from the format and were decoded as LCM decodes them"),
        ] {
            if n > 0 {
                text += &format!("\n{n} {what}");
            }
        }
        say(text)?;
    }
    Ok(loss(!exported.is_lossless()))
}

fn say_retyped(report: &RetypeReport, json: bool) -> anyhow::Result<Outcome> {
    if json {
        say_json(report)?;
        return Ok(loss(!report.is_lossless()));
    }
    let copied = print_copy_report(&report.copy, false)?;
    let mut text =
        format!("{} messages rewritten, {} of other types copied as they are", report.converted, report.unchanged);
    for FieldDifference { field, change, messages } in &report.differences {
        let what = match change {
            FieldChange::Added => "added with its default (0, false, empty)",
            FieldChange::Converted => "converted to another type or length",
            FieldChange::Removed => "removed, its values are lost",
            FieldChange::Truncated => "does not fit its new type, values are lost",
        };
        text += &format!("\n{}: {what}, in {messages} messages", printable(field));
    }
    say(text)?;
    Ok(if report.is_lossless() { copied } else { Outcome::DataLoss })
}

fn say_ros2(exported: &ros2::Exported, json: bool) -> anyhow::Result<Outcome> {
    if json {
        say_json(exported)?;
    } else {
        let mut text = format!("{} messages in {}", exported.messages, exported.out.display());
        text += match exported.base {
            None => "\nno robot topics: the log has no RUN_INFO with a URDF",
            Some(BaseSource::GroundTruth) => "\nbase pose in /tf: ground truth of the simulator",
            Some(BaseSource::Estimate) => {
                "\nbase pose in /tf: estimated orientation and height; the horizontal position stays at 0"
            }
            Some(BaseSource::Imu) => "\nbase pose in /tf: orientation of the IMU; the position stays at 0",
        };
        text += &losses(exported.unreadable, exported.damaged, exported.cut);
        say(text)?;
    }
    Ok(loss(!exported.is_lossless()))
}

fn losses(unreadable: u64, damaged: u64, cut: bool) -> String {
    let mut text = String::new();
    for (n, what) in [
        (unreadable, "messages omitted: malformed, not LCM messages, or of unknown type (see --lcm-types)"),
        (damaged, "damaged ranges in the log"),
        (u64::from(cut), "cut: the log ends inside a record"),
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
            "{}: no output format: expected --to FORMAT, or an output name that ends with .lcmlog, .mcap or .mat",
            out.unwrap_or(&args.log).display()
        );
    };
    anyhow::ensure!(to == To::Mcap || args.encoding == Encoding::Lcm, "--encoding ros2 requires --to mcap");
    let stem = args.log.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = match (to, args.encoding) {
        (To::Csv | To::Parquet, _) => format!("{stem}_{}", to.name()),
        (To::Ticks, _) => format!("{stem}_ticks.parquet"),
        (To::Mcap, Encoding::Ros2) => format!("{stem}_ros2.mcap"),
        _ => format!("{stem}.{}", to.name()),
    };
    Ok((to, out.cloned().unwrap_or_else(|| args.log.with_file_name(name))))
}
