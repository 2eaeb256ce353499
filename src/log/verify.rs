//! `hoof log verify`: checks a log for damage, losses and replayability.

use super::{LogTypes, OneRun};
use crate::progress::Progress;
use crate::{Outcome, say, say_json};
use replay::log::{ChannelReport, Gap, ReplayCheck, VerifyReport};
use replay::printable;
use std::path::PathBuf;

/// Gaps printed per channel.
const MAX_GAPS: usize = 5;

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log verify run.mcap\n         hoof log verify run.mcap --json\n\n\
    Exit code 0: complete, and a run in it can be replayed from its first to its last tick; 1: messages are lost, were \
        reported as lost by the recorder, or cannot be decoded, \
        or the run cannot be replayed completely; 3: the file is damaged or cut.")]
pub struct Args {
    /// Log to read
    log: PathBuf,
    #[command(flatten)]
    one_run: OneRun,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let types = args.types.read()?;
    let bar = Progress::new("verify");
    let report = replay::log::verify(&args.one_run.of(&args.log), types, &mut |part| bar.set(part))?;
    drop(bar);
    if args.json {
        say_json(&report)?;
    } else {
        say(text(&report))?;
    }
    Ok(if report.good {
        Outcome::Good
    } else if report.cut.is_some() || !report.damaged.is_empty() {
        Outcome::DataLoss
    } else {
        Outcome::Failed
    })
}

fn text(c: &VerifyReport) -> String {
    let verdict = if c.good { "good" } else { "not good" };
    let mut text = format!("{verdict}: {}, {} events, {:.3} s", c.format.name(), c.events, c.duration_s);
    for damaged in &c.damaged {
        text += &format!("\ndamaged at byte {}, {} bytes: {}", damaged.offset, damaged.bytes, printable(&damaged.why));
    }
    if let Some(cut) = &c.cut {
        text += &format!("\ncut at byte {}: {} bytes of a record", cut.offset, cut.bytes);
    }
    for loss in &c.reported_losses {
        #[expect(clippy::cast_precision_loss, reason = "a time for display")]
        let t_s = loss.t_ns.saturating_sub(c.zero_t_ns) as f64 * 1e-9;
        text += &format!("\nreported by the recorder at {t_s:.3} s: {}", printable(&loss.text));
    }
    if c.times_backwards > 0 {
        text += &format!("\n{} timestamps out of order", c.times_backwards);
    }
    text += "\n";
    for channel in &c.channels {
        text += &channel_text(channel, c.zero_t_ns);
    }
    text + &replay_text(&c.replay)
}

fn channel_text(c: &ChannelReport, zero_t_ns: i64) -> String {
    let expected = c.lost.map_or(0, |lost| c.count + lost);
    let mut text = match (c.lost, c.counter) {
        (Some(_), Some(counter)) => format!("\n{}: {} of {expected} by {counter}", printable(&c.name), c.count),
        _ => format!("\n{}: {}", printable(&c.name), c.count),
    };
    for gap in c.gaps.iter().take(MAX_GAPS) {
        let Gap { first, last, t_ns } = gap;
        #[expect(clippy::cast_precision_loss, reason = "a time for display")]
        let t_s = t_ns.saturating_sub(zero_t_ns) as f64 * 1e-9;
        text += &format!("\n  {} lost before t = {t_s:.6} s: {first} to {last}", gap.missing());
    }
    if c.gaps.len() > MAX_GAPS {
        text += &format!("\n  {} more gaps", c.gaps.len() - MAX_GAPS);
    }
    for (n, what) in [
        (c.duplicates, "duplicates"),
        (c.late, "out of order"),
        (c.restarts, "restarts of the sequence"),
        (c.undecodable, "not decodable as their type"),
    ] {
        if n > 0 {
            text += &format!("\n  {n} {what}");
        }
    }
    if let Some(first) = &c.first_deviation {
        text += &format!("\n  {} decoded with deviations from the format; the first: {first}", c.deviating);
    }
    text
}

fn replay_text(r: &ReplayCheck) -> String {
    let mut text = "\n\n".to_owned();
    if r.complete {
        let from = r.first_tick.unwrap_or(0);
        text += &format!("replay: complete: {} ticks from tick {from}, {} snapshots", r.ticks, r.snapshots);
    } else {
        text += "replay: not possible for the whole run";
    }
    for why in &r.why {
        text += &format!("\n  {}", printable(why));
    }
    text
}
