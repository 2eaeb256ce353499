//! The quadruped controller: one tick from input to messages.

use super::checks;
use super::digests::{self, Digests};
use super::estimation::{AssumedBase, Estimate};
use super::gait;
use super::modes::{self, ModeRequest, OperatorRequest};
use super::operator;
use super::recovery;
use super::reference::{References, Tick};
use super::robot::Robot;
use super::stand_sit::StandSit;
use super::state::{Mode, State};
use super::terrain;
use super::trunk::{TrunkReference, trunk_reference};
use super::wbc::Wbc;
use super::wire::Messages;
use crate::digest::{command_digest, input_digest};
use crate::dump::Dump;
use crate::error::{LoadError, RestoreError};
use crate::interface::{Controller, Probe};
use crate::outbox::Outbox;
use crate::params::{Params, parameters_digest};
use crate::qp::NamedViolation;
use crate::safety::{Fault, check_command, fault, limit_command};
use crate::time::step_seconds;
use lcmtypes::channels::{self, Stage};
use lcmtypes::{ControllerTick, Message, QuadrupedState, TickInput};
use nalgebra::{Matrix3, Vector3};
use std::cell::RefCell;

/// Name by which [`crate::load`] finds the controller.
pub const NAME: &str = "quadruped";

/// The controller: parameters, robot, state and scratch memory.
pub struct Quadruped {
    pub(super) params: Params,
    digest_parameters: i64,
    pub(super) robot: Robot,
    stand_sit: StandSit,
    pub(super) state: State,
    /// Position and velocity assumed for the base; the default in operation.
    assumed_base: AssumedBase,
    pub(super) scratch: Scratch,
    pub(super) messages: Messages,
    /// Preallocated message for writing and reading snapshots.
    snapshot_buffer: RefCell<QuadrupedState>,
}

/// Scratch memory of a tick. Nothing in it is used by the next tick.
pub(super) struct Scratch {
    pub(super) estimate: Estimate,
    pub(super) references: References,
    pub(super) wbc: Wbc,
    pub(super) trunk: TrunkReference,
}

impl Scratch {
    fn new(robot: &Robot, params: &Params) -> Result<Self, LoadError> {
        let nan = f64::NAN;
        Ok(Scratch {
            estimate: Estimate::new(robot),
            references: References::new(robot),
            wbc: Wbc::new(robot, params)?,
            trunk: TrunkReference { R_WB: Matrix3::from_element(nan), w_WB_W: Vector3::from_element(nan) },
        })
    }
}

impl Quadruped {
    /// Builds the controller from the URDF text and the TOML text of the parameters.
    ///
    /// # Errors
    /// A text is invalid, or the parameters do not fit the robot.
    pub fn new(urdf: &str, params: &str) -> Result<Self, LoadError> {
        let digest_parameters = parameters_digest(params);
        let params = Params::from_toml(params, "parameters")?;
        let robot = Robot::new(urdf, &params.robot)?;
        let stand_sit = StandSit::new(&robot, &params)?;
        let state = State::new(robot.nj());
        let scratch = Scratch::new(&robot, &params)?;
        let messages = Messages::new(&robot, &scratch.wbc);
        let snapshot_buffer = RefCell::new(messages.snapshot.clone());
        let assumed_base = AssumedBase::default();
        Ok(Quadruped {
            params,
            digest_parameters,
            robot,
            stand_sit,
            state,
            assumed_base,
            scratch,
            messages,
            snapshot_buffer,
        })
    }

    /// The state between two ticks.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// The parameters.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The whole-body controller as the last tick that solved left it: quadratic programs, solutions, torques.
    pub fn wbc(&self) -> &Wbc {
        &self.scratch.wbc
    }

    /// Finds out why the last solve failed: the level of the stack, from 0, and the names of the constraints that contradict each other. `None` if
    /// every level has a solution. To explain a failure in a log, replay the log up to the tick of the failure first. It allocates: do not call
    /// it in a tick.
    pub fn explain(&self) -> Option<(usize, Vec<NamedViolation>)> {
        self.scratch.wbc.explain(&self.robot)
    }

