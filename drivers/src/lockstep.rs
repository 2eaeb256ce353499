//! The lockstep run: simulator, controller and log in one process, one control tick per physics step, as fast as possible.
//!
//! The log contains every message that a live run sends over the bus, stamped with the simulation time. Two runs of one scenario and
//! seed give equal logs except for TIMING, which contains the wall clock.

mod others;

pub use others::LockstepOthers;

use crate::parameter_requests::{self, ParameterRequestHandler, Proposal, Refusal};
use crate::robot_info::{ROBOT_INFO_EVERY_NS, of_run};
use crate::stage_clock::StageClock;
use crate::watch::{ComponentEvent, ModeEvent, ModeWatch};
use crate::{DriverError, FaultInjection, Scenario, Simulator};
use controller::handover::take_over;
use controller::{Component, Outbox};
use lcmtypes::{
    ControllerTick, Event, EventNumbers, GroundTruth, LegState, Message, ParameterChange, ParameterRequest,
    RequestReply, RobotCommand, RobotInfo, RobotState, RunInfo, Running, TaskRequest, channels,
};
use replay::record::EventSink;
use robot_model::math::WalkedDistance;
use std::collections::VecDeque;
use std::time::Instant;

/// Result of a lockstep run.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Control ticks.
    pub ticks: i64,
    /// Simulated time, s.
    pub sim_seconds: f64,
    /// Wall time, s.
    pub wall_seconds: f64,
    /// Time of the fall, s; `None` if the robot did not fall.
    pub fell_at_s: Option<f64>,
    /// Distance walked, m; see [`WalkedDistance`].
    pub distance_m: f64,
    /// Time and reason of the safe state; `None` if the controller did not enter it.
    pub safe_state: Option<String>,
}

/// Ticks that are simulated after a fall.
const TICKS_AFTER_FALL: i64 = 1000;

/// Runs `scenario` and logs every message.
///
/// - `sim`: a simulator after reset.
/// - `controller`: the first component.
/// - `others`: the other components; see [`LockstepOthers::build`].
/// - `log`: receives all events; the caller finishes it. A [`replay::record::RingWriter`] compresses and writes on another thread.
/// - `progress`: called with the simulated time, s, ten times per simulated second.
///
/// # Errors
/// A scenario with unknown links or joints, an invalid command, a simulation that diverges, a log that cannot be written.
pub fn run(
    scenario: &Scenario,
    info: &RunInfo,
    sim: &mut dyn Simulator,
    controller: &mut Component,
    others: LockstepOthers,
    log: &mut dyn EventSink,
    progress: &mut dyn FnMut(f64),
) -> Result<Outcome, DriverError> {
    let mut run = Run::new(scenario, info, sim, others, controller.stages().len())?;
    check_pushes(scenario, sim)?;
    let period_ns = sim.period_ns();
    let ticks = scenario.duration_ns() / period_ns;
    let started = Instant::now();
    run.put(log, channels::RUN_INFO, 0, info)?;
    let mut tick = 0;
    while tick < ticks && run.fell_at.is_none_or(|at| tick < at + TICKS_AFTER_FALL) {
        let t_ns = tick * period_ns;
        run.tick(scenario, sim, controller, log, tick, t_ns)?;
        tick += 1;
        if tick % 100 == 0 {
            progress(seconds(tick * period_ns));
        }
    }
    Ok(Outcome {
        ticks: tick,
        sim_seconds: seconds(tick * period_ns),
        wall_seconds: started.elapsed().as_secs_f64(),
        fell_at_s: run.fell_at.map(|at| seconds(at * period_ns)),
        distance_m: run.walked.get().unwrap_or(0.0),
        safe_state: run.safe_state,
    })
}

/// Checks the links of all pushes before the run starts.
fn check_pushes(scenario: &Scenario, sim: &mut dyn Simulator) -> Result<(), DriverError> {
    for (number, push) in (1..).zip(&scenario.pushes) {
        sim.add_push(push.link.as_deref(), [0.0; 3], [0.0; 3]).map_err(|mut error| {
            if let DriverError::Unknown { wanted_by, .. } = &mut error {
                *wanted_by = format!("push[{number}].link");
            }
            error
        })?;
    }
    sim.clear_pushes();
    Ok(())
}

/// State of a run between ticks.
struct Run {
    operator: crate::operator_script::OperatorScript,
    faults: FaultInjection,
    timeline: VecDeque<(i64, String)>,
    /// Parameter requests of the scenario, in the order of time.
    requests: VecDeque<ParameterRequest>,
    /// Requests to tasks of the scenario, in the order of time.
    tasks: VecDeque<TaskRequest>,
    parameters: ParameterRequestHandler,
    /// The controller after the first parameter change.
    changed: Option<Component>,
    /// Snapshot buffer for a handover.
    state: Vec<u8>,
    others: LockstepOthers,
    run_id: i64,
    measured: RobotState,
    truth: GroundTruth,
    command: RobotCommand,
    outbox: Outbox,
    bytes: Vec<u8>,
    clock: StageClock,
    /// Time since lift-off of each leg, s, 0 in stance; updated only in runs with false touches.
    t_swing: [f64; 4],
    mode: ModeWatch,
    events: EventNumbers,
    info: RobotInfo,
    fell_at: Option<i64>,
    safe_state: Option<String>,
    walked: WalkedDistance,
}

