//! The bus: what is sent, and what the controller says back.

use super::view;
use anyhow::Context;
use controller::params::Params;
use drivers::teleop::{Limits, check_channel};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::{ControllerInput, ControllerTick, Event, Message, OperatorCommand, RunInfo, channels, enum_names};
use nix::time::{ClockId, clock_gettime};
use std::collections::VecDeque;
use std::time::Duration;

/// Events that are kept to be shown.
const EVENTS: usize = 20;
/// Commands of which it is remembered when they were sent: more than can be under way.
const SENT: usize = 64;
/// Silence of the controller after which what it said last is old, ns.
pub const SILENCE_NS: i64 = 500_000_000;

/// Monotonic time, ns: the clock of the messages of a machine.
pub fn now_ns() -> i64 {
    // The clock exists on every Linux.
    clock_gettime(ClockId::CLOCK_MONOTONIC).map_or(0, |t| t.tv_sec() * 1_000_000_000 + t.tv_nsec())
}

/// Sends commands, hears the controller.
pub struct Link {
    bus: Box<dyn Bus>,
    channel: String,
    bytes: Vec<u8>,
    sent: VecDeque<(i64, i64)>,
    /// What was heard.
    pub heard: Heard,
}

/// What the controller said.
#[derive(Debug, Default)]
pub struct Heard {
    /// Commands sent.
    pub commands: i64,
    /// Its last tick, and when that came, ns.
    pub tick: Option<(ControllerTick, i64)>,
    /// Ticks in the last second.
    pub rate_hz: f64,
    /// Whom it follows.
    pub follows: Follows,
    /// What happened, the newest last.
    pub events: VecDeque<Event>,
    /// Robot and its limits, once RUN_INFO has come.
    pub robot: Option<(String, Limits)>,
    /// A number of ticks, and since when they were counted, ns.
    counted: (u32, i64),
}

/// Whose command the controller consumes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Follows {
    /// Nobody's, as far as is known.
    #[default]
    Nobody,
    /// Ours.
    Us,
    /// Somebody else's.
    Another,
}

impl Link {
    /// Opens the bus.
    ///
    /// # Errors
    /// The bus says what to do.
    pub fn open(url: &str, channel: &str) -> anyhow::Result<Self> {
        check_channel(channel).with_context(|| format!("--channel {channel:?}"))?;
        let mut bus = LcmBus::open(url).context("hoof doctor says what is wrong")?;
        for heard in [channels::CONTROLLER_TICK, channels::CONTROLLER_INPUT, channels::EVENT, channels::RUN_INFO] {
            bus.subscribe(heard)?;
        }
        Ok(Link::over(Box::new(bus), channel))
    }

    fn over(bus: Box<dyn Bus>, channel: &str) -> Self {
        let (bytes, sent) = (Vec::new(), VecDeque::new());
        Link { bus, channel: channel.to_owned(), bytes, sent, heard: Heard::default() }
    }

    /// Where it sends.
    pub fn channel(&self) -> &str {
        &self.channel
    }

    /// Sends a command.
    ///
    /// # Errors
    /// The bus refuses it.
    pub fn send(&mut self, command: &OperatorCommand) -> anyhow::Result<()> {
        self.bytes.clear();
        command.encode(&mut self.bytes)?;
        self.bus.publish(&self.channel, &self.bytes)?;
        self.heard.commands += 1;
        if self.sent.len() == SENT {
            self.sent.pop_front();
        }
        self.sent.push_back((command.seq, command.t_ns));
        Ok(())
    }

    /// Says something to everybody.
    ///
    /// # Errors
    /// The bus refuses it.
    pub fn say(&mut self, level: i8, text: String) -> anyhow::Result<()> {
        let event = Event { t_ns: now_ns(), tick: -1, level, source: "teleop".to_owned(), text };
        self.bytes.clear();
        event.encode(&mut self.bytes)?;
        Ok(self.bus.publish(channels::EVENT, &self.bytes)?)
    }

