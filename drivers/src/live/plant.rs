//! The simulator as a driver process, in real time: what a robot's own driver does, done by MuJoCo.
//!
//! A command acts from the step after its arrival, so it is as late as on a robot. Until the first command comes the robot is held still; then
//! the scenario begins. When commands stay away for [`WATCHDOG_NS`], the joints are damped, as a robot's driver must.

use super::clock::{TickSchedule, now_ns, sleep_until};
use super::socket::{Ear, Speaker};
use crate::operator_script::OperatorScript;
use crate::{DriverError, FaultInjection, Scenario, Simulator};
use lcmtypes::{ControllerTick, Event, GroundTruth, Message, ParameterRequest, RobotCommand, RobotState, channels};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

/// Age of the newest command beyond which the joints are damped, ns: with a step and a late wake-up it stays below 20 ms.
pub const WATCHDOG_NS: i64 = 15_000_000;
/// Damping of each joint then, N m s/rad.
const WATCHDOG_KD: f64 = 8.0;

/// How a driver's run went.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Simulated time, s.
    pub sim_seconds: f64,
    /// Steps left out of the world's time, because the thread was late: the simulated robot has lived less long.
    pub skipped: u64,
    /// Times that the watchdog took over.
    pub watchdog: u64,
    /// When the robot fell, s, if it did.
    pub fell_at_s: Option<f64>,
    /// Commands that were refused: wrong size, not finite.
    pub refused: u64,
    /// Messages that the network did not take.
    pub unsent: u64,
}

/// What drives it.
pub struct Plant<'a> {
    /// Operator script, pushes and faults.
    pub scenario: &'a Scenario,
    /// Whether to send the scenario's operator commands and changes of parameters; no when a person does.
    pub send_operator: bool,
    /// The robot, reset.
    pub sim: &'a mut dyn Simulator,
    /// Where messages go to.
    pub speaker: Speaker,
    /// Where commands come from.
    pub network: Ear,
}

/// Runs until `stop` is set. When the scenario ends, the last of its operator commands goes on.
///
/// # Errors
/// A scenario that names unknown joints or links, a simulation that blew up.
pub fn run(plant: Plant<'_>, stop: &AtomicBool) -> Result<Summary, DriverError> {
    let beat = TickSchedule { period_ns: plant.sim.period_ns(), phase_ns: 0 };
    let mut run = Run::new(plant)?;
    let mut due_ns = beat.after(now_ns());
    while !stop.load(Ordering::Relaxed) {
        sleep_until(due_ns);
        run.step(now_ns())?;
        let next_ns = beat.after(now_ns());
        if run.started {
            run.summary.skipped += ((next_ns - due_ns) / beat.period_ns - 1).cast_unsigned();
        }
        due_ns = next_ns;
    }
    run.summary.sim_seconds = seconds(run.t_ns);
    Ok(run.summary)
}

/// What a run carries from step to step.
struct Run<'a> {
    scenario: &'a Scenario,
    sim: &'a mut dyn Simulator,
    network: Ear,
    talk: Talk,
    faults: FaultInjection,
    operator: Option<OperatorScript>,
    timeline: VecDeque<(i64, String)>,
    /// Parameters that are to be otherwise, in the order of time.
    wishes: VecDeque<ParameterRequest>,
    state: RobotState,
    truth: GroundTruth,
    newest: RobotCommand,
    applied: RobotCommand,
    damping: RobotCommand,
    /// Time of the scenario, ns: stands still until the first command.
    t_ns: i64,
    number: i64,
    started: bool,
    /// The controller is to hold the robot up: one that lies, sits or has been damped is low, and has not fallen for that.
    upright: bool,
    watching: bool,
    arrived_ns: i64,
    summary: Summary,
}

impl<'a> Run<'a> {
    fn new(plant: Plant<'a>) -> Result<Self, DriverError> {
        let Plant { scenario, send_operator, sim, speaker, network } = plant;
        Ok(Run {
            faults: FaultInjection::new(&scenario.faults, sim.joints())?,
            operator: send_operator.then(|| scenario.operator.clone()),
            timeline: scenario.timeline().into(),
            wishes: if send_operator { scenario.parameters.clone().into() } else { VecDeque::new() },
            state: RobotState::default(),
            truth: GroundTruth::default(),
            newest: RobotCommand::default(),
            applied: RobotCommand::default(),
            damping: RobotCommand::damping(sim.joints().len(), WATCHDOG_KD),
            scenario,
            sim,
            network,
            talk: Talk { speaker, bytes: Vec::new() },
            t_ns: 0,
            number: 0,
            started: false,
            upright: false,
            watching: false,
            arrived_ns: 0,
            summary: Summary::default(),
        })
    }

