//! `hoof teleop`: operator on the bus, by keyboard, gamepad or lines of text.

mod gamepad;
mod keyboard;
mod keys;
mod lines;
mod link;
mod view;

use crate::robot::{RobotFiles, read};
use crate::{Outcome, note, say};
use anyhow::Context;
use controller::params::Params;
use drivers::live::clock::now_ns;
use drivers::teleop::{CHANNEL, HEARTBEAT_NS, Limits, OperatorInput};
use gamepad::Gamepad;
use lcmtypes::{Event, OperatorCommand, enum_names};
use link::Link;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Number of times that the last command is sent: a datagram may be lost.
const LAST_COMMANDS: u32 = 10;

/// Command the robot by keyboard, gamepad or lines of text
///
/// Sends commands 50 times a second on a channel of its own. The run file of the robot lists the channels that the controller follows, and their
/// priorities.
///
/// A terminal does not report the release of a key. A velocity is therefore kept for 0.8 s after the first press of its key and for 0.3 s after each
/// repeat: hold the key to walk, release it to stop. Poses are kept.
///
/// The first command is the present mode of the robot: a lying robot keeps lying. When the terminal, the gamepad or the script ends, a walking robot
/// stands; an emergency stop stays in force.
///
/// An emergency stop that the controller does not confirm within 0.2 s is shown as failed.
///
/// Exit code 1 if, at the end of a script, the last command is not followed: no controller is running, it follows another operator, or it is in
/// another mode than requested.
#[derive(clap::Args)]
#[command(after_help = KEYS)]
pub struct Args {
    /// Channel of the commands
    #[arg(long, value_name = "NAME", default_value = CHANNEL)]
    channel: String,
    /// LCM network [default: LCM_DEFAULT_URL, else udpm://239.255.76.67:7667?ttl=0]
    #[arg(long, value_name = "URL", default_value = "", hide_default_value = true)]
    lcm_url: String,
    /// Use the limits of this robot until its RUN_INFO arrives
    #[arg(long, value_name = "NAME_OR_TOML")]
    robot: Option<String>,
    /// Use the gamepad too; when it is disconnected, the program ends
    #[arg(long, conflicts_with = "no_screen")]
    pad: bool,
    /// Read lines from standard input instead of keys, such as: walk vx=0.2
    #[arg(long)]
    no_screen: bool,
    /// Read lines from this file instead of keys
    #[arg(long, value_name = "FILE", conflicts_with = "pad")]
    script: Option<PathBuf>,
}

const KEYS: &str = "\
Example: hoof teleop
         hoof teleop --pad --channel OPERATOR_PAD
         printf 'stand\\nwait 2\\nwalk vx=0.2\\nwait 5\\nstand\\n' | hoof teleop --no-screen

Keys:    Esc x   EMERGENCY STOP            Enter    stand up, sit down
         Space   walk, stop walking        r        level; sitting: no torque; after a stop: clear it
         w s     forward, backward         o l      higher, lower
         q e     left, right               u j      nose up, down
         a d     turn left, right          h k      roll left, right
         + -     faster, slower            g        next gait
         Ctrl-C  end

Gamepad: left stick moves, right stick turns and pitches, L1 or R1 held: walk (released: stand), cross/A gait, circle/B EMERGENCY STOP,
         Start stands up and sits down, Select is r, directional pad height and roll

Lines:   stand, walk, sit, idle, estop, each with or without vx= vy= yaw= roll= pitch= height= gait= swing_frequency= duty=
         step_height=, which are kept until set again; wait SECONDS; # starts a comment";

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let signals = Signals::catch()?;
    let limits = args.robot.as_deref().map(limits_of).transpose()?;
    let device = Device::open(args)?;
    let mut session = Session::open(args, limits)?;
    session.link.event(Event::LEVEL_INFO, format!("teleoperation started on {}", args.channel))?;
    let (ended, has_screen) = match device {
        Device::Lines(source, name) => (lines::operate(&mut session, &signals, source, &name), false),
        Device::Keys(pad) => (keyboard::operate(&mut session, &signals, pad.map(|pad| *pad)), true),
    };
    // In any case the last command is sent before the result is printed.
    let left = session.leave(ended.as_ref().err());
    let ended = ended?;
    say(format!("{ended}; {}", left?))?;
    // The screen has shown it already.
    let failure = session.failure().filter(|_| !has_screen);
    if let Some(failure) = &failure {
        note(format!("warning: {failure}"));
    }
    Ok(Outcome::failed_if(failure.is_some()))
}

/// Input device. It is opened before the start of the teleoperation is announced.
enum Device {
    Lines(lines::Source, String),
    Keys(Option<Box<Gamepad>>),
}