    /// Takes what has come since the last time.
    ///
    /// # Errors
    /// The bus fails.
    pub fn listen(&mut self, now_ns: i64) -> anyhow::Result<()> {
        let messages = self.bus.handle(Duration::ZERO)?;
        let newest = |channel: &str| messages.iter().rev().find(|m| m.channel == channel).map(|m| &*m.data);
        // Messages of another program's types, or another version's, are no reason to leave the operator without a stop.
        if let Some(Ok(tick)) = newest(channels::CONTROLLER_TICK).map(ControllerTick::decode) {
            self.heard.tick = Some((tick, now_ns));
        }
        if let Some(Ok(input)) = newest(channels::CONTROLLER_INPUT).map(ControllerInput::decode) {
            self.heard.follows = follows(&self.sent, &input.op);
        }
        if let Some(Ok(info)) = newest(channels::RUN_INFO).map(RunInfo::decode)
            && let Ok(params) = Params::from_toml(&info.params, "RUN_INFO")
        {
            self.heard.robot = Some((info.robot, Limits::of(&params)));
        }
        let ticks = messages.iter().filter(|m| m.channel == channels::CONTROLLER_TICK).count();
        self.heard.count(u32::try_from(ticks).unwrap_or(u32::MAX), now_ns);
        for event in messages.iter().filter(|m| m.channel == channels::EVENT) {
            let Ok(event) = Event::decode(&event.data) else { continue };
            if self.heard.events.len() == EVENTS {
                self.heard.events.pop_front();
            }
            self.heard.events.push_back(event);
        }
        Ok(())
    }
}

impl Heard {
    /// The controller's mode, if it has spoken lately.
    pub fn mode(&self, now_ns: i64) -> Option<i8> {
        self.tick.as_ref().filter(|(_, at)| now_ns - at <= SILENCE_NS).map(|(tick, _)| tick.mode)
    }

    /// Why nothing comes of asking for a mode, `OperatorCommand::MODE_*`, on a channel, as far as that has been heard; `None`: the robot does it.
    pub fn trouble(&self, asked: i8, channel: &str, now_ns: i64) -> Option<String> {
        let Some(robot) = self.mode(now_ns) else {
            return Some("no controller is heard here: nobody obeys".to_owned());
        };
        match self.follows {
            Follows::Us => {}
            Follows::Another => {
                return Some(format!(
                    "the controller follows another operator, not {channel}: its run file says who may command, and who before whom"
                ));
            }
            Follows::Nobody => {
                return Some(format!("the controller follows nobody, not {channel} either: is it in its run file?"));
            }
        }
        let does = match asked {
            OperatorCommand::MODE_STAND | OperatorCommand::MODE_WALK => {
                [ControllerTick::MODE_STAND_UP, ControllerTick::MODE_STANCE, ControllerTick::MODE_WALK].contains(&robot)
            }
            OperatorCommand::MODE_SIT => robot == ControllerTick::MODE_SIT,
            OperatorCommand::MODE_IDLE => robot == ControllerTick::MODE_IDLE,
            _ => robot == ControllerTick::MODE_DAMPING,
        };
        let way_out = match (robot, asked) {
            (ControllerTick::MODE_DAMPING, OperatorCommand::MODE_IDLE) => {
                ": it goes once nothing is wrong and it rests"
            }
            (ControllerTick::MODE_DAMPING, _) => ": it leaves that by idle, and then stands",
            _ => "",
        };
        let asked = view::mode(asked);
        (!does).then(|| format!("asked for {asked}, the robot is in {}{way_out}", enum_names::mode(robot)))
    }

    fn count(&mut self, ticks: u32, now_ns: i64) {
        let (count, since_ns) = &mut self.counted;
        *count = count.saturating_add(ticks);
        let counted_ns = now_ns - *since_ns;
        if counted_ns >= 1_000_000_000 {
            #[expect(clippy::cast_precision_loss, reason = "a time that a person has spent here")]
            let seconds = counted_ns as f64 * 1e-9;
            self.rate_hz = f64::from(*count) / seconds;
            (*count, *since_ns) = (0, now_ns);
        }
    }
}

