//! `hoof log record`: records an LCM network into a log.

use crate::live::{Stop, wait_for_controller};
use crate::{Outcome, note, say, say_json};
use analysis::table::{Column, Table};
use anyhow::Context;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use replay::record::{
    Filter, Pattern, Progress, RecordLevel, RecordOptions, RecordSummary, Recorder, Rotation, SenderCounts,
};
use replay::udpm::Url;
use replay::{printable, printable_path};
use signal_hook::consts::SIGXFSZ;
use std::cell::OnceCell;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Time without ROBOT_COMMAND after which a run whose parent has died is over: longer than the driver waits, whose last EVENT is recorded.
const QUIET: Duration = Duration::from_secs(1);

/// Record all messages of an LCM network
///
/// The recorder only receives. Lost messages are found from LCM's sequence numbers; they are shown, and written into the log on channel EVENT with
/// sender and number. Log times are the kernel's receive times. LCM_SELF_TEST is not recorded.
///
/// If disk or processor are too slow, debug channels are dropped first, then controller outputs. Inputs that a replay needs (RUN_INFO,
/// CONTROLLER_INPUT, EVENT) and the channels of --vital are kept. The log reports what was dropped. On a full disk, the recorder waits for space.
///
/// No log is overwritten: an existing file of the same name is renamed, run.mcap to run.1.mcap or the next free number. A log that another process is
/// recording into is rejected.
///
/// Ctrl-C or SIGTERM completes the log. Exit code 3 if messages were lost or dropped, or the disk stayed full.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof log record run.mcap\n         \
    hoof log record --exclude 'CAMERA.*' --rotate-mb 500 --keep 20 field.lcmlog\n         \
    hoof log record --lcm-url 'udpm://239.255.76.67:7667?ttl=1&recv_buf_size=8000000' --seconds 60 --json run.mcap")]
pub struct Args {
    /// Log to write, .lcmlog or .mcap; default: log_DATE_TIME.mcap (UTC)
    out: Option<PathBuf>,
    /// LCM network; default: LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0
    #[arg(long, value_name = "URL")]
    lcm_url: Option<String>,
    /// Record only channels whose whole name matches this regular expression
    #[arg(long, value_name = "REGEX")]
    include: Option<String>,
    /// Do not record channels whose whole name matches this regular expression
    #[arg(long, value_name = "REGEX")]
    exclude: Option<String>,
    /// Never drop channels whose whole name matches this regular expression
    #[arg(long, value_name = "REGEX")]
    vital: Option<String>,
    /// Stop after this time, s
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Start a new file after this size: run_0000.mcap, run_0001.mcap, ...
    #[arg(long, value_name = "MB")]
    rotate_mb: Option<f64>,
    /// Start a new file after this time, s
    #[arg(long, value_name = "S")]
    rotate_s: Option<f64>,
    /// Keep only the newest N files when rotating
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    keep: Option<u32>,
    /// Free disk space reserved for replay inputs; below twice as much, debug channels are dropped
    #[arg(long, value_name = "MB", default_value_t = 500.0)]
    reserve_mb: f64,
    /// Memory buffer between network and disk
    #[arg(long, value_name = "MB", default_value_t = 64.0)]
    buffer_mb: f64,
    /// Print JSON at the end
    #[arg(long)]
    json: bool,
    /// Process that started the recorder; the recorder stops when it ends
    #[arg(long, hide = true)]
    parent: Option<i32>,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let options = options(args)?;
    let end = args.seconds.map(|s| seconds("--seconds", s)).transpose()?.map(|length| Instant::now() + length);
    // Before the first byte is written, so that a signal cannot leave an incomplete log.
    let stop = Stop::new(args.parent)?;
    // A file size limit is handled as a full disk, not as a fatal signal.
    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false))).context("signal handler")?;

    let url = options.url.clone();
    let recorder = Recorder::start(options)?;
    if let Some(warning) = recorder.warning() {
        note(format!("warning: {warning}"));
    }
    if let Some(moved) = recorder.moved() {
        note(format!("existing log renamed to {}", printable_path(moved)));
    }
    let mut line = StatusLine::new();
    note(format!("recording {url}"));
    let waiting = OnceCell::new();
    let stop = || {
        // After the death of `hoof run`, the end of the robot's motion is recorded too; on another thread, since this one must not block.
        if stop.is_orphaned() {
            let url = url.clone();
            return waiting.get_or_init(|| std::thread::spawn(move || wait_for_controller(&url, QUIET))).is_finished();
        }
        stop.is_due() || end.is_some_and(|end| Instant::now() >= end)
    };
    let recorded = recorder.run(&stop, &mut |progress| line.show(progress))?;
    drop(line);
    if args.json {
        say_json(&recorded)?
    } else {
        say(text(&recorded))?
    }
    Ok(if recorded.is_lossy() { Outcome::DataLoss } else { Outcome::Good })
}

