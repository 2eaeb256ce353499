//! The publisher thread. It may block: it publishes the messages of the real-time thread, derives events from them, and receives requests.

use super::clock::now_ns;
use super::message_ring::{MessageReceiver, MessageSender, RingMessage};
use super::outgoing::Outgoing;
use super::peers::{Finding, Peers};
use super::realtime_loop::{End, EndCause, Ending};
use super::requests::Requests;
use super::{CallSender, Lateness};
use crate::command_mux::CommandMux;
use crate::watch::{ComponentEvent, ComponentWatch, FaultOfRun, ModeEvent, ModeWatch};
use controller::Unpacked;
use lcmtypes::bus::{Bus, Received};
use lcmtypes::{
    ControllerInput, ControllerTick, DecodeError, Event, Message, ParameterChange, RobotInfo, RunInfo, TickInput,
    Timing, channels, enum_names,
};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Period at which RUN_INFO and the parameter changes are published again, so that a log that begins later can be read, ns.
pub const RUN_INFO_EVERY_NS: i64 = 5_000_000_000;
/// Shortest time between two reports of messages that were not used, ns.
const REPORT_EVERY_NS: i64 = 1_000_000_000;
/// Longest wait for a message from the bus before the ring is checked again.
const POLL: Duration = Duration::from_millis(1);

/// Result of a publisher thread.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PublisherReport {
    /// Messages that the bus did not accept.
    pub unpublished: u64,
    /// Received messages that could not be decoded.
    pub unreadable: u64,
    /// Calls for which the ring to the real-time thread had no room.
    pub not_called: u64,
    /// Another run was active on the network; this one ended if it started later.
    pub second_run: bool,
    /// Messages of processes that were too long, or for which the ring to the real-time thread had no room.
    pub not_passed: u64,
    /// The fault with which the run ended in its safe state, if it did.
    pub fault: Option<FaultOfRun>,
}

/// Number of messages that EVENTs have reported.
#[derive(Debug)]
struct Reported {
    count: u64,
    /// Earliest time of the next report, ns.
    due_ns: i64,
}

impl Default for Reported {
    fn default() -> Self {
        Reported { count: 0, due_ns: i64::MIN }
    }
}

impl Reported {
    /// Messages to report at `now_ns`, if there are `count` in all; at most once per [`REPORT_EVERY_NS`].
    fn new_messages(&mut self, count: u64, now_ns: i64) -> Option<u64> {
        let new = count.saturating_sub(self.count);
        if new == 0 || now_ns < self.due_ns {
            return None;
        }
        *self = Reported { count, due_ns: now_ns.saturating_add(REPORT_EVERY_NS) };
        Some(new)
    }
}

/// The publisher thread's data.
pub struct Publisher {
    ring: MessageReceiver,
    /// Channels of processes, and the ring that their messages take to the real-time thread.
    remote: Option<(MessageSender, BTreeSet<String>)>,
    not_passed: u64,
    out: Outgoing,
    requests: Requests,
    events: TickEvents,
    info: RunInfo,
    info_due_ns: Option<i64>,
    peers: Option<Peers>,
    peers_due_ns: i64,
    /// Received messages that could not be decoded, and the channel of the last one.
    unreadable: (u64, String),
    reported_unreadable: Reported,
    reported_states: Reported,
    /// Another run was active.
    second_run: bool,
}

impl Publisher {
    /// A publisher between the rings of the real-time thread and `bus`.
    ///
    /// `bus` has subscribed to [`channels::EXECUTOR_COMMAND`], [`channels::PARAMETER_REQUEST`] and the channels of the operators.
    /// `controllers`: names, in the order of their bits. `peers`: if the robot is on the bus.
    pub fn new(
        (ring, calls): (MessageReceiver, CallSender),
        (bus, peers): (Box<dyn Bus>, Option<Peers>),
        mux: CommandMux,
        info: RunInfo,
        controllers: Vec<String>,
        lateness: Lateness,
        ending: Arc<Ending>,
    ) -> Self {
        Publisher {
            ring,
            out: Outgoing::new(bus, info.run_id),
            requests: Requests::new(calls, mux, &info, controllers.clone()),
            events: TickEvents::new(&info, controllers, lateness, ending),
            info,
            info_due_ns: None,
            peers,
            peers_due_ns: i64::MIN,
            unreadable: (0, String::new()),
            reported_unreadable: Reported::default(),
            reported_states: Reported::default(),
            second_run: false,
            remote: None,
            not_passed: 0,
        }
    }

    /// Passes messages on these channels to the real-time thread.
    #[must_use]
    pub fn with_remote(self, ring: MessageSender, channels: BTreeSet<String>) -> Self {
        Publisher { remote: Some((ring, channels)), ..self }
    }

