//! Planner-free quadruped locomotion: trot over what terrain there is, with joint sensors and an IMU and nothing else.
//!
//! Source: G. Raiola, E. Mingo Hoffman, M. Focchi, N. Tsagarakis, C. Semini, *A simple yet effective whole-body locomotion framework for
//! quadruped robots*, Frontiers in Robotics and AI, 2020. Cited by equation number where an equation is used; a line that departs from it says so.
//!
//! A tick, in the order of [`Quadruped::step_probed`]: [`safety`] checks the input, [`modes`] decides what the robot as a whole does,
//! [`estimation`] finds base, dynamics and contacts, [`gait`] moves the legs' state machines, [`mod@reference`] plans footholds and joint
//! references, [`wbc`] builds and solves the quadratic programs of the stack of [`tasks`], [`wire`] writes the messages. While the robot gets up
//! or sits down, [`stand_sit`] takes the place of gait, references and programs.

mod digests;
mod dump;
pub mod estimation;
pub mod foothold;
pub mod gait;
pub mod leg;
pub mod modes;
mod operator;
pub mod recovery;
pub mod reference;
pub mod robot;
pub mod safety;
pub mod stand_sit;
pub mod state;
pub mod sway;
pub mod swing;
pub mod tasks;
pub mod terrain;
pub mod wbc;
pub mod wire;

use crate::digest::Digest;
use crate::params::Params;
use crate::qp::NamedViolation;
use crate::{Controller, LoadError, Outbox, Probe, RestoreError, Stage};
use digests::Digests;
pub(crate) use digests::input as digest_of_input;
use estimation::{BasePlace, Estimate};
use lcmtypes::{ControllerInput, ControllerTick, Message, QuadrupedState, channels};
use modes::{Asked, Wish};
use nalgebra::Vector3;
use reference::{References, Tick};
use robot::Robot;
use safety::{fault, seconds};
use stand_sit::Rise;
use state::{Fault, Mode, State};
use std::cell::RefCell;
use wbc::{TrunkReference, Wbc};
use wire::Messages;

/// Name by which [`crate::load`] finds the controller.
pub const NAME: &str = "quadruped";
/// Ticks between two snapshots of the state.
pub const SNAPSHOT_TICKS: i64 = 1000;
/// Longest time step that integrators see, s: a late tick must not throw references.
const MAX_DT: f64 = 0.01;

/// The controller: parameters and robot, state, scratch.
pub struct Quadruped {
    params: Params,
    robot: Robot,
    rise: Rise,
    state: State,
    /// Where the base is taken to be; nothing in operation changes it.
    place: BasePlace,
    scratch: Scratch,
    messages: Messages,
    /// Through which a state goes in and out, kept so that no memory is asked for then.
    passage: RefCell<QuadrupedState>,
}

/// Memory of a tick; nothing in it survives one.
struct Scratch {
    estimate: Estimate,
    references: References,
    wbc: Wbc,
    trunk: TrunkReference,
}

impl Scratch {
    fn new(robot: &Robot, params: &Params) -> Result<Self, LoadError> {
        let nan = f64::NAN;
        Ok(Scratch {
            estimate: Estimate::new(robot),
            references: References::new(robot),
            wbc: Wbc::new(robot, params)?,
            trunk: TrunkReference { R_WB: nalgebra::Matrix3::from_element(nan), w_WB_W: Vector3::from_element(nan) },
        })
    }
}

impl Quadruped {
    /// Builds the controller from the text of a URDF and of the parameters.
    ///
    /// # Errors
    /// Unusable texts; parameters that do not fit the robot.
    pub fn new(urdf: &str, params: &str) -> Result<Self, LoadError> {
        let params = Params::from_toml(params, "parameters")?;
        let robot = Robot::new(urdf, &params.robot)?;
        let rise = Rise::new(&robot, &params)?;
        let state = State::new(robot.nj());
        let scratch = Scratch::new(&robot, &params)?;
        let messages = Messages::new(&robot, &scratch.wbc);
        let passage = RefCell::new(messages.snapshot.clone());
        Ok(Quadruped { params, robot, rise, state, place: BasePlace::default(), scratch, messages, passage })
    }