fn follows(sent: &VecDeque<(i64, i64)>, op: &OperatorCommand) -> Follows {
    match op.seq {
        -1 => Follows::Nobody,
        seq if sent.contains(&(seq, op.t_ns)) => Follows::Us,
        _ => Follows::Another,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lcmtypes::bus::MemoryBus;

    fn put(bus: &mut MemoryBus, channel: &str, message: &impl Message) {
        let mut bytes = Vec::new();
        message.encode(&mut bytes).unwrap();
        bus.publish(channel, &bytes).unwrap();
    }

    #[test]
    fn what_the_controller_says_is_kept_and_garbage_is_not() {
        let mut theirs = MemoryBus::new();
        let mut ours = theirs.connect();
        ours.subscribe(".*").unwrap();
        let mut link = Link::over(Box::new(ours), "PAD");
        let mine = OperatorCommand { seq: 4, t_ns: 77, ..OperatorCommand::default() };
        link.send(&mine).unwrap();
        theirs.publish(channels::CONTROLLER_TICK, b"garbage").unwrap();
        for tick in 0..1000 {
            put(&mut theirs, channels::CONTROLLER_TICK, &ControllerTick { tick, ..ControllerTick::default() });
        }
        for number in 0..30 {
            put(&mut theirs, channels::EVENT, &Event { text: number.to_string(), ..Event::default() });
        }
        put(
            &mut theirs,
            channels::CONTROLLER_INPUT,
            &ControllerInput { op: mine.clone(), ..ControllerInput::default() },
        );
        link.listen(2_000_000_000).unwrap();
        let heard = &link.heard;
        assert_eq!(heard.tick.as_ref().map(|(tick, at)| (tick.tick, *at)), Some((999, 2_000_000_000)));
        assert_eq!((heard.mode(2_500_000_000), heard.mode(2_500_000_001)), (Some(0), None));
        assert_eq!(heard.rate_hz, 500.5);
        assert_eq!((heard.events.len(), &*heard.events[0].text), (EVENTS, "10"));
        assert_eq!(heard.follows, Follows::Us);
        let other = OperatorCommand { t_ns: 78, ..mine };
        put(&mut theirs, channels::CONTROLLER_INPUT, &ControllerInput { op: other, ..ControllerInput::default() });
        link.listen(2_000_000_000).unwrap();
        assert_eq!(link.heard.follows, Follows::Another);
    }

    #[test]
    fn what_is_asked_for_is_held_against_what_the_robot_does() {
        let of = |mode: i8, follows, asked| {
            let tick = ControllerTick { mode, ..ControllerTick::default() };
            Heard { tick: Some((tick, 0)), follows, ..Heard::default() }.trouble(asked, "PAD", 0)
        };
        let (us, another) = (Follows::Us, Follows::Another);
        for (mode, asked) in [
            (ControllerTick::MODE_STAND_UP, OperatorCommand::MODE_STAND),
            (ControllerTick::MODE_STANCE, OperatorCommand::MODE_STAND),
            (ControllerTick::MODE_WALK, OperatorCommand::MODE_STAND),
            (ControllerTick::MODE_SIT, OperatorCommand::MODE_SIT),
            (ControllerTick::MODE_IDLE, OperatorCommand::MODE_IDLE),
            (ControllerTick::MODE_DAMPING, OperatorCommand::MODE_DAMPING),
        ] {
            assert_eq!(of(mode, us, asked), None);
            let text = "the controller follows another operator, not PAD: its run file says who may command, and who before whom";
            assert_eq!(of(mode, another, asked).unwrap(), text);
            assert!(of(mode, Follows::Nobody, asked).unwrap().starts_with("the controller follows nobody"));
        }
        let (damping, stand) = (ControllerTick::MODE_DAMPING, OperatorCommand::MODE_STAND);
        let text = "asked for STAND, the robot is in DAMPING: it leaves that by idle, and then stands";
        assert_eq!(of(damping, us, stand).unwrap(), text);
        assert_eq!(
            of(ControllerTick::MODE_WALK, us, OperatorCommand::MODE_DAMPING).unwrap(),
            "asked for EMERGENCY STOP, the robot is in WALK"
        );
        let nobody = "no controller is heard here: nobody obeys";
        assert_eq!(Heard::default().trouble(stand, "PAD", 0).unwrap(), nobody);
    }

    #[test]
    fn limits_come_with_the_run() {
        let mut theirs = MemoryBus::new();
        let mut ours = theirs.connect();
        ours.subscribe(channels::RUN_INFO).unwrap();
        let mut link = Link::over(Box::new(ours), "PAD");
        let (_, params) = crate::robot::RobotFiles::find_with_params("anymal_b").unwrap();
        let params = crate::robot::with_overrides(&params, &["foothold.max_speed=0.25".to_owned()]).unwrap();
        put(&mut theirs, channels::RUN_INFO, &RunInfo { robot: "anymal_b".to_owned(), params, ..RunInfo::default() });
        link.listen(0).unwrap();
        let (robot, limits) = link.heard.robot.unwrap();
        assert_eq!((&*robot, limits.speed), ("anymal_b", 0.25));
        let command = OperatorCommand { seq: -1, ..OperatorCommand::default() };
        assert_eq!(follows(&VecDeque::new(), &command), Follows::Nobody);
    }
}
