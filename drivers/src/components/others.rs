//! The components beside the first one: on the thread of the first one, on threads of their own, in processes of their own.
//!
//! A live run and a lockstep run use the same code; in lockstep every component computes in place, whatever its `runs`. This changes no bit of its results.
//!
//! | runs | its input | its results |
//! |---|---|---|
//! | rt, and all in lockstep | stepped in place | at once |
//! | worker | a ring to its thread | a ring back, relayed to the publisher |
//! | process | CONTROLLER_INPUT on the bus | messages on the bus, through the publisher; they contain the time of the input that they belong to |
//! | external | its own business | any message on a channel that a component listens to, when it arrives |
//!
//! The release rule is that of [`super::Releases`]. A result that has not arrived when it is due is listed as late in the input of each component that
//! listens to it, in every tick until it arrives; the one before holds. A component that is far behind misses ticks: its messages wait for its next one.

use super::release::Releases;
use super::slot::Slot;
use crate::DriverError;
use crate::live::{END_OF_TICK, MessageReceiver, WorkerEnd};
use crate::stage_clock::StageClock;
use controller::{Component, Outbox};
use lcmtypes::{Message, OperatorCommand, RobotState, RunInfo, channels};
use std::collections::VecDeque;
use std::time::Duration;

/// Inputs of a component whose results have not arrived, beyond those within its latency.
const MAX_BEHIND: usize = 4;
/// Longest wait for the results of a worker after the last tick, and time between two looks.
const END_WAIT: Duration = Duration::from_secs(2);
const END_POLL: Duration = Duration::from_millis(1);
/// Messages of other processes that a tick takes at most.
const MAX_RECEIVED: usize = 64;

/// Where a component computes.
pub enum Runner {
    /// On the thread of the first one.
    Rt(Box<Component>, StageClock),
    /// On a thread of its own.
    Worker(WorkerEnd),
    /// In a process of its own.
    Process,
    /// In a program that is not a component of this project.
    External,
}

impl Runner {
    /// A component that computes on the thread of the first one.
    pub fn in_place(component: Component) -> Self {
        let clock = StageClock::new(component.stages().len());
        Runner::Rt(Box::new(component), clock)
    }
}

/// Builds a component of a run.
///
/// - `index`: its place in RUN_INFO.
///
/// # Errors
/// [`DriverError::Controller`] with the name of the component.
pub fn build(info: &RunInfo, index: usize) -> Result<Component, DriverError> {
    controller::load(&info.of_component(index)).map_err(|source| DriverError::Controller {
        robot: format!("component {}", info.components[index].name),
        source: Box::new(source),
    })
}

/// A component beside the first one.
struct Other {
    name: String,
    latency_ticks: i64,
    runner: Runner,
    /// Base tick and time of each input whose results have not arrived, oldest first.
    pending: VecDeque<(i64, i64)>,
    max_pending: usize,
}

/// The components of a run, as the thread of the first one has them.
pub struct Others {
    /// The first component, then the others.
    slots: Vec<Slot>,
    others: Vec<Other>,
    /// Messages of processes, from the publisher.
    received: MessageReceiver,
    results: Releases,
    outbox: Outbox,
    bytes: Vec<u8>,
    /// Ticks that components have missed because they were behind.
    pub missed: u64,
    /// Messages of processes that belong to no input.
    pub unknown: u64,
}

impl Others {
    /// - `slots`: of all components, the first one included.
    /// - `runners`: of those beside the first one.
    /// - `received`: messages of processes.
    pub fn new(slots: Vec<Slot>, runners: Vec<Runner>, mut received: MessageReceiver) -> Self {
        received.reserve();
        let other = |(runner, slot): (Runner, &Slot)| {
            let max_pending = MAX_BEHIND + slot.ticks_within_latency();
            let (name, latency_ticks) = (slot.name.clone(), slot.latency_ticks);
            Other { name, latency_ticks, runner, pending: VecDeque::with_capacity(max_pending + 1), max_pending }
        };
        Others {
            others: runners.into_iter().zip(slots.iter().skip(1)).map(other).collect(),
            slots,
            received,
            results: Releases::default(),
            outbox: Outbox::new(),
            bytes: Vec::with_capacity(1 << 16),
            missed: 0,
            unknown: 0,
        }
    }

    /// The slot of the first component.
    pub fn first(&mut self) -> &mut Slot {
        &mut self.slots[0]
    }

    /// Waits until the workers have computed their last inputs, and passes their results on; not in a tick. Gives up on a worker after 2 s.
    pub fn finish(&mut self, t_ns: i64, send: &mut dyn FnMut(i64, &str, &[u8])) {
        let begin = std::time::Instant::now();
        let is_open = |other: &Other| matches!(other.runner, Runner::Worker(_)) && !other.pending.is_empty();
        while self.others.iter().any(is_open) && begin.elapsed() < END_WAIT {
            for k in 0..self.others.len() {
                self.take_results(k, t_ns, send);
            }
            std::thread::sleep(END_POLL);
        }
    }

    /// Lets no component compute any more.
    pub fn stop(&mut self) {
        for other in &mut self.others {
            other.runner = Runner::External;
        }
    }

    /// Delivers an operator command to all components beside the first one.
    pub fn operator(&mut self, t_ns: i64, op: &OperatorCommand) {
        for slot in &mut self.slots[1..] {
            slot.put_operator(t_ns, op).expect("an operator command has no arrays");
        }
    }

