//! A controller that moves every joint to a named posture with limited velocity and acceleration, and holds it there.
//!
//! In each tick the velocity reference of a joint changes towards the largest velocity from which it can still stop at the goal, `v² / (2 a)` before it.
//! So the posture (`motion.posture`) can be changed at any time: the references continue without a step in position and velocity. Nothing is computed
//! from the dynamics; the joint loop of the drives follows the references, as with [`crate::hold`].
//!
//! A `joint_reference_t` that is delivered replaces the goal of the joints that it names, from then on also against changes of `motion.posture`. One
//! with an unknown joint, or with a position that is not finite or outside the limits of its joint, changes nothing and counts as ignored.

pub mod params;

use crate::digest::input_digest;
use crate::error::{LoadError, RestoreError};
use crate::hold::drive::{Gains, Handover, Output, STAGES, judge, posture_of};
use crate::interface::{Controller, Probe};
use crate::model::{JointInfo, NOMINAL, UrdfTree, check_runnable};
use crate::outbox::Outbox;
use crate::params::{Params, parameters_digest};
use crate::safety::Fault;
use crate::time::StepLimit;
use crate::trajectory::approach::approach;
use lcmtypes::{ControllerTick, JointReference, Message, PostureState, RobotCommand, RunInfo, TickInput, channels};

/// Name by which [`crate::load`] finds the controller.
pub const NAME: &str = "posture";
/// Largest speed of a joint without a velocity limit, rad/s or m/s.
const LARGEST_SPEED: f64 = 10.0;

/// The controller.
pub struct Posture {
    params: Params,
    joints: Vec<JointInfo>,
    gains: Gains,
    /// Goal of every joint before the first [`JointReference`].
    q_posture: Vec<f64>,
    step_limit: StepLimit,
    state: PostureState,
    /// Preallocated message for reading snapshots.
    snapshot_buffer: PostureState,
    /// Preallocated message for reading references.
    reference: JointReference,
    output: Output,
    handover: Handover,
}

impl Posture {
    /// Builds the controller of the first component of a run from URDF, parameters and period.
    ///
    /// # Errors
    /// A text is invalid, the robot does not have the posture `motion.posture`, or the posture lacks a joint of the robot.
    pub fn new(info: &RunInfo) -> Result<Self, LoadError> {
        let digest_parameters = parameters_digest(info.params());
        let params = Params::from_toml(info.params(), "parameters")?;
        let tree = UrdfTree::parse(&info.urdf, &params.robot.urdf)?;
        let robot = params.robot.description(&tree)?;
        let model = robot.model(&tree)?;
        let q_posture = posture_of(&robot, &params.motion.posture)?;
        check_runnable(&model, &posture_of(&robot, NOMINAL)?)?;
        let gains = Gains::new(&robot, &params.hold, &params.safety);
        let nj = q_posture.len();
        let output = Output::new(nj, digest_parameters);
        let state = PostureState {
            tick: -1,
            mode: ControllerTick::MODE_IDLE,
            fault_index: -1,
            nj: output.command.nj,
            q_ref: vec![0.0; nj],
            qd_ref: vec![0.0; nj],
            q_goal: q_posture.clone(),
            ..PostureState::default()
        };
        let (joints, snapshot_buffer) = (model.joints, state.clone());
        let names = joints.iter().map(|joint| joint.name.clone()).collect();
        let reference = JointReference { n: output.command.nj, joints: names, q: vec![0.0; nj], ..Default::default() };
        let step_limit = StepLimit::of(info);
        Ok(Posture {
            params,
            joints,
            gains,
            q_posture,
            step_limit,
            state,
            snapshot_buffer,
            reference,
            output,
            handover: Handover::new(nj),
        })
    }

    /// Replaces the goal of the joints that a reference names.
    fn take_reference(&mut self, data: &[u8]) -> bool {
        let Posture { reference, joints, state, .. } = self;
        if reference.decode_into(data).is_err() {
            return false;
        }
        let index = |name: &String| joints.iter().position(|joint| joint.name == *name);
        let is_valid = |(name, q): (&String, &f64)| {
            q.is_finite() && index(name).is_some_and(|j| (joints[j].lower..=joints[j].upper).contains(q))
        };
        if !reference.joints.iter().zip(&reference.q).all(is_valid) {
            return false;
        }
        state.has_goal = true;
        for (name, q) in reference.joints.iter().zip(&reference.q) {
            state.q_goal[index(name).expect("`is_valid` found it")] = *q;
        }
        true
    }