fn options(args: &Args) -> anyhow::Result<RecordOptions> {
    let pattern = |text: &Option<String>| text.as_deref().map(Pattern::new).transpose();
    let rotation = Rotation {
        bytes: args.rotate_mb.map(rotation_bytes).transpose()?,
        time_ns: match args.rotate_s {
            Some(s) => Some(i64::try_from(seconds("--rotate-s", s)?.as_nanos()).context("--rotate-s")?),
            None => None,
        },
        keep: args.keep.map(|keep| keep as usize),
    };
    Ok(RecordOptions {
        url: Url::choose(args.lcm_url.as_deref())?,
        out: args.out.clone().unwrap_or_else(default_name),
        filter: Filter { include: pattern(&args.include)?, exclude: pattern(&args.exclude)? },
        vital: pattern(&args.vital)?,
        rotation,
        reserve: bytes("--reserve-mb", args.reserve_mb)?,
        buffer: usize::try_from(bytes("--buffer-mb", args.buffer_mb.max(1.0))?)?,
    })
}

fn bytes(option: &str, megabytes: f64) -> anyhow::Result<u64> {
    anyhow::ensure!((0.0..=1e7).contains(&megabytes), "{option} {megabytes}: expected 0 to 10000000");
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in range, as just checked")]
    Ok((megabytes * 1e6) as u64)
}

fn rotation_bytes(megabytes: f64) -> anyhow::Result<u64> {
    anyhow::ensure!((0.001..=1e7).contains(&megabytes), "--rotate-mb {megabytes}: expected 0.001 to 10000000");
    bytes("--rotate-mb", megabytes)
}

fn seconds(option: &str, s: f64) -> anyhow::Result<Duration> {
    anyhow::ensure!((0.001..=1e7).contains(&s), "{option} {s}: expected 0.001 to 10000000");
    Ok(Duration::from_secs_f64(s))
}

/// Default name from the time in UTC, such as `log_20261122_080500.mcap`.
pub fn default_name() -> PathBuf {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    let (days, second) = (since / 86_400, since % 86_400);
    let (year, month, day) = civil(days);
    let (h, m, s) = (second / 3600, second / 60 % 60, second % 60);
    format!("log_{year:04}{month:02}{day:02}_{h:02}{m:02}{s:02}.mcap").into()
}

/// Year, month and day of a number of days since 1970-01-01. Source: H. Hinnant, *chrono-compatible low-level date algorithms*.
fn civil(days: u64) -> (u64, u64, u64) {
    let days = days + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    // Years start in March here, so that the leap day is the last day.
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    (era * 400 + year_of_era + u64::from(month <= 2), month, day)
}

/// Status line on standard error, if it is a terminal; otherwise a line when messages are lost.
struct StatusLine {
    bar: Option<ProgressBar>,
    began: Instant,
    last: (Instant, u64, u64),
    rates: (f64, f64),
    /// Lost and dropped messages that a line has reported, and when.
    losses: (u64, Option<Instant>),
}

/// Shortest time between two reports of losses.
const LOSS_INTERVAL: Duration = Duration::from_secs(1);
/// Averaging time of the rates.
const RATE: Duration = Duration::from_millis(500);

