//! A Cartesian server for any robot: inverse kinematics at velocity level for a stack of tasks from a file, moved by requests over LCM.
//!
//! In each tick the requests that were delivered are carried out ([`requests`]), the references of the tasks advance within their limits ([`crate::trajectory`]), the
//! hierarchy of the stack is solved for the velocities of the model ([`ik`]), and the model state is integrated: it is the joint reference of the drives. The model
//! state starts at the last command or the measured joints, with the base above the ground such that its lowest contact is at z = 0, and with the measured roll and
//! pitch. With `feedback = "measured"` the joints of the model are the measured ones in every tick.
//!
//! Source: Laurenzi 2020, sections 2.4, 4.3, 5.2. Names of operations follow CartesI/O.

pub mod ik;
pub mod one_shot;
pub mod params;
pub mod requests;
pub mod stack_file;
mod status;
mod task;

pub use ik::{Ik, IkState};
pub use stack_file::StackFile;
pub use task::IkTask;

use crate::digest::{Digest, input_digest};
use crate::error::{LoadError, RestoreError};
use crate::hold::drive::{Gains, Handover, Output, STAGES, judge, posture_of};
use crate::interface::{Controller, Probe};
use crate::math::{Rz, quaternion, rpy_of};
use crate::model::{ContactGeometry, FrameId, JointInfo, NOMINAL, RobotDescription, UrdfTree, check_runnable};
use crate::outbox::Outbox;
use crate::params::{Params, parameters_digest};
use crate::safety::{Fault, SafetyParams};
use crate::time::StepLimit;
use lcmtypes::{
    CartesianState, ControllerTick, Message, RequestReply, RobotCommand, RunInfo, TaskAnswer, TaskMemory, TaskReply,
    TaskRequest, TaskWaypoint, TickInput, channels,
};
use nalgebra::Matrix3;
use stack_file::Feedback;
use status::Status;
use std::collections::BTreeMap;

/// Name by which [`crate::load`] finds the controller.
pub const NAME: &str = "cartesian_ik";
/// Largest number of requests in a tick; the further ones are refused.
const MOST_REQUESTS: usize = 32;
/// Longest name in a request for which memory is kept.
const LONGEST_NAME: usize = 64;

/// The controller.
pub struct Cartesian {
    joints: Vec<JointInfo>,
    safety: SafetyParams,
    gains: Gains,
    feedback: Feedback,
    step_limit: StepLimit,
    postures: BTreeMap<String, Vec<f64>>,
    /// Lowest point of each contact: link, and offset of its origin above the ground.
    contacts: Vec<(FrameId, f64)>,
    imu: Option<FrameId>,
    ik: Ik,
    /// The model state, in the form in which it is integrated; a copy of that in `state`.
    model: IkState,
    state: CartesianState,
    snapshot_buffer: CartesianState,
    output: Output,
    handover: Handover,
    /// Preallocated messages: the request that is read, and the answers of the tick.
    request: TaskRequest,
    reply: TaskReply,
    spare: Vec<TaskAnswer>,
    status: Status,
}

impl Cartesian {
    /// Builds the controller of the first component of a run from URDF, parameters and period.
    ///
    /// # Errors
    /// A text is invalid, or the stack does not fit the robot.
    pub fn new(info: &RunInfo) -> Result<Self, LoadError> {
        let params = Params::from_toml(info.params(), "parameters")?;
        let tree = UrdfTree::parse(&info.urdf, &params.robot.urdf)?;
        let robot = params.robot.description(&tree)?;
        let model = robot.model(&tree)?;
        check_runnable(&model, &posture_of(&robot, NOMINAL)?)?;
        let stack = StackFile::parse(&params.cartesian_ik.stack)?;
        let step_limit = StepLimit::of(info);
        let (ik, memories) = Ik::new(&stack, &robot, &tree, &model)?;
        let nj = model.nj();
        let of_model = IkState::at(&vec![0.0; nj], model.nv());
        let state = CartesianState {
            tick: -1,
            mode: ControllerTick::MODE_IDLE,
            fault_index: -1,
            q_WB_wxyz: of_model.q_WB,
            nv: count(model.nv()),
            v: vec![0.0; model.nv()],
            nj: count(nj),
            q: vec![0.0; nj],
            stack: text_digest(&params.cartesian_ik.stack),
            n_answered: count(MOST_REQUESTS),
            answered: answers(),
            n_tasks: count(memories.len()),
            tasks: memories,
            ..CartesianState::default()
        };
        let status = Status::new(&stack.0, &ik);
        Ok(Cartesian {
            gains: Gains::new(&robot, &params.hold, &params.safety),
            contacts: contacts_of(&robot, &model)?,
            imu: robot.imus.first().map(|imu| model.frame(&imu.link)).transpose()?,
            postures: postures_of(&robot),
            joints: model.joints,
            safety: params.safety,
            feedback: stack.0.feedback,
            step_limit,
            ik,
            model: of_model,
            snapshot_buffer: with_memory(state.clone()),
            state,
            output: Output::new(nj, parameters_digest(info.params())),
            handover: Handover::new(nj),
            request: largest_request(),
            reply: TaskReply { answers: Vec::with_capacity(MOST_REQUESTS), ..TaskReply::default() },
            spare: answers(),
            status,
        })
    }

