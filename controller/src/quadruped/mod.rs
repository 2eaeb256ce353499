//! Planner-free quadruped locomotion: trot over what terrain there is, with joint sensors and an IMU and nothing else.
//!
//! Source: G. Raiola, E. Mingo Hoffman, M. Focchi, N. Tsagarakis, C. Semini, *A simple yet effective whole-body locomotion framework for
//! quadruped robots*, Frontiers in Robotics and AI, 2020. Cited by equation number where an equation is used; a line that departs from it says so.
//!
//! A tick, in the order of [`Quadruped::step_probed`]: [`safety`] checks the input, [`estimation`] finds base, dynamics and
//! contacts, [`gait`] moves the legs' state machines, [`mod@reference`] plans footholds and joint references, [`wbc`] builds and solves
//! the quadratic programs of the stack of [`tasks`], [`wire`] writes the messages.

mod dump;
pub mod estimation;
pub mod foothold;
pub mod gait;
pub mod leg;
pub mod reference;
pub mod robot;
pub mod safety;
pub mod state;
pub mod sway;
pub mod swing;
pub mod tasks;
pub mod wbc;
pub mod wire;

use crate::digest::Digest;
use crate::math::{Rx, Ry, Rz, low_pass, ramp, wrap_angle};
use crate::params::Params;
use crate::qp::NamedViolation;
use crate::{Controller, LoadError, Outbox, Probe, RestoreError, Stage};
use estimation::{BasePlace, Estimate};
use gait::{Transitions, Wish};
use lcmtypes::{ControllerInput, ControllerTick, Message, OperatorCommand, QuadrupedState, channels};
use leg::Leg;
use nalgebra::Vector3;
use reference::References;
use robot::Robot;
use safety::{fault, seconds};
use state::{Fault, Gait, Mode, State};
use wbc::{TrunkReference, Wbc};
use wire::Messages;

/// Name by which [`crate::load`] finds the controller.
pub const NAME: &str = "quadruped";
/// Ticks between two snapshots of the state.
pub const SNAPSHOT_TICKS: i64 = 1000;
/// Longest time step that integrators see, s: a late tick must not throw references.
const MAX_DT: f64 = 0.01;
/// Largest lead of the heading reference over the heading, rad.
const MAX_HEADING_LEAD: f64 = 0.3;

