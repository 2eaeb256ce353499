//! `hoof teleop`: a person at the keyboard, with a gamepad, or a script, as an operator on the bus.

mod gamepad;
mod keyboard;
mod keys;
mod lines;
mod link;
mod view;

use crate::robot::{RobotFiles, read};
use crate::{Outcome, say};
use anyhow::Context;
use controller::params::Params;
use drivers::teleop::{CHANNEL, Desk, HEARTBEAT_NS, Limits};
use gamepad::Gamepad;
use lcmtypes::{Event, OperatorCommand};
use link::{Link, now_ns};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Times that the last command is said: one datagram may be lost.
const LAST_WORDS: u32 = 10;

/// Command the robot by keyboard, gamepad or lines of text
///
/// Commands go out 50 times a second on a channel of their own; which channels a robot obeys, and in which order, stands in its run file.
///
/// A terminal does not tell when a key is let go. So a velocity lives 0.8 s from the first press of its key and 0.3 s from each repetition: hold
/// the key to walk, let go to stop. Poses stay as they are set.
///
/// It begins with what the robot does already (one that lies stays lying), and where the terminal, the gamepad or the script ends, a robot
/// that walks stands; an emergency stop stays one.
///
/// Exit code 1 where lines have ended and nobody obeys them: no controller is heard, it follows another operator, or the robot does not do what was
/// asked last.
#[derive(clap::Args)]
#[command(after_help = KEYS)]
pub struct Args {
    /// Channel of the commands
    #[arg(long, value_name = "NAME", default_value = CHANNEL)]
    channel: String,
    /// Network, else that of LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0
    #[arg(long, value_name = "URL", default_value = "", hide_default_value = true)]
    lcm_url: String,
    /// Take the limits of this robot, before it says them itself
    #[arg(long, value_name = "NAME_OR_TOML")]
    robot: Option<String>,
    /// Use the gamepad too; when it is gone, so is the operator
    #[arg(long, conflicts_with = "no_screen")]
    pad: bool,
    /// Take lines from standard input instead of keys, such as: walk vx=0.2
    #[arg(long)]
    no_screen: bool,
    /// Take lines from this file instead of keys
    #[arg(long, value_name = "FILE", conflicts_with = "pad")]
    script: Option<PathBuf>,
}

const KEYS: &str = "\
Example: hoof teleop
         hoof teleop --pad --channel OPERATOR_PAD
         printf 'stand\\nwait 2\\nwalk vx=0.2\\nwait 5\\nstand\\n' | hoof teleop --no-screen

Keys:    Esc x   EMERGENCY STOP            Enter    stand up, sit down
         Space   walk, stop walking        r        level; sitting: no torque; stopped: take it back
         w s     forward, backward         o l      higher, lower
         q e     left, right               u j      nose up, down
         a d     turn left, right          h k      roll left, right
         + -     faster, slower            g        other gait
         Ctrl-C  end

Gamepad: left stick moves, right stick turns and pitches, L1 or R1 held walks (let go: stands), cross/A gait, circle/B EMERGENCY STOP,
         Start stands up and sits down, Select is r, directional pad height and roll

Lines:   stand, walk, sit, idle, estop, each with or without vx= vy= yaw= roll= pitch= height= gait= swing_frequency= duty=
         step_height=, which stay until set again; wait SECONDS; # begins a comment";

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let signals = Signals::catch()?;
    let limits = args.robot.as_deref().map(limits_of).transpose()?;
    let hands = Hands::find(args)?;
    let mut session = Session::open(args, limits)?;
    session.link.say(Event::LEVEL_INFO, format!("begins on {}", args.channel))?;
    let (ended, is_seen) = match hands {
        Hands::Lines(source, name) => (lines::obey(&mut session, &signals, source, &name), false),
        Hands::Keys(pad) => (keyboard::obey(&mut session, &signals, pad.map(|pad| *pad)), true),
    };
    // Whatever ended it: the robot is told first, and a person afterwards.
    let left = session.leave(ended.as_ref().err());
    let ended = ended?;
    say(format!("{ended}; {}", left?))?;
    // Who has a screen sees it there.
    let trouble = session.trouble().filter(|_| !is_seen);
    if let Some(trouble) = &trouble {
        eprintln!("warning: {trouble}");
    }
    Ok(Outcome::failed_if(trouble.is_some()))
}

/// What the operator has to command with; looked for before anybody is told of an operator.
enum Hands {
    Lines(lines::Source, String),
    Keys(Option<Box<Gamepad>>),
}

