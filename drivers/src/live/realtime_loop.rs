//! The real-time thread: it wakes by the absolute clock, takes the newest measurement, steps the controller and sends the command.

use super::Hardware;
use super::call::{Call, CallReceiver, CallResult, Handover, HandoverError, Switch};
use super::clock::{TickSchedule, now_ns, sleep_until};
use super::message_ring::MessageSender;
use crate::components::Others;
use crate::stage_clock::StageClock;
use controller::handover::take_over;
use controller::runtime::empty_state;
use controller::{Component, Delivery, Outbox};
use lcmtypes::{ControllerTick, Event, Message, OperatorCommand, RobotState, Running, channels};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};

/// Last ticks of a run, in which the executor requests damping: the last commands that a driver receives damp the joints.
pub const LAST_TICKS: i64 = 20;
/// Longest time for sitting down before the run ends, ns.
const SIT_NS: i64 = 15_000_000_000;
/// Longest time until the robot begins to sit down, ns: it may have steps to finish. Some controllers cannot sit.
const SIT_BEGINS_NS: i64 = 3_000_000_000;
/// Messages of a tick that are left for the executor's own, beside those of other components: its request, changes of the running controllers.
const RESERVED: usize = 4;
/// Consecutive ticks that may take longer than a period.
const OVERRUNS: u32 = 3;

/// Request to end a run, set from any thread.
#[derive(Debug, Default)]
pub struct Ending {
    end: AtomicU8,
    cause: AtomicU8,
    /// Measurements that the hardware did not use, for the publisher's reports.
    pub(super) refused_states: AtomicU64,
}

/// Why a run ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum EndCause {
    /// Its length is over.
    Length,
    /// SIGINT: Ctrl-C.
    Interrupt,
    /// SIGTERM.
    Terminate,
    /// SIGHUP: the terminal was closed.
    HangUp,
    /// The process that started the run has died.
    ParentDied,
    /// The publisher thread has died: the run has neither an operator nor a log.
    PublisherDied,
    /// Another run, which started earlier, is active.
    SecondRun,
}

impl EndCause {
    const ALL: [EndCause; 7] = [
        EndCause::Length,
        EndCause::Interrupt,
        EndCause::Terminate,
        EndCause::HangUp,
        EndCause::ParentDied,
        EndCause::PublisherDied,
        EndCause::SecondRun,
    ];

    /// Text for an EVENT.
    pub fn text(self) -> &'static str {
        match self {
            EndCause::Length => "length of the run reached",
            EndCause::Interrupt => "SIGINT received",
            EndCause::Terminate => "SIGTERM received",
            EndCause::HangUp => "SIGHUP received (terminal closed)",
            EndCause::ParentDied => "the process that started the run has died",
            EndCause::PublisherDied => "the publisher thread has died",
            EndCause::SecondRun => "another run on this network started earlier",
        }
    }
}

/// How a run is to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum End {
    /// The run goes on.
    No,
    /// Sit down if the robot stands, then end.
    Sit,
    /// Damp the joints and end.
    Damp,
}

impl Ending {
    /// Requests an end. A more urgent request stays in force; the cause is that of the first request.
    pub fn request(&self, end: End, cause: EndCause) {
        if self.requested() == End::No {
            self.cause.store(cause as u8, Ordering::Relaxed);
        }
        self.end.fetch_max(end as u8, Ordering::Relaxed);
    }

    /// Cause of the first request; [`EndCause::Length`] if there was none.
    pub fn cause(&self) -> EndCause {
        EndCause::ALL[usize::from(self.cause.load(Ordering::Relaxed))]
    }

    fn requested(&self) -> End {
        match self.end.load(Ordering::Relaxed) {
            0 => End::No,
            1 => End::Sit,
            _ => End::Damp,
        }
    }
}

/// Result of a real-time thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RealtimeReport {
    /// Ticks.
    pub ticks: i64,
    /// Ticks whose command was ready after the next tick was due.
    pub late: u64,
    /// Ticks skipped because the tick before took too long or the thread woke too late.
    pub skipped: u64,
    /// Messages dropped because the ring to the publisher was full.
    pub not_carried: u64,
    /// Ticks that components have missed because they were behind.
    pub missed: u64,
    /// Messages on the channels of components that belong to no input of theirs.
    pub unknown_results: u64,
    /// Commands that the hardware could not send.
    pub unsent: u64,
    /// Ticks and handovers in which a controller panicked.
    pub panics: u64,
    /// Times that all controllers were stopped because of consecutive overruns.
    pub overrun_stops: u64,
}

