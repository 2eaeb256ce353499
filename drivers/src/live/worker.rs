//! A component on a thread of its own.

use super::RealtimeParams;
use super::message_ring::{MessageReceiver, MessageSender, RingMessage, message_ring};
use crate::DriverError;
use crate::stage_clock::StageClock;
use controller::{Component, Outbox};
use lcmtypes::{ControllerInput, Message, channels};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread::{JoinHandle, Thread};
use std::time::Duration;

/// Channel of the message that ends the results of a tick.
pub const END_OF_TICK: &str = "";
/// Capacity of each ring, bytes: several ticks of a robot with 45 joints.
const RING_BYTES: usize = 1 << 21;
/// Longest wait for the next input, so that the thread notices the end of the run.
const WAIT: Duration = Duration::from_millis(20);

/// The end of the real-time thread.
pub struct WorkerEnd {
    inputs: MessageSender,
    results: MessageReceiver,
    thread: Thread,
}

impl WorkerEnd {
    /// Hands an input out; false if the thread is so far behind that its ring is full. Allocates nothing.
    ///
    /// - `base_tick`: comes back with the results.
    pub fn send(&mut self, base_tick: i64, input: &[u8]) -> bool {
        let sent = self.inputs.push(base_tick, channels::CONTROLLER_INPUT, input);
        self.thread.unpark();
        sent
    }

    /// The next result: `t_ns` is the base tick of its input.
    pub fn result(&mut self) -> Option<RingMessage<'_>> {
        self.results.pop()
    }
}

/// Starts the thread of a component. It ends when the real-time thread has ended.
///
/// - `settings`: real-time settings to request for it.
/// - `pause`: wait before each tick, to try out late results.
///
/// # Errors
/// [`DriverError::Thread`]
pub fn start(
    component: Component,
    settings: RealtimeParams,
    pause: Duration,
) -> Result<(WorkerEnd, JoinHandle<Option<String>>), DriverError> {
    let (inputs, inputs_out) = message_ring(RING_BYTES);
    let (results_in, mut results) = message_ring(RING_BYTES);
    results.reserve();
    let work = move || {
        settings.apply();
        Worker::new(component, inputs_out, results_in, pause).run()
    };
    let thread = std::thread::Builder::new().name("worker".to_owned()).spawn(work);
    let thread = thread.map_err(|source| DriverError::Thread { what: "worker", source })?;
    Ok((WorkerEnd { inputs, results, thread: thread.thread().clone() }, thread))
}

struct Worker {
    component: Component,
    inputs: MessageReceiver,
    results: MessageSender,
    pause: Duration,
    input: ControllerInput,
    outbox: Outbox,
    clock: StageClock,
    bytes: Vec<u8>,
}

impl Worker {
    fn new(component: Component, inputs: MessageReceiver, results: MessageSender, pause: Duration) -> Self {
        Worker {
            clock: StageClock::new(component.stages().len()),
            component,
            inputs,
            results,
            pause,
            input: ControllerInput::default(),
            outbox: Outbox::new(),
            bytes: Vec::new(),
        }
    }

    /// Runs until the real-time thread has ended. Returns the message of a panic of the controller: its results are missing from then on.
    fn run(mut self) -> Option<String> {
        loop {
            let has_ended = self.inputs.is_abandoned();
            let Some(message) = self.inputs.pop() else {
                if has_ended {
                    return None;
                }
                std::thread::park_timeout(WAIT);
                continue;
            };
            let base_tick = message.t_ns;
            self.input.decode_into(message.data).expect("the real-time thread encoded it");
            if !self.pause.is_zero() {
                std::thread::sleep(self.pause);
            }
            let Worker { component, input, outbox, clock, results, bytes, .. } = &mut self;
            clock.start();
            if let Err(panic) = catch_unwind(AssertUnwindSafe(|| component.step_probed(input, outbox, clock))) {
                return Some(super::realtime_loop::text_of(&*panic).to_owned());
            }
            bytes.clear();
            clock.timing(input.t_ns, input.tick).encode(bytes).expect("one duration for each stage");
            for (channel, data) in outbox.iter().chain([(channels::TIMING, &bytes[..])]) {
                results.push(base_tick, channel, data);
            }
            results.push(base_tick, END_OF_TICK, &[]);
        }
    }
}
