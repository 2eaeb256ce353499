//! The simulator as a driver process, in real time, in place of the driver of a robot.
//!
//! A command acts from the step after its arrival, with the same delay as on a robot. The robot is held still until the first command arrives; then
//! the scenario starts. If no command arrives for [`WATCHDOG_NS`], the watchdog damps the joints.

use super::clock::{TickSchedule, now_ns, sleep_until};
use super::command_gate::CommandGate;
use super::event_limit::EventLimit;
use super::joint_range::JointRange;
use super::peers::is_fresh;
use super::socket::{LcmReceiver, LcmSender};
use crate::operator_script::OperatorScript;
use crate::robot_info::ROBOT_INFO_EVERY_NS;
use crate::{DriverError, FaultInjection, Scenario, Simulator};
use lcmtypes::{
    Event, EventNumbers, GroundTruth, Message, ParameterRequest, RobotCommand, RobotInfo, RobotState, channels,
    new_sender_id,
};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest age of the newest command before the joints are damped, ns. With one step and a late wake-up the delay stays below 20 ms.
pub const WATCHDOG_NS: i64 = 15_000_000;
/// Shortest time between two ROBOT_INFO, ns.
const ANSWER_EVERY_NS: i64 = 100_000_000;

/// Result of a driver process.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Simulated time, s.
    pub sim_seconds: f64,
    /// Skipped steps: the thread was late, and the simulation advanced by less than the wall time.
    pub skipped: u64,
    /// Number of times that the watchdog damped the joints.
    pub watchdog: u64,
    /// Time of the fall, s; `None` if the robot did not fall.
    pub fell_at_s: Option<f64>,
    /// Refused commands: of other runs or senders, old, undecodable, or with values out of range.
    pub refused: u64,
    /// Messages that could not be sent.
    pub unsent: u64,
}

/// A simulated robot and its connections.
pub struct Plant<'a> {
    /// Operator script, pushes and faults.
    pub scenario: &'a Scenario,
    /// Whether to send the scenario's operator commands and parameter requests; false if a person commands.
    pub send_operator: bool,
    /// The simulator, after a reset.
    pub sim: &'a mut dyn Simulator,
    /// Sends measurements, events and requests.
    pub sender: LcmSender,
    /// Receives commands.
    pub receiver: LcmReceiver,
    /// Describes the robot; the driver sets sender and times.
    pub info: RobotInfo,
    /// Ranges of commands of the actuated joints, in URDF order.
    pub joints: Vec<JointRange>,
    /// Damping of each joint when the driver damps by itself, N m s/rad.
    pub damping: Vec<f64>,
}

/// Runs until `stop` is set. After the end of the scenario its last operator command continues to be sent.
///
/// # Errors
/// If the scenario names unknown joints or links, or the simulation diverges.
pub fn run(plant: Plant<'_>, stop: &AtomicBool) -> Result<Summary, DriverError> {
    let schedule = TickSchedule { period_ns: plant.sim.period_ns(), phase_ns: 0 };
    let mut run = Run::new(plant)?;
    let mut due_ns = schedule.after(now_ns());
    while !stop.load(Ordering::Relaxed) {
        sleep_until(due_ns);
        run.step(now_ns())?;
        let next_ns = schedule.after(now_ns());
        if run.started {
            run.summary.skipped += ((next_ns - due_ns) / schedule.period_ns - 1).cast_unsigned();
        }
        due_ns = next_ns;
    }
    run.out.report_rest(now_ns())?;
    run.summary.sim_seconds = seconds(run.t_ns);
    Ok(run.summary)
}

/// State of a run between steps.
struct Run<'a> {
    scenario: &'a Scenario,
    sim: &'a mut dyn Simulator,
    receiver: LcmReceiver,
    out: Sender,
    faults: FaultInjection,
    operator: Option<OperatorScript>,
    timeline: VecDeque<(i64, String)>,
    /// Parameter requests of the scenario, in the order of time.
    requests: VecDeque<ParameterRequest>,
    info: RobotInfo,
    info_due_ns: i64,
    gate: CommandGate,
    state: RobotState,
    truth: GroundTruth,
    newest: RobotCommand,
    applied: RobotCommand,
    damping: RobotCommand,
    /// Time of the scenario, ns; 0 until the first command.
    t_ns: i64,
    number: i64,
    started: bool,
    /// The watchdog damps the joints.
    timed_out: bool,
    /// The last driver that started later than this one.
    second_driver: Option<i64>,
    /// The driver damps the joints until the controller does: both may have acted on its commands.
    two_drivers: bool,
    arrived_ns: i64,
    summary: Summary,
}

