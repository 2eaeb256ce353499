//! The real-time thread: wakes by the absolute clock, takes what came, steps the controller, sends the command.

use super::Hardware;
use super::call::{Call, Called, Handover};
use super::clock::{TickSchedule, now_ns, sleep_until, wall_ns};
use super::hardware::empty_state;
use controller::handover::take_over;
use controller::{Controller, Outbox, Probe, Stage};
use lcmtypes::{ControllerInput, ControllerTick, Event, Message, OperatorCommand, Timing, channels};
use replay::record::BytesIn;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU8, Ordering};

/// Ticks with which a run ends, in which the operator is taken to ask for the safe state: the last command that a driver hears is to damp.
pub const LAST_TICKS: i64 = 20;
/// How long a robot that is to sit down before the end may take, ns.
const SIT_NS: i64 = 15_000_000_000;
/// How long until it sits down at all: it may have steps to finish; some controllers cannot sit.
const SIT_BEGINS_NS: i64 = 3_000_000_000;
/// Ticks in a row that may take longer than a period.
const OVERRUNS: u32 = 3;

/// How a run is to end, told from any thread.
#[derive(Debug, Default)]
pub struct Ending(AtomicU8);

/// What is asked of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum End {
    /// To go on.
    No,
    /// To sit down, if the robot stands, and then to end.
    Sit,
    /// To damp the joints and to end.
    Damp,
}

impl Ending {
    /// Asks for an end; what is more urgent stays.
    pub fn ask(&self, end: End) {
        self.0.fetch_max(end as u8, Ordering::Relaxed);
    }

    fn asked(&self) -> End {
        match self.0.load(Ordering::Relaxed) {
            0 => End::No,
            1 => End::Sit,
            _ => End::Damp,
        }
    }
}

/// What a real-time thread has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ticked {
    /// Ticks.
    pub ticks: i64,
    /// Ticks whose command was ready after the next one was due.
    pub late: u64,
    /// Ticks left out, because the one before took too long or the thread was woken too late.
    pub skipped: u64,
    /// Messages that did not fit into the ring.
    pub not_carried: u64,
    /// Commands that the hardware could not send.
    pub unsent: u64,
    /// Ticks in which a controller panicked.
    pub panics: u64,
}

/// All that the real-time thread works with.
pub struct RealtimeLoop {
    controller: Box<dyn Controller>,
    hardware: Box<dyn Hardware>,
    calls: Called,
    ring: BytesIn,
    beat: TickSchedule,
    input: ControllerInput,
    outbox: Outbox,
    bytes: Vec<u8>,
    /// A state on its way from controller to controller.
    state: Vec<u8>,
    clock: StageClock,
    /// Ticks in a row whose controllers took longer than a period.
    overruns: u32,
    done: Ticked,
}

impl RealtimeLoop {
    /// Takes everything together, and allocates whatever a tick needs. Bit k of `running`: the k-th controller starts at once.
    pub fn new(
        controller: Box<dyn Controller>,
        running: i64,
        hardware: Box<dyn Hardware>,
        calls: Called,
        ring: BytesIn,
        beat: TickSchedule,
    ) -> Self {
        let mut input = ControllerInput { running, state: empty_state(), ..ControllerInput::default() };
        input.op.seq = -1;
        RealtimeLoop {
            controller,
            hardware,
            calls,
            ring,
            beat,
            input,
            outbox: Outbox::new(),
            bytes: Vec::with_capacity(1 << 16),
            state: Vec::with_capacity(1 << 16),
            clock: StageClock::default(),
            overruns: 0,
            done: Ticked::default(),
        }
    }

