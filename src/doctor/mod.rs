//! `hoof doctor`: checks this machine for live runs and prints the commands that fix problems.

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
/// Prints one line per check: OK, WARN (works with the named drawback) or FAIL, with the command that fixes it. Commands that change the system
/// need root. Settings of `sysctl -w` last until the next boot; add them to /etc/sysctl.d to keep them. See docs/multicast.md for the network.
///
/// Between machines: start `--between listen` on one and `--between send` on the other, then swap. The listener counts lost messages. A switch with
/// IGMP snooping and without a querier stops multicast after some minutes only: use `--seconds 300` to detect it.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof doctor\n         hoof doctor --json\n         \
    hoof doctor --between listen --lcm-url 'udpm://239.255.76.67:7667?ttl=1'\n         \
    hoof doctor --between send --lcm-url 'udpm://239.255.76.67:7667?ttl=1' --seconds 300")]
pub struct Args {
    /// LCM URL of the network [default: LCM_DEFAULT_URL, or udpm://239.255.76.67:7667?ttl=0]
    #[arg(long, value_name = "URL")]
    lcm_url: Option<String>,
    /// Directory of the logs; its disk is checked
    #[arg(long, value_name = "DIR", default_value = ".")]
    logs: PathBuf,
    /// Send to, or listen to, another machine and count lost messages
    #[arg(long, value_enum, value_name = "SIDE")]
    between: Option<between::Side>,
    /// Sending time, s; the listener waits as long for the first message
    #[arg(long, value_name = "S", default_value_t = 10.0, requires = "between")]
    seconds: f64,
    /// Messages of 400 bytes per second; every hundredth has 100,000 additional bytes
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
        say(check::table(&checks))?;
    }
    Ok(Outcome::failed_if(worst == Level::Fail))
}
