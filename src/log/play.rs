//! `hoof log play`: publishes the messages of a log over LCM at their recorded times.

use super::{Channels, OneRun, check_names};
use crate::{Outcome, note, say, say_json};
use anyhow::{Context, bail};
use crossterm::event::{Event as TerminalEvent, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use drivers::live::has_traffic;
use drivers::teleop;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::channels::{
    EXECUTOR_COMMAND, EXPECTED_ROBOT, OPERATOR_COMMAND, PARAMETER_REQUEST, ROBOT_COMMAND, ROBOT_INFO, ROBOT_STATE,
};
use replay::play::{Lateness, LatenessSummary, OrderKind, PlayOptions, Player, TimeBase, TimeOrder};
use replay::printable_path;
use replay::record::{Filter, Pattern};
use replay::udpm::Url;
use serde::Serialize;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Publish the messages of a log over LCM at their recorded times
///
/// Keys in a terminal: space pauses and resumes, s or . steps to the next event, left and right seek by 1 s, down and up by 10 s, + and - double and
/// halve the speed, q quits.
///
/// If a robot is live on the network, a log with channels that drive it (ROBOT_STATE, ROBOT_COMMAND, operator commands, requests) or that can stop it
/// (ROBOT_INFO, EXPECTED_ROBOT) is rejected unless --force is given, or --channels or --rename leave them out. Other channels are always played.
///
/// Messages are played in the order of their log time. If the clock of the recording jumped back, the log is played in the order of the file, and the
/// time after the jump continues the time before it.
///
/// At the end it prints how late messages were published (p50, p99, p99.9, maximum). Lateness is lowest on an idle processor.
#[derive(clap::Args)]
#[command(after_help = "Example: hoof log play run.mcap\n         \
    hoof log play run.mcap --time tick --speed 0.25 --from 3 --to 5 --loop\n         \
    hoof log play field.lcmlog --channels 'ROBOT_STATE|OPERATOR_.*' --rename ROBOT_STATE=OLD_STATE --flat-out --json")]
pub struct Args {
    /// LCM event log or MCAP; the format is detected from the content
    log: PathBuf,
    #[command(flatten)]
    one_run: OneRun,
    /// LCM network; default: LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0
    #[arg(long, value_name = "URL", default_value = "", hide_default_value = true)]
    lcm_url: String,
    /// Clock of the playback: receive time in the log, t_ns of the messages, or the controller's tick
    #[arg(long, value_enum, default_value = "receive")]
    time: Time,
    /// Playback speed relative to the recording
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    speed: f64,
    /// Publish as fast as possible; receivers may lose messages
    #[arg(long, conflicts_with = "speed")]
    flat_out: bool,
    /// Start time, s since the run's first tick [default: the log's first event]
    #[arg(long, value_name = "S")]
    from: Option<f64>,
    /// End time, s since the run's first tick [default: the log's last event]
    #[arg(long, value_name = "S")]
    to: Option<f64>,
    /// Restart at the end
    #[arg(long = "loop")]
    repeat: bool,
    /// Play only channels whose whole name matches this regular expression
    #[arg(long, value_name = "REGEX")]
    channels: Option<String>,
    /// Publish channel A as B; may be repeated
    #[arg(long, value_name = "A=B")]
    rename: Vec<String>,
    /// Also play channels that drive a robot that is live on the network
    #[arg(long)]
    force: bool,
    /// Print JSON at the end
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Time {
    /// Receive time in the log
    Receive,
    /// `t_ns` of each message
    Publish,
    /// Constant period per tick
    Tick,
}

/// Result; the JSON of `--json`.
#[derive(Serialize)]
struct Summary {
    log: PathBuf,
    events: u64,
    wall_seconds: f64,
    /// Lateness of events with a due time; empty with `--flat-out`.
    lateness: LatenessSummary,
    damaged: bool,
    /// Order of the log's times.
    order: OrderKind,
    /// Jumps back in time.
    jumps_back: u64,
}

/// Time before an event that is spent in a busy wait, since a sleeping thread wakes late.
const SPIN: Duration = Duration::from_micros(150);

/// Channels that a robot or its controller acts on.
const DRIVING: [&str; 8] = [
    ROBOT_STATE,
    ROBOT_COMMAND,
    OPERATOR_COMMAND,
    teleop::CHANNEL,
    EXECUTOR_COMMAND,
    PARAMETER_REQUEST,
    ROBOT_INFO,
    EXPECTED_ROBOT,
];

/// Time to detect a live robot: many of its periods.
const DETECTION_TIME: Duration = Duration::from_millis(30);

/// Longest sleep; bounds the reaction time to a signal.
const SLEEP: Duration = Duration::from_millis(50);

const SECOND: i64 = 1_000_000_000;

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let (log, options) = (args.one_run.of(&args.log), options(args)?);
    Channels { channels: args.channels.clone(), exclude: None }.check(&[&log])?;
    check_names("--rename", &log, options.rename.keys().cloned())?;
    let mut bus = LcmBus::open(&args.lcm_url)?;
    let order = TimeOrder::of(&log)?;
    if !args.force {
        reject_live_robot(&args.lcm_url, &options, &order)?;
    }
    if let Some(notice) = order.notice() {
        note(format!("{}: {notice}", printable_path(&log)));
    }
    let stopped = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stopped)).context("signal handler")?;
    }
    let began = Instant::now();
    let mut player = Player::open_with(&log, options, &order, 0)?;
    let mut lateness = Lateness::default();
    let mut screen = Screen::new()?;
    let now_ns = || i64::try_from(began.elapsed().as_nanos()).unwrap_or(i64::MAX);
    while !stopped.load(Ordering::Relaxed) && (player.is_paused() || !player.is_at_end()) {
        screen.show(&player, now_ns());
        let due_ns = player.due_ns();
        let wait = due_ns.map_or(SLEEP, |due| Duration::from_nanos(u64::try_from(due - now_ns()).unwrap_or(0)));
        if wait > SPIN {
            match screen.key_within((wait - SPIN).min(SLEEP)) {
                Some(Key::End) => break,
                Some(key) => press(&mut player, &mut bus, &key, now_ns())?,
                None => {}
            }
            continue;
        }
        let Some(due_ns) = due_ns else { continue };
        while now_ns() < due_ns {
            std::hint::spin_loop();
        }
        if player.speed().is_some() {
            lateness.add(Duration::from_nanos(u64::try_from(now_ns() - due_ns).unwrap_or(0)));
        }
        if let Some(event) = player.take(now_ns())? {
            bus.publish(&event.channel, &event.data)?;
        }
        // Check for keys also between events that follow each other directly.
        match screen.key_within(Duration::ZERO) {
            Some(Key::End) => break,
            Some(key) => press(&mut player, &mut bus, &key, now_ns())?,
            None => {}
        }
    }
    drop(screen);
    let damaged = !player.health().is_good();
    let summary = Summary {
        log,
        events: player.played(),
        wall_seconds: began.elapsed().as_secs_f64(),
        lateness: lateness.summary(),
        damaged,
        order: order.kind(),
        jumps_back: order.jumps_back,
    };
    if args.json {
        say_json(&summary)?
    } else {
        say(text(&summary))?
    }
    Ok(if damaged { Outcome::DataLoss } else { Outcome::Good })
}