    /// After the state of another stack was taken: the tasks are those of this stack again. One with the name and base link of a task of the other stack keeps its
    /// reference, another one starts at the present pose.
    ///
    /// # Errors
    /// [`RestoreError`] for a reference that is not one of the task; the caller has checked them.
    fn keep_references(&mut self) -> Result<(), RestoreError> {
        let Cartesian { state, snapshot_buffer: own, ik, model, .. } = self;
        std::mem::swap(&mut state.tasks, &mut own.tasks);
        (state.n_tasks, state.stack) = (own.n_tasks, own.stack);
        let before = &own.tasks;
        ik.place(model);
        ik.with_tasks(model, |tasks, at| {
            for (task, memory) in tasks.iter_mut().zip(&mut state.tasks) {
                match kept(before, memory) {
                    Some(known) => task.change(memory, |reference| reference.read_motion(&known.reference))?,
                    None => task.reset(memory, at),
                }
            }
            Ok(())
        })
    }

    /// Copies the model state of a snapshot.
    fn take_model(&mut self) {
        let CartesianState { p_WB, q_WB_wxyz, q, v, .. } = &self.state;
        self.model.p_WB = (*p_WB).into();
        self.model.q_WB = *q_WB_wxyz;
        self.model.q.copy_from_slice(q);
        self.model.v.copy_from_slice(v);
    }

    fn keep_model(&mut self) {
        let IkState { p_WB, q_WB, q, v } = &self.model;
        self.state.p_WB = (*p_WB).into();
        self.state.q_WB_wxyz = *q_WB;
        self.state.q.copy_from_slice(q);
        self.state.v.copy_from_slice(v);
    }

    /// Answers a request; the answers of a tick are in the order of the requests.
    fn answer(&mut self, data: &[u8], t_ns: i64) -> bool {
        let Cartesian { request, reply, spare, ik, model, state, postures, .. } = self;
        if request.decode_into(data).is_err() {
            return false;
        }
        let Some(mut answer) = spare.pop() else { return false };
        answer.reason.clear();
        (answer.sender_id, answer.request_id) = (request.sender_id, request.request_id);
        let of_request =
            |known: &&TaskAnswer| (known.sender_id, known.request_id) == (request.sender_id, request.request_id);
        // The scenario, sender 0, sends each request once.
        if let Some(known) = state.answered.iter().find(of_request) {
            answer.code = known.code;
            answer.reason.push_str(&known.reason);
            reply.answers.push(answer);
            return true;
        }
        let outcome = if state.mode == ControllerTick::MODE_STANCE {
            ik.place(model);
            let tasks = &mut state.tasks;
            ik.with_tasks(model, |of, at| requests::carry_out(request, of, tasks, postures, at, t_ns))
        } else {
            Err((RequestReply::CODE_WRONG_STATE, "the controller does not control the robot"))
        };
        let (code, reason) = outcome.err().unwrap_or((RequestReply::CODE_DONE, ""));
        answer.code = code;
        answer.reason.push_str(reason);
        state.answered.rotate_left(1);
        if let Some(newest) = state.answered.last_mut() {
            (newest.sender_id, newest.request_id, newest.code) = (answer.sender_id, answer.request_id, code);
            newest.reason.clear();
            newest.reason.push_str(reason);
        }
        reply.answers.push(answer);
        true
    }

    /// Updates the state: mode, faults, references, model.
    fn advance(&mut self, input: &TickInput) {
        self.ik.begin_tick();
        let before_ns = self.state.t_ns;
        (self.state.t_ns, self.state.tick) = (input.t_ns, input.tick);
        if self.state.mode == ControllerTick::MODE_DAMPING {
            return;
        }
        let (fault, goes_on) = judge(&self.joints, &self.safety, input, &mut self.state.mode);
        (self.state.fault, self.state.fault_index, self.state.fault_value) = (fault.code, fault.index, fault.value);
        if !goes_on {
            return;
        }
        if self.state.mode == ControllerTick::MODE_IDLE {
            self.start(input);
        }
        let dt = self.step_limit.seconds(input.t_ns, before_ns);
        if self.feedback == Feedback::Measured {
            self.model.q.copy_from_slice(&input.state.q);
        }
        let Cartesian { ik, model, state, .. } = self;
        ik.place(model);
        let is_solved = ik.solve(model, &mut state.tasks, input.t_ns, dt);
        if !is_solved {
            (state.fault, state.fault_index) = (ControllerTick::FAULT_QP, -1);
        }
        let n_base = ik.model().nv_base();
        model.integrate(n_base, dt);
        self.keep_model();
    }

