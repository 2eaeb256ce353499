//! Starts and ends the two threads of a controller process.

use super::clock::{TickSchedule, now_ns};
use super::peers::{Finding, Peers};
use super::publisher::{Publisher, PublisherReport};
use super::realtime_loop::{End, EndCause, Ending, RealtimeLoop, RealtimeReport};
use super::worker;
use super::{Granted, Hardware, Lateness, RealtimeParams, call_ring, message_ring};
use crate::DriverError;
use crate::command_mux::CommandMux;
use crate::components::{ComponentEntry, EXTERNAL, Others, Runner, Runs, Slot, build, slots};
use crate::robot_info::of_run;
use controller::Component;
use lcmtypes::bus::Bus;
use lcmtypes::{Message, RobotInfo, RunInfo, channels, new_sender_id};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;

/// Capacity of the ring to the publisher, bytes: more than a second of a quadruped's messages.
const RING_BYTES: usize = 1 << 24;
/// Longest wait for the answer of the driver, ns.
const ANSWER_NS: i64 = 300_000_000;
/// Time between two questions for the driver, ns.
const ASK_EVERY_NS: i64 = 20_000_000;
/// Longest wait for one message.
const POLL: Duration = Duration::from_millis(20);
/// Capacity of the ring for messages of processes, bytes.
const RECEIVED_BYTES: usize = 1 << 20;
/// How far the real-time priority of a worker is below that of the real-time thread.
const WORKER_BELOW: u8 = 10;
/// Real-time priority of the publisher: above ordinary processes, below all threads in control.
const PUBLISHER_PRIORITY: u8 = 1;

/// Description of a run for [`Executor::start`].
pub struct Plan {
    /// The component that commands the robot, as in RUN_INFO.
    pub component: Component,
    /// Entries of the other components of RUN_INFO.
    pub others: Vec<ComponentEntry>,
    /// Channels that the first component listens to.
    pub receives: Vec<String>,
    /// Name of each controller, and whether it runs from the first tick on; in the order of RUN_INFO.
    pub controllers: Vec<(String, bool)>,
    /// The robot.
    pub hardware: Box<dyn Hardware>,
    /// Bus for messages and requests.
    pub bus: Box<dyn Bus>,
    /// The operators.
    pub operators: CommandMux,
    /// Description of the run; the executor sets its time, identity and real-time settings.
    pub info: RunInfo,
    /// Times at which ticks are due.
    pub schedule: TickSchedule,
    /// Number of ticks after which the run ends; `None` = no limit.
    pub ticks: Option<i64>,
    /// Real-time settings to request from the system.
    pub realtime: RealtimeParams,
}

/// Result of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// The real-time thread.
    pub realtime: RealtimeReport,
    /// The publisher.
    pub publisher: PublisherReport,
}

impl Summary {
    /// Whether a message or a command was lost.
    pub fn is_lossy(&self) -> bool {
        let Summary { realtime, publisher } = self;
        realtime.not_carried + realtime.unsent + publisher.unpublished + publisher.not_called > 0
    }
}

/// A run in progress. Dropping it damps the joints and ends the run.
pub struct Executor {
    ending: Arc<Ending>,
    granted: Granted,
    realtime: Option<JoinHandle<RealtimeReport>>,
    workers: Vec<(String, JoinHandle<Option<String>>)>,
    publisher: Option<JoinHandle<PublisherReport>>,
}

impl Executor {
    /// Starts both threads. Returns once the real-time settings are known.
    ///
    /// # Errors
    /// If the bus refuses a subscription, a thread cannot be started, the driver has another robot, or another run is active.
    pub fn start(plan: Plan) -> Result<Self, DriverError> {
        let Plan { component, others, receives, controllers, mut hardware, mut bus, mut operators, .. } = plan;
        let Plan { mut info, schedule, ticks, realtime, .. } = plan;
        info.run_id = new_sender_id();
        operators.start(now_ns());
        bus.subscribe(channels::EXECUTOR_COMMAND)?;
        bus.subscribe(channels::PARAMETER_REQUEST)?;
        operators.sources().iter().try_for_each(|source| bus.subscribe(&source.channel))?;
        let mut workers = Vec::new();
        let (received_in, received_out) = message_ring(RECEIVED_BYTES);
        let (slots, runners) = start_others(&info, &others, &receives, &realtime, &mut workers)?;
        // Messages of processes, and of programs that are no components.
        let mut remote: BTreeSet<String> = slots.iter().flat_map(Slot::receives).map(ToString::to_string).collect();
        for entry in others.iter().filter(|entry| entry.kind != EXTERNAL) {
            if entry.runs == Runs::Process {
                remote.insert(format!("{}/{}", entry.name, channels::CONTROLLER_TICK));
            } else {
                remote.retain(|channel| channels::split(channel).0 != entry.name);
            }
        }
        remote.iter().try_for_each(|channel| bus.subscribe(channel))?;
        let ending = Arc::<Ending>::default();
        let (messages_in, messages_out) = message_ring(RING_BYTES);
        let (calls_in, calls_out) = call_ring();
        let peers = if hardware.is_on_bus() {
            let robot = of_run(&info);
            let mut peers = Peers::new(RobotInfo { t_start_ns: now_ns(), ..robot });
            hardware.listen_to(find_driver(&mut peers, &mut *bus)?);
            Some(peers)
        } else {
            None
        };
        let (granted_in, granted_out) = mpsc::channel();
        let others = Others::new(slots, runners, received_out);
        let running = controllers.iter().enumerate().fold(0, |bits, (k, (_, starts))| bits | i64::from(*starts) << k);
        let mut realtime_loop =
            RealtimeLoop::new(component, others, (info.run_id, running), hardware, calls_out, messages_in, schedule);
        let realtime_thread = spawn("real-time", {
            let (ending, realtime) = (ending.clone(), realtime.clone());
            move || {
                // The receiver waits for it until this thread ends.
                let _ = granted_in.send(realtime.apply());
                drop(granted_in);
                realtime_loop.run(ticks.unwrap_or(i64::MAX), &ending)
            }
        })?;
        let granted = granted_out.recv().unwrap_or_default();
        info.realtime = format!("live, every {} us, {}", schedule.period_ns / 1000, granted.text());
        let names = controllers.into_iter().map(|(name, _)| name).collect();
        let lateness = Lateness::new(schedule.period_ns, info.stages());
        let publisher =
            Publisher::new((messages_out, calls_in), (bus, peers), operators, info, names, lateness, ending.clone())
                .with_remote(received_in, remote);
        // On a busy machine it must not fall behind by more than the window within which a log's reader sorts messages.
        let settings = RealtimeParams { priority: realtime.priority.min(PUBLISHER_PRIORITY), ..RealtimeParams::none() };
        let publisher_thread = spawn("publisher", move || {
            settings.apply();
            publisher.run()
        })?;
        Ok(Executor { ending, granted, realtime: Some(realtime_thread), workers, publisher: Some(publisher_thread) })
    }