impl Run {
    fn new(
        scenario: &Scenario,
        info: &RunInfo,
        sim: &dyn Simulator,
        others: LockstepOthers,
        n_stages: usize,
    ) -> Result<Self, DriverError> {
        Ok(Run {
            operator: scenario.operator.clone(),
            faults: FaultInjection::new(&scenario.faults, sim.joints())?,
            timeline: scenario.timeline().into(),
            requests: scenario.parameters.clone().into(),
            tasks: scenario.tasks.clone().into(),
            parameters: ParameterRequestHandler::new(info),
            changed: None,
            state: Vec::new(),
            others,
            run_id: info.run_id,
            measured: RobotState { sender_id: info.run_id, ..RobotState::default() },
            truth: GroundTruth::default(),
            command: RobotCommand::default(),
            outbox: Outbox::new(),
            bytes: Vec::new(),
            clock: StageClock::new(n_stages),
            t_swing: [0.0; 4],
            mode: ModeWatch::new(sim.joints().to_vec()).with_limits(info),
            events: EventNumbers::new(info.run_id),
            info: of_run(info),
            fell_at: None,
            safe_state: None,
            walked: WalkedDistance::default(),
        })
    }

    fn tick(
        &mut self,
        scenario: &Scenario,
        sim: &mut dyn Simulator,
        controller: &mut Component,
        log: &mut dyn EventSink,
        tick: i64,
        t_ns: i64,
    ) -> Result<(), DriverError> {
        while let Some((at, text)) = self.timeline.pop_front_if(|(at, _)| *at <= t_ns) {
            self.event(log, at, tick, Event::LEVEL_INFO, "scenario", text)?;
        }
        if t_ns % ROBOT_INFO_EVERY_NS == 0 {
            self.info.t_ns = t_ns;
            put(&mut self.bytes, log, channels::ROBOT_INFO, t_ns, &self.info)?;
        }
        self.others.of_first().inbox.begin(t_ns, tick);
        if tick == 0 {
            let running = self.others.running;
            self.others.of_first().inbox.put(channels::RUNNING, t_ns, &Running { t_ns, running })?;
        }
        if let Some(mut op) = self.operator.operator_at(t_ns) {
            op.sender_id = self.run_id;
            self.put(log, channels::OPERATOR_COMMAND, t_ns, &op)?;
            if self.faults.operator_arrives(t_ns) {
                self.others.of_first().inbox.put(channels::OPERATOR_COMMAND, t_ns, &op)?;
                self.others.operator(t_ns, &op);
            }
        }
        while let Some(request) = self.tasks.pop_front_if(|request| request.t_ns <= t_ns) {
            self.put(log, channels::TASK_REQUEST, t_ns, &request)?;
            self.others.of_first().inbox.put(channels::TASK_REQUEST, t_ns, &request)?;
        }
        sim.robot_state(t_ns, tick, &mut self.measured);
        self.add_false_touches(sim, t_ns);
        let has_state = self.faults.on_state(t_ns, &mut self.measured);
        if has_state {
            self.others.of_first().inbox.put(channels::ROBOT_STATE, t_ns, &self.measured)?;
            put(&mut self.bytes, log, channels::ROBOT_STATE, t_ns, &self.measured)?;
        }
        sim.ground_truth(t_ns, &mut self.truth);
        put(&mut self.bytes, log, channels::GROUND_TRUTH, t_ns, &self.truth)?;
        self.walked.add(t_ns, self.truth.p_WB);

        let events = self.others.tick(t_ns, tick, has_state.then_some(&self.measured), log)?;
        for ComponentEvent { component, event: ModeEvent { level, text, is_safe_state }, .. } in events {
            if is_safe_state {
                self.safe_state = Some(format!("{:.3} s: {component}: {text}", seconds(t_ns)));
            }
            self.event(log, t_ns, tick, level, &component, text)?;
        }

        self.change_parameters(controller, log, t_ns, tick)?;
        let controller = self.changed.as_mut().unwrap_or(controller);
        let input = self.others.of_first().inbox.input();
        put(&mut self.bytes, log, channels::CONTROLLER_INPUT, t_ns, input)?;
        self.clock.start();
        controller.step_probed(input, &mut self.outbox, &mut self.clock);
        for (channel, bytes) in self.outbox.iter() {
            log.write(channel, t_ns, bytes)?;
        }
        let timing = self.clock.timing(t_ns, tick);
        put(&mut self.bytes, log, channels::TIMING, t_ns, timing)?;
        self.watch_mode(log, t_ns, tick)?;
        self.watch_swings()?;

        if let (Some(bytes), true) = (self.outbox.get(channels::ROBOT_COMMAND), self.faults.command_arrives(t_ns)) {
            self.command = RobotCommand::decode(bytes)?;
            self.faults.on_command(t_ns, &mut self.command);
            sim.apply(&self.command)?;
        }
        sim.clear_pushes();
        for push in scenario.pushes_at(t_ns) {
            sim.add_push(push.link.as_deref(), push.f_W, push.tau_W)?;
        }
        sim.step()?;
        // A low base is a fall in stance and walk only. In idle (no torque) the robot lies where it was placed.
        let fell = match self.mode.mode() {
            ControllerTick::MODE_STANCE | ControllerTick::MODE_WALK => sim.fallen(),
            ControllerTick::MODE_IDLE => false,
            _ => sim.tipped(),
        };
        let below = sim.below_ground();
        if self.fell_at.is_none() && (fell || below) {
            self.fell_at = Some(tick);
            let p = self.truth.p_WB;
            let what = if below { "the base is below the ground" } else { "the robot fell" };
            let text = format!("{what} at x = {:.2} m, y = {:.2} m", p[0], p[1]);
            self.event(log, t_ns, tick, Event::LEVEL_ERROR, "driver", text)?;
        }
        Ok(())
    }

