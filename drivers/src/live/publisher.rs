//! The thread that may block: it publishes what the real-time thread leaves in the ring, tells people what it finds in there, and takes in
//! what others want.

use super::clock::now_ns;
use super::{Call, Caller, Handover, Lateness};
use crate::command_mux::CommandMux;
use crate::parameter_requests::{self, ParameterRequestHandler, Proposal};
use crate::watch::{ModeWatch, Said};
use controller::model::{JointKind, UrdfTree};
use lcmtypes::bus::{Bus, Received};
use lcmtypes::{
    ControllerInput, ControllerTick, Event, ExecutorCommand, Message, OperatorCommand, ParameterChange,
    ParameterRequest, RunInfo, Timing, channels, enum_names,
};
use replay::record::BytesOut;
use std::collections::VecDeque;
use std::time::Duration;

/// How often RUN_INFO and what has changed since are said again, so that who comes late can still read the run, ns.
pub const RUN_INFO_EVERY_NS: i64 = 5_000_000_000;
/// How long it waits for what others say before it looks into the ring again.
const REST: Duration = Duration::from_millis(1);
/// Wishes for other parameters that may wait.
const MAX_WISHES: usize = 64;
/// When a change is said again, ns after it: within the ticks that a replay waits for a message.
const AGAIN_NS: [i64; 3] = [20_000_000, 60_000_000, 140_000_000];

/// How a carrier's work went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PublisherReport {
    /// Messages that the bus refused.
    pub unpublished: u64,
    /// Messages on the carrier's channels that could not be read.
    pub unreadable: u64,
    /// Calls that did not fit into their ring: the real-time thread stands still.
    pub not_called: u64,
}

/// The carrier.
pub struct Publisher {
    ring: BytesOut,
    calls: Caller,
    mux: CommandMux,
    bus: Box<dyn Bus>,
    info: RunInfo,
    info_due_ns: Option<i64>,
    controllers: Vec<String>,
    /// The controllers that ran in the last tick, a bit each.
    running: i64,
    modes: ModeWatch,
    lateness: Lateness,
    desk: ParameterRequestHandler,
    /// Wishes for other parameters that wait for the one before them.
    wishes: VecDeque<ParameterRequest>,
    /// A wish is with the real-time thread.
    changing: bool,
    /// What has changed, in order, the last change of a key only.
    changes: Vec<ParameterChange>,
    /// Changes that are to be said again, and when, ns, in the order of time.
    again: VecDeque<(i64, ParameterChange)>,
    /// The executor has asked for something in the operator's place.
    ending: bool,
    bytes: Vec<u8>,
    done: PublisherReport,
}

impl Publisher {
    /// A carrier between the ends of rings towards the real-time thread and `bus`, which has subscribed to [`channels::EXECUTOR_COMMAND`],
    /// [`channels::PARAMETER_REQUEST`] and to what the operators speak on. `controllers`: names, in the order of their bits.
    pub fn new(
        (ring, calls): (BytesOut, Caller),
        bus: Box<dyn Bus>,
        mux: CommandMux,
        info: RunInfo,
        controllers: Vec<String>,
        lateness: Lateness,
    ) -> Self {
        let (desk, modes) = (ParameterRequestHandler::new(&info), ModeWatch::new(joints(&info)));
        Publisher {
            ring,
            calls,
            mux,
            bus,
            info,
            info_due_ns: None,
            controllers,
            running: 0,
            modes,
            lateness,
            desk,
            wishes: VecDeque::new(),
            changing: false,
            changes: Vec::new(),
            again: VecDeque::new(),
            ending: false,
            bytes: Vec::new(),
            done: PublisherReport::default(),
        }
    }

    /// Works until the real-time thread is gone and the ring is empty.
    pub fn run(mut self) -> PublisherReport {
        let mut parcel = Vec::new();
        loop {
            // Asked before the ring is: what was put in last is there then.
            let ended = self.ring.is_abandoned();
            while self.ring.pop(&mut parcel) {
                let (length, rest) = parcel.split_first().expect("put in with a channel");
                let (channel, data) = rest.split_at(usize::from(*length));
                self.carry(std::str::from_utf8(channel).expect("put in as text"), data);
            }
            if ended {
                self.settle();
                // A log that was begun in the last seconds has not heard it yet.
                if let Some(due_ns) = &mut self.info_due_ns {
                    *due_ns = i64::MIN;
                    self.say_run_info(&[]);
                }
                self.tell_lateness(true);
                return self.done;
            }
            self.listen();
            self.change_parameters();
        }
    }

    fn carry(&mut self, channel: &str, data: &[u8]) {
        self.say_run_info(data);
        self.publish(channel, data);
        match channel {
            channels::CONTROLLER_INPUT => {
                self.tell_running(data);
                self.tell_end(data);
            }
            channels::CONTROLLER_TICK => {
                if let Ok(tick) = ControllerTick::decode(data)
                    && let Some(Said { level, text, .. }) = self.modes.see(&tick)
                {
                    self.tell(tick.t_ns, tick.tick, level, "controller", text);
                }
            }
            channels::TIMING => {
                if let Ok(timing) = Timing::decode(data) {
                    self.lateness.see(&timing);
                    self.tell_lateness(false);
                }
            }
            _ => {}
        }
    }