fn options(args: &Args) -> anyhow::Result<PlayOptions> {
    anyhow::ensure!((0.001..=1000.0).contains(&args.speed), "--speed {}: expected 0.001 to 1000", args.speed);
    let mut rename = BTreeMap::new();
    for pair in &args.rename {
        let (from, to) = pair.split_once('=').with_context(|| format!("--rename {pair}: expected A=B"))?;
        anyhow::ensure!((1..=63).contains(&to.len()), "--rename {pair}: expected a channel name of 1 to 63 bytes");
        rename.insert(from.to_owned(), to.to_owned());
    }
    let from_ns = args.from.map(|from| nanoseconds("--from", from)).transpose()?;
    let to_ns = args.to.map(|to| nanoseconds("--to", to)).transpose()?;
    anyhow::ensure!(
        from_ns.zip(to_ns).is_none_or(|(from, to)| to > from),
        "--to {} is not later than --from {}",
        args.to.unwrap_or_default(),
        args.from.unwrap_or_default()
    );
    Ok(PlayOptions {
        base: match args.time {
            Time::Receive => TimeBase::Receive,
            Time::Publish => TimeBase::Publish,
            Time::Tick => TimeBase::Tick,
        },
        speed: (!args.flat_out).then_some(args.speed),
        from_ns,
        to_ns,
        repeat: args.repeat,
        filter: Filter { include: args.channels.as_deref().map(Pattern::new).transpose()?, exclude: None },
        rename,
    })
}

/// Fails if a robot is live on the network and channels of the log that are selected would drive it.
fn reject_live_robot(url: &str, options: &PlayOptions, order: &TimeOrder) -> anyhow::Result<()> {
    let PlayOptions { filter, rename, .. } = options;
    let takes = |name: &str| order.has_channel(name) && filter.takes(name);
    let is_played = |name: &&str| {
        let renamed = rename.iter().any(|(from, to)| to == name && takes(from));
        renamed || takes(name) && !rename.contains_key(*name)
    };
    let driving: Vec<&str> = DRIVING.into_iter().filter(is_played).collect();
    // Only UDP multicast networks have robots.
    let Ok(url) = Url::choose(Some(url).filter(|url| !url.is_empty())) else { return Ok(()) };
    for channel in [ROBOT_STATE, ROBOT_COMMAND] {
        if !driving.is_empty() && has_traffic(&url, channel, DETECTION_TIME)? {
            bail!(
                "{url}: a robot is live ({channel} is published) and playing {} would drive it: use another network (--lcm-url), \
                 omit these channels (--channels), or use --force",
                driving.join(", ")
            );
        }
    }
    Ok(())
}

