//! Starts and ends the two threads of a controller process.

use super::calls;
use super::clock::TickSchedule;
use super::publisher::{Publisher, PublisherReport};
use super::realtime_loop::{End, Ending, RealtimeLoop, Ticked};
use super::{Granted, Hardware, Lateness, RealtimeParams};
use crate::DriverError;
use crate::command_mux::CommandMux;
use controller::Controller;
use lcmtypes::bus::Bus;
use lcmtypes::{RunInfo, channels};
use replay::record::byte_ring;
use std::sync::Arc;
use std::sync::mpsc;
use std::thread::JoinHandle;

/// Bytes that may wait for the carrier: more than a second of a quadruped's messages.
const RING_BYTES: usize = 1 << 24;
/// Real-time priority of the carrier: before whatever else the machine does, behind all that is in control.
const CARRIER_PRIORITY: u8 = 1;

/// What to run.
pub struct Plan {
    /// The controllers as one, as RUN_INFO describes it.
    pub controller: Box<dyn Controller>,
    /// Their names, and whether each starts at once; those that RUN_INFO names, in its order.
    pub controllers: Vec<(String, bool)>,
    /// The robot.
    pub hardware: Box<dyn Hardware>,
    /// Where messages go to and wishes come from.
    pub bus: Box<dyn Bus>,
    /// Who may command.
    pub operators: CommandMux,
    /// The run's description; the executor fills in time and real-time settings.
    pub info: RunInfo,
    /// When ticks are due.
    pub beat: TickSchedule,
    /// Ticks after which it stops by itself.
    pub ticks: Option<i64>,
    /// What is asked of the system.
    pub realtime: RealtimeParams,
}

/// How a run went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// The real-time thread.
    pub ticked: Ticked,
    /// The carrier.
    pub carried: PublisherReport,
}

impl Summary {
    /// Something is missing on the bus, or never came to the hardware.
    pub fn is_lossy(&self) -> bool {
        self.ticked.not_carried + self.ticked.unsent + self.carried.unpublished + self.carried.not_called > 0
    }
}

/// A run in progress; stops when dropped.
pub struct Executor {
    ending: Arc<Ending>,
    granted: Granted,
    runner: Option<JoinHandle<Ticked>>,
    carrier: Option<JoinHandle<PublisherReport>>,
}

impl Executor {
    /// Starts both threads. Returns once the real-time settings are known.
    ///
    /// # Errors
    /// If the bus takes no subscription, or there can be no further thread.
    pub fn start(plan: Plan) -> Result<Self, DriverError> {
        let Plan { controller, controllers, hardware, mut bus, operators, mut info, beat, ticks, realtime } = plan;
        bus.subscribe(channels::EXECUTOR_COMMAND)?;
        bus.subscribe(channels::PARAMETER_REQUEST)?;
        operators.sources().iter().try_for_each(|source| bus.subscribe(&source.channel))?;
        let ending = Arc::<Ending>::default();
        let (ring_in, ring_out) = byte_ring(RING_BYTES);
        let (caller, called) = calls();
        let (granted_in, granted_out) = mpsc::channel();
        let running = controllers.iter().enumerate().fold(0, |bits, (k, (_, starts))| bits | i64::from(*starts) << k);
        let mut runner = RealtimeLoop::new(controller, running, hardware, called, ring_in, beat);
        let runner = spawn("real-time", {
            let (ending, realtime) = (ending.clone(), realtime.clone());
            move || {
                // Whoever started us waits for it.
                let _ = granted_in.send(realtime.apply());
                drop(granted_in);
                runner.run(ticks.unwrap_or(i64::MAX), &ending)
            }
        })?;
        let granted = granted_out.recv().unwrap_or_default();
        info.realtime = format!("live, every {} us, {}", beat.period_ns / 1000, granted.text());
        let names = controllers.into_iter().map(|(name, _)| name).collect();
        let lateness = Lateness::new(beat.period_ns);
        let carrier = Publisher::new((ring_out, caller), bus, operators, info, names, lateness);
        // On a busy machine it must not fall behind by more than a log's reader puts in order again.
        let ahead = RealtimeParams { priority: realtime.priority.min(CARRIER_PRIORITY), ..RealtimeParams::none() };
        let carrier = spawn("carrier", move || {
            ahead.apply();
            carrier.run()
        })?;
        Ok(Executor { ending, granted, runner: Some(runner), carrier: Some(carrier) })
    }

    /// What the system granted.
    pub fn granted(&self) -> &Granted {
        &self.granted
    }

    /// The run has ended by itself. Without its carrier there is neither operator nor log: the robot sits down then.
    pub fn is_finished(&self) -> bool {
        if self.carrier.as_ref().is_some_and(JoinHandle::is_finished) {
            self.sit_down();
        }
        self.runner.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Lets a robot that stands sit down; then it ends by itself.
    pub fn sit_down(&self) {
        self.ending.ask(End::Sit);
    }

    /// Damps the joints, ends, and waits until every message is out.
    pub fn finish(mut self) -> Summary {
        self.close()
    }

    fn close(&mut self) -> Summary {
        self.ending.ask(End::Damp);
        let ticked = self.runner.take().map(join).unwrap_or_default();
        Summary { ticked, carried: self.carrier.take().map(join).unwrap_or_default() }
    }
}

impl Drop for Executor {
    fn drop(&mut self) {
        self.close();
    }
}

fn spawn<T: Send + 'static>(
    what: &'static str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>, DriverError> {
    let thread = std::thread::Builder::new().name(what.to_owned()).spawn(work);
    thread.map_err(|source| DriverError::Thread { what, source })
}

fn join<T>(thread: JoinHandle<T>) -> T {
    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}