/// Data of the real-time thread.
pub struct RealtimeLoop {
    component: Component,
    hardware: Box<dyn Hardware>,
    calls: CallReceiver,
    ring: MessageSender,
    schedule: TickSchedule,
    others: Others,
    run_id: i64,
    /// The newest measurement.
    robot: RobotState,
    /// The newest command that was delivered.
    op: OperatorCommand,
    /// Bit k: the k-th controller runs; and the bits that were delivered last.
    running: i64,
    delivered_running: Option<i64>,
    outbox: Outbox,
    bytes: Vec<u8>,
    /// Decoding buffer.
    status: ControllerTick,
    /// `controller_tick_t` MODE_* of the last tick; `None` before the first one.
    mode: Option<i8>,
    /// Snapshot buffer for a handover.
    state: Vec<u8>,
    clock: StageClock,
    /// Consecutive ticks whose controllers took longer than a period.
    overruns: u32,
    report: RealtimeReport,
}

impl RealtimeLoop {
    /// Allocates all that a tick needs. `run_id`: as in RUN_INFO. Bit k of `running`: the k-th controller runs from the first tick on.
    pub fn new(
        component: Component,
        others: Others,
        (run_id, running): (i64, i64),
        hardware: Box<dyn Hardware>,
        calls: CallReceiver,
        ring: MessageSender,
        schedule: TickSchedule,
    ) -> Self {
        RealtimeLoop {
            clock: StageClock::new(component.stages().len()),
            status: ControllerTick {
                digest: Vec::with_capacity(component.stages().len()),
                ..ControllerTick::default()
            },
            component,
            hardware,
            calls,
            ring,
            schedule,
            others,
            run_id,
            robot: empty_state(),
            op: OperatorCommand { seq: -1, ..OperatorCommand::default() },
            running,
            delivered_running: None,
            outbox: Outbox::new(),
            bytes: Vec::with_capacity(1 << 16),
            mode: None,
            state: Vec::with_capacity(1 << 16),
            overruns: 0,
            report: RealtimeReport::default(),
        }
    }

    /// Runs for `ticks` ticks, or until `ending` requests an end. The last `LAST_TICKS` damp the joints.
    pub fn run(&mut self, ticks: i64, ending: &Ending) -> RealtimeReport {
        let mut due_ns = self.schedule.after(now_ns());
        let (mut end, mut sit_since_ns) = (ticks, None);
        while self.report.ticks < end {
            sleep_until(due_ns);
            let wake_ns = now_ns();
            let deadline_ns = due_ns + self.schedule.period_ns;
            ending.refused_states.store(self.hardware.refused(), Ordering::Relaxed);
            let mut instead = None;
            match ending.requested() {
                End::No => {}
                End::Sit if self.stands() && self.may_sit(wake_ns - *sit_since_ns.get_or_insert(wake_ns)) => {
                    // IDLE takes effect once the robot lies.
                    let sits = self.mode == Some(ControllerTick::MODE_SIT);
                    instead = Some(if sits { OperatorCommand::MODE_IDLE } else { OperatorCommand::MODE_SIT });
                }
                _ => end = end.min(self.report.ticks + LAST_TICKS),
            }
            if end - self.report.ticks <= LAST_TICKS {
                let at_rest = self.mode == Some(ControllerTick::MODE_IDLE);
                instead = Some(if at_rest { OperatorCommand::MODE_IDLE } else { OperatorCommand::MODE_DAMPING });
            }
            // A tick that starts after its deadline is skipped: the next one is near and gets a newer measurement.
            if wake_ns < deadline_ns {
                self.tick(wake_ns, deadline_ns, instead);
            }
            let next_ns = self.schedule.after(now_ns()).max(deadline_ns);
            let ticked = u64::from(wake_ns < deadline_ns);
            self.report.skipped += ((next_ns - due_ns) / self.schedule.period_ns).cast_unsigned() - ticked;
            due_ns = next_ns;
        }
        let Self { others, ring, report, .. } = self;
        others.finish(now_ns(), &mut |t_ns, channel, data| {
            report.not_carried += u64::from(!ring.push(t_ns, channel, data));
        });
        self.report.unsent = self.hardware.unsent();
        (self.report.missed, self.report.unknown_results) = (self.others.missed, self.others.unknown);
        self.report
    }

    /// Whether the robot stands, walks, stands up or sits down.
    fn stands(&self) -> bool {
        !matches!(self.mode, None | Some(ControllerTick::MODE_IDLE | ControllerTick::MODE_DAMPING))
    }

    /// Whether there is time left to sit down, `since_ns` after the request.
    fn may_sit(&self, since_ns: i64) -> bool {
        let sits = self.mode == Some(ControllerTick::MODE_SIT);
        since_ns < if sits { SIT_NS } else { SIT_BEGINS_NS }
    }

