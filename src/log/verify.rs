//! `hoof log verify`: the account of a log.

use super::LogTypes;
use crate::progress::Progress;
use crate::{Outcome, say, say_json};
use replay::log::{ChannelReport, Gap, ReplayCheck, VerifyReport};
use std::path::PathBuf;

/// Gaps that are shown of a channel.
const SHOWN: usize = 5;

#[derive(clap::Args)]
#[command(after_help = "Example: hoof log verify run.mcap\n         hoof log verify run.mcap --json\n\n\
    Exit code 0: all is there, and if it is a run, it can be replayed from end to end; 1: messages are lost or cannot be decoded, \
    or the run cannot be replayed; 3: the file itself is damaged or cut.")]
pub struct Args {
    /// Log to read
    log: PathBuf,
    #[command(flatten)]
    types: LogTypes,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let types = args.types.read()?;
    let bar = Progress::new("verify");
    let certificate = replay::log::verify(&args.log, types, &mut |part| bar.set(part))?;
    drop(bar);
    if args.json {
        say_json(&certificate)?;
    } else {
        say(text(&certificate))?;
    }
    Ok(if certificate.good {
        Outcome::Good
    } else if certificate.cut.is_some() || !certificate.damaged.is_empty() {
        Outcome::DataLoss
    } else {
        Outcome::Failed
    })
}

fn text(c: &VerifyReport) -> String {
    let verdict = if c.good { "good" } else { "not good" };
    let mut text = format!("{verdict}: {:?}, {} events, {:.3} s", c.format, c.events, c.duration_s);
    for damaged in &c.damaged {
        text += &format!("\ndamaged at byte {}, {} bytes: {}", damaged.offset, damaged.bytes, damaged.why);
    }
    if let Some(cut) = &c.cut {
        text += &format!("\ncut at byte {}: {} bytes of a record", cut.offset, cut.bytes);
    }
    if c.times_backwards > 0 {
        text += &format!("\n{} times go backwards", c.times_backwards);
    }
    text += "\n";
    for channel in &c.channels {
        text += &channel_text(channel);
    }
    text + &replay_text(&c.replay)
}

fn channel_text(c: &ChannelReport) -> String {
    let expected = c.lost.map_or(0, |lost| c.count + lost);
    let mut text = match (c.lost, c.counter) {
        (Some(_), Some(counter)) => format!("\n{}: {} of {expected} by {counter}", c.name, c.count),
        _ => format!("\n{}: {}", c.name, c.count),
    };
    for gap in c.gaps.iter().take(SHOWN) {
        let Gap { first, last, t_ns } = gap;
        #[expect(clippy::cast_precision_loss, reason = "a time for a person to read")]
        let t_s = *t_ns as f64 * 1e-9;
        text += &format!("\n  {} lost before t = {t_s:.6} s: {first} to {last}", gap.missing());
    }
    if c.gaps.len() > SHOWN {
        text += &format!("\n  and {} more gaps", c.gaps.len() - SHOWN);
    }
    for (n, what) in [
        (c.duplicates, "came twice"),
        (c.late, "came late"),
        (c.restarts, "times the counter began anew"),
        (c.undecodable, "are not of their type"),
    ] {
        if n > 0 {
            text += &format!("\n  {n} {what}");
        }
    }
    text
}

fn replay_text(r: &ReplayCheck) -> String {
    let mut text = "\n\n".to_owned();
    if r.complete {
        let from = r.first_tick.unwrap_or(0);
        text += &format!("replay: {} ticks from tick {from} on, {} snapshots", r.ticks, r.snapshots);
    } else {
        text += "replay: not of the whole run";
    }
    for why in &r.why {
        text += &format!("\n  {why}");
    }
    text
}
