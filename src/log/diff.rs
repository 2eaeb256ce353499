//! `hoof log diff`: compares two logs channel by channel.

use super::{LogTypes, OneRun, Part};
use crate::progress::Progress;
use crate::{Outcome, say, say_json};
use replay::log::{ChannelDiff, LogDiff};
use replay::printable;
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log diff before.mcap after.mcap --exclude TIMING\n         \
    hoof log diff two_runs.mcap#1 two_runs.mcap#2 --exclude TIMING\n\n\
    TIMING contains wall-clock times and differs between any two runs. Exit code 0: identical; 1: different; 3: a log is damaged or \
        cut, and its readable part is identical.")]
pub struct Args {
    /// First log
    left: PathBuf,
    /// Second log
    right: PathBuf,
    #[command(flatten)]
    one_run: OneRun,
    #[command(flatten)]
    part: Part,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let (filter, types) = (args.part.filter()?, args.types.read()?);
    let (left, right) = (args.one_run.of(&args.left), args.one_run.of(&args.right));
    args.part.channels.check(&[&left, &right])?;
    let bar = Progress::new("diff");
    let diff = replay::log::diff(&left, &right, &filter, types, &mut |part| bar.set(part))?;
    drop(bar);
    if args.json {
        say_json(&diff)?;
    } else {
        say(text(&diff))?;
    }
    let differs = diff.channels.iter().any(|channel| !channel.identical);
    Ok(match (differs, diff.damaged) {
        (true, _) => Outcome::Failed,
        (false, 0) => Outcome::Good,
        (false, _) => Outcome::DataLoss,
    })
}

fn text(d: &LogDiff) -> String {
    let (same, other): (Vec<_>, Vec<_>) = d.channels.iter().partition(|channel| channel.identical);
    let verdict = if other.is_empty() { "identical" } else { "different" };
    let mut text = format!("{verdict}: {} and {} events", d.left_events, d.right_events);
    if d.damaged > 0 {
        text += &format!("\n{} damaged or cut ranges", d.damaged);
    }
    for channel in other {
        text += &channel_text(channel);
    }
    if !same.is_empty() {
        let names: Vec<_> = same.iter().map(|channel| printable(&channel.name)).collect();
        text += &format!("\n\nidentical: {}", names.join(", "));
    }
    text
}

fn channel_text(c: &ChannelDiff) -> String {
    let mut text = format!("\n\n{}: {} and {} messages", printable(&c.name), c.left, c.right);
    for (n, what) in [
        (c.different, "differ"),
        (c.times_different, "differ only in log time"),
        (c.left_only, "only in the first log"),
        (c.right_only, "only in the second log"),
        (c.reordered, "in another order"),
    ] {
        if n > 0 {
            text += &format!("; {n} {what}");
        }
    }
    if let Some(first) = &c.first {
        let ulp = first.ulp.map_or(String::new(), |ulp| format!(" ({ulp} ulp)"));
        let field = if first.field.is_empty() { "whole message".into() } else { printable(&first.field) };
        text += &format!(
            "\n  first at t = {:.6} s, number {}: {field}{ulp}\n    {}\n    {}",
            first.t_s,
            first.number,
            printable(&first.left),
            printable(&first.right)
        );
    }
    text
}
