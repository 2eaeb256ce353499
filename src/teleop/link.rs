//! Connection to the bus: sends commands, receives the controller's state and its replies.

use anyhow::Context;
use controller::params::Params;
use drivers::live::clock::now_ns;
use drivers::teleop::{Limits, check_channel};
use lcmtypes::bus::{Bus, LcmBus};
use lcmtypes::{
    ControllerInput, ControllerTick, Event, EventNumbers, Message, OperatorCommand, RequestReply, RunInfo, channels,
    enum_names, new_sender_id,
};
use std::collections::VecDeque;
use std::time::Duration;

/// Number of events that are kept for the display.
const EVENTS: usize = 20;
/// Time without a CONTROLLER_TICK after which the controller counts as timed out, ns.
pub const TIMEOUT_NS: i64 = 500_000_000;
/// Time after which an emergency stop that the controller has not confirmed has failed, ns.
const STOP_TIMEOUT_NS: i64 = 200_000_000;

/// Shortest time between two RUN_INFO that are read, ns: reading one takes milliseconds, and a foreign program may send any number.
const INFO_EVERY_NS: i64 = 1_000_000_000;

/// Sends commands and receives the controller's messages.
pub struct Link {
    bus: Box<dyn Bus>,
    channel: String,
    sender_id: i64,
    events: EventNumbers,
    bytes: Vec<u8>,
    /// The last RUN_INFO that was read: a run repeats it.
    info: Vec<u8>,
    /// Earliest time to read another one, ns.
    info_due_ns: i64,
    /// What is known of the controller.
    pub status: Status,
}

/// State of the controller and of this operator's request, from the messages received.
#[derive(Debug, Default)]
pub struct Status {
    /// Commands sent.
    pub commands: i64,
    /// Last CONTROLLER_TICK and its time of arrival, ns.
    pub tick: Option<(ControllerTick, i64)>,
    /// Ticks per second, over the last second.
    pub rate_hz: f64,
    /// Operator whose commands the controller follows.
    pub follows: Follows,
    /// Last events, oldest first.
    pub events: VecDeque<Event>,
    /// Name and limits of the robot, after a RUN_INFO.
    pub robot: Option<(String, Limits)>,
    /// The mode that is requested now.
    request: Option<Request>,
    /// Ticks counted, and start of the interval, ns.
    counted: (u32, i64),
}

/// A requested mode.
#[derive(Debug)]
struct Request {
    mode: i8,
    /// seq and time of the first command with it.
    first_seq: i64,
    since_ns: i64,
    /// The executor's last reply to a command with it.
    reply: Option<RequestReply>,
}

/// Operator whose commands the controller consumes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Follows {
    /// None, as far as is known.
    #[default]
    NoOperator,
    /// This one.
    Us,
    /// Another one.
    Another,
}

/// State of an emergency stop that this operator requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// Sent less than [`STOP_TIMEOUT_NS`] ago.
    Sent,
    /// The controller damps the joints.
    Confirmed,
    /// Not confirmed in time.
    Failed,
}

impl Link {
    /// Joins the network.
    ///
    /// # Errors
    /// If the channel is invalid or the network cannot be joined.
    pub fn open(url: &str, channel: &str) -> anyhow::Result<Self> {
        check_channel(channel).with_context(|| format!("--channel {channel:?}"))?;
        let mut bus = LcmBus::open(url).context("run `hoof doctor` to find the cause")?;
        for name in [
            channels::CONTROLLER_TICK,
            channels::CONTROLLER_INPUT,
            channels::EVENT,
            channels::RUN_INFO,
            channels::REQUEST_REPLY,
        ] {
            bus.subscribe(name)?;
        }
        Ok(Link::over(Box::new(bus), channel))
    }

    fn over(bus: Box<dyn Bus>, channel: &str) -> Self {
        let (bytes, sender_id) = (Vec::new(), new_sender_id());
        let events = EventNumbers::new(sender_id);
        let (info, info_due_ns, status) = (Vec::new(), i64::MIN, Status::default());
        Link { bus, channel: channel.to_owned(), sender_id, events, bytes, info, info_due_ns, status }
    }