    /// The first tick: model state and references.
    fn start(&mut self, input: &TickInput) {
        self.state.mode = ControllerTick::MODE_STANCE;
        let Cartesian { joints, handover, ik, model, state, contacts, imu, .. } = self;
        handover.start(joints, &input.state.q, &mut model.q);
        model.v.fill(0.0);
        model.p_WB = nalgebra::Vector3::zeros();
        model.q_WB = [1.0, 0.0, 0.0, 0.0];
        ik.place(model);
        if ik.model().nv_base() > 0 {
            if let (Some(imu), Some(measured)) = (*imu, input.state.q_WI_wxyz.first()) {
                let R_WI = quaternion::to_rotation(*measured);
                let R_WB = R_WI * ik.kin().R_WF(ik.model(), imu).transpose();
                if R_WB.iter().all(|x| x.is_finite()) {
                    let level = Rz(-rpy_of(&R_WB)[2]) * R_WB;
                    model.q_WB = quaternion::from_rotation(&level);
                    ik.place(model);
                }
            }
            let lowest = lowest(ik, contacts);
            if lowest < f64::INFINITY {
                model.p_WB.z = -lowest;
                ik.place(model);
            }
        }
        let tasks = &mut state.tasks;
        ik.with_tasks(model, |of, at| {
            for (task, memory) in of.iter_mut().zip(tasks) {
                task.reset(memory, at);
            }
        });
    }

    /// Computes the command from the state, before effort limits.
    fn fill_command(&mut self) {
        let Cartesian { gains, state, ik, output: Output { command, .. }, .. } = self;
        command.tau.fill(0.0);
        gains.fill(state.mode, command);
        if command.mode == RobotCommand::MODE_TORQUE {
            command.q_des.copy_from_slice(&state.q);
            command.qd_des.copy_from_slice(&state.v[ik.model().nv_base()..]);
        } else {
            command.q_des.fill(0.0);
            command.qd_des.fill(0.0);
        }
    }
}

/// Empty answers with memory for a reason. No request has the id -1.
fn answers() -> Vec<TaskAnswer> {
    let empty = || TaskAnswer { request_id: -1, reason: String::with_capacity(LONGEST_NAME), ..TaskAnswer::default() };
    (0..MOST_REQUESTS).map(|_| empty()).collect()
}

/// The state with memory for all answers.
fn with_memory(mut state: CartesianState) -> CartesianState {
    state.answered = answers();
    state
}

/// Digest of a stack file.
fn text_digest(text: &str) -> i64 {
    let mut digest = Digest::default();
    text.bytes().for_each(|byte| digest.word(byte.into()));
    digest.finish()
}

fn count(n: usize) -> i32 {
    i32::try_from(n).expect("far below 2^31")
}

/// A request with the longest names, and as many way-points and values as a valid one can have.
fn largest_request() -> TaskRequest {
    TaskRequest {
        task: String::with_capacity(LONGEST_NAME),
        name: String::with_capacity(LONGEST_NAME),
        poses: vec![TaskWaypoint::default(); crate::trajectory::MAX_WAYPOINTS],
        values: vec![0.0; LONGEST_NAME],
        ..TaskRequest::default()
    }
}

/// The postures that name every joint.
fn postures_of(robot: &RobotDescription) -> BTreeMap<String, Vec<f64>> {
    let names = robot.postures.keys();
    names.filter_map(|name| Some((name.clone(), posture_of(robot, name).ok()?))).collect()
}

/// Height of the lowest contact of the placed model, m; infinite without contacts.
fn lowest(ik: &Ik, contacts: &[(FrameId, f64)]) -> f64 {
    let heights = contacts.iter().map(|(link, above)| ik.kin().p_WF(ik.model(), *link).z - above);
    heights.fold(f64::INFINITY, f64::min)
}

fn contacts_of(robot: &RobotDescription, model: &crate::model::Model) -> Result<Vec<(FrameId, f64)>, LoadError> {
    let of_contact = |contact: &crate::model::Contact| {
        let above = match contact.geometry {
            ContactGeometry::Point { radius } | ContactGeometry::Wheel { radius, .. } => radius,
            _ => 0.0,
        };
        Ok((model.frame(&contact.link)?, above))
    };
    let is_foot = |contact: &&crate::model::Contact| !matches!(contact.geometry, ContactGeometry::Hand { .. });
    robot.contacts.iter().filter(is_foot).map(of_contact).collect()
}