    /// Runs for `ticks` ticks, of which the last `LAST_TICKS` lead to the safe state, or until `ending` asks for an end.
    pub fn run(&mut self, ticks: i64, ending: &Ending) -> Ticked {
        let mut due_ns = self.beat.after(now_ns());
        let (mut end, mut sit_since_ns) = (ticks, None);
        while self.done.ticks < end {
            sleep_until(due_ns);
            let wake_ns = now_ns();
            let deadline_ns = due_ns + self.beat.period_ns;
            let mut instead = None;
            match ending.asked() {
                End::No => {}
                End::Sit if self.stands() && self.may_sit(wake_ns - *sit_since_ns.get_or_insert(wake_ns)) => {
                    // Followed once it lies.
                    let sits = self.mode() == Some(ControllerTick::MODE_SIT);
                    instead = Some(if sits { OperatorCommand::MODE_IDLE } else { OperatorCommand::MODE_SIT });
                }
                _ => end = end.min(self.done.ticks + LAST_TICKS),
            }
            if end - self.done.ticks <= LAST_TICKS {
                let at_rest = self.mode() == Some(ControllerTick::MODE_IDLE);
                instead = Some(if at_rest { OperatorCommand::MODE_IDLE } else { OperatorCommand::MODE_DAMPING });
            }
            // Woken so late, it would act on a measurement from before. The next tick is near, and finds a fresh one.
            if wake_ns < deadline_ns {
                self.tick(wake_ns, deadline_ns, instead);
            }
            let next_ns = self.beat.after(now_ns()).max(deadline_ns);
            let ticked = u64::from(wake_ns < deadline_ns);
            self.done.skipped += ((next_ns - due_ns) / self.beat.period_ns).cast_unsigned() - ticked;
            due_ns = next_ns;
        }
        self.done.unsent = self.hardware.unsent();
        self.done
    }

    /// `controller_tick_t` MODE_* of the last tick.
    fn mode(&self) -> Option<i8> {
        let tick = self.outbox.get(channels::CONTROLLER_TICK)?;
        tick.get(24).map(|mode| mode.cast_signed())
    }

    /// The robot is on its legs, or on its way there or back.
    fn stands(&self) -> bool {
        !matches!(self.mode(), None | Some(ControllerTick::MODE_IDLE | ControllerTick::MODE_DAMPING))
    }

    /// There is time left to sit down, `since_ns` after it was asked for.
    fn may_sit(&self, since_ns: i64) -> bool {
        let sits = self.mode() == Some(ControllerTick::MODE_SIT);
        since_ns < if sits { SIT_NS } else { SIT_BEGINS_NS }
    }

    /// One tick; `instead` is the mode that the executor asks for in the operator's place, but for an emergency stop.
    fn tick(&mut self, wake_ns: i64, deadline_ns: i64, instead: Option<i8>) {
        let wall_ns = wall_ns();
        self.hardware.receive(&mut self.input.state);
        (self.input.t_ns, self.input.tick) = (wake_ns, self.done.ticks);
        while let Some(call) = self.calls.next() {
            match call {
                Call::Operator { t_ns, command } => (self.input.t_op_ns, self.input.op) = (t_ns, command),
                Call::Start(k) => self.input.running |= 1 << k,
                Call::Stop(k) => self.input.running &= !(1 << k),
                Call::Change(handover) => self.change(handover),
            }
        }
        let is_stopped = self.input.op.mode == OperatorCommand::MODE_DAMPING;
        if let Some(mode) = instead.filter(|mode| !is_stopped || *mode == OperatorCommand::MODE_DAMPING) {
            let seq = self.input.op.seq.max(0);
            (self.input.t_op_ns, self.input.op) =
                (wake_ns, OperatorCommand { mode, seq, ..OperatorCommand::default() });
        }

        self.step();
        if let Some(command) = self.outbox.get(channels::ROBOT_COMMAND) {
            self.hardware.send(command);
        }
        let end_ns = now_ns();
        self.done.late += u64::from(end_ns > deadline_ns);
        self.hand_over_tick();
        self.stop_overrun(end_ns - self.clock.start_ns);

        let timing = Timing {
            t_ns: wake_ns,
            tick: self.input.tick,
            wall_ns,
            wake_ns,
            start_ns: self.clock.start_ns,
            end_ns,
            deadline_ns,
            stage_ns: self.clock.stage_ns,
        };
        encode(&mut self.bytes, &timing);
        self.done.not_carried += hand_over(&mut self.ring, channels::TIMING, &self.bytes);
        self.done.ticks += 1;
    }

