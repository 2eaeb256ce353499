//! `hoof spy`: channels, rates, losses and senders of an LCM network, or of a log.

mod curve;
mod help;
mod once;
mod plot;
mod processes;
mod recording;
mod screen_data;
mod session;
mod source;
mod state;
mod table;
#[cfg(test)]
mod tests;
mod tree;
mod view;

use crate::live::toml_error;
use crate::log::{LogTypes, OneRun, seconds};
use crate::{Outcome, note, say};
use anyhow::Context;
use once::Report;
use replay::log::Health;
use replay::traffic::{Alarm, Alarms, Live};
use replay::udpm::Url;
use serde::Deserialize;
use signal_hook::consts::{SIGINT, SIGTERM};
use source::{LogPlayback, Source};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest sleep between two checks for a signal.
const POLL: Duration = Duration::from_millis(20);

/// Watch an LCM network or a log in the terminal: channels, rates, jitter, losses, senders, every field
///
/// It uses its own socket, only listens and never sends. Rates and jitter are computed from the kernel's receive times over the last two seconds
/// (for a slow channel, over its last 16 intervals); with --once, over the whole time. Jitter is half the range of the middle 68.27 % of the
/// intervals: an outlier-robust standard deviation.
///
/// The number of messages lost per sender is exact: it comes from LCM's sequence numbers. The number lost per channel is known if its messages have
/// a counter (seq, tick) or its senders lost nothing; otherwise ≤N is the number that its senders lost on all channels.
///
/// Known types: those of this build, of --lcm-types, of a received RUN_INFO, and of the log.
///
/// Exit code with --once: 1 if an alarm is raised or no message was received, 3 if the kernel dropped datagrams or the log is damaged.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof spy\n         \
    hoof spy --log run.mcap\n         \
    hoof spy --once --json --seconds 5 --alarm 'ROBOT_STATE rate<900' --alarm '.* lost>0'\n         \
    hoof spy --lcm-types ~/other/types --lcm-url 'udpm://239.255.76.67:7667?ttl=1'\n\n\
    Alarms: CHANNEL_REGEX QUANTITY<NUMBER or >NUMBER, with rate (Hz), jitter, jitter_rms, gap (us), age (s), lost, late, count, senders,\n\
    bandwidth (B/s). A channel without messages has rate 0; conditions that match no channel are reported. In a TOML file: alarms = [\"ROBOT_STATE rate<900\", \"ROBOT_STATE gap>20000\"]\n\n\
    JSON: format, events, duration_s, lost, damaged as in `hoof log info`; bytes and heard, for datagrams; channels with name, type, fingerprint, count,\n\
    rate_hz, bytes, lost (null: unknown, at most lost_at_most), late, jitter_us, jitter_rms_us, gap_us, age_s, bytes_per_s, senders; senders; alarms;\n\
    unmatched: conditions that match no channel")]
pub struct Args {
    /// LCM URL of the network [default: LCM_DEFAULT_URL, or udpm://239.255.76.67:7667?ttl=0]
    #[arg(long, value_name = "URL", conflicts_with = "log")]
    lcm_url: Option<String>,
    /// Show this log instead of a network (LCM event log or MCAP)
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    #[command(flatten)]
    one_run: OneRun,
    #[command(flatten)]
    types: LogTypes,
    /// Alarm condition, such as 'ROBOT_STATE rate<900'; may be repeated
    #[arg(long, value_name = "CONDITION")]
    alarm: Vec<String>,
    /// Read alarm conditions from the list `alarms` of a TOML file
    #[arg(long, value_name = "FILE")]
    alarms: Option<PathBuf>,
    /// Plot a field from the start, such as `ROBOT_STATE q[2]`; may be repeated
    #[arg(long, value_name = "CHANNEL FIELD", conflicts_with = "once")]
    plot: Vec<String>,
    /// Listen for --seconds, or read the whole log, print the table and exit
    #[arg(long)]
    once: bool,
    /// Listening time of --once, s; Ctrl-C ends it earlier
    #[arg(long, value_name = "S", value_parser = seconds, default_value = "2", requires = "once", conflicts_with = "log")]
    seconds: f64,
    /// Print JSON; needs --once
    #[arg(long, requires = "once")]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let alarms = alarms(args)?;
    let log = args.log.as_ref().map(|log| args.one_run.of(log));
    anyhow::ensure!(log.is_some() || args.one_run.run.is_none(), "--run selects a run of a log: give --log");
    match &log {
        Some(log) if args.once => once_log(args, log, alarms),
        None if args.once => once_live(args, alarms),
        Some(log) => watch(Source::Log(Box::new(LogPlayback::open(log, args.types.read()?)?)), args, alarms),
        None => {
            let live = Live::start(&Url::choose(args.lcm_url.as_deref())?, args.types.read()?)?;
            watch(Source::Live(live), args, alarms)
        }
    }
}