    /// Takes arrived results, computes or hands out the ticks that are due, and delivers what is due to the first component.
    ///
    /// - `measured`: the newest measurement, and whether it arrived in this base tick.
    /// - `send`: takes the messages for the bus: time, channel, bytes.
    pub fn tick(
        &mut self,
        (base_tick, t_ns): (i64, i64),
        (measured, is_new): (&RobotState, bool),
        send: &mut dyn FnMut(i64, &str, &[u8]),
    ) {
        self.take_received(base_tick);
        for k in 0..self.others.len() {
            self.take_results(k, t_ns, send);
        }
        for slot in &mut self.slots[1..] {
            slot.has_new_state |= is_new;
        }
        for k in 0..self.others.len() {
            if self.slots[k + 1].is_due(base_tick) && !matches!(self.others[k].runner, Runner::External) {
                self.compute(k, (base_tick, t_ns), measured, send);
            }
        }
        self.deliver(0, (base_tick, t_ns));
    }

    /// Delivers what is due to a component, and states what is late.
    fn deliver(&mut self, at: usize, (base_tick, t_ns): (i64, i64)) {
        self.results.release(base_tick, t_ns, &mut self.slots);
        for other in &self.others {
            let due_tick = other.pending.front().map(|(of_tick, _)| of_tick + other.latency_ticks);
            if let Some(due_tick) = due_tick.filter(|due_tick| *due_tick <= base_tick) {
                self.slots[at].state_late(&other.name, due_tick);
            }
        }
    }

    /// Computes a tick of a component, or hands its input out.
    fn compute(
        &mut self,
        k: usize,
        (base_tick, t_ns): (i64, i64),
        measured: &RobotState,
        send: &mut dyn FnMut(i64, &str, &[u8]),
    ) {
        let at = k + 1;
        if self.others[k].pending.len() >= self.others[k].max_pending {
            self.missed += 1;
            return;
        }
        self.deliver(at, (base_tick, t_ns));
        let Others { slots, others, results, outbox, bytes, .. } = self;
        let slot = &mut slots[at];
        if slot.has_new_state {
            slot.inbox.put(channels::ROBOT_STATE, t_ns, measured).expect("arrays have the length of a decoded message");
            slot.has_new_state = false;
        }
        slot.inbox.stamp(t_ns, slot.tick);
        bytes.clear();
        slot.inbox.input().encode(bytes).expect("the delivery sets every length field");
        send(t_ns, slot.channel(channels::CONTROLLER_INPUT), bytes);
        match &mut others[k].runner {
            Runner::Rt(component, clock) => {
                clock.start();
                component.step_probed(slot.inbox.input(), outbox, clock);
                let due_tick = base_tick + slot.latency_ticks;
                for (channel, data) in outbox.iter() {
                    let channel = slots[at].channel(channel);
                    send(t_ns, channel, data);
                    if slots.iter().any(|slot| slot.listens_to(channel)) {
                        results.put(due_tick, channel, data);
                    }
                }
                let slot = &slots[at];
                bytes.clear();
                clock.timing(t_ns, slot.tick).encode(bytes).expect("one duration for each stage");
                send(t_ns, slot.channel(channels::TIMING), bytes);
            }
            Runner::Worker(worker) => {
                // A full ring is a worker that is behind, which `pending` finds first.
                if worker.send(base_tick, bytes) {
                    others[k].pending.push_back((base_tick, t_ns));
                }
            }
            Runner::Process => others[k].pending.push_back((base_tick, t_ns)),
            Runner::External => {}
        }
        let slot = &mut slots[at];
        slot.inbox.clear();
        slot.tick += 1;
    }

    /// Takes the results of a worker.
    fn take_results(&mut self, k: usize, t_ns: i64, send: &mut dyn FnMut(i64, &str, &[u8])) {
        let Others { slots, others, results, .. } = self;
        let Other { runner: Runner::Worker(worker), pending, .. } = &mut others[k] else { return };
        while let Some(message) = worker.result() {
            // In the ring, the time of a message is the base tick of its input.
            let of_tick = message.t_ns;
            if message.channel == END_OF_TICK {
                while pending.pop_front_if(|(tick, _)| *tick <= of_tick).is_some() {}
                continue;
            }
            let channel = slots[k + 1].channel(message.channel);
            send(t_ns, channel, message.data);
            if slots.iter().any(|slot| slot.listens_to(channel)) {
                results.put(of_tick + slots[k + 1].latency_ticks, channel, message.data);
            }
        }
    }

    /// Takes the messages of processes.
    fn take_received(&mut self, base_tick: i64) {
        let Others { slots, others, received, results, unknown, .. } = self;
        for _ in 0..MAX_RECEIVED {
            let Some(message) = received.pop() else { return };
            let (component, name) = channels::split(message.channel);
            let due_tick = match others.iter_mut().find(|other| other.name == component) {
                Some(Other { runner: Runner::Process, pending, latency_ticks, .. }) => {
                    let t_ns =
                        message.data.get(8..16).and_then(|bytes| Some(i64::from_be_bytes(bytes.try_into().ok()?)));
                    let Some((of_tick, _)) = pending.iter().find(|(_, t)| Some(*t) == t_ns).copied() else {
                        *unknown += 1;
                        continue;
                    };
                    // The last message of a tick.
                    if name == channels::CONTROLLER_TICK {
                        while pending.pop_front_if(|(tick, _)| *tick <= of_tick).is_some() {}
                    }
                    of_tick + *latency_ticks
                }
                Some(Other { runner: Runner::External, latency_ticks, .. }) => base_tick + *latency_ticks,
                None => base_tick,
                // Another program uses the channel of a component of this process.
                Some(_) => {
                    *unknown += 1;
                    continue;
                }
            };
            let listener = slots.iter().find_map(|slot| slot.received_name(message.channel));
            if let Some(channel) = listener {
                results.put(due_tick, channel, message.data);
            }
        }
    }
}