    /// Real-time settings that the system granted.
    pub fn granted(&self) -> &Granted {
        &self.granted
    }

    /// Whether the run has ended by itself. If the publisher thread has ended, no operator command arrives and nothing is logged: the robot sits down.
    pub fn is_finished(&self) -> bool {
        if self.publisher.as_ref().is_some_and(JoinHandle::is_finished) {
            self.sit_down(EndCause::PublisherDied);
        }
        self.realtime.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Requests that a standing robot sits down; the run ends afterwards. An EVENT reports the cause.
    pub fn sit_down(&self, cause: EndCause) {
        self.ending.request(End::Sit, cause);
    }

    /// Damps the joints, ends the run, and waits until every message is published.
    pub fn finish(mut self) -> Summary {
        self.close()
    }

    fn close(&mut self) -> Summary {
        self.ending.request(End::Damp, EndCause::Length);
        let mut realtime = self.realtime.take().map(join).unwrap_or_default();
        for (_, worker) in self.workers.drain(..) {
            realtime.panics += u64::from(join(worker).is_some());
        }
        Summary { realtime, publisher: self.publisher.take().map(join).unwrap_or_default() }
    }
}

impl Drop for Executor {
    fn drop(&mut self) {
        self.close();
    }
}

/// Slots of all components, and where those beside the first one compute; starts their threads.
fn start_others(
    info: &RunInfo,
    entries: &[ComponentEntry],
    receives: &[String],
    realtime: &RealtimeParams,
    workers: &mut Vec<(String, JoinHandle<Option<String>>)>,
) -> Result<(Vec<Slot>, Vec<Runner>), DriverError> {
    let mut runners = Vec::with_capacity(entries.len());
    for (index, entry) in (1..).zip(entries) {
        runners.push(match entry.runs {
            _ if entry.kind == EXTERNAL => Runner::External,
            Runs::Process => Runner::Process,
            Runs::Rt => Runner::in_place(build(info, index)?),
            Runs::Worker => {
                // Below the real-time thread, above the publisher.
                let priority = realtime.priority.saturating_sub(WORKER_BELOW).max(realtime.priority.min(1));
                let settings = RealtimeParams { priority, ..RealtimeParams::none() };
                let (end, thread) =
                    worker::start(build(info, index)?, settings, Duration::from_millis(entry.pause_ms))?;
                workers.push((entry.name.clone(), thread));
                Runner::Worker(end)
            }
        });
    }
    Ok((slots(info, entries, receives), runners))
}

/// Exchanges EXPECTED_ROBOT and ROBOT_INFO with the driver. Returns the driver of the run's robot; `None` if no driver answers in time.
fn find_driver(peers: &mut Peers, bus: &mut dyn Bus) -> Result<Option<i64>, DriverError> {
    bus.subscribe(channels::ROBOT_INFO)?;
    bus.subscribe(channels::EXPECTED_ROBOT)?;
    let mut bytes = Vec::new();
    let end_ns = now_ns() + ANSWER_NS;
    let mut due_ns = i64::MIN;
    while now_ns() < end_ns {
        // Again and again: a message may be lost. Not after each message that arrives, which may be our own.
        if now_ns() >= due_ns {
            due_ns = now_ns() + ASK_EVERY_NS;
            bytes.clear();
            peers.expected(now_ns()).encode(&mut bytes)?;
            bus.publish(channels::EXPECTED_ROBOT, &bytes)?;
        }
        for message in bus.handle(POLL)? {
            let Ok(info) = RobotInfo::decode(&message.data) else { continue };
            let found = match &*message.channel {
                channels::ROBOT_INFO => peers.robot_info(&info, now_ns()),
                channels::EXPECTED_ROBOT => peers.expected_robot(&info, now_ns()),
                _ => None,
            };
            match found {
                Some(Finding::Driver(id)) => return Ok(Some(id)),
                Some(Finding::OtherRobot(difference)) => return Err(DriverError::OtherRobot { difference }),
                Some(Finding::SecondRun { is_earlier: true }) => return Err(DriverError::SecondRun),
                _ => {}
            }
        }
    }
    Ok(None)
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