    /// Has a controller with other parameters take over before this tick's step, and says so before this tick's input.
    fn change(&mut self, mut handover: Box<Handover>) {
        let Handover { controller: next, change, refused, .. } = &mut *handover;
        match take_over(&*self.controller, &mut **next, &mut self.state) {
            Ok(()) => {
                std::mem::swap(&mut self.controller, next);
                (change.t_ns, change.tick) = (self.input.t_ns, self.input.tick);
                encode(&mut self.bytes, change);
                self.done.not_carried += hand_over(&mut self.ring, channels::PARAMETER_CHANGE, &self.bytes);
            }
            Err(error) => *refused = Some(error),
        }
        self.calls.give_back(handover);
    }

    /// The controllers' step. One that panics takes all of them with it: the tick is computed again with none of them running, which damps the
    /// joints, and it is that tick which the log holds and a replay finds.
    fn step(&mut self) {
        self.clock.start();
        let RealtimeLoop { controller, input, outbox, clock, .. } = self;
        // What a panic leaves half done is scratch, or state that a start begins anew.
        let stepped = catch_unwind(AssertUnwindSafe(|| controller.step_probed(input, outbox, clock)));
        let Err(panic) = stepped else { return };
        let running = std::mem::take(&mut input.running);
        outbox.clear();
        let damped = catch_unwind(AssertUnwindSafe(|| controller.step_probed(input, outbox, clock)));
        // Were even that to fail, no command leaves, and the driver's watchdog damps.
        if damped.is_err() {
            outbox.clear();
        }
        self.done.panics += 1;
        self.tell(format!(
            "a controller panicked and all are stopped: {}; it happens again in a replay of this tick with running = {running}",
            text_of(&*panic)
        ));
    }

    /// Stops all controllers when they take longer than a period several times in a row: there is no control any more.
    fn stop_overrun(&mut self, took_ns: i64) {
        self.overruns = if took_ns > self.beat.period_ns && self.input.running != 0 { self.overruns + 1 } else { 0 };
        if self.overruns > OVERRUNS {
            self.overruns = 0;
            self.input.running = 0;
            self.tell(format!(
                "all controllers are stopped: {} ticks in a row took longer than a period",
                OVERRUNS + 1
            ));
        }
    }

    /// Says why the controllers were stopped. This allocates: the run is not in time any more.
    fn tell(&mut self, text: String) {
        let ControllerInput { t_ns, tick, .. } = self.input;
        let event = Event { t_ns, tick, level: Event::LEVEL_ERROR, source: "executor".to_owned(), text };
        encode(&mut self.bytes, &event);
        self.done.not_carried += hand_over(&mut self.ring, channels::EVENT, &self.bytes);
    }

    /// Input and outputs of the tick, to the carrier.
    fn hand_over_tick(&mut self) {
        encode(&mut self.bytes, &self.input);
        self.done.not_carried += hand_over(&mut self.ring, channels::CONTROLLER_INPUT, &self.bytes);
        for (channel, bytes) in self.outbox.iter() {
            if channel != channels::ROBOT_COMMAND || !self.hardware.is_on_bus() {
                self.done.not_carried += hand_over(&mut self.ring, channel, bytes);
            }
        }
    }
}

/// What a panic says.
fn text_of(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a word")
}

fn encode(bytes: &mut Vec<u8>, message: &impl Message) {
    bytes.clear();
    message.encode(bytes).expect("arrays have the length that a decoder or this module gave them");
}

/// Puts a message into the ring; 1 if there was no room.
fn hand_over(ring: &mut BytesIn, channel: &str, data: &[u8]) -> u64 {
    let length = [u8::try_from(channel.len()).expect("channels of the table are short")];
    u64::from(!ring.push(&[&length, channel.as_bytes(), data]))
}

/// Reads the clock at the ends of the stages.
#[derive(Default)]
struct StageClock {
    start_ns: i64,
    last_ns: i64,
    stage_ns: [i64; Stage::ALL.len()],
}

impl StageClock {
    fn start(&mut self) {
        self.start_ns = now_ns();
        self.last_ns = self.start_ns;
        self.stage_ns = [0; Stage::ALL.len()];
    }
}

impl Probe for StageClock {
    fn stage_done(&mut self, stage: Stage) {
        let now = now_ns();
        // A controller of several passes some stages more than once.
        self.stage_ns[stage as usize] += now - self.last_ns;
        self.last_ns = now;
    }
}