    /// RUN_INFO is the first message of a run, and comes again now and then, always with the same bytes, with what has changed since.
    fn say_run_info(&mut self, first: &[u8]) {
        let now_ns = now_ns();
        if self.info_due_ns.is_some_and(|due| now_ns < due) {
            return;
        }
        if self.info_due_ns.is_none()
            && let Some(t_ns) = first.get(8..).and_then(|rest| rest.first_chunk())
        {
            self.info.t_ns = i64::from_be_bytes(*t_ns);
        }
        self.info_due_ns = Some(now_ns + RUN_INFO_EVERY_NS);
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.clear();
        self.info.encode(&mut bytes).expect("it holds as many types as it says");
        self.publish(channels::RUN_INFO, &bytes);
        self.bytes = bytes;
        self.say_changes();
    }

    /// What has changed by now, for those who come late.
    fn say_changes(&mut self) {
        for change in std::mem::take(&mut self.changes) {
            self.say_change(&change);
            self.changes.push(change);
        }
    }

    fn say_change(&mut self, change: &ParameterChange) {
        let mut bytes = Vec::new();
        change.encode(&mut bytes).expect("a change has no arrays");
        self.publish(channels::PARAMETER_CHANGE, &bytes);
    }

    /// Says that the run ends: what is asked for comes from the executor then, in the tick that it is followed in.
    fn tell_end(&mut self, input: &[u8]) {
        if self.ending || input.get(8..16) != input.get(32..40) {
            return;
        }
        let Ok(ControllerInput { t_ns, tick, op, .. }) = ControllerInput::decode(input) else { return };
        self.ending = true;
        let what = enum_names::operator_mode(op.mode);
        self.tell(t_ns, tick, Event::LEVEL_INFO, "executor", format!("the run ends: {what} is asked for"));
    }

    /// Says which controllers were started and stopped.
    fn tell_running(&mut self, input: &[u8]) {
        let number = |at: usize| input.get(at..)?.first_chunk().map(|bytes| i64::from_be_bytes(*bytes));
        let [Some(t_ns), Some(tick), Some(running)] = [8, 16, 24].map(number) else { return };
        let changed = std::mem::replace(&mut self.running, running) ^ running;
        for k in (0..self.controllers.len()).filter(|k| changed >> k & 1 == 1) {
            let what = if running >> k & 1 == 1 { "starts" } else { "stops" };
            let text = format!("controller {} {what}", self.controllers[k]);
            self.tell(t_ns, tick, Event::LEVEL_INFO, "executor", text);
        }
    }

    fn tell_lateness(&mut self, at_end: bool) {
        if let Some((t_ns, tick, text)) = self.lateness.tell(at_end) {
            self.tell(t_ns, tick, Event::LEVEL_WARNING, "executor", text);
        }
    }

    /// Another controller has taken over. What held before is said once more, for a log that was begun after it was said; the change itself several
    /// times, since a log that has lost it cannot be replayed.
    fn changed(&mut self, change: ParameterChange) {
        self.say(&parameter_requests::event(change.t_ns, change.tick, Ok(&change)));
        self.say_changes();
        self.changes.retain(|before| before.key != change.key);
        self.changes.push(change.clone());
        let now_ns = now_ns();
        self.again.extend(AGAIN_NS.map(|later| (now_ns + later, change.clone())));
        self.again.make_contiguous().sort_by_key(|(due, _)| *due);
    }

    fn tell(&mut self, t_ns: i64, tick: i64, level: i8, source: &str, text: String) {
        self.say(&Event { t_ns, tick, level, source: source.to_owned(), text });
    }

    fn say(&mut self, event: &Event) {
        let mut bytes = Vec::new();
        event.encode(&mut bytes).expect("an event has no arrays");
        self.publish(channels::EVENT, &bytes);
    }

    fn publish(&mut self, channel: &str, data: &[u8]) {
        self.done.unpublished += u64::from(self.bus.publish(channel, data).is_err());
    }

    /// Waits a moment for what others want.
    fn listen(&mut self) {
        let Ok(heard) = self.bus.handle(REST) else {
            // A bus that fails at once must not make this thread spin.
            std::thread::sleep(REST);
            return;
        };
        heard.iter().for_each(|message| self.hear(message));
        // Sources run out of time in silence.
        self.follow_operator();
    }