    /// Channel of the commands.
    pub fn channel(&self) -> &str {
        &self.channel
    }

    /// Sends a command.
    ///
    /// # Errors
    /// If the bus does not accept it.
    pub fn send(&mut self, command: &OperatorCommand) -> anyhow::Result<()> {
        self.bytes.clear();
        OperatorCommand { sender_id: self.sender_id, ..command.clone() }.encode(&mut self.bytes)?;
        self.bus.publish(&self.channel, &self.bytes)?;
        self.status.sent(command);
        Ok(())
    }

    /// Publishes an EVENT.
    ///
    /// # Errors
    /// If the bus does not accept it.
    pub fn event(&mut self, level: i8, text: String) -> anyhow::Result<()> {
        let source = "teleop".to_owned();
        let mut event = Event { t_ns: now_ns(), tick: -1, level, source, text, ..Event::default() };
        self.events.number(&mut event);
        self.bytes.clear();
        event.encode(&mut self.bytes)?;
        Ok(self.bus.publish(channels::EVENT, &self.bytes)?)
    }

    /// Takes the messages that have arrived since the last call.
    ///
    /// # Errors
    /// If the bus fails.
    pub fn receive(&mut self, now_ns: i64) -> anyhow::Result<()> {
        let messages = self.bus.handle(Duration::ZERO)?;
        let newest = |channel: &str| messages.iter().rev().find(|m| m.channel == channel).map(|m| &*m.data);
        // Messages of other types or versions are ignored: the operator must keep its emergency stop.
        if let Some(Ok(tick)) = newest(channels::CONTROLLER_TICK).map(ControllerTick::decode) {
            self.status.tick = Some((tick, now_ns));
        }
        // A command holds until the next one is delivered.
        let inputs = messages.iter().rev().filter(|m| m.channel == channels::CONTROLLER_INPUT);
        let mut inputs = inputs.filter_map(|m| ControllerInput::decode(&m.data).ok());
        if let Some(op) = inputs.find_map(|input| input.newest(channels::OPERATOR_COMMAND)) {
            self.status.follows = follows(self.sender_id, &op);
        }
        if let Some(bytes) = newest(channels::RUN_INFO)
            && now_ns >= self.info_due_ns
            && *bytes != *self.info
        {
            self.info = bytes.to_vec();
            self.info_due_ns = now_ns.saturating_add(INFO_EVERY_NS);
            if let Ok(info) = RunInfo::decode(bytes)
                && let Ok(params) = Params::from_toml(info.params(), "RUN_INFO")
            {
                self.status.robot = Some((info.robot, Limits::of(&params, &info.urdf)));
            }
        }
        let ticks = messages.iter().filter(|m| m.channel == channels::CONTROLLER_TICK).count();
        self.status.count(u32::try_from(ticks).unwrap_or(u32::MAX), now_ns);
        let mine = (RequestReply::KIND_OPERATOR, self.sender_id);
        for message in &messages {
            if message.channel == channels::REQUEST_REPLY
                && let Ok(reply) = RequestReply::decode(&message.data)
                && (reply.kind, reply.sender_id) == mine
            {
                self.status.replied(reply);
            }
            if message.channel == channels::EVENT
                && let Ok(event) = Event::decode(&message.data)
            {
                if self.status.events.len() == EVENTS {
                    self.status.events.pop_front();
                }
                self.status.events.push_back(event);
            }
        }
        Ok(())
    }
}

impl Status {
    /// The controller's mode; `None` if the controller has timed out.
    pub fn mode(&self, now_ns: i64) -> Option<i8> {
        self.tick.as_ref().filter(|(_, at)| now_ns - at <= TIMEOUT_NS).map(|(tick, _)| tick.mode)
    }

    /// State of the emergency stop that this operator requests; `None` if it requests another mode.
    pub fn stop(&self, now_ns: i64) -> Option<Stop> {
        let request = self.request.as_ref().filter(|request| request.mode == OperatorCommand::MODE_DAMPING)?;
        let is_done = request.reply.as_ref().is_some_and(|reply| reply.code == RequestReply::CODE_DONE);
        // A state that was seen before the controller timed out confirms nothing.
        let seen = self.tick.as_ref().filter(|(_, at)| now_ns - at <= STOP_TIMEOUT_NS).map(|(tick, _)| tick.mode);
        Some(match seen {
            Some(ControllerTick::MODE_DAMPING) => Stop::Confirmed,
            // The reply may arrive before the tick.
            _ if is_done && now_ns - request.since_ns <= STOP_TIMEOUT_NS => Stop::Confirmed,
            _ if now_ns - request.since_ns <= STOP_TIMEOUT_NS => Stop::Sent,
            _ => Stop::Failed,
        })
    }