    /// The state between two ticks.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The whole-body controller after the last tick that solved: its programs, solutions, torques.
    pub fn wbc(&self) -> &Wbc {
        &self.scratch.wbc
    }

    /// Which constraints contradicted each other in the last tick that solved, by name, and on which level of the stack, from 0; `None` if it
    /// found all its solutions. To ask this of a log, replay it to the tick of the failure first. Not for use in a tick.
    pub fn explain(&self) -> Option<(usize, Vec<NamedViolation>)> {
        self.scratch.wbc.explain(&self.robot)
    }

    /// Takes the base to be somewhere, and to move, from the next tick on, instead of resting at the origin. No bit of a
    /// message depends on it: that is what experiments feed it for. Not for operation, and no part of the state.
    pub fn take_base_to_be(&mut self, place: BasePlace) {
        self.place = place;
    }

    /// One tick of standing or walking. Digests and messages of all its stages; gives the fault that ends it, if any.
    fn operate(
        &mut self,
        input: &ControllerInput,
        asked: &Asked,
        dt: f64,
        digests: &mut Digests,
        probe: &mut dyn Probe,
    ) -> Option<Fault> {
        let Quadruped { params, robot, state, place, scratch, messages, .. } = self;
        let Scratch { estimate, references, wbc, trunk } = scratch;

        estimate.update_at(robot, &input.state, place, state.gradient_W);
        if let Some(fault) = safety::check_tilt(params, &estimate.base.rpy) {
            return Some(fault);
        }
        estimate.contact_forces(robot, params, &input.state.tau, state);
        let gradient_before = state.gradient_W;
        terrain::update(params, estimate, state, dt);
        estimate.height(state);
        if let Some(fault) = safety::check_footing(robot, params, state, dt) {
            return Some(fault);
        }
        digests.0[Stage::Estimation as usize] = digests::estimation(estimate, state);
        probe.stage_done(Stage::Estimation);

        let rate =
            |now: [f64; 2], before: [f64; 2]| [0, 1].map(|k| if dt > 0.0 { (now[k] - before[k]) / dt } else { 0.0 });
        let rp_before = state.rp_des;
        let wish = operator::follow(params, estimate, state, &input.op, asked, dt);
        let rp_rate = rate(state.rp_des, rp_before);
        *trunk = operator::trunk_reference(state, rp_rate, rate(state.gradient_W, gradient_before));
        let met = recovery::surprises(robot, params, estimate, state, dt);
        let changes = gait::update(state, params, wish, &met, dt);
        let q = &input.state.q;
        references.update(&Tick { robot, params, estimate, q, changes: &changes, dt }, state);
        digests.0[Stage::Gait as usize] = digests::gait(references, state);
        probe.stage_done(Stage::Gait);

        wbc.build(robot, params, &input.state, estimate, trunk, references, state);
        digests.0[Stage::Tasks as usize] = digests::tasks(wbc);
        probe.stage_done(Stage::Tasks);

        wbc.solve(estimate, state);
        digests.0[Stage::Qp as usize] = digests::qp(wbc);
        probe.stage_done(Stage::Qp);

        let n_clamped = take_torques(params, robot, wbc, state);
        messages.estimation(robot, estimate, trunk, wbc, state);
        messages.legs(params, estimate, references, wbc, state);
        messages.wbc(estimate, wbc, state, n_clamped);
        if state.qp_failures > params.safety.max_qp_failures {
            return fault(ControllerTick::FAULT_QP, None, f64::from(state.qp_failures));
        }
        None
    }