impl<'a> Run<'a> {
    fn new(plant: Plant<'a>) -> Result<Self, DriverError> {
        let Plant { scenario, send_operator, sim, sender, receiver, mut info, joints, damping } = plant;
        (info.sender_id, info.t_start_ns) = (new_sender_id(), now_ns());
        let sender_id = info.sender_id;
        Ok(Run {
            faults: FaultInjection::new(&scenario.faults, sim.joints())?,
            operator: send_operator.then(|| scenario.operator.clone()),
            timeline: scenario.timeline().into(),
            requests: if send_operator { scenario.parameters.clone().into() } else { VecDeque::new() },
            state: RobotState { sender_id, ..RobotState::default() },
            gate: CommandGate::new(joints, info.clone()),
            info,
            info_due_ns: i64::MIN,
            truth: GroundTruth::default(),
            newest: RobotCommand::default(),
            applied: RobotCommand::default(),
            damping: RobotCommand::damping(damping),
            scenario,
            sim,
            receiver,
            out: Sender {
                sender,
                bytes: Vec::new(),
                events: EventNumbers::new(sender_id),
                limit: EventLimit::default(),
            },
            t_ns: 0,
            number: 0,
            started: false,
            timed_out: false,
            second_driver: None,
            two_drivers: false,
            arrived_ns: 0,
            summary: Summary::default(),
        })
    }

    fn step(&mut self, now: i64) -> Result<(), DriverError> {
        self.measure(now)?;
        self.receive(now)?;
        if !self.started {
            return Ok(());
        }
        let Run { scenario, sim, out, faults, applied, t_ns, info, .. } = self;
        while let Some((_, text)) = self.timeline.pop_front_if(|(at, _)| *at <= *t_ns) {
            out.event(now, -1, Event::LEVEL_INFO, "scenario", text)?;
        }
        if let Some(mut op) = self.operator.as_mut().and_then(|script| script.operator_at(*t_ns))
            && faults.operator_arrives(*t_ns)
        {
            op.t_mode_ns += now - op.t_ns;
            (op.t_ns, op.sender_id) = (now, info.sender_id);
            self.summary.unsent += out.put(channels::OPERATOR_COMMAND, &op)?;
        }
        while let Some(request) = self.requests.pop_front_if(|request| request.t_ns <= *t_ns) {
            let request = ParameterRequest { t_ns: now, sender_id: info.sender_id, ..request };
            self.summary.unsent += out.put(channels::PARAMETER_REQUEST, &request)?;
        }
        applied.clone_from(if self.timed_out || self.two_drivers { &self.damping } else { &self.newest });
        faults.on_command(*t_ns, applied);
        // The gate has checked size, mode and values; a fault of the scenario only scales them.
        sim.apply(applied)?;
        sim.clear_pushes();
        for push in scenario.pushes_at(*t_ns) {
            sim.add_push(push.link.as_deref(), push.f_W, push.tau_W)?;
        }
        sim.step()?;
        *t_ns += sim.period_ns();
        if self.summary.fell_at_s.is_none() && (sim.tipped() || sim.below_ground()) {
            self.summary.fell_at_s = Some(seconds(*t_ns));
            let p = self.truth.p_WB;
            let text = format!("the robot fell at x {:.2} m, y {:.2} m", p[0], p[1]);
            out.event(now, self.newest.tick, Event::LEVEL_ERROR, "driver", text)?;
        }
        Ok(())
    }

    /// Sends the measurement, the ground truth and, once a second, the description of the robot.
    fn measure(&mut self, now: i64) -> Result<(), DriverError> {
        let Run { sim, out, faults, state, truth, t_ns, number, info, info_due_ns, .. } = self;
        if now >= *info_due_ns {
            (info.t_ns, *info_due_ns) = (now, now + ROBOT_INFO_EVERY_NS);
            self.summary.unsent += out.put(channels::ROBOT_INFO, info)?;
        }
        // Fault windows are in scenario time; the message has the time of the monotonic clock.
        sim.robot_state(*t_ns, *number, state);
        state.t_ns = now;
        if faults.on_state(*t_ns, state) {
            self.summary.unsent += out.put(channels::ROBOT_STATE, state)?;
        }
        sim.ground_truth(now, truth);
        self.summary.unsent += out.put(channels::GROUND_TRUTH, truth)?;
        *number += 1;
        Ok(())
    }