    /// The executor's reason for not following the requested mode, if it has replied so.
    pub fn rejection(&self) -> Option<&str> {
        let reply = self.request.as_ref()?.reply.as_ref()?;
        (reply.code != RequestReply::CODE_DONE).then_some(&*reply.reason)
    }

    /// Why the robot does not follow a requested mode, `OperatorCommand::MODE_*`, sent on a channel; `None` if it does.
    pub fn failure(&self, requested: i8, channel: &str, now_ns: i64) -> Option<String> {
        let Some(robot) = self.mode(now_ns) else {
            return Some("no CONTROLLER_TICK received: no controller is running on this network".to_owned());
        };
        match self.follows {
            Follows::Us => {}
            Follows::Another => {
                return Some(format!(
                    "the controller follows another operator, not {channel}: see the priorities of [[operator]] in its run file"
                ));
            }
            Follows::NoOperator => {
                return Some(format!(
                    "the controller follows no operator, not {channel} either: add it as [[operator]] to its run file"
                ));
            }
        }
        let is_followed = match requested {
            OperatorCommand::MODE_STAND | OperatorCommand::MODE_WALK => {
                [ControllerTick::MODE_STAND_UP, ControllerTick::MODE_STANCE, ControllerTick::MODE_WALK].contains(&robot)
            }
            OperatorCommand::MODE_SIT => robot == ControllerTick::MODE_SIT,
            OperatorCommand::MODE_IDLE => robot == ControllerTick::MODE_IDLE,
            _ => robot == ControllerTick::MODE_DAMPING,
        };
        if is_followed {
            return None;
        }
        let advice = match (robot, requested) {
            (ControllerTick::MODE_DAMPING, OperatorCommand::MODE_IDLE) => {
                "; it changes to IDLE once no fault is present and the robot is at rest"
            }
            (ControllerTick::MODE_DAMPING, _) => "; request idle first",
            _ => "",
        };
        let (requested, robot) = (enum_names::operator_mode(requested), enum_names::mode(robot));
        let reason = self.rejection().map(|reason| format!(" ({reason})")).unwrap_or_default();
        Some(format!("{requested} requested, but the controller is in {robot}{reason}{advice}"))
    }

    /// Notes a command that has been sent.
    pub fn sent(&mut self, command: &OperatorCommand) {
        self.commands += 1;
        if self.request.as_ref().is_none_or(|request| request.mode != command.mode) {
            let OperatorCommand { mode, seq, t_ns, .. } = *command;
            self.request = Some(Request { mode, first_seq: seq, since_ns: t_ns, reply: None });
        }
    }

    /// Takes a reply to this operator; one to an earlier mode is ignored.
    fn replied(&mut self, reply: RequestReply) {
        if let Some(request) = self.request.as_mut().filter(|request| reply.request_id >= request.first_seq) {
            request.reply = Some(reply);
        }
    }

    fn count(&mut self, ticks: u32, now_ns: i64) {
        let (count, since_ns) = &mut self.counted;
        *count = count.saturating_add(ticks);
        let counted_ns = now_ns - *since_ns;
        if counted_ns >= 1_000_000_000 {
            #[expect(clippy::cast_precision_loss, reason = "intervals are far below 2^53 ns")]
            let seconds = counted_ns as f64 * 1e-9;
            self.rate_hz = f64::from(*count) / seconds;
            (*count, *since_ns) = (0, now_ns);
        }
    }
}