    /// One tick. `instead`: mode that the executor requests in place of the operator; an emergency stop stays in force.
    fn tick(&mut self, wake_ns: i64, deadline_ns: i64, instead: Option<i8>) {
        let base_tick = self.report.ticks;
        self.delivery().begin(wake_ns, base_tick);
        let is_new = self.hardware.receive(&mut self.robot);
        if is_new {
            let Self { others, robot, .. } = self;
            deliver(&mut others.first().inbox, channels::ROBOT_STATE, wake_ns, robot);
        }
        // Calls beyond that wait for the next tick.
        let reserved = RESERVED + self.others.first().receives().len();
        while self.delivery().room() > reserved
            && let Some(call) = self.calls.next()
        {
            match call {
                Call::Operator { t_ns, command } => {
                    let is_stop = |op: &OperatorCommand| op.mode == OperatorCommand::MODE_DAMPING;
                    let begins_stop = is_stop(&command) && !is_stop(&self.op);
                    self.deliver_operator(t_ns, command);
                    // Later calls wait for the next tick, so that a tick consumes the emergency stop even if it is cleared at once.
                    if begins_stop {
                        break;
                    }
                }
                Call::Driver(id) => self.hardware.listen_to(Some(id)),
                Call::Switch(switch) => self.switch(switch),
                Call::Handover(handover) => self.hand_over(handover),
            }
        }
        let is_stopped = self.op.mode == OperatorCommand::MODE_DAMPING;
        if let Some(mode) = instead.filter(|mode| !is_stopped || *mode == OperatorCommand::MODE_DAMPING) {
            let (sender_id, seq) = (self.run_id, self.op.seq.max(0));
            self.deliver_operator(wake_ns, OperatorCommand { sender_id, mode, seq, ..OperatorCommand::default() });
        }
        self.deliver_running();
        let Self { others, robot, ring, report, .. } = self;
        let mut send = |t_ns: i64, channel: &str, data: &[u8]| {
            report.not_carried += u64::from(!ring.push(t_ns, channel, data));
        };
        let stepped = catch_unwind(AssertUnwindSafe(|| {
            others.tick((report.ticks, wake_ns), (robot, is_new), &mut send);
        }));
        if let Err(panic) = stepped {
            self.others.stop();
            self.running = 0;
            self.deliver_running();
            self.report.panics += 1;
            self.report_error(format!("a component panicked, all controllers stopped: {}", text_of(&*panic)));
        }

        self.step();
        if let Some(command) = self.outbox.get(channels::ROBOT_COMMAND) {
            self.hardware.send(command);
        }
        let end_ns = now_ns();
        self.report.late += u64::from(end_ns > deadline_ns);
        self.pass_tick();
        self.stop_overrun(end_ns - wake_ns);

        let timing = self.clock.timing(wake_ns, self.report.ticks);
        (timing.wake_ns, timing.end_ns, timing.deadline_ns) = (wake_ns, end_ns, deadline_ns);
        encode(&mut self.bytes, timing);
        self.pass_bytes(channels::TIMING);
        self.report.ticks += 1;
    }

    fn deliver_operator(&mut self, t_arrival_ns: i64, command: OperatorCommand) {
        deliver(self.delivery(), channels::OPERATOR_COMMAND, t_arrival_ns, &command);
        self.others.operator(t_arrival_ns, &command);
        self.op = command;
    }

    /// Delivers which controllers run, if it has changed.
    fn deliver_running(&mut self) {
        if self.delivered_running != Some(self.running) {
            self.delivered_running = Some(self.running);
            let (t_ns, running) = (self.t_ns(), self.running);
            deliver(self.delivery(), channels::RUNNING, t_ns, &Running { t_ns, running });
        }
    }

    /// Time of the present tick, ns.
    fn t_ns(&mut self) -> i64 {
        self.delivery().input().t_ns
    }

    /// The messages of the first component's tick.
    fn delivery(&mut self) -> &mut Delivery {
        &mut self.others.first().inbox
    }

    /// Starts or stops a controller.
    fn switch(&mut self, switch: Switch) {
        let running = &mut self.running;
        let before = std::mem::replace(
            running,
            if switch.start { *running | 1 << switch.controller } else { *running & !(1 << switch.controller) },
        );
        let (t_ns, tick, changed) = (self.t_ns(), self.report.ticks, self.running != before);
        // A controller that starts continues from the last command: the handover.
        let Self { others, outbox, .. } = self;
        if changed
            && switch.start
            && let Some(last) = outbox.get(channels::ROBOT_COMMAND)
        {
            others.first().inbox.put_newest(channels::ROBOT_COMMAND, t_ns, last);
        }
        self.put_result(CallResult::Switched { switch, t_ns, tick, changed });
    }