    /// Updates the state: mode, faults and references.
    fn advance(&mut self, input: &TickInput) {
        let before_ns = self.state.t_ns;
        (self.state.t_ns, self.state.tick) = (input.t_ns, input.tick);
        if self.state.mode == ControllerTick::MODE_DAMPING {
            return;
        }
        let (fault, goes_on) = judge(&self.joints, &self.params.safety, input, &mut self.state.mode);
        (self.state.fault, self.state.fault_index, self.state.fault_value) = (fault.code, fault.index, fault.value);
        if !goes_on {
            return;
        }
        if self.state.mode == ControllerTick::MODE_IDLE {
            self.state.mode = ControllerTick::MODE_STAND_UP;
            self.handover.start(&self.joints, &input.state.q, &mut self.state.q_ref);
            self.state.qd_ref.fill(0.0);
            return;
        }
        let dt = self.step_limit.seconds(input.t_ns, before_ns);
        let Posture { params, joints, q_posture, state, .. } = self;
        let mut is_there = true;
        if !state.has_goal {
            state.q_goal.copy_from_slice(q_posture);
        }
        for (j, joint) in joints.iter().enumerate() {
            let goal = state.q_goal[j];
            let v_max = params.motion.velocity * joint.velocity.min(LARGEST_SPEED);
            let from = (state.q_ref[j], state.qd_ref[j]);
            let (q, qd) = approach(from, goal, v_max, params.motion.acceleration, dt);
            (state.q_ref[j], state.qd_ref[j]) = (q, qd);
            is_there &= q == goal && qd == 0.0;
        }
        self.state.mode = if is_there { ControllerTick::MODE_STANCE } else { ControllerTick::MODE_STAND_UP };
    }

    /// Computes the command from the state, before effort limits.
    fn fill_command(&mut self) {
        let Posture { gains, state, output: Output { command, .. }, .. } = self;
        command.tau.fill(0.0);
        gains.fill(state.mode, command);
        if command.mode == RobotCommand::MODE_TORQUE {
            command.q_des.copy_from_slice(&state.q_ref);
            command.qd_des.copy_from_slice(&state.qd_ref);
        } else {
            command.q_des.fill(0.0);
            command.qd_des.fill(0.0);
        }
    }
}

impl Controller for Posture {
    fn name(&self) -> &'static str {
        NAME
    }

    fn stages(&self) -> &[&'static str] {
        &STAGES
    }

    fn receive(&mut self, _: &TickInput, channel: &str, data: &[u8]) -> bool {
        match channels::split(channel) {
            ("", channels::ROBOT_COMMAND) => self.handover.take(data, self.q_posture.len()),
            (_, channels::JOINT_REFERENCE) => self.take_reference(data),
            _ => false,
        }
    }

    fn step_probed(&mut self, input: &TickInput, out: &mut Outbox, probe: &mut dyn Probe) {
        let digest_input = input_digest(input);
        self.advance(input);
        self.handover.clear();
        probe.stage_done(0);
        self.fill_command();
        let PostureState { mode, fault: code, fault_index: index, fault_value: value, .. } = self.state;
        self.output.publish(&self.joints, input, digest_input, mode, Fault { code, index, value }, out);
        probe.stage_done(1);
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.state.encode(out).expect("the state's arrays have the robot's length");
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let state = &mut self.snapshot_buffer;
        state.decode_into(bytes)?;
        let (found, expected) = (state.q_ref.len(), self.q_posture.len());
        if found != expected {
            return Err(RestoreError::Joints { found, expected });
        }
        for (field, values) in [("q_ref", &state.q_ref), ("qd_ref", &state.qd_ref), ("q_goal", &state.q_goal)] {
            if values.iter().any(|x| !x.is_finite()) {
                return Err(RestoreError::NotFinite { field });
            }
        }
        std::mem::swap(&mut self.state, &mut self.snapshot_buffer);
        Ok(())
    }

    fn poison_workspace(&mut self) {
        self.output.poison();
    }
}