    /// Runs until the real-time thread has ended and the ring is empty.
    pub fn run(mut self) -> PublisherReport {
        loop {
            // Read before the ring is emptied: the last messages are in the ring by then.
            let ended = self.ring.is_abandoned();
            self.publish_ring();
            if ended {
                break;
            }
            self.receive();
            self.requests.work(&mut self.out);
            self.out.report_suppressed();
            self.announce();
            self.report_refused();
        }
        self.requests.close(&mut self.out);
        // For a log that began within the last seconds.
        if self.info_due_ns.is_some() {
            self.publish_info();
        }
        self.events.report_lateness(true, &mut self.out);
        self.out.report_rest();
        PublisherReport {
            unpublished: self.out.unpublished(),
            unreadable: self.unreadable.0,
            not_called: self.requests.not_called(),
            second_run: self.second_run,
            not_passed: self.not_passed,
            fault: self.events.modes.fault_of_safe_state(),
        }
    }

    fn publish_ring(&mut self) {
        loop {
            // RUN_INFO is the first message of a run, and is repeated with the same bytes.
            let is_due = self.info_due_ns.is_none_or(|due| now_ns() >= due);
            let Some(message) = self.ring.pop() else { return };
            if is_due {
                if self.info_due_ns.is_none() {
                    self.info.t_ns = message.t_ns;
                }
                self.info_due_ns = Some(now_ns() + RUN_INFO_EVERY_NS);
                self.out.put(channels::RUN_INFO, &self.info);
                self.requests.publish_changes(&mut self.out);
            }
            match message.channel {
                // The events of both threads are numbered together.
                channels::EVENT => drop(Event::decode(message.data).map(|event| self.out.put_event(event))),
                channel => self.out.put_bytes(channel, message.data),
            }
            self.events.take(message, &mut self.requests, &mut self.out);
        }
    }

    fn publish_info(&mut self) {
        self.out.put(channels::RUN_INFO, &self.info);
        self.requests.publish_changes(&mut self.out);
    }

    /// Sends EXPECTED_ROBOT if it is due.
    fn announce(&mut self) {
        let now = now_ns();
        if let Some(peers) = &mut self.peers
            && now >= self.peers_due_ns
        {
            self.peers_due_ns = now + peers.period_ns();
            self.out.put(channels::EXPECTED_ROBOT, peers.expected(now));
        }
    }

    /// Reports received messages that were not used.
    fn report_refused(&mut self) {
        let now = now_ns();
        let states = self.events.ending.refused_states.load(Ordering::Relaxed);
        if let Some(new) = self.reported_states.new_messages(states, now) {
            let text =
                format!("{new} ROBOT_STATE refused: undecodable, of another sender, or of a driver without ROBOT_INFO");
            self.out.event(now, -1, Event::LEVEL_WARNING, "executor", text);
        }
        let (unreadable, channel) = &self.unreadable;
        if let Some(new) = self.reported_unreadable.new_messages(*unreadable, now) {
            let text = format!("{new} received messages cannot be decoded, the last one on {channel}");
            self.out.event(now, -1, Event::LEVEL_WARNING, "executor", text);
        }
    }

    /// Takes a ROBOT_INFO or EXPECTED_ROBOT. With a second driver or run the joints are damped; of two runs, the later one ends.
    ///
    /// # Errors
    /// If it cannot be decoded.
    fn receive_peer(&mut self, message: &Received) -> Result<(), DecodeError> {
        let info = RobotInfo::decode(&message.data)?;
        let Some(peers) = &mut self.peers else { return Ok(()) };
        let now = now_ns();
        let found = match &*message.channel {
            channels::ROBOT_INFO => peers.robot_info(&info, now),
            _ => peers.expected_robot(&info, now),
        };
        // At once, if it is open whether a driver has ended.
        self.peers_due_ns = self.peers_due_ns.min(now + peers.period_ns());
        let text = match found {
            None => return Ok(()),
            Some(Finding::Driver(id)) => {
                self.requests.use_driver(id);
                return Ok(());
            }
            Some(Finding::OtherRobot(difference)) => {
                format!("a driver has another robot and is not used: {difference}")
            }
            Some(Finding::SecondDriver) => {
                self.requests.damp(now, self.info.run_id);
                "two drivers of this robot are running: joints damped".to_owned()
            }
            Some(Finding::SecondRun { is_earlier }) => {
                self.requests.damp(now, self.info.run_id);
                self.second_run = true;
                // At once, so that the other run detects this one too.
                self.peers_due_ns = i64::MIN;
                if is_earlier {
                    self.events.ending.request(End::Damp, EndCause::SecondRun);
                    "another run on this network started earlier: this run ends".to_owned()
                } else {
                    "another run on this network started later: joints damped".to_owned()
                }
            }
        };
        self.out.event(now, -1, Event::LEVEL_ERROR, "executor", text);
        Ok(())
    }