    /// Handles the parameter requests that are due: a controller with the new parameter takes over before this tick.
    fn change_parameters(
        &mut self,
        controller: &Component,
        log: &mut dyn EventSink,
        t_ns: i64,
        tick: i64,
    ) -> Result<(), DriverError> {
        while let Some(request) = self.requests.pop_front_if(|request| request.t_ns <= t_ns) {
            self.put(log, channels::PARAMETER_REQUEST, t_ns, &request)?;
            let outcome =
                self.parameters.propose(&request).and_then(|Proposal { controller: mut next, change, parameters }| {
                    take_over(self.changed.as_ref().unwrap_or(controller), &mut next, &mut self.state).map_err(
                        |why| Refusal::of_parameter(&change.key, &change.value, RequestReply::CODE_WRONG_STATE, &why),
                    )?;
                    self.changed = Some(next);
                    self.mode.change(&change.key, &change.value);
                    self.parameters.accept(parameters);
                    Ok(ParameterChange { t_ns, tick, ..change })
                });
            if let Ok(change) = &outcome {
                self.put(log, channels::PARAMETER_CHANGE, t_ns, change)?;
            }
            let outcome = outcome.as_ref();
            self.put_event(log, parameter_requests::event(t_ns, tick, outcome))?;
            self.put(log, channels::REQUEST_REPLY, t_ns, &parameter_requests::reply(&request, t_ns, outcome))?;
        }
        Ok(())
    }

    /// Adds the torques of false touches to the measured torques.
    fn add_false_touches(&mut self, sim: &dyn Simulator, t_ns: i64) {
        let forces = self.faults.false_touches(t_ns, &self.t_swing);
        for (foot, force) in forces.into_iter().enumerate().filter(|(_, force)| *force != 0.0) {
            let torque = sim.torque_of_touch(foot, [0.0, 0.0, force]);
            self.measured.tau.iter_mut().zip(torque).for_each(|(measured, added)| *measured += added);
        }
    }

    /// Logs mode changes, rejected operator commands and faults of the controller as EVENT.
    fn watch_mode(&mut self, log: &mut dyn EventSink, t_ns: i64, tick: i64) -> Result<(), DriverError> {
        let Some(bytes) = self.outbox.get(channels::CONTROLLER_TICK) else { return Ok(()) };
        let Some(ModeEvent { level, text, is_safe_state }) = self.mode.update(&ControllerTick::decode(bytes)?) else {
            return Ok(());
        };
        if is_safe_state {
            self.safe_state = Some(format!("{:.3} s: {text}", seconds(t_ns)));
        }
        self.event(log, t_ns, tick, level, "controller", text)
    }

    /// Stores the swing times of the legs for false touches.
    fn watch_swings(&mut self) -> Result<(), DriverError> {
        if let (true, Some(bytes)) = (self.faults.has_false_touch(), self.outbox.get(channels::LEG_STATE)) {
            self.t_swing = LegState::decode(bytes)?.t_swing;
        }
        Ok(())
    }

    fn event(
        &mut self,
        log: &mut dyn EventSink,
        t_ns: i64,
        tick: i64,
        level: i8,
        source: &str,
        text: String,
    ) -> Result<(), DriverError> {
        self.put_event(log, Event { t_ns, tick, level, source: source.to_owned(), text, ..Event::default() })
    }

    fn put_event(&mut self, log: &mut dyn EventSink, mut event: Event) -> Result<(), DriverError> {
        self.events.number(&mut event);
        self.put(log, channels::EVENT, event.t_ns, &event)
    }

    fn put(
        &mut self,
        log: &mut dyn EventSink,
        channel: &str,
        t_ns: i64,
        message: &impl Message,
    ) -> Result<(), DriverError> {
        put(&mut self.bytes, log, channel, t_ns, message)
    }
}

fn put(
    bytes: &mut Vec<u8>,
    log: &mut dyn EventSink,
    channel: &str,
    t_ns: i64,
    message: &impl Message,
) -> Result<(), DriverError> {
    bytes.clear();
    message.encode(bytes)?;
    log.write(channel, t_ns, bytes)?;
    Ok(())
}

#[expect(clippy::cast_precision_loss, reason = "simulation times are far below 2^53 ns")]
fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}