impl Device {
    fn open(args: &Args) -> anyhow::Result<Self> {
        Ok(match &args.script {
            Some(file) => Device::Lines(lines::Source::Text(read(file)?), file.display().to_string()),
            None if args.no_screen => Device::Lines(lines::Source::Input, "standard input".to_owned()),
            None => {
                keyboard::check()?;
                Device::Keys(args.pad.then(Gamepad::open).transpose()?.map(Box::new))
            }
        })
    }
}

fn limits_of(robot: &str) -> anyhow::Result<Limits> {
    let (files, text) = RobotFiles::find_with_params(robot)?;
    Ok(Limits::of(&Params::from_toml(&text, robot)?, &files.urdf))
}

/// Signals that end the program.
struct Signals(Arc<AtomicUsize>);

impl Signals {
    fn catch() -> anyhow::Result<Self> {
        let flag = Arc::new(AtomicUsize::new(0));
        for signal in [SIGINT, SIGTERM, SIGHUP] {
            let number = usize::try_from(signal).context("signal number")?;
            signal_hook::flag::register_usize(signal, Arc::clone(&flag), number).context("signal handler")?;
        }
        Ok(Signals(flag))
    }

    /// The reason for the end if a signal has arrived.
    ///
    /// # Errors
    /// On SIGHUP: the terminal is disconnected.
    fn received(&self) -> anyhow::Result<Option<&'static str>> {
        match i32::try_from(self.0.load(Ordering::Relaxed)) {
            Ok(0) => Ok(None),
            Ok(SIGHUP) => Err(anyhow::anyhow!("terminal disconnected")),
            _ => Ok(Some("ended by a signal")),
        }
    }
}

/// Operator input, bus, and the heartbeat between them.
struct Session {
    input: OperatorInput,
    link: Link,
    due_ns: i64,
    /// A failed emergency stop has been reported.
    warned: bool,
}

impl Session {
    fn open(args: &Args, limits: Option<Limits>) -> anyhow::Result<Self> {
        let link = Link::open(&args.lcm_url, &args.channel)?;
        Ok(Session { input: OperatorInput::new(limits.unwrap_or_default()), link, due_ns: now_ns(), warned: false })
    }

    /// Reports an emergency stop that the controller does not confirm in time, once.
    fn warn_of_failed_stop(&mut self, now_ns: i64) {
        let failed = self.link.status.stop(now_ns) == Some(link::Stop::Failed);
        if failed && !self.warned {
            let channel = self.link.channel();
            note(format!("warning: EMERGENCY STOP on {channel} NOT CONFIRMED: no controller damps the joints"));
        }
        self.warned = failed;
    }

    /// Time until the next heartbeat.
    fn rest(&self, now_ns: i64) -> Duration {
        Duration::from_nanos(u64::try_from(self.due_ns - now_ns).unwrap_or(0))
    }

    /// Receives and sends, if the heartbeat is due.
    fn heartbeat(&mut self, now_ns: i64) -> anyhow::Result<()> {
        if now_ns < self.due_ns {
            return Ok(());
        }
        self.link.receive(now_ns)?;
        if let Some((_, limits)) = &self.link.status.robot {
            self.input.set_limits(limits);
        }
        if let Some(mode) = self.link.status.mode(now_ns) {
            self.input.set_robot_mode(mode);
        }
        self.send(now_ns)?;
        self.due_ns = now_ns + HEARTBEAT_NS;
        Ok(())
    }

    /// Sends the present command, if there is one.
    fn send(&mut self, now_ns: i64) -> anyhow::Result<()> {
        self.input.command(now_ns).map_or(Ok(()), |command| self.link.send(&command))
    }

    /// Sends the last command several times, and an EVENT; returns a sentence about them. All steps are tried; the first failure is returned.
    fn leave(&mut self, why: Option<&anyhow::Error>) -> anyhow::Result<String> {
        self.input.leave();
        let mut outcome = Ok(());
        for _ in 0..LAST_COMMANDS {
            outcome = outcome.and(self.send(now_ns()));
            std::thread::sleep(Duration::from_nanos(HEARTBEAT_NS.cast_unsigned()));
            outcome = outcome.and(self.link.receive(now_ns()));
        }
        let left = match self.input.mode() {
            None => "no command was sent".to_owned(),
            Some(OperatorCommand::MODE_DAMPING) if self.failure().is_none() => {
                "the emergency stop stays in force".to_owned()
            }
            Some(mode) => format!("the last command was {}", enum_names::operator_mode(mode)),
        };
        let (level, text) = match why {
            Some(error) => (Event::LEVEL_WARNING, format!("teleoperation ended: {error:#}; {left}")),
            None => (Event::LEVEL_INFO, format!("teleoperation ended: {left}")),
        };
        outcome = outcome.and(self.link.event(level, text));
        outcome.map(|()| format!("{left}, {} commands sent", self.link.status.commands))
    }

    /// Why the last request is not followed; `None` if it is, or if there was none.
    fn failure(&self) -> Option<String> {
        self.link.status.failure(self.input.mode()?, self.link.channel(), now_ns())
    }
}
