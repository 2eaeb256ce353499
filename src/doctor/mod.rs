//! `hoof doctor`: whether this machine is fit for live runs, and what mends it.

mod between;
mod check;
mod files;
mod machine;
mod network;

use crate::{Outcome, say, say_json};
use check::{Check, Level};
use files::System;
use replay::udpm::Url;
use serde::Serialize;
use std::path::PathBuf;

/// Check this machine for live runs: network, real-time settings, libraries
///
/// A line each: OK, WARN (it works, with the drawback named) or FAIL, with the command that mends it. Commands need root where they change
/// the system. What `sysctl -w` sets lasts until the next start: lines in /etc/sysctl.d keep it. docs/multicast.md explains the network.
///
/// Between machines: start `--between listen` on one and `--between send` on the other, then the other way round. It counts what was lost. Switches
/// with IGMP snooping and nobody who asks for members cut multicast off after some minutes only: `--seconds 300` outlasts that.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof doctor\n         hoof doctor --json\n         \
    hoof doctor --between listen --lcm-url 'udpm://239.255.76.67:7667?ttl=1'\n         \
    hoof doctor --between send --lcm-url 'udpm://239.255.76.67:7667?ttl=1' --seconds 300")]
pub struct Args {
    /// Network, else that of LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0
    #[arg(long, value_name = "URL")]
    lcm_url: Option<String>,
    /// Folder of the logs, whose disk is looked at
    #[arg(long, value_name = "DIR", default_value = ".")]
    logs: PathBuf,
    /// Send to, or listen to, another machine, and count what is lost
    #[arg(long, value_enum, value_name = "SIDE")]
    between: Option<between::Side>,
    /// How long to send; a listener waits as long for the first message
    #[arg(long, value_name = "S", default_value_t = 10.0, requires = "between")]
    seconds: f64,
    /// Messages a second of 400 bytes; one in a hundred has 100,000 bytes more
    #[arg(long, value_name = "HZ", default_value_t = 1000.0, requires = "between")]
    rate: f64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// The JSON of `--json`.
#[derive(Serialize)]
struct Report<'a> {
    url: String,
    worst: Level,
    checks: &'a [Check],
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let url = Url::choose(args.lcm_url.as_deref())?;
    if let Some(side) = args.between {
        return between::run(side, &url, args.seconds, args.rate, args.json);
    }
    let system = System::here();
    let mut checks = network::checks(&system, &url);
    checks.extend(machine::checks(&system, &args.logs));
    let worst = checks.iter().map(|check| check.level).max().unwrap_or(Level::Ok);
    if args.json {
        say_json(&Report { url: url.to_string(), worst, checks: &checks })?;
    } else {
        for check in &checks {
            say(check.text())?;
        }
    }
    Ok(Outcome::failed_if(worst == Level::Fail))
}
