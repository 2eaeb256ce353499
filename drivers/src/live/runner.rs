//! The real-time thread: wakes by the absolute clock, takes what came, steps the controller, sends the command.

use super::Hardware;
use super::clock::{Beat, now_ns, sleep_until, wall_ns};
use controller::{Controller, Outbox, Probe, Stage};
use lcmtypes::{ControllerInput, Message, OperatorCommand, Timing, channels};
use replay::record::BytesIn;
use rtrb::Consumer;
use std::sync::atomic::{AtomicBool, Ordering};

/// Ticks with which a run ends, in which the operator is taken to ask for the safe state: the last command that a driver hears is to damp.
pub const LAST_TICKS: i64 = 20;

/// What another thread wants of the real-time thread; carried out at the beginning of the next tick, in order.
#[derive(Clone, Debug)]
pub enum Call {
    /// Follow an operator command, which arrived at `t_ns`.
    Operator {
        /// Arrival, ns.
        t_ns: i64,
        /// The command.
        command: OperatorCommand,
    },
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
}

/// All that the real-time thread works with.
pub struct Runner {
    controller: Box<dyn Controller>,
    hardware: Box<dyn Hardware>,
    calls: Consumer<Call>,
    ring: BytesIn,
    beat: Beat,
    input: ControllerInput,
    outbox: Outbox,
    bytes: Vec<u8>,
    clock: StageClock,
    done: Ticked,
}

impl Runner {
    /// Takes everything together, and allocates whatever a tick needs.
    pub fn new(
        controller: Box<dyn Controller>,
        hardware: Box<dyn Hardware>,
        calls: Consumer<Call>,
        ring: BytesIn,
        beat: Beat,
    ) -> Self {
        let mut input = ControllerInput { running: 1, ..ControllerInput::default() };
        input.op.seq = -1;
        Runner {
            controller,
            hardware,
            calls,
            ring,
            beat,
            input,
            outbox: Outbox::new(),
            bytes: Vec::with_capacity(1 << 16),
            clock: StageClock::default(),
            done: Ticked::default(),
        }
    }

    /// Runs for `ticks` ticks or until `stop` is set; the last [`LAST_TICKS`] lead to the safe state.
    pub fn run(&mut self, ticks: i64, stop: &AtomicBool) -> Ticked {
        let mut due_ns = self.beat.after(now_ns());
        let mut end = ticks;
        while self.done.ticks < end {
            if stop.load(Ordering::Relaxed) {
                end = end.min(self.done.ticks + LAST_TICKS);
            }
            sleep_until(due_ns);
            let wake_ns = now_ns();
            let deadline_ns = due_ns + self.beat.period_ns;
            // Woken so late, it would act on a measurement from before. The next tick is near, and finds a fresh one.
            if wake_ns < deadline_ns {
                self.tick(wake_ns, deadline_ns, end - self.done.ticks <= LAST_TICKS);
            }
            let next_ns = self.beat.after(now_ns()).max(deadline_ns);
            let ticked = u64::from(wake_ns < deadline_ns);
            self.done.skipped += ((next_ns - due_ns) / self.beat.period_ns).cast_unsigned() - ticked;
            due_ns = next_ns;
        }
        self.done.unsent = self.hardware.unsent();
        self.done
    }

    fn tick(&mut self, wake_ns: i64, deadline_ns: i64, is_last: bool) {
        let wall_ns = wall_ns();
        self.hardware.receive(&mut self.input.state);
        while let Ok(call) = self.calls.pop() {
            match call {
                Call::Operator { t_ns, command } => (self.input.t_op_ns, self.input.op) = (t_ns, command),
            }
        }
        if is_last {
            (self.input.t_op_ns, self.input.op.mode) = (wake_ns, OperatorCommand::MODE_DAMPING);
        }
        (self.input.t_ns, self.input.tick) = (wake_ns, self.done.ticks);

        self.clock.start();
        self.controller.step_probed(&self.input, &mut self.outbox, &mut self.clock);
        if let Some(command) = self.outbox.get(channels::ROBOT_COMMAND) {
            self.hardware.send(command);
        }
        let end_ns = now_ns();
        self.done.late += u64::from(end_ns > deadline_ns);

        self.hand_over_tick();
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