    /// Replaces the controller by one with other parameters before this tick's step, and logs it before this tick's input.
    fn hand_over(&mut self, mut handover: Box<Handover>) {
        let t_ns = self.t_ns();
        let Handover { controller: next, change, refused, .. } = &mut *handover;
        let (now, state) = (&self.component, &mut self.state);
        match catch_unwind(AssertUnwindSafe(|| take_over(now, next, state))) {
            Ok(Ok(())) => {
                std::mem::swap(&mut self.component, next);
                (change.t_ns, change.tick) = (t_ns, self.report.ticks);
                encode(&mut self.bytes, change);
                self.pass_bytes(channels::PARAMETER_CHANGE);
            }
            Ok(Err(error)) => *refused = Some(error.into()),
            Err(panic) => {
                *refused = Some(HandoverError::Panicked);
                let running = std::mem::take(&mut self.running);
                self.report.panics += 1;
                self.report_error(format!(
                    "controller panicked in a handover, all controllers stopped: {}; running was {running}",
                    text_of(&*panic)
                ));
            }
        }
        self.put_result(CallResult::Handover(handover));
    }

    /// Returns a result to the publisher. Were the ring full, the request would stay unanswered until the run ends.
    fn put_result(&mut self, result: CallResult) {
        self.report.not_carried += u64::from(self.calls.put_result(result).is_some());
    }

    /// Steps the controllers. If one panics, the tick is computed again with no controller running, which damps the joints; that second result is
    /// logged, and a replay computes the same.
    fn step(&mut self) {
        self.clock.start();
        let RealtimeLoop { component, others, outbox, clock, .. } = self;
        let delivery = &others.first().inbox;
        // A panic leaves only scratch memory, and state that the next start resets, half written.
        let stepped = catch_unwind(AssertUnwindSafe(|| component.step_probed(delivery.input(), outbox, clock)));
        if let Err(panic) = stepped {
            let running = std::mem::take(&mut self.running);
            self.deliver_running();
            let RealtimeLoop { component, others, outbox, clock, .. } = self;
            let delivery = &others.first().inbox;
            outbox.clear();
            let damped = catch_unwind(AssertUnwindSafe(|| component.step_probed(delivery.input(), outbox, clock)));
            // If this fails too, no command is sent and the driver's watchdog damps.
            if damped.is_err() {
                outbox.clear();
            }
            self.report.panics += 1;
            self.report_error(format!(
                "controller panicked, all controllers stopped: {}; to reproduce, replay this tick with running = {running}",
                text_of(&*panic)
            ));
        }
        let RealtimeLoop { outbox, status, mode, .. } = self;
        let decoded = outbox.get(channels::CONTROLLER_TICK).is_some_and(|bytes| status.decode_into(bytes).is_ok());
        *mode = decoded.then_some(status.mode);
    }

    /// Stops all controllers after several consecutive ticks that took longer than a period.
    fn stop_overrun(&mut self, took_ns: i64) {
        let is_long = took_ns > self.schedule.period_ns && self.running != 0;
        self.overruns = if is_long { self.overruns + 1 } else { 0 };
        if self.overruns > OVERRUNS {
            self.overruns = 0;
            self.report.overrun_stops += 1;
            self.running = 0;
            self.report_error(format!(
                "all controllers stopped: {} consecutive ticks took longer than a period",
                OVERRUNS + 1
            ));
        }
    }

    /// Sends an EVENT. This allocates; the controllers have been stopped by then.
    fn report_error(&mut self, text: String) {
        let (t_ns, tick) = (self.t_ns(), self.report.ticks);
        let (level, source) = (Event::LEVEL_ERROR, "executor".to_owned());
        let event = Event { t_ns, tick, level, source, text, ..Event::default() };
        encode(&mut self.bytes, &event);
        self.pass_bytes(channels::EVENT);
    }

    /// Passes input and outputs of the tick to the publisher.
    fn pass_tick(&mut self) {
        let t_ns = self.t_ns();
        encode(&mut self.bytes, self.others.first().inbox.input());
        self.pass_bytes(channels::CONTROLLER_INPUT);
        for (channel, bytes) in self.outbox.iter() {
            if channel != channels::ROBOT_COMMAND || !self.hardware.is_on_bus() {
                self.report.not_carried += u64::from(!self.ring.push(t_ns, channel, bytes));
            }
        }
    }

    /// Passes the encoded message in `bytes` to the publisher.
    fn pass_bytes(&mut self, channel: &str) {
        let t_ns = self.t_ns();
        self.report.not_carried += u64::from(!self.ring.push(t_ns, channel, &self.bytes));
    }
}

/// Delivers a message; there is always room: the loop leaves [`RESERVED`].
fn deliver(delivery: &mut Delivery, channel: &str, t_arrival_ns: i64, message: &impl Message) {
    let delivered = delivery.put(channel, t_arrival_ns, message);
    delivered.expect("arrays have the length that a decoder or this module gave them");
}

/// Message of a panic.
pub(super) fn text_of(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message")
}

fn encode(bytes: &mut Vec<u8>, message: &impl Message) {
    bytes.clear();
    message.encode(bytes).expect("arrays have the length that a decoder or this module gave them");
}