/// The controller: parameters and robot, state, scratch.
pub struct Quadruped {
    params: Params,
    robot: Robot,
    state: State,
    /// Where the base is taken to be; nothing in operation changes it.
    place: BasePlace,
    scratch: Scratch,
    messages: Messages,
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

/// Digests of a tick, by stage.
#[derive(Default)]
struct Digests([i64; 6]);

impl Quadruped {
    /// Builds the controller from the text of a URDF and of the parameters.
    ///
    /// # Errors
    /// Unusable texts; parameters that do not fit the robot.
    pub fn new(urdf: &str, params: &str) -> Result<Self, LoadError> {
        let params = Params::from_toml(params, "parameters")?;
        let robot = Robot::new(urdf, &params.robot)?;
        let state = State::new(robot.nj());
        let scratch = Scratch::new(&robot, &params)?;
        let messages = Messages::new(&robot, &scratch.wbc);
        Ok(Quadruped { params, robot, state, place: BasePlace::default(), scratch, messages })
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

    /// Takes the base to be somewhere, and to move, from the next tick on, instead of resting at the origin. No command depends on it, but for
    /// rounding: that is what experiments feed it for. Not for operation, and no part of the state.
    pub fn take_base_to_be(&mut self, place: BasePlace) {
        self.place = place;
    }

    /// One tick in operation. Digests and messages of all its stages; gives the fault that ends it, if any.
    fn operate(
        &mut self,
        input: &ControllerInput,
        dt: f64,
        digests: &mut Digests,
        probe: &mut dyn Probe,
    ) -> Option<Fault> {
        let Quadruped { params, robot, state, place, scratch, messages } = self;
        let Scratch { estimate, references, wbc, trunk } = scratch;

        estimate.update_at(robot, &input.state, place);
        if let Some(fault) = safety::check_tilt(params, &estimate.base.rpy) {
            return Some(fault);
        }
        estimate.contact_forces(robot, params, &input.state.tau, state);
        estimate.height(state);
        digests.0[Stage::Estimation as usize] = digest_estimation(estimate, state);
        probe.stage_done(Stage::Estimation);

        let rp_before = state.rp_des;
        let op = follow_operator(params, estimate, state, &input.op, dt);
        let rp_rate = [0, 1].map(|k| if dt > 0.0 { (state.rp_des[k] - rp_before[k]) / dt } else { 0.0 });
        *trunk = trunk_reference(state, rp_rate);
        let changes: Transitions = gait::update(state, params, op, dt);
        references.update(robot, params, estimate, &input.state.q, &changes, state, dt);
        digests.0[Stage::Gait as usize] = digest_gait(references, state);
        probe.stage_done(Stage::Gait);

        wbc.build(robot, params, &input.state, estimate, trunk, references, state);
        digests.0[Stage::Tasks as usize] = digest_tasks(wbc);
        probe.stage_done(Stage::Tasks);

        wbc.solve(estimate, state);
        digests.0[Stage::Qp as usize] = digest_qp(wbc);
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

    /// Writes command and tick, and fills the outbox.
    fn publish(&mut self, digests: &Digests, out: &mut Outbox) {
        let Quadruped { params, state, scratch, messages, .. } = self;
        let mut digest = Digest::default();
        messages.command(params, &scratch.references, state);
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
        digests.0[Stage::Input as usize] = digest_input(input);
        let found = safety::check_input(&self.robot, &self.params, &self.state, input)
            .or_else(|| safety::check_operator(&input.op));
        let dt = if self.state.started {
            seconds(input.t_ns.saturating_sub(self.state.t_ns)).clamp(0.0, MAX_DT)
        } else {
            0.0
        };
        (self.state.t_ns, self.state.tick) = (input.t_ns, input.tick);
        if found.is_none() && !self.state.started {
            start(&self.robot, &mut self.state, input);
        }
        probe.stage_done(Stage::Input);

        let found = match self.state.mode {
            Mode::Damping => None,
            _ if found.is_some() => found,
            _ => self.operate(input, dt, &mut digests, probe),
        };
        if let Some(fault) = found {
            self.state.fault = fault;
            // Before the first good input there is nothing to save: the controller waits and says what for.
            self.state.mode = if self.state.started { Mode::Damping } else { Mode::Idle };
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
        self.publish(&digests, out);
        probe.stage_done(Stage::Output);
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        let mut message = QuadrupedState::default();
        self.state.write(&mut message);
        message.encode(out).expect("the state's arrays have the robot's length");
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let message = QuadrupedState::decode(bytes)?;
        self.state = State::read(&message, self.robot.nj())?;
        Ok(())
    }

    fn poison_workspace(&mut self) {
        self.scratch = Scratch::new(&self.robot, &self.params).expect("the same was built before");
        self.messages = Messages::new(&self.robot, &self.scratch.wbc);
    }

    fn dump(&self) -> crate::Dump {
        self.quantities()
    }
}

/// First valid input: references start where the robot is.
fn start(robot: &Robot, state: &mut State, input: &ControllerInput) {
    state.started = true;
    state.mode = Mode::Stance;
    state.q_des.copy_from_slice(&input.state.q);
    state.yaw_des = estimation::base_estimate(robot, &input.state).rpy[2];
    state.height = robot.nominal_height;
}

/// Ramps and filters the operator's numbers into the state; says what is wished of the gait.
///
/// A command that is not a number counts as the wish to stand, and the tick's fault code says so. A mode without meaning counts as the
/// wish to stand too, a gait without meaning as the present one: they come from a newer operator, not from a broken one.
fn follow_operator(params: &Params, estimate: &Estimate, state: &mut State, op: &OperatorCommand, dt: f64) -> Wish {
    let usable = safety::operator_is_finite(op);
    state.fault = if usable {
        Fault::default()
    } else {
        Fault { code: ControllerTick::FAULT_OPERATOR_NOT_FINITE, index: -1, value: 0.0 }
    };
    let none = OperatorCommand::default();
    let op = if usable { op } else { &none };
    let walk = op.mode == OperatorCommand::MODE_WALK;
    let steps = walk && state.gait_running && state.gait_clock >= 0.0;

    let limits = &params.foothold;
    let mut v = if steps { op.v_H } else { [0.0; 2] };
    let speed = (v[0] * v[0] + v[1] * v[1]).sqrt();
    if speed > limits.max_speed {
        // In this order a speed too large to be squared gives 0, not NaN.
        let part = limits.max_speed / speed;
        v = v.map(|x| x * part);
    }
    let yaw_rate = if steps { op.yaw_rate.clamp(-limits.max_yaw_rate, limits.max_yaw_rate) } else { 0.0 };
    for (v_des, v) in state.v_H_des.iter_mut().zip(v) {
        let filtered = low_pass(*v_des, v, limits.command_time_constant, dt);
        *v_des = ramp(*v_des, filtered, limits.max_acceleration * dt);
    }
    state.yaw_rate_des = low_pass(state.yaw_rate_des, yaw_rate, limits.command_time_constant, dt);
    // The heading reference waits for the robot rather than winding up against a base that cannot turn.
    let yaw = estimate.base.rpy[2];
    let ahead = wrap_angle(state.yaw_des + state.yaw_rate_des * dt - yaw);
    state.yaw_des = yaw + ahead.clamp(-MAX_HEADING_LEAD, MAX_HEADING_LEAD);

    let trunk = &params.trunk;
    for (k, wished) in [op.roll, op.pitch].into_iter().enumerate() {
        let wished = wished.clamp(-trunk.max_orientation, trunk.max_orientation);
        state.rp_des[k] = ramp(state.rp_des[k], wished, trunk.max_orientation_rate * dt);
    }
    let wished = op.height_offset.clamp(-trunk.max_height_offset, trunk.max_height_offset);
    state.height_offset = ramp(state.height_offset, wished, trunk.max_height_rate * dt);

    let gait = match op.gait {
        OperatorCommand::GAIT_TROT => Gait::Trot,
        OperatorCommand::GAIT_CRAWL => Gait::Crawl,
        _ => state.gait,
    };
    Wish { walk, gait }
}

/// `R_des = Rz(yaw_des) Ry(pitch_des) Rx(roll_des)`, turning at the commanded yaw rate and with the ramps of roll and pitch.
fn trunk_reference(state: &State, rp_rate: [f64; 2]) -> TrunkReference {
    let [roll, pitch] = state.rp_des;
    let R_yaw = Rz(state.yaw_des);
    let R_pitch = R_yaw * Ry(pitch);
    TrunkReference {
        R_WB: R_pitch * Rx(roll),
        w_WB_W: R_pitch * Vector3::x() * rp_rate[0]
            + R_yaw * Vector3::y() * rp_rate[1]
            + Vector3::z() * state.yaw_rate_des,
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

fn digest_input(input: &ControllerInput) -> i64 {
    let ControllerInput { t_ns, tick, state, op } = input;
    let mut d = Digest::default();
    for word in [t_ns, tick, &state.t_ns, &state.seq, &op.t_ns, &op.seq] {
        d.word(word.cast_unsigned());
    }
    for values in [&state.q, &state.qd, &state.tau] {
        d.f64s(values);
    }
    d.f64s(&state.q_WI_wxyz);
    d.f64s(&state.w_WI_I);
    d.f64s(&state.a_I);
    d.word(u64::from(op.mode.cast_unsigned()));
    d.word(u64::from(op.gait.cast_unsigned()));
    d.f64s(&op.v_H);
    d.f64s(&[op.yaw_rate, op.roll, op.pitch, op.height_offset]);
    d.finish()
}

fn digest_estimation(estimate: &Estimate, state: &State) -> i64 {
    let mut d = Digest::default();
    d.mat3(&estimate.base.R_WB);
    d.vec3(&estimate.base.w_WB_W);
    d.f64s(&estimate.base.rpy);
    d.f64(estimate.base.yaw_rate);
    d.dmat(&estimate.M);
    d.dvec(&estimate.h);
    d.vec3(&estimate.n_W);
    for (leg, of_leg) in estimate.legs.iter() {
        d.vec3(&of_leg.p_BF_W);
        d.vec3(&of_leg.p_hip_W);
        d.dmat(&of_leg.J);
        d.vec3(&of_leg.a_bias_W);
        d.vec3(&state.f_F_W[leg]);
        d.word(u64::from(state.contact[leg]));
    }
    d.f64(state.height);
    d.finish()
}

fn digest_gait(references: &References, state: &State) -> i64 {
    let mut d = Digest::default();
    d.f64s(&[state.gait_clock, state.yaw_des, state.height_offset, state.zeta, state.yaw_rate_des]);
    d.f64s(&state.rp_des);
    d.f64s(&state.v_H_des);
    d.f64s(&state.sway_H);
    d.word(state.gait as u64);
    d.word(state.mode as u64);
    for leg in Leg::ALL {
        d.word(state.leg_phase[leg] as u64);
        d.f64s(&[state.t_leg[leg], state.step_length[leg], state.step_heading[leg]]);
        d.vec3(&references.p_BF_H[leg]);
        d.vec3(&references.v_BF_H[leg]);
        d.vec3(&references.foothold_H[leg]);
    }
    d.f64s(&state.q_des);
    d.f64s(&state.qd_des);
    d.f64s(&state.qdd_des);
    d.finish()
}

fn digest_tasks(wbc: &Wbc) -> i64 {
    let mut d = Digest::default();
    for level in &wbc.stack.levels {
        for matrix in [&level.qp.H, &level.qp.A, &level.qp.C] {
            d.dmat(matrix);
        }
        for vector in [&level.qp.g, &level.qp.b, &level.qp.d, &level.qp.lower, &level.qp.upper] {
            d.dvec(vector);
        }
    }
    d.vec3(&wbc.tasks.e_o_W);
    d.vec3(&wbc.tasks.wd_trunk);
    d.dvec(&wbc.tasks.qdd_posture);
    d.finish()
}

fn digest_qp(wbc: &Wbc) -> i64 {
    let mut d = Digest::default();
    for level in &wbc.stack.levels {
        if let Some(info) = level.info {
            d.word(info.status as u64);
            d.word(u64::from(info.iterations));
        }
        d.dvec(&level.x);
    }
    d.dvec(&wbc.tau);
    d.finish()
}