    /// Sets the base position and velocity that the controller assumes from the next tick on; the default is at rest at the origin. No bit of a
    /// message depends on it; experiments call it to show that. It is not part of the state.
    pub fn assume_base(&mut self, base: AssumedBase) {
        self.assumed_base = base;
    }

    /// Computes a tick of standing or walking, with the digests and messages of all its stages. Returns the fault that ends it, if any.
    fn step_locomotion(
        &mut self,
        input: &TickInput,
        request: &OperatorRequest,
        dt: f64,
        digests: &mut Digests,
        probe: &mut dyn Probe,
    ) -> Option<Fault> {
        let Quadruped { params, robot, state, assumed_base, scratch, messages, .. } = self;
        let Scratch { estimate, references, wbc, trunk } = scratch;

        estimate.update_at(robot, &input.state, assumed_base, state.gradient_W);
        if let Some(fault) = checks::check_tilt(params, &estimate.base.rpy) {
            return Some(fault);
        }
        estimate.contact_forces(robot, params, &input.state.tau, state);
        let gradient_before = state.gradient_W;
        terrain::update(params, estimate, state, dt);
        estimate.height(state);
        let found = checks::check_ground_contact(robot, params, state, dt);
        if let Some(fault) = found.or_else(|| checks::check_held_foot(params, estimate, state)) {
            return Some(fault);
        }
        digests.0[Stage::Estimation as usize] = digests::estimation(estimate, state);
        probe.stage_done(Stage::Estimation as usize);

        let rate =
            |now: [f64; 2], before: [f64; 2]| [0, 1].map(|k| if dt > 0.0 { (now[k] - before[k]) / dt } else { 0.0 });
        let rp_before = state.rp_des;
        let gait_request = operator::update_references(robot, params, estimate, state, &input.op, request, dt);
        let rp_rate = rate(state.rp_des, rp_before);
        *trunk = trunk_reference(state, rp_rate, rate(state.gradient_W, gradient_before));
        let events = recovery::contact_events(robot, params, estimate, state, dt);
        let transitions = gait::update(state, params, gait_request, &events, dt);
        // A rejected request is reported first: its sender waits for the reason.
        let is_followed = matches!(state.fault, ControllerTick::FAULT_NONE | ControllerTick::FAULT_OPERATOR_LIMITED);
        if let Some(held) = checks::held_foot(params, state).filter(|_| is_followed) {
            state.set_fault(held);
        }
        let q = &input.state.q;
        references.update(&Tick { robot, params, estimate, q, transitions: &transitions, dt }, state);
        digests.0[Stage::Gait as usize] = digests::gait(references, state);
        probe.stage_done(Stage::Gait as usize);

        wbc.build(robot, params, &input.state, estimate, trunk, references, state);
        digests.0[Stage::Tasks as usize] = digests::tasks(wbc);
        probe.stage_done(Stage::Tasks as usize);

        wbc.solve(estimate, state);
        digests.0[Stage::Qp as usize] = digests::qp(wbc);
        probe.stage_done(Stage::Qp as usize);

        let n_clamped = apply_torques(params, robot, &input.state.qd, wbc, state);
        messages.estimation(robot, estimate, trunk, wbc, state);
        messages.legs(params, estimate, references, wbc, state);
        messages.wbc(estimate, wbc, state, n_clamped);
        if state.qp_failures > params.safety.max_qp_failures {
            return fault(ControllerTick::FAULT_QP, None, f64::from(state.qp_failures));
        }
        None
    }