    fn step(&mut self, now: i64) -> Result<(), DriverError> {
        self.measure(now)?;
        self.listen(now)?;
        if !self.started {
            return Ok(());
        }
        let Run { scenario, sim, talk, faults, applied, t_ns, .. } = self;
        while let Some((_, text)) = self.timeline.pop_front_if(|(at, _)| *at <= *t_ns) {
            talk.tell(now, -1, Event::LEVEL_INFO, "scenario", text)?;
        }
        if let Some(mut op) = self.operator.as_mut().and_then(|script| script.operator_at(*t_ns))
            && faults.operator_arrives(*t_ns)
        {
            op.t_ns = now;
            self.summary.unsent += talk.put(channels::OPERATOR_COMMAND, &op)?;
        }
        while let Some(wish) = self.wishes.pop_front_if(|wish| wish.t_ns <= *t_ns) {
            self.summary.unsent += talk.put(channels::PARAMETER_REQUEST, &ParameterRequest { t_ns: now, ..wish })?;
        }
        applied.clone_from(if self.watching { &self.damping } else { &self.newest });
        faults.on_command(*t_ns, applied);
        self.summary.refused += u64::from(sim.apply(applied).is_err());
        sim.clear_pushes();
        for push in scenario.pushes_at(*t_ns) {
            sim.add_push(push.link.as_deref(), push.f_W, push.tau_W)?;
        }
        sim.step()?;
        *t_ns += sim.period_ns();
        if self.summary.fell_at_s.is_none() && sim.tipped() {
            self.summary.fell_at_s = Some(seconds(*t_ns));
            let p = self.truth.p_WB;
            let text = format!("the robot fell at x {:.2} m, y {:.2} m", p[0], p[1]);
            talk.tell(now, self.newest.tick, Event::LEVEL_ERROR, "driver", text)?;
        }
        Ok(())
    }

    /// Sends what sensors read, and the truth.
    fn measure(&mut self, now: i64) -> Result<(), DriverError> {
        let Run { sim, talk, faults, state, truth, t_ns, number, .. } = self;
        // Windows of faults are times of the scenario; the message carries the clock of the machine.
        sim.robot_state(*t_ns, *number, state);
        state.t_ns = now;
        if faults.on_state(*t_ns, state) {
            self.summary.unsent += talk.put(channels::ROBOT_STATE, state)?;
        }
        sim.ground_truth(now, truth);
        self.summary.unsent += talk.put(channels::GROUND_TRUTH, truth)?;
        *number += 1;
        Ok(())
    }

    /// Takes the newest command; damps when there was none for too long.
    fn listen(&mut self, now: i64) -> Result<(), DriverError> {
        let Run { newest, talk, .. } = self;
        let mut came = false;
        let arrives = self.faults.command_arrives(self.t_ns);
        let upright = &mut self.upright;
        self.network.hear(|channel, data| match channel {
            channels::ROBOT_COMMAND => came |= arrives && newest.decode_into(data).is_ok(),
            channels::CONTROLLER_TICK => {
                let mode = ControllerTick::decode(data).map_or(ControllerTick::MODE_IDLE, |tick| tick.mode);
                *upright = matches!(mode, ControllerTick::MODE_STANCE | ControllerTick::MODE_WALK);
            }
            _ => {}
        });
        if came {
            if !self.started {
                let text = format!("scenario {} begins", self.scenario.name);
                talk.tell(now, newest.tick, Event::LEVEL_INFO, "driver", text)?;
            }
            if std::mem::take(&mut self.watching) {
                let text = "commands are back".to_owned();
                talk.tell(now, newest.tick, Event::LEVEL_WARNING, "driver", text)?;
            }
            (self.started, self.arrived_ns) = (true, now);
        }
        let age = now - self.arrived_ns;
        // A process that stands still watches nothing.
        let awake = self.faults.stands_still_until(self.t_ns).is_none();
        if self.started && !self.watching && awake && age > WATCHDOG_NS {
            (self.watching, self.summary.watchdog) = (true, self.summary.watchdog + 1);
            let text = format!("no command for {} us: joints are damped", age / 1000);
            // Who commands torque and falls silent has died; who has asked for damping before may go.
            let died = newest.mode == RobotCommand::MODE_TORQUE;
            talk.tell(now, newest.tick, if died { Event::LEVEL_ERROR } else { Event::LEVEL_INFO }, "driver", text)?;
        }
        Ok(())
    }
}

/// Sends messages.
struct Talk {
    speaker: Speaker,
    bytes: Vec<u8>,
}

impl Talk {
    /// 1 if the network did not take it.
    fn put(&mut self, channel: &str, message: &impl Message) -> Result<u64, DriverError> {
        self.bytes.clear();
        message.encode(&mut self.bytes)?;
        Ok(u64::from(!self.speaker.say(channel, &self.bytes)))
    }

    fn tell(&mut self, t_ns: i64, tick: i64, level: i8, source: &str, text: String) -> Result<(), DriverError> {
        let event = Event { t_ns, tick, level, source: source.to_owned(), text };
        self.put(channels::EVENT, &event).map(drop)
    }
}

#[expect(clippy::cast_precision_loss, reason = "simulation times are far below 2^53 ns")]
fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}