    fn hear(&mut self, message: &Received) {
        let t_ns = now_ns();
        if let Some(source) = self.mux.source_of(&message.channel) {
            match OperatorCommand::decode(&message.data) {
                Ok(command) => {
                    self.mux.hear(source, t_ns, &command);
                    // After each: an emergency stop that is taken back at once was one.
                    self.follow_operator();
                }
                Err(_) => self.done.unreadable += 1,
            }
        } else if message.channel == channels::PARAMETER_REQUEST {
            match ParameterRequest::decode(&message.data) {
                // Asked again while it waits.
                Ok(wish) if self.wishes.contains(&wish) => {}
                Ok(wish) if self.wishes.len() < MAX_WISHES => self.wishes.push_back(wish),
                Ok(ParameterRequest { key, value, .. }) => {
                    self.refuse(parameter_requests::refusal(&key, &value, &format!("{MAX_WISHES} wait before it")));
                }
                Err(_) => self.done.unreadable += 1,
            }
        } else if message.channel == channels::EXECUTOR_COMMAND {
            match ExecutorCommand::decode(&message.data) {
                Ok(command) => {
                    if let Some(call) = self.start_or_stop(t_ns, &command) {
                        self.call(call);
                    }
                }
                Err(_) => self.done.unreadable += 1,
            }
        }
    }

    /// Answers the next wish for another parameter, once the one before it is settled: each is built on what was granted before.
    fn change_parameters(&mut self) {
        self.settle();
        while let Some((_, change)) = self.again.pop_front_if(|(due, _)| *due <= now_ns()) {
            self.say_change(&change);
        }
        if self.changing {
            return;
        }
        let Some(wish) = self.wishes.pop_front() else { return };
        // Who has not heard the answer asks again.
        if let Some(change) = self.changes.iter().find(|change| change.seq == wish.seq && change.key == wish.key) {
            self.say_change(&change.clone());
            return;
        }
        match self.desk.answer(&wish) {
            Ok(Proposal { controller, change, parameters }) => {
                let handover = Handover { controller, change, parameters, refused: None };
                self.changing = self.call(Call::Change(Box::new(handover)));
                if !self.changing {
                    self.refuse(parameter_requests::refusal(
                        &wish.key,
                        &wish.value,
                        &"the real-time thread stands still",
                    ));
                }
            }
            Err(why) => self.refuse(why),
        }
    }

    /// Takes back what the real-time thread has carried out.
    fn settle(&mut self) {
        while let Some(handover) = self.calls.returned() {
            let Handover { change, parameters, refused, .. } = *handover;
            self.changing = false;
            match refused {
                None => {
                    self.desk.granted(parameters);
                    self.changed(change);
                }
                Some(why) => self.refuse(parameter_requests::refusal(&change.key, &change.value, &why)),
            }
        }
    }

    fn refuse(&mut self, why: String) {
        self.say(&parameter_requests::event(now_ns(), -1, Err(&why)));
    }

    fn call(&mut self, call: Call) -> bool {
        let called = self.calls.call(call);
        self.done.not_called += u64::from(!called);
        called
    }

    fn follow_operator(&mut self) {
        let now_ns = now_ns();
        if let Some(choice) = self.mux.news(now_ns) {
            let call = Call::Operator { t_ns: choice.arrival_ns, command: choice.command.clone() };
            self.call(call);
        }
        while let Some(switch) = self.mux.switch() {
            let level = if switch.is_alarming() { Event::LEVEL_WARNING } else { Event::LEVEL_INFO };
            let text = self.mux.text(switch);
            self.tell(now_ns, -1, level, "operator", text);
        }
    }

    /// The call that a wish means; says so where it means none.
    fn start_or_stop(&mut self, t_ns: i64, wish: &ExecutorCommand) -> Option<Call> {
        let place = self.controllers.iter().position(|name| *name == wish.controller);
        let call = match (place, wish.action) {
            (Some(k), ExecutorCommand::ACTION_START) => Some(Call::Start(k)),
            (Some(k), ExecutorCommand::ACTION_STOP) => Some(Call::Stop(k)),
            _ => None,
        };
        let text = match (place, &call) {
            (None, _) => {
                format!(
                    "no controller \"{}\" to start or stop: there are {}",
                    wish.controller,
                    self.controllers.join(", ")
                )
            }
            (_, None) => format!("action {} of EXECUTOR_COMMAND, expected 0 (start) or 1 (stop)", wish.action),
            (Some(k), Some(call)) if (self.running >> k & 1 == 1) == matches!(call, Call::Start(_)) => {
                let is = if matches!(call, Call::Start(_)) { "running" } else { "stopped" };
                format!("controller {} is {is} already", wish.controller)
            }
            _ => return call,
        };
        self.tell(t_ns, -1, Event::LEVEL_WARNING, "executor", text);
        None
    }
}

/// Names of the robot's actuated joints, in URDF order.
fn joints(info: &RunInfo) -> Vec<String> {
    let tree = UrdfTree::parse(&info.urdf, &info.robot).ok();
    let joints = tree.into_iter().flat_map(|tree| tree.joints);
    joints.filter(|joint| joint.kind != JointKind::Fixed).map(|joint| joint.name).collect()
}