fn nanoseconds(option: &str, s: f64) -> anyhow::Result<i64> {
    anyhow::ensure!((0.0..=1e9).contains(&s), "{option} {s}: expected 0 to 1000000000");
    #[expect(clippy::cast_possible_truncation, reason = "in range, as just checked")]
    Ok((s * 1e9).round() as i64)
}

fn press(player: &mut Player, bus: &mut dyn Bus, key: &Key, now_ns: i64) -> anyhow::Result<()> {
    match *key {
        Key::Pause if player.is_paused() => player.resume(now_ns),
        Key::Pause => player.pause(now_ns),
        Key::Step => {
            player.pause(now_ns);
            if let Some(event) = player.take(now_ns)? {
                bus.publish(&event.channel, &event.data)?;
            }
        }
        Key::Seek(ns) => player.seek(player.position_ns(now_ns) + ns, now_ns)?,
        Key::Faster(factor) => player.set_speed(player.speed().unwrap_or(1.0) * factor, now_ns),
        Key::End => {}
    }
    Ok(())
}

fn text(summary: &Summary) -> String {
    let Summary { log, events, wall_seconds, lateness: l, damaged, .. } = summary;
    let mut text = format!("{}: {events} messages in {wall_seconds:.2} s", printable_path(log));
    if l.events > 0 {
        text += &format!(
            "\nlateness: p50 {:.0} us, p99 {:.0} us, p99.9 {:.0} us, maximum {:.0} us",
            l.p50_us, l.p99_us, l.p999_us, l.max_us
        );
    }
    if *damaged {
        text += "\nthe log is damaged or cut; see hoof log info";
    }
    text
}

/// A key command.
enum Key {
    Pause,
    Step,
    Seek(i64),
    Faster(f64),
    End,
}

impl Key {
    fn of(key: &KeyEvent) -> Option<Self> {
        Some(match key.code {
            KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => Key::End,
            KeyCode::Char('q') | KeyCode::Esc => Key::End,
            KeyCode::Char(' ') => Key::Pause,
            KeyCode::Char('s' | '.') => Key::Step,
            KeyCode::Left => Key::Seek(-SECOND),
            KeyCode::Right => Key::Seek(SECOND),
            KeyCode::Down => Key::Seek(-10 * SECOND),
            KeyCode::Up => Key::Seek(10 * SECOND),
            KeyCode::Char('+') => Key::Faster(2.0),
            KeyCode::Char('-') => Key::Faster(0.5),
            _ => return None,
        })
    }
}

/// Keyboard and status line in a terminal; elsewhere only a sleep.
struct Screen {
    bar: Option<ProgressBar>,
    shown: Option<Instant>,
    keys: Option<Receiver<Key>>,
}

impl Screen {
    fn new() -> anyhow::Result<Self> {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
            bar.set_style(ProgressStyle::with_template("{msg}").expect("the template is a constant that parses"));
            bar
        });
        let mut screen = Screen { bar, shown: None, keys: None };
        if std::io::stdin().is_terminal() {
            crossterm::terminal::enable_raw_mode().context("terminal")?;
            let (pressed, keys) = channel();
            std::thread::spawn(move || {
                while let Ok(event) = crossterm::event::read() {
                    let TerminalEvent::Key(key) = event else { continue };
                    let key = Some(key).filter(|key| key.kind != KeyEventKind::Release).as_ref().and_then(Key::of);
                    if key.is_some_and(|key| pressed.send(key).is_err()) {
                        return;
                    }
                }
            });
            screen.keys = Some(keys);
        }
        Ok(screen)
    }

    /// The next key within `time`.
    fn key_within(&mut self, time: Duration) -> Option<Key> {
        let Some(keys) = &self.keys else {
            if !time.is_zero() {
                std::thread::sleep(time);
            }
            return None;
        };
        match keys.recv_timeout(time) {
            Ok(key) => Some(key),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => {
                self.keys = None;
                None
            }
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "seconds for display")]
    fn show(&mut self, player: &Player, now_ns: i64) {
        let Some(bar) = &self.bar else { return };
        if self.shown.is_some_and(|at| at.elapsed() < SLEEP) {
            return;
        }
        self.shown = Some(Instant::now());
        let pace = match (player.is_paused(), player.speed()) {
            (true, _) => "paused".to_owned(),
            (false, Some(speed)) => format!("{speed} times real time"),
            (false, None) => "flat out".to_owned(),
        };
        let at_s = player.position_ns(now_ns) as f64 * 1e-9;
        let keys = if self.keys.is_some() { "  space s arrows + - q" } else { "" };
        bar.set_message(format!("{at_s:.2} s  {} messages  {pace}{keys}", player.played()));
        bar.tick();
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        if self.keys.is_some() {
            // A closed terminal needs no reset.
            let _ = crossterm::terminal::disable_raw_mode();
        }
    }
}