impl StatusLine {
    fn new() -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            bar.set_style(ProgressStyle::with_template("{msg}").expect("the template is a constant that parses"));
            bar
        });
        let now = Instant::now();
        StatusLine { bar, began: now, last: (now, 0, 0), rates: (0.0, 0.0), losses: (0, None) }
    }

    #[expect(clippy::cast_precision_loss, reason = "numbers for display")]
    fn show(&mut self, progress: &Progress) {
        let Some(bar) = &self.bar else { return self.report_losses(progress) };
        let Progress { status, file_bytes, free_bytes, trouble, file } = progress;
        let (at, received, bytes) = self.last;
        let span = at.elapsed();
        if span >= RATE {
            let per_second = |n: u64| n as f64 / span.as_secs_f64();
            self.rates = (per_second(status.counts.received - received), per_second(status.counts.bytes - bytes));
            self.last = (Instant::now(), status.counts.received, status.counts.bytes);
        }
        let [lost, duplicates, late] = status.lost_duplicate_late;
        let mut text = format!(
            "{:.1} s  {:.0} msg/s  {:.2} MB/s  {:.1} MB in {}  senders {}  lost {lost}  duplicates {duplicates}  out of order {late}",
            self.began.elapsed().as_secs_f64(),
            self.rates.0,
            self.rates.1 * 1e-6,
            *file_bytes as f64 * 1e-6,
            file.display(),
            status.senders,
        );
        if let Some(free) = free_bytes {
            text += &format!("  free {:.1} GB", *free as f64 * 1e-9);
        }
        if status.left_out > 0 {
            text += &format!("  dropped {}", status.left_out);
        }
        if status.level != RecordLevel::All {
            text += &format!("  {}", status.level.text());
        }
        if let Some(trouble) = trouble {
            text += &format!("  waiting for the disk, {:.0} % of the memory used: {trouble}", status.fill * 100.0);
        }
        bar.set_message(text);
        bar.tick();
    }

    /// Reports losses when they happen, at most once per [`LOSS_INTERVAL`]. `hoof run` shows the line.
    fn report_losses(&mut self, progress: &Progress) {
        let Progress { status, trouble, .. } = progress;
        let ([lost, ..], kernel, dropped) = (status.lost_duplicate_late, status.counts.kernel_dropped, status.left_out);
        let (reported, at) = self.losses;
        let sum = lost + kernel + dropped;
        if sum == reported || at.is_some_and(|at| at.elapsed() < LOSS_INTERVAL) {
            return;
        }
        self.losses = (sum, Some(Instant::now()));
        let cause = trouble.as_ref().map_or(String::new(), |trouble| format!(": {trouble}"));
        note(format!(
            "warning: {} messages are not in the log so far: {lost} lost on the network, of these {kernel} datagrams because the receive buffer was \
             full; {dropped} dropped because disk or processor are too slow{cause}",
            lost + dropped
        ));
    }
}

impl Drop for StatusLine {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "a size for display")]
fn text(recorded: &RecordSummary) -> String {
    let RecordSummary { files, file_bytes, intake } = recorded;
    let files: Vec<_> = files.iter().map(|file| file.display().to_string()).collect();
    let events = intake.events.map_or_else(String::new, |events| format!("{events} events, "));
    let mut text = format!("{}: {events}{:.1} MB", files.join(", "), *file_bytes as f64 * 1e-6);
    if let Some(failure) = &intake.failure {
        text += &format!("\nthe log ends early: {failure}");
    }
    if !intake.senders.is_empty() {
        let counts = ["received", "lost", "duplicates", "out of order"].map(Column::right);
        let mut table = Table::new([Column::left("sender")].into_iter().chain(counts));
        for SenderCounts { sender, received, lost, duplicates, reordered, .. } in &intake.senders {
            table.row([
                sender.to_string(),
                received.to_string(),
                lost.to_string(),
                duplicates.to_string(),
                reordered.to_string(),
            ]);
        }
        text += &format!("\n{table}");
    }
    if intake.counts.kernel_dropped > 0 {
        text +=
            &format!("\nthe kernel dropped {} datagrams: its receive buffer was full", intake.counts.kernel_dropped);
    }
    if intake.counts.malformed > 0 {
        text += &format!("\n{} malformed datagrams", intake.counts.malformed);
    }
    if !intake.left_out.is_empty() {
        let dropped: Vec<_> =
            intake.left_out.iter().map(|(name, count)| format!("{} {count}", printable(name))).collect();
        text += &format!("\ndropped by channel: {}", dropped.join(", "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::civil;

    #[test]
    fn days_since_1970_as_dates() {
        // Expected: `date -u -d @$((DAYS * 86400)) +%F`.
        assert_eq!(
            [0, 59, 11_016, 19_782, 20_779].map(civil),
            [(1970, 1, 1), (1970, 3, 1), (2000, 2, 29), (2024, 2, 29), (2026, 11, 22)]
        );
    }
}