/// Whether two memories are of tasks of the same size.
fn fits((a, b): (&TaskMemory, &TaskMemory)) -> bool {
    a.weights.len() == b.weights.len() && a.reference.len() == b.reference.len()
}

/// The task of another stack whose reference a task keeps.
fn kept<'a>(before: &'a [TaskMemory], memory: &TaskMemory) -> Option<&'a TaskMemory> {
    let known = before.iter().find(|known| known.name == memory.name)?;
    (known.base_link == memory.base_link && known.active && fits((known, memory))).then_some(known)
}

/// Checks the numbers of a task that the memory alone holds.
fn check_numbers(memory: &TaskMemory) -> Result<(), RestoreError> {
    if memory.weights.iter().chain([&memory.gain]).all(|x| x.is_finite()) {
        return Ok(());
    }
    Err(RestoreError::NotFinite { field: "tasks" })
}

impl Controller for Cartesian {
    fn name(&self) -> &'static str {
        NAME
    }

    fn stages(&self) -> &[&'static str] {
        &STAGES
    }

    fn receive(&mut self, input: &TickInput, channel: &str, data: &[u8]) -> bool {
        match channels::split(channel) {
            ("", channels::ROBOT_COMMAND) => self.handover.take(data, self.joints.len()),
            (_, channels::TASK_REQUEST) => self.answer(data, input.t_ns),
            _ => false,
        }
    }

    fn step_probed(&mut self, input: &TickInput, out: &mut Outbox, probe: &mut dyn Probe) {
        let digest_input = input_digest(input);
        self.advance(input);
        self.handover.clear();
        probe.stage_done(0);
        self.fill_command();
        let CartesianState { mode, fault: code, fault_index: index, fault_value: value, .. } = self.state;
        self.output.publish(&self.joints, input, digest_input, mode, Fault { code, index, value }, out);
        let reply = &mut self.reply;
        if !reply.answers.is_empty() {
            (reply.t_ns, reply.tick, reply.run_id) = (input.t_ns, input.tick, input.run_id);
            reply.n = count(reply.answers.len());
            out.put(channels::TASK_REPLY, reply).expect("`n` is the number of answers");
            self.spare.append(&mut reply.answers);
        }
        if self.status.is_due(&mut self.state.t_status_ns, input.t_ns) {
            let Cartesian { ik, model, state, .. } = self;
            ik.place(model);
            self.status.fill(ik, model, state, input.run_id);
            self.status.put(out);
        }
        probe.stage_done(1);
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.state.encode(out).expect("the state's arrays have the robot's length");
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let (expected_q, expected_v) = (self.state.q.len(), self.state.v.len());
        let buffer = &mut self.snapshot_buffer;
        buffer.decode_into(bytes)?;
        if (buffer.q.len(), buffer.v.len()) != (expected_q, expected_v) {
            return Err(RestoreError::Joints { found: buffer.q.len(), expected: expected_q });
        }
        let rotation: Matrix3<f64> = quaternion::to_rotation(buffer.q_WB_wxyz);
        let numbers = buffer.q.iter().chain(&buffer.v).chain(&buffer.p_WB).chain(rotation.iter());
        if numbers.copied().any(|x| !x.is_finite()) {
            return Err(RestoreError::NotFinite { field: "q" });
        }
        if buffer.answered.len() != MOST_REQUESTS {
            return Err(RestoreError::Tasks { found: buffer.answered.len(), expected: MOST_REQUESTS });
        }
        let is_same = buffer.stack == self.state.stack;
        let (found, expected) = (buffer.tasks.len(), self.state.tasks.len());
        if is_same && (found != expected || !buffer.tasks.iter().zip(&self.state.tasks).all(fits)) {
            return Err(RestoreError::Tasks { found, expected });
        }
        for (i, (task, memory)) in self.ik.tasks().iter().zip(&self.state.tasks).enumerate() {
            let found = if is_same { buffer.tasks.get(i) } else { kept(&buffer.tasks, memory) };
            if let Some(found) = found {
                check_numbers(found)?;
                task.reference().check(&found.reference)?;
            }
        }
        std::mem::swap(&mut self.state, &mut self.snapshot_buffer);
        self.take_model();
        if !is_same {
            return self.keep_references();
        }
        self.ik.tasks().iter_mut().zip(&self.state.tasks).try_for_each(|(task, memory)| task.read(memory))
    }

    fn poison_workspace(&mut self) {
        self.output.poison();
        self.ik.poison();
    }
}