    /// Computes a tick of standing up or sitting down. Returns the fault that ends it, if any.
    fn step_stand_sit(
        &mut self,
        input: &TickInput,
        request: &OperatorRequest,
        dt: f64,
        digests: &mut Digests,
        probe: &mut dyn Probe,
    ) -> Option<Fault> {
        let Quadruped { params, robot, stand_sit, state, assumed_base, scratch, messages, .. } = self;
        let estimate = &mut scratch.estimate;
        estimate.update_at(robot, &input.state, assumed_base, state.gradient_W);
        if let Some(fault) = checks::check_tilt(params, &estimate.base.rpy) {
            return Some(fault);
        }
        estimate.contact_forces(robot, params, &input.state.tau, state);
        estimate.height(state);
        digests.0[Stage::Estimation as usize] = digests::estimation(estimate, state);
        probe.stage_done(Stage::Estimation as usize);

        state.set_fault(request.rejected.unwrap_or_default());
        let fault = stand_sit.update(robot, params, estimate, &input.state, state, dt);
        digests.0[Stage::Gait as usize] = digests::stand_sit(state);
        probe.stage_done(Stage::Gait as usize);

        messages.clear(state);
        messages.stand_sit(robot, estimate, state);
        fault
    }

    /// Builds the command of this tick and checks it, whatever was computed before.
    fn check_command(&mut self) -> Option<Fault> {
        let Quadruped { params, robot, stand_sit, state, scratch, messages, .. } = self;
        messages.command(robot, params, stand_sit, &scratch.references, state);
        check_command(&messages.command)
    }

    /// Enters the safe state if a fault was found. The safe state keeps the fault that led to it, until the operator requests IDLE and another fault
    /// prevents that.
    fn apply_fault(&mut self, found: Option<Fault>, request: &OperatorRequest) {
        let state = &mut self.state;
        match (state.mode, found) {
            (Mode::Damping, None) => {}
            (Mode::Damping, Some(fault)) if request.mode == ModeRequest::Idle => state.set_fault(fault),
            (Mode::Damping, Some(_)) => {}
            // Before the first valid input the robot has no torque: the controller stays in IDLE and reports the fault.
            (_, Some(fault)) => {
                state.set_fault(fault);
                state.t_still = 0.0;
                state.mode = if state.started { Mode::Damping } else { Mode::Idle };
            }
            (Mode::Idle, None) => state.set_fault(request.rejected.unwrap_or_default()),
            (_, None) => {}
        }
    }

    /// Writes command and tick messages, and puts all messages into the outbox.
    fn publish(&mut self, input: &TickInput, digests: &Digests, out: &mut Outbox) {
        let Quadruped { params, digest_parameters, robot, stand_sit, state, scratch, messages, .. } = self;
        messages.command(robot, params, stand_sit, &scratch.references, state);
        messages.command.run_id = input.run_id;
        limit_command(&robot.model.joints, &mut messages.command, &input.state);
        let m = &mut messages.tick;
        (m.t_ns, m.tick, m.run_id, m.n_ignored) = (state.t_ns, state.tick, input.run_id, input.n_ignored);
        (m.mode, m.fault, m.fault_index, m.fault_value) =
            (state.mode as i8, state.fault, state.fault_index, state.fault_value);
        m.digest.copy_from_slice(&digests.0);
        m.digest[Stage::Output as usize] = command_digest(&messages.command);
        m.digest_parameters = *digest_parameters;
        out.clear();
        let mut put = Ok(());
        put = put.and_then(|()| out.put(channels::CONTACT_ESTIMATE, &messages.contact));
        put = put.and_then(|()| out.put(channels::BASE_TRACKING, &messages.base));
        put = put.and_then(|()| out.put(channels::LEG_STATE, &messages.legs));
        put = put.and_then(|()| out.put(channels::WBC_SOLUTION, &messages.wbc));
        put = put.and_then(|()| out.put(channels::ROBOT_COMMAND, &messages.command));
        put = put.and_then(|()| out.put(channels::CONTROLLER_TICK, &messages.tick));
        put.expect("every array has the length of the robot since construction");
    }
}