impl Hands {
    fn find(args: &Args) -> anyhow::Result<Self> {
        Ok(match &args.script {
            Some(file) => Hands::Lines(lines::Source::Text(read(file)?), file.display().to_string()),
            None if args.no_screen => Hands::Lines(lines::Source::Input, "standard input".to_owned()),
            None => {
                keyboard::check()?;
                Hands::Keys(args.pad.then(Gamepad::open).transpose()?.map(Box::new))
            }
        })
    }
}

fn limits_of(robot: &str) -> anyhow::Result<Limits> {
    let (_, text) = RobotFiles::find_with_params(robot)?;
    Ok(Limits::of(&Params::from_toml(&text, robot)?))
}

/// Signals that end it.
struct Signals(Arc<AtomicUsize>);

impl Signals {
    fn catch() -> anyhow::Result<Self> {
        let flag = Arc::new(AtomicUsize::new(0));
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            let number = usize::try_from(signal).context("number of a signal")?;
            signal_hook::flag::register_usize(signal, Arc::clone(&flag), number).context("signal handler")?;
        }
        Ok(Signals(flag))
    }

    /// Says so if a signal asked for the end.
    ///
    /// # Errors
    /// The terminal was hung up.
    fn asked(&self) -> anyhow::Result<Option<&'static str>> {
        match i32::try_from(self.0.load(Ordering::Relaxed)) {
            Ok(0) => Ok(None),
            Ok(SIGHUP) => Err(anyhow::anyhow!("the terminal is gone")),
            _ => Ok(Some("ended by a signal")),
        }
    }
}

/// The desk, the bus, and the heartbeat between them.
struct Session {
    desk: Desk,
    link: Link,
    due_ns: i64,
}

impl Session {
    fn open(args: &Args, limits: Option<Limits>) -> anyhow::Result<Self> {
        let link = Link::open(&args.lcm_url, &args.channel)?;
        Ok(Session { desk: Desk::new(limits.unwrap_or_default()), link, due_ns: now_ns() })
    }

    /// Time until the next heartbeat.
    fn rest(&self, now_ns: i64) -> Duration {
        Duration::from_nanos(u64::try_from(self.due_ns - now_ns).unwrap_or(0))
    }

    /// Listens and sends, where it is time.
    fn beat(&mut self, now_ns: i64) -> anyhow::Result<()> {
        if now_ns < self.due_ns {
            return Ok(());
        }
        self.link.listen(now_ns)?;
        if let Some((_, limits)) = self.link.heard.robot {
            self.desk.set_limits(limits);
        }
        if let Some(mode) = self.link.heard.mode(now_ns) {
            self.desk.hear(mode);
        }
        self.send(now_ns)?;
        self.due_ns = now_ns + HEARTBEAT_NS;
        Ok(())
    }

    /// Sends what the desk says.
    fn send(&mut self, now_ns: i64) -> anyhow::Result<()> {
        self.desk.command(now_ns).map_or(Ok(()), |command| self.link.send(&command))
    }

    /// The last words to the robot; a sentence about them. The first failure counts, and no failure keeps the others from being tried.
    fn leave(&mut self, why: Option<&anyhow::Error>) -> anyhow::Result<String> {
        self.desk.leave();
        let mut outcome = Ok(());
        for _ in 0..LAST_WORDS {
            outcome = outcome.and(self.send(now_ns()));
            std::thread::sleep(Duration::from_nanos(HEARTBEAT_NS.cast_unsigned()));
            outcome = outcome.and(self.link.listen(now_ns()));
        }
        let left = match self.desk.mode() {
            None => "the robot was told nothing".to_owned(),
            Some(OperatorCommand::MODE_DAMPING) if self.trouble().is_none() => "the emergency stop stays".to_owned(),
            Some(mode) => format!("the last command was {}", view::mode(mode)),
        };
        let (level, text) = match why {
            Some(error) => (Event::LEVEL_WARNING, format!("ends: {error:#}; {left}")),
            None => (Event::LEVEL_INFO, format!("ends: {left}")),
        };
        outcome = outcome.and(self.link.say(level, text));
        outcome.map(|()| format!("{left}, {} commands sent", self.link.heard.commands))
    }
    /// Why nothing came of what was asked last, if it was asked and nothing did.
    fn trouble(&self) -> Option<String> {
        self.link.heard.trouble(self.desk.mode()?, self.link.channel(), now_ns())
    }
}