    /// Receives the newest command; damps the joints if commands time out.
    fn receive(&mut self, now: i64) -> Result<(), DriverError> {
        let Run { newest, out, gate, info, info_due_ns, .. } = self;
        let (mut is_new, mut other_robot, mut is_second, mut later) = (false, None, false, None);
        let arrives = self.faults.command_arrives(self.t_ns);
        self.receiver.receive(|from, channel, data| match channel {
            channels::ROBOT_COMMAND if arrives => is_new |= gate.take(from, data, now, newest).is_ok(),
            channels::EXPECTED_ROBOT => {
                let Ok(expected) = RobotInfo::decode(data) else { return };
                if is_fresh(&expected, now) {
                    other_robot = gate.expect(&expected).or(other_robot.take());
                    // The answer, at most ten times a second.
                    *info_due_ns = (*info_due_ns).min(info.t_ns + ANSWER_EVERY_NS);
                }
            }
            channels::ROBOT_INFO => {
                let Ok(other) = RobotInfo::decode(data) else { return };
                if other.sender_id != info.sender_id && is_fresh(&other, now) {
                    if (other.t_start_ns, other.sender_id) < (info.t_start_ns, info.sender_id) {
                        is_second = true;
                    } else {
                        later = Some(other.sender_id);
                    }
                    *info_due_ns = (*info_due_ns).min(info.t_ns + ANSWER_EVERY_NS);
                }
            }
            _ => {}
        });
        if is_second {
            out.event(now, -1, Event::LEVEL_ERROR, "driver", DriverError::SecondDriver.to_string())?;
            return Err(DriverError::SecondDriver);
        }
        if later.is_some() {
            // Before the first command the robot is held still.
            self.two_drivers |= self.started;
            if std::mem::replace(&mut self.second_driver, later) != later {
                let text = "a second driver was started: joints damped until the controller damps them".to_owned();
                out.event(now, newest.tick, Event::LEVEL_ERROR, "driver", text)?;
            }
        } else if is_new && newest.mode != RobotCommand::MODE_TORQUE {
            self.two_drivers = false;
        }
        if let Some(difference) = other_robot {
            let text = format!("a run controls another robot and is not obeyed: {difference}");
            out.event(now, -1, Event::LEVEL_ERROR, "driver", text)?;
        }
        if let Some(text) = gate.report(now) {
            out.event(now, newest.tick, Event::LEVEL_WARNING, "driver", text)?;
        }
        out.report_suppressed(now)?;
        self.summary.refused = gate.refused();
        if is_new {
            if !self.started {
                let text = format!("scenario {} starts", self.scenario.name);
                out.event(now, newest.tick, Event::LEVEL_INFO, "driver", text)?;
            }
            if std::mem::take(&mut self.timed_out) {
                let text = "commands arrive again".to_owned();
                out.event(now, newest.tick, Event::LEVEL_WARNING, "driver", text)?;
            }
            (self.started, self.arrived_ns) = (true, now);
        }
        let age = now - self.arrived_ns;
        // During a late_process fault the watchdog does not run.
        let awake = self.faults.paused_until(self.t_ns).is_none();
        if self.started && !self.timed_out && awake && age > WATCHDOG_NS {
            (self.timed_out, self.summary.watchdog) = (true, self.summary.watchdog + 1);
            // A controller that commanded torque has died; one that commanded damping has ended.
            let (level, text) = if newest.mode == RobotCommand::MODE_TORQUE {
                (
                    Event::LEVEL_ERROR,
                    format!("no command for {} us, limit {} us: joints damped", age / 1000, WATCHDOG_NS / 1000),
                )
            } else {
                (Event::LEVEL_INFO, "no more commands; the last one damps the joints".to_owned())
            };
            out.event(now, newest.tick, level, "driver", text)?;
        }
        Ok(())
    }
}

/// Encodes and sends messages.
struct Sender {
    sender: LcmSender,
    bytes: Vec<u8>,
    events: EventNumbers,
    limit: EventLimit,
}

impl Sender {
    /// Sends a message; 1 if it could not be sent.
    fn put(&mut self, channel: &str, message: &impl Message) -> Result<u64, DriverError> {
        self.bytes.clear();
        message.encode(&mut self.bytes)?;
        Ok(u64::from(!self.sender.send(channel, &self.bytes)))
    }

    /// Sends an EVENT, unless there are too many: foreign messages may cause them.
    fn event(&mut self, t_ns: i64, tick: i64, level: i8, source: &str, text: String) -> Result<(), DriverError> {
        let event = Event { t_ns, tick, level, source: source.to_owned(), text, ..Event::default() };
        if self.limit.passes(t_ns, &event) { self.put_event(event) } else { Ok(()) }
    }

    /// Sends the number of EVENTs that were not sent, by source.
    fn report_suppressed(&mut self, t_ns: i64) -> Result<(), DriverError> {
        self.limit.take_suppressed(t_ns).into_iter().try_for_each(|suppressed| self.put_event(suppressed.event(t_ns)))
    }

    /// [`Sender::report_suppressed`] at the end of the run.
    fn report_rest(&mut self, t_ns: i64) -> Result<(), DriverError> {
        self.limit.take_rest().into_iter().try_for_each(|suppressed| self.put_event(suppressed.event(t_ns)))
    }

    fn put_event(&mut self, mut event: Event) -> Result<(), DriverError> {
        self.events.number(&mut event);
        self.put(channels::EVENT, &event).map(drop)
    }
}

#[expect(clippy::cast_precision_loss, reason = "simulation times are far below 2^53 ns")]
fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}