    /// One tick of getting up or sitting down.
    fn change_posture(
        &mut self,
        input: &ControllerInput,
        asked: &Asked,
        dt: f64,
        digests: &mut Digests,
        probe: &mut dyn Probe,
    ) -> Option<Fault> {
        let Quadruped { params, robot, rise, state, place, scratch: Scratch { estimate, .. }, messages, .. } = self;
        estimate.update_at(robot, &input.state, place, state.gradient_W);
        if let Some(fault) = safety::check_tilt(params, &estimate.base.rpy) {
            return Some(fault);
        }
        estimate.contact_forces(robot, params, &input.state.tau, state);
        estimate.height(state);
        digests.0[Stage::Estimation as usize] = digests::estimation(estimate, state);
        probe.stage_done(Stage::Estimation);

        state.fault = asked.refused.unwrap_or_default();
        let fault = rise.update(robot, params, estimate, &input.state, state, dt);
        digests.0[Stage::Gait as usize] = digests::posture(state);
        probe.stage_done(Stage::Gait);

        messages.nothing_computed(state);
        messages.posture(robot, estimate, state);
        fault
    }

    /// What is wrong with the command that this tick has come to: the last check, whatever was computed before.
    fn check_command(&mut self) -> Option<Fault> {
        let Quadruped { params, robot, rise, state, scratch, messages, .. } = self;
        messages.command(robot, params, rise, &scratch.references, state);
        safety::check_command(&messages.command)
    }

    /// Goes to the safe state if a fault was found, and keeps its reason there until the operator asks what holds it.
    fn end(&mut self, found: Option<Fault>, asked: &Asked) {
        let state = &mut self.state;
        match (state.mode, found) {
            (Mode::Damping, None) => {}
            (Mode::Damping, Some(fault)) if asked.wish == Wish::Idle => state.fault = fault,
            (Mode::Damping, Some(_)) => {}
            // Before the first good input there is nothing to save: the controller waits and says what for.
            (_, Some(fault)) => {
                state.fault = fault;
                state.t_still = 0.0;
                state.mode = if state.started { Mode::Damping } else { Mode::Idle };
            }
            (Mode::Idle, None) => state.fault = asked.refused.unwrap_or_default(),
            (_, None) => {}
        }
    }

    /// Writes command and tick, and fills the outbox.
    fn publish(&mut self, input: &ControllerInput, digests: &Digests, out: &mut Outbox) {
        let Quadruped { params, robot, rise, state, scratch, messages, .. } = self;
        let mut digest = Digest::default();
        messages.command(robot, params, rise, &scratch.references, state);
        safety::limit(&robot.model.joints, &mut messages.command, &input.state);
        let c = &messages.command;
        for values in [&c.tau, &c.q_des, &c.qd_des, &c.kp, &c.kd] {
            digest.f64s(values);
        }
        digest.word(u64::from(c.mode.cast_unsigned()));
        messages.tick = ControllerTick {
            t_ns: state.t_ns,
            tick: state.tick,
            mode: state.mode as i8,
            fault: state.fault.code,
            fault_index: state.fault.index,
            fault_value: state.fault.value,
            digest_input: digests.0[Stage::Input as usize],
            digest_estimation: digests.0[Stage::Estimation as usize],
            digest_gait: digests.0[Stage::Gait as usize],
            digest_tasks: digests.0[Stage::Tasks as usize],
            digest_qp: digests.0[Stage::Qp as usize],
            digest_output: digest.finish(),
        };
        out.clear();
        let mut put = Ok(());
        put = put.and_then(|()| out.put(channels::CONTACT_ESTIMATE, &messages.contact));
        put = put.and_then(|()| out.put(channels::BASE_TRACKING, &messages.base));
        put = put.and_then(|()| out.put(channels::LEG_STATE, &messages.legs));
        put = put.and_then(|()| out.put(channels::WBC_SOLUTION, &messages.wbc));
        put = put.and_then(|()| out.put(channels::ROBOT_COMMAND, &messages.command));
        put = put.and_then(|()| out.put(channels::CONTROLLER_TICK, &messages.tick));
        if state.tick % SNAPSHOT_TICKS == 0 {
            state.write(&mut messages.snapshot);
            put = put.and_then(|()| out.put(channels::CONTROLLER_SNAPSHOT, &messages.snapshot));
        }
        put.expect("every array has the length of the robot since construction");
    }
}