fn watch(mut source: Source, args: &Args, alarms: Alarms) -> anyhow::Result<Outcome> {
    for field in &args.plot {
        let followed =
            field.split_once(' ').is_some_and(|(channel, path)| source.with(|t| t.follow(channel, path.trim())));
        anyhow::ensure!(followed, "--plot {field:?}: expected a channel and a field, such as 'ROBOT_STATE q[2]'");
    }
    let stopped = stop_signals()?;
    if let Some(left) = session::interact(source, alarms, &stopped)? {
        say(left)?;
    }
    Ok(Outcome::Good)
}

/// Alarm conditions from the command line and from the file.
fn alarms(args: &Args) -> anyhow::Result<Alarms> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct File {
        alarms: Vec<String>,
    }
    let mut texts = args.alarm.clone();
    if let Some(path) = &args.alarms {
        let text = replay::read_text(path).with_context(|| path.display().to_string())?;
        let file: File = toml::from_str(&text).map_err(|error| toml_error(path, &text, &error))?;
        texts.extend(file.alarms);
    }
    Ok(Alarms::new(texts.iter().map(|text| Alarm::new(text)).collect::<Result<_, _>>()?))
}

fn once_live(args: &Args, mut alarms: Alarms) -> anyhow::Result<Outcome> {
    let stopped = stop_signals()?;
    let url = Url::choose(args.lcm_url.as_deref())?;
    let mut live = Live::start(&url, args.types.read()?)?;
    if let Some(warning) = live.warning() {
        note(format!("warning: {warning}"));
    }
    note(format!("listening on {url}"));
    let end = Instant::now() + Duration::from_secs_f64(args.seconds);
    while Instant::now() < end && !stopped.load(Ordering::Relaxed) && !live.has_failed() {
        std::thread::sleep(POLL);
    }
    let now_ns = live.now_ns();
    live.end()?;
    let mut traffic = live.traffic();
    traffic.settle_all();
    let summary = traffic.summary(now_ns);
    let report = Report::new(url.to_string(), "udpm".to_owned(), &Health::default(), summary, &mut alarms);
    let outcome = report.say(args.json)?;
    if report.is_empty() {
        note(source::nothing_received(&url));
    }
    Ok(outcome)
}

fn once_log(args: &Args, log: &Path, mut alarms: Alarms) -> anyhow::Result<Outcome> {
    let read = source::read_log(log, args.types.read()?)?;
    let format = serde_json::to_value(read.format)?.as_str().unwrap_or_default().to_owned();
    let (name, now_ns) = (log.display().to_string(), read.last_ns);
    let report = Report::new(name, format, &read.health, read.traffic.summary(now_ns), &mut alarms);
    report.say(args.json)
}

/// A flag that SIGINT and SIGTERM set.
fn stop_signals() -> anyhow::Result<Arc<AtomicBool>> {
    let stopped = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stopped)).context("signal handler")?;
    }
    Ok(stopped)
}