impl Controller for Quadruped {
    fn name(&self) -> &'static str {
        NAME
    }

    fn stages(&self) -> &[&'static str] {
        &Stage::NAMES
    }

    fn step_probed(&mut self, input: &TickInput, out: &mut Outbox, probe: &mut dyn Probe) {
        let mut digests = Digests::default();
        digests.0[Stage::Input as usize] = input_digest(input);
        let found = checks::check_input(&self.robot, &self.params, &self.state, input);
        if found.is_some() {
            self.state.t_still = 0.0;
        }
        let mut request = modes::operator_request(&self.params, input);
        let dt = if self.state.started { step_seconds(input.t_ns, self.state.t_ns) } else { 0.0 };
        (self.state.t_ns, self.state.tick) = (input.t_ns, input.tick);
        let found = found.or_else(|| {
            let Quadruped { params, robot, stand_sit, state, scratch, .. } = self;
            modes::update_rest_time(state, &input.state, dt);
            modes::follow(robot, params, stand_sit, &mut scratch.estimate, state, input, &mut request)
        });
        probe.stage_done(Stage::Input as usize);

        let found = match self.state.mode {
            _ if found.is_some() => found,
            Mode::Idle | Mode::Damping => None,
            Mode::Stance | Mode::Walk => self.step_locomotion(input, &request, dt, &mut digests, probe),
            Mode::StandUp | Mode::Sit => self.step_stand_sit(input, &request, dt, &mut digests, probe),
        };
        let found = found.or_else(|| self.check_command());
        self.apply_fault(found, &request);
        if found.is_some_and(|fault| fault.code == ControllerTick::FAULT_COMMAND) {
            // A non-finite command was computed from the state, so the state may contain NaN. Neither the next tick nor a snapshot may use it.
            self.state.reset(&input.state, self.robot.nominal_height);
        }
        if matches!(self.state.mode, Mode::Idle | Mode::Damping) {
            self.state.tau_last.fill(0.0);
            self.state.qd_des.fill(0.0);
            self.state.qdd_des.fill(0.0);
            self.state.gait_running = false;
            // After the last QP failure that is allowed, all other quantities of the tick are valid, and WBC_SOLUTION contains the level
            // that failed: keep the messages.
            if found.is_none_or(|fault| fault.code != ControllerTick::FAULT_QP) {
                self.messages.clear(&self.state);
            }
        }
        self.publish(input, &digests, out);
        probe.stage_done(Stage::Output as usize);
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        let mut message = self.snapshot_buffer.borrow_mut();
        self.state.write(&mut message);
        message.encode(out).expect("the state's arrays have the robot's length");
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let message = self.snapshot_buffer.get_mut();
        message.decode_into(bytes)?;
        if self.params.gait.gait(message.gait).is_none() {
            let (found, last) = (message.gait.into(), self.params.gait.last().into());
            return Err(RestoreError::Value { field: "gait", found, last });
        }
        self.state.read(message)
    }

    fn poison_workspace(&mut self) {
        self.scratch = Scratch::new(&self.robot, &self.params).expect("the same was built before");
        self.messages = Messages::new(&self.robot, &self.scratch.wbc);
        // A field that `write` omits is zero in the next snapshot.
        self.snapshot_buffer = RefCell::new(self.messages.snapshot.clone());
    }

    fn dump(&self) -> Dump {
        self.quantities()
    }
}

/// Takes the torques of the solution, limited to what the drives can do at the joint velocities `qd`, as the torques of this tick, and returns the number of
/// joints limited. Without a solution the last torques stay, and the failure is counted.
fn apply_torques(params: &Params, robot: &Robot, qd: &[f64], wbc: &Wbc, state: &mut State) -> i32 {
    if !wbc.solved() {
        state.qp_failures = state.qp_failures.min(params.safety.max_qp_failures).saturating_add(1);
        return 0;
    }
    state.qp_failures = 0;
    let mut n_clamped = 0;
    for (j, joint) in robot.model.joints.iter().enumerate() {
        let (least, most) = joint.torque_range(qd[j]);
        let limited = wbc.tau[j].clamp(least, most);
        n_clamped += i32::from(limited != wbc.tau[j]);
        state.tau_last[j] = limited;
    }
    n_clamped
}