    fn receive(&mut self) {
        match self.out.bus().handle(POLL) {
            Ok(messages) => {
                for message in messages {
                    if let Some((ring, _)) = self.remote.as_mut().filter(|(_, known)| known.contains(&message.channel))
                    {
                        let is_passed =
                            message.data.len() <= MAX_REMOTE && ring.push(now_ns(), &message.channel, &message.data);
                        self.not_passed += u64::from(!is_passed);
                        self.events.take_other(&message.channel, &message.data, &mut self.out);
                        continue;
                    }
                    let decoded = match &*message.channel {
                        channels::ROBOT_INFO | channels::EXPECTED_ROBOT => self.receive_peer(&message),
                        _ => self.requests.receive(&message, &mut self.out),
                    };
                    if decoded.is_err() {
                        self.unreadable = (self.unreadable.0 + 1, message.channel);
                    }
                }
            }
            // Without a pause, a bus whose calls fail at once would keep a core busy.
            Err(_) => std::thread::sleep(POLL),
        }
    }
}

/// Largest message of a process that is passed on, bytes.
const MAX_REMOTE: usize = 1 << 16;

/// Derives events from the messages of the ticks.
struct TickEvents {
    controllers: Vec<String>,
    /// The controllers that ran in the last tick, one bit each.
    running: i64,
    /// The request to end the run, for its cause.
    ending: Arc<Ending>,
    /// The executor has replaced the operator's command, to end the run.
    is_ending: bool,
    modes: ModeWatch,
    /// Those of the other components.
    others: ComponentWatch,
    lateness: Lateness,
    /// Decoded messages of the present tick, and what holds of them.
    input: ControllerInput,
    unpacked: Unpacked,
    timing: Timing,
}

impl TickEvents {
    fn new(info: &RunInfo, controllers: Vec<String>, lateness: Lateness, ending: Arc<Ending>) -> Self {
        TickEvents {
            controllers,
            running: 0,
            ending,
            is_ending: false,
            modes: ModeWatch::new(info.joints.clone()).with_limits(info),
            others: ComponentWatch::new(info),
            lateness,
            input: ControllerInput::default(),
            unpacked: Unpacked::default(),
            timing: Timing::default(),
        }
    }

    /// Takes a message of the real-time thread.
    fn take(&mut self, message: RingMessage, requests: &mut Requests, out: &mut Outgoing) {
        match message.channel {
            channels::CONTROLLER_INPUT if self.input.decode_into(message.data).is_ok() => {
                self.unpacked.update(&self.input);
                self.report_running(out);
                self.report_end(out);
            }
            channels::CONTROLLER_TICK => {
                if let Ok(tick) = ControllerTick::decode(message.data) {
                    if let Some(ModeEvent { level, text, .. }) = self.modes.update(&tick) {
                        out.event(tick.t_ns, tick.tick, level, "controller", text);
                    }
                    requests.tick(self.unpacked.input(), &tick, out);
                }
            }
            channels::PARAMETER_CHANGE => {
                if let Ok(change) = ParameterChange::decode(message.data) {
                    self.modes.change(&change.key, &change.value);
                }
            }
            channels::TIMING if self.timing.decode_into(message.data).is_ok() => {
                self.lateness.add(&self.timing);
                self.report_lateness(false, out);
            }
            channel => self.take_other(channel, message.data, out),
        }
    }

    /// Reports modes and faults of a component beside the first one. It counts its own ticks, so the event has none.
    fn take_other(&mut self, channel: &str, data: &[u8], out: &mut Outgoing) {
        if let Some(ComponentEvent { component, t_ns, event }) = self.others.update(channel, data) {
            out.event(t_ns, -1, event.level, &component, event.text);
        }
    }

    /// Reports which controllers were started and stopped.
    fn report_running(&mut self, out: &mut Outgoing) {
        let TickInput { t_ns, tick, running, .. } = *self.unpacked.input();
        let changed = std::mem::replace(&mut self.running, running) ^ running;
        for (k, name) in self.controllers.iter().enumerate().filter(|(k, _)| changed >> k & 1 == 1) {
            let what = if running >> k & 1 == 1 { "started" } else { "stopped" };
            out.event(t_ns, tick, Event::LEVEL_INFO, "executor", format!("controller {name} {what}"));
        }
    }

    /// Reports that the run is ending: from then on the executor's command replaces the operator's, with the time of the tick itself.
    fn report_end(&mut self, out: &mut Outgoing) {
        let TickInput { t_ns, tick, t_op_ns, ref op, .. } = *self.unpacked.input();
        if !self.is_ending && t_op_ns == t_ns {
            self.is_ending = true;
            let cause = self.ending.cause();
            let text = format!("run ending: {}; requesting {}", cause.text(), enum_names::operator_mode(op.mode));
            let is_planned = matches!(cause, EndCause::Length | EndCause::Interrupt);
            out.event(t_ns, tick, if is_planned { Event::LEVEL_INFO } else { Event::LEVEL_WARNING }, "executor", text);
        }
    }

    fn report_lateness(&mut self, at_end: bool, out: &mut Outgoing) {
        if let Some((t_ns, tick, text)) = self.lateness.report(at_end) {
            out.event(t_ns, tick, Event::LEVEL_WARNING, "executor", text);
        }
    }
}
