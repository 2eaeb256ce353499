//! The thread that may block: it publishes what the real-time thread leaves in the ring, tells people what it finds in there, and takes in
//! what others want.

use super::clock::now_ns;
use super::{Call, Lateness};
use crate::watch::{ModeWatch, Said};
use lcmtypes::bus::Bus;
use lcmtypes::{ControllerTick, Event, Message, OperatorCommand, RunInfo, Timing, channels};
use replay::record::BytesOut;
use rtrb::Producer;
use std::time::Duration;

/// How often RUN_INFO is said again, so that who comes late can still read the run, ns.
pub const RUN_INFO_EVERY_NS: i64 = 5_000_000_000;
/// How long it waits for what others say before it looks into the ring again.
const REST: Duration = Duration::from_millis(1);

/// How a carrier's work went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Carried {
    /// Messages that the bus refused.
    pub unpublished: u64,
    /// Messages on the carrier's channels that could not be read.
    pub unreadable: u64,
    /// Calls that did not fit into their ring: the real-time thread stands still.
    pub not_called: u64,
}

/// The carrier.
pub struct Carrier {
    ring: BytesOut,
    calls: Producer<Call>,
    bus: Box<dyn Bus>,
    info: RunInfo,
    info_due_ns: Option<i64>,
    modes: ModeWatch,
    lateness: Lateness,
    bytes: Vec<u8>,
    done: Carried,
}

impl Carrier {
    /// A carrier between `ring` and `bus`, which has subscribed to [`Carrier::CHANNELS`].
    pub fn new(ring: BytesOut, calls: Producer<Call>, bus: Box<dyn Bus>, info: RunInfo, lateness: Lateness) -> Self {
        Carrier {
            ring,
            calls,
            bus,
            info,
            info_due_ns: None,
            modes: ModeWatch::default(),
            lateness,
            bytes: Vec::new(),
            done: Carried::default(),
        }
    }

    /// What it listens to, as a pattern.
    pub const CHANNELS: &str = channels::OPERATOR_COMMAND;

    /// Works until the real-time thread is gone and the ring is empty.
    pub fn run(mut self) -> Carried {
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
                self.tell_lateness(true);
                return self.done;
            }
            self.listen();
        }
    }

    fn carry(&mut self, channel: &str, data: &[u8]) {
        self.say_run_info(data);
        self.publish(channel, data);
        match channel {
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

    /// RUN_INFO is the first message of a run, and comes again now and then, always with the same bytes.
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
    }

    fn tell_lateness(&mut self, at_end: bool) {
        if let Some((t_ns, tick, text)) = self.lateness.tell(at_end) {
            self.tell(t_ns, tick, Event::LEVEL_WARNING, "executor", text);
        }
    }

    fn tell(&mut self, t_ns: i64, tick: i64, level: i8, source: &str, text: String) {
        let event = Event { t_ns, tick, level, source: source.to_owned(), text };
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
        for message in heard {
            let t_ns = now_ns();
            match OperatorCommand::decode(&message.data) {
                Ok(command) => {
                    self.done.not_called += u64::from(self.calls.push(Call::Operator { t_ns, command }).is_err());
                }
                Err(_) => self.done.unreadable += 1,
            }
        }
    }
}