/// Operator of the command that the controller has consumed.
fn follows(sender_id: i64, op: &OperatorCommand) -> Follows {
    match op.seq {
        -1 => Follows::NoOperator,
        _ if op.sender_id == sender_id => Follows::Us,
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

    /// A link, and the controller's side of its bus.
    fn link() -> (Link, MemoryBus) {
        let theirs = MemoryBus::new();
        let mut ours = theirs.connect();
        ours.subscribe(".*").unwrap();
        (Link::over(Box::new(ours), "PAD"), theirs)
    }

    #[test]
    fn messages_update_the_status_and_garbage_is_ignored() {
        let (mut link, mut theirs) = link();
        let mine = OperatorCommand { seq: 4, t_ns: 77, ..OperatorCommand::default() };
        link.send(&mine).unwrap();
        theirs.publish(channels::CONTROLLER_TICK, b"garbage").unwrap();
        for tick in 0..1000 {
            put(&mut theirs, channels::CONTROLLER_TICK, &ControllerTick { tick, ..ControllerTick::default() });
        }
        for number in 0..30 {
            put(&mut theirs, channels::EVENT, &Event { text: number.to_string(), ..Event::default() });
        }
        let op = OperatorCommand { sender_id: link.sender_id, ..mine };
        let of = |op: &OperatorCommand| {
            let mut input = ControllerInput::default();
            input.deliver(channels::OPERATOR_COMMAND, 0, op).unwrap();
            input
        };
        put(&mut theirs, channels::CONTROLLER_INPUT, &of(&op));
        // A tick without a new command.
        put(&mut theirs, channels::CONTROLLER_INPUT, &ControllerInput::default());
        link.receive(2_000_000_000).unwrap();
        let status = &link.status;
        assert_eq!(status.tick.as_ref().map(|(tick, at)| (tick.tick, *at)), Some((999, 2_000_000_000)));
        assert_eq!((status.mode(2_500_000_000), status.mode(2_500_000_001)), (Some(0), None));
        assert_eq!(status.rate_hz, 500.5);
        assert_eq!((status.events.len(), &*status.events[0].text), (EVENTS, "10"));
        assert_eq!(status.follows, Follows::Us);
        let other = OperatorCommand { sender_id: link.sender_id + 1, ..op };
        put(&mut theirs, channels::CONTROLLER_INPUT, &of(&other));
        link.receive(2_000_000_000).unwrap();
        assert_eq!(link.status.follows, Follows::Another);
    }

    #[test]
    fn a_request_fails_if_the_controller_does_not_follow_it() {
        let of = |mode: i8, follows, requested| {
            let tick = ControllerTick { mode, ..ControllerTick::default() };
            Status { tick: Some((tick, 0)), follows, ..Status::default() }.failure(requested, "PAD", 0)
        };
        for (mode, requested) in [
            (ControllerTick::MODE_STAND_UP, OperatorCommand::MODE_STAND),
            (ControllerTick::MODE_STANCE, OperatorCommand::MODE_STAND),
            (ControllerTick::MODE_WALK, OperatorCommand::MODE_STAND),
            (ControllerTick::MODE_SIT, OperatorCommand::MODE_SIT),
            (ControllerTick::MODE_IDLE, OperatorCommand::MODE_IDLE),
            (ControllerTick::MODE_DAMPING, OperatorCommand::MODE_DAMPING),
        ] {
            assert_eq!(of(mode, Follows::Us, requested), None);
            assert!(of(mode, Follows::Another, requested).unwrap().contains("PAD"));
            assert!(of(mode, Follows::NoOperator, requested).unwrap().contains("PAD"));
        }
        for (mode, requested, named) in [
            (ControllerTick::MODE_DAMPING, OperatorCommand::MODE_STAND, ["STAND", "DAMPING"]),
            (ControllerTick::MODE_WALK, OperatorCommand::MODE_DAMPING, ["DAMPING", "WALK"]),
        ] {
            let failure = of(mode, Follows::Us, requested).unwrap();
            assert!(named.iter().all(|name| failure.contains(name)), "{failure}");
        }
        assert!(Status::default().failure(OperatorCommand::MODE_STAND, "PAD", 0).is_some());
    }

    #[test]
    fn an_emergency_stop_is_confirmed_by_reply_or_mode_and_fails_otherwise() {
        let (mut link, mut theirs) = link();
        let stop = OperatorCommand { mode: OperatorCommand::MODE_DAMPING, seq: 8, ..OperatorCommand::default() };
        assert_eq!(link.status.stop(0), None);
        link.send(&stop).unwrap();
        assert_eq!(link.status.stop(STOP_TIMEOUT_NS), Some(Stop::Sent));
        assert_eq!(link.status.stop(STOP_TIMEOUT_NS + 1), Some(Stop::Failed));
        let (mine, kind) = (link.sender_id, RequestReply::KIND_OPERATOR);
        let reply = |sender_id, request_id| RequestReply { sender_id, request_id, kind, ..RequestReply::default() };
        put(&mut theirs, channels::REQUEST_REPLY, &reply(mine + 1, 8));
        put(&mut theirs, channels::REQUEST_REPLY, &reply(mine, 7));
        let other_kind = RequestReply { kind: RequestReply::KIND_PARAMETER, ..reply(mine, 8) };
        put(&mut theirs, channels::REQUEST_REPLY, &other_kind);
        link.receive(0).unwrap();
        assert_eq!(link.status.stop(0), Some(Stop::Sent), "replies to others");
        put(&mut theirs, channels::REQUEST_REPLY, &reply(mine, 8));
        link.receive(0).unwrap();
        assert_eq!(link.status.stop(0), Some(Stop::Confirmed));
        let mut tick = ControllerTick { mode: ControllerTick::MODE_DAMPING, ..ControllerTick::default() };
        put(&mut theirs, channels::CONTROLLER_TICK, &tick);
        link.receive(STOP_TIMEOUT_NS).unwrap();
        assert_eq!(link.status.stop(STOP_TIMEOUT_NS + 1), Some(Stop::Confirmed));
        tick.mode = ControllerTick::MODE_WALK;
        put(&mut theirs, channels::CONTROLLER_TICK, &tick);
        link.receive(STOP_TIMEOUT_NS).unwrap();
        assert_eq!(link.status.stop(STOP_TIMEOUT_NS + 1), Some(Stop::Failed), "the robot walks");
    }

    #[test]
    fn a_rejected_request_has_the_reason_of_the_reply() {
        let (mut link, mut theirs) = link();
        link.send(&OperatorCommand { seq: 2, ..OperatorCommand::default() }).unwrap();
        let reply = RequestReply {
            sender_id: link.sender_id,
            request_id: 2,
            kind: RequestReply::KIND_OPERATOR,
            code: RequestReply::CODE_WRONG_STATE,
            reason: "too steep".to_owned(),
            ..RequestReply::default()
        };
        put(&mut theirs, channels::REQUEST_REPLY, &reply);
        link.receive(0).unwrap();
        assert_eq!(link.status.rejection(), Some("too steep"));
        let walk = OperatorCommand { seq: 3, mode: OperatorCommand::MODE_WALK, ..OperatorCommand::default() };
        link.send(&walk).unwrap();
        assert_eq!(link.status.rejection(), None, "another request");
    }

    #[test]
    fn limits_come_from_the_run() {
        let (mut link, mut theirs) = link();
        let (_, params) = crate::robot::RobotFiles::find_with_params("anymal_b").unwrap();
        let of = |max_speed: f64| {
            let set = [format!("foothold.max_speed={max_speed}")];
            let params = drivers::robot_files::with_overrides(&params, &set).unwrap();
            RunInfo { robot: "anymal_b".to_owned(), ..RunInfo::default() }.with_params(params)
        };
        // A second one within a second is not read, and a repetition is not read again.
        for (now_ns, max_speed, expected) in
            [(0, 0.25, 0.25), (1, 0.2, 0.25), (INFO_EVERY_NS, 0.25, 0.25), (INFO_EVERY_NS, 0.2, 0.2)]
        {
            put(&mut theirs, channels::RUN_INFO, &of(max_speed));
            link.receive(now_ns).unwrap();
            let (robot, limits) = link.status.robot.as_ref().unwrap();
            assert_eq!((&**robot, limits.gaits[0].speed), ("anymal_b", expected), "at {now_ns} ns");
        }
        let command = OperatorCommand { seq: -1, ..OperatorCommand::default() };
        assert_eq!(follows(1, &command), Follows::NoOperator);
    }
}