impl Controller for Quadruped {
    fn name(&self) -> &'static str {
        NAME
    }

    fn step_probed(&mut self, input: &ControllerInput, out: &mut Outbox, probe: &mut dyn Probe) {
        let mut digests = Digests::default();
        digests.0[Stage::Input as usize] = digests::input(input);
        let found = safety::check_input(&self.robot, &self.params, &self.state, input);
        if found.is_some() {
            self.state.t_still = 0.0;
        }
        let mut asked = modes::asked(&self.params, input);
        let dt = if self.state.started {
            seconds(input.t_ns.saturating_sub(self.state.t_ns)).clamp(0.0, MAX_DT)
        } else {
            0.0
        };
        (self.state.t_ns, self.state.tick) = (input.t_ns, input.tick);
        let found = found.or_else(|| {
            let Quadruped { params, robot, rise, state, scratch, .. } = self;
            modes::rest(state, &input.state, dt);
            modes::follow(robot, params, rise, &mut scratch.estimate, state, input, &mut asked)
        });
        probe.stage_done(Stage::Input);

        let found = match self.state.mode {
            _ if found.is_some() => found,
            Mode::Idle | Mode::Damping => None,
            Mode::Stance | Mode::Walk => self.operate(input, &asked, dt, &mut digests, probe),
            Mode::StandUp | Mode::Sit => self.change_posture(input, &asked, dt, &mut digests, probe),
        };
        let found = found.or_else(|| self.check_command());
        self.end(found, &asked);
        if found.is_some_and(|fault| fault.code == ControllerTick::FAULT_COMMAND) {
            // What led to it is in the state: nothing of that may go on, or into a snapshot.
            self.state.forget(&input.state, self.robot.nominal_height);
        }
        if matches!(self.state.mode, Mode::Idle | Mode::Damping) {
            self.state.tau_last.fill(0.0);
            self.state.qd_des.fill(0.0);
            self.state.qdd_des.fill(0.0);
            self.state.gait_running = false;
            // The tick in which one failure was too many has computed everything else, and its solution says what failed.
            if found.is_none_or(|fault| fault.code != ControllerTick::FAULT_QP) {
                self.messages.nothing_computed(&self.state);
            }
        }
        self.publish(input, &digests, out);
        probe.stage_done(Stage::Output);
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        let mut message = self.passage.borrow_mut();
        self.state.write(&mut message);
        message.encode(out).expect("the state's arrays have the robot's length");
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let message = self.passage.get_mut();
        message.decode_into(bytes)?;
        self.state.read(message)
    }

    fn poison_workspace(&mut self) {
        self.scratch = Scratch::new(&self.robot, &self.params).expect("the same was built before");
        self.messages = Messages::new(&self.robot, &self.scratch.wbc);
    }

    fn dump(&self) -> crate::Dump {
        self.quantities()
    }
}

/// Takes over the torques of a good solution, limited to the joints' effort; repeats the last ones when there is none.
fn take_torques(params: &Params, robot: &Robot, wbc: &Wbc, state: &mut State) -> i32 {
    if !wbc.solved() {
        state.qp_failures = state.qp_failures.min(params.safety.max_qp_failures).saturating_add(1);
        return 0;
    }
    state.qp_failures = 0;
    let mut n_clamped = 0;
    for (j, joint) in robot.model.joints.iter().enumerate() {
        let limited = wbc.tau[j].clamp(-joint.effort, joint.effort);
        n_clamped += i32::from(limited != wbc.tau[j]);
        state.tau_last[j] = limited;
    }
    n_clamped
}
