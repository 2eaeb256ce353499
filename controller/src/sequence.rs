//! Several controllers in one run, executed in order; each can be started and stopped while the others run.
//!
//! [`TickInput::running`] has one bit for each controller, set while it runs. It is part of the input, so a replay needs no other
//! information. The stages of a sequence are those of its controllers, each name once; a tick has digest 0 for stages that the last running
//! controller does not have. The last running controller commands the robot: its messages are published unchanged. The messages of the other running
//! controllers are published on channels with the controller's name as prefix, for example `hold/ROBOT_COMMAND`. So a controller can be tried on a
//! robot that another controller moves. While no controller runs, the joints are damped.
//!
//! | from | bit in this tick | to | action |
//! |---|---|---|---|
//! | stopped | set | running | starts from its initial state, and computes its first step in this tick |
//! | running | set | running | computes a step |
//! | running | not set | stopped | its state is discarded |

use crate::digest::input_digest;
use crate::dump::Dump;
use crate::error::{LoadError, RestoreError};
use crate::interface::{Controller, Probe};
use crate::outbox::{Outbox, interned};
use lcmtypes::channels;
use lcmtypes::{ControllerState, ControllerTick, Message, RobotCommand, SequenceState, TickInput};
use std::cell::{RefCell, RefMut};
use std::collections::BTreeSet;

/// Name of the kind; the name of a run's controller contains the list too: `sequence(hold, quadruped)`.
pub const NAME: &str = "sequence";
/// Largest number of controllers: the bits of `running` without the sign bit.
const MAX_CONTROLLERS: usize = 63;

/// Several controllers, in the order in which they run.
pub struct Sequence {
    members: Vec<Member>,
    /// The bits of the last tick.
    running: i64,
    t_ns: i64,
    tick: i64,
    member_outbox: Outbox,
    damping: RobotCommand,
    /// Names of the stages.
    stages: Vec<&'static str>,
    /// CONTROLLER_TICK of the sequence, and that of its last running controller.
    status: ControllerTick,
    of_member: ControllerTick,
    digest_parameters: i64,
    /// Preallocated message for writing and reading snapshots.
    snapshot_buffer: RefCell<SequenceState>,
}

struct Member {
    controller: Box<dyn Controller>,
    /// Its state before its first tick.
    initial_state: Vec<u8>,
    /// Each channel, and its name with the controller's name as prefix.
    prefixed: Vec<(&'static str, &'static str)>,
    /// Index of each of its stages in the stages of the sequence.
    stages: Vec<usize>,
}

/// Passes the stages of a controller on as those of the sequence.
struct StageProbe<'p> {
    probe: &'p mut dyn Probe,
    stages: &'p [usize],
}

impl Probe for StageProbe<'_> {
    fn stage_done(&mut self, stage: usize) {
        if let Some(stage) = self.stages.get(stage) {
            self.probe.stage_done(*stage);
        }
    }
}

impl Sequence {
    /// Builds a sequence.
    ///
    /// - `damping`: the command while no controller runs.
    /// - `digest_parameters`: as in `controller_tick_t`.
    ///
    /// # Errors
    /// The number of controllers is not 1 to 63, or two have the same name.
    pub fn new(
        controllers: Vec<Box<dyn Controller>>,
        damping: RobotCommand,
        digest_parameters: i64,
    ) -> Result<Self, LoadError> {
        let wrong = |what: String| LoadError::Sequence { what };
        if controllers.is_empty() || controllers.len() > MAX_CONTROLLERS {
            return Err(wrong(format!("found {} controllers, expected 1 to {MAX_CONTROLLERS}", controllers.len())));
        }
        let mut names = BTreeSet::new();
        let mut members = Vec::with_capacity(controllers.len());
        for controller in controllers {
            let name = controller.name();
            if !names.insert(name) {
                return Err(wrong(format!("controller \"{name}\" is listed twice")));
            }
            let mut initial_state = Vec::new();
            controller.snapshot(&mut initial_state);
            let prefixed =
                channels::CHANNELS.iter().map(|c| (c.name, interned(format!("{name}/{}", c.name)))).collect();
            members.push(Member { controller, initial_state, prefixed, stages: Vec::new() });
        }
        let stages = merged_stages(&mut members);
        let zeros = |n: usize| ControllerTick {
            n_stages: i32::try_from(n).expect("a few stages"),
            digest: vec![0; n],
            ..ControllerTick::default()
        };
        let num_parts = i32::try_from(members.len()).expect("at most 63");
        // A state has the same size in every tick.
        let initial = |member: &Member| ControllerState { size: 0, data: member.initial_state.clone() };
        let state = SequenceState { num_parts, parts: members.iter().map(initial).collect(), ..Default::default() };
        Ok(Sequence {
            members,
            running: 0,
            t_ns: 0,
            tick: -1,
            member_outbox: Outbox::new(),
            damping,
            status: zeros(stages.len()),
            of_member: zeros(stages.len()),
            stages,
            digest_parameters,
            snapshot_buffer: RefCell::new(state),
        })
    }

    /// Names of the controllers, in the order in which they run: bit k of [`TickInput::running`] belongs to the k-th name.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.members.iter().map(|member| member.controller.name())
    }

    /// Puts the members that start in this tick into their initial states.
    fn start(&mut self, running: i64) {
        for (k, member) in self.members.iter_mut().enumerate() {
            if runs(running, k) && !runs(self.running, k) {
                member.controller.restore(&member.initial_state).expect("the controller wrote this state itself");
            }
        }
        self.running = running;
    }

    /// Writes the state into the snapshot buffer.
    fn state(&self) -> RefMut<'_, SequenceState> {
        let mut state = self.snapshot_buffer.borrow_mut();
        (state.t_ns, state.tick, state.running) = (self.t_ns, self.tick, self.running);
        for (k, (member, part)) in self.members.iter().zip(&mut state.parts).enumerate() {
            part.data.clear();
            // A stopped controller starts from its initial state, so its present state does not matter. After a panic the state
            // would be that of an incomplete tick, which a replay cannot compute.
            if runs(self.running, k) {
                member.controller.snapshot(&mut part.data);
            } else {
                part.data.extend_from_slice(&member.initial_state);
            }
            part.size = i32::try_from(part.data.len()).expect("a state is far below 2 GB");
        }
        state
    }
}

/// Names of the stages of all controllers, each once: a stage that is new comes before the next stage of the same controller that is not. Sets
/// [`Member::stages`].
fn merged_stages(members: &mut [Member]) -> Vec<&'static str> {
    let mut merged: Vec<&'static str> = Vec::new();
    for member in &*members {
        let mut place = merged.len();
        for name in member.controller.stages().iter().rev() {
            match merged.iter().position(|known| known == name) {
                Some(known) => place = known,
                None => merged.insert(place, name),
            }
        }
    }
    for member in members {
        let place = |name: &&str| merged.iter().position(|known| known == name).expect("every name was added");
        member.stages = member.controller.stages().iter().map(place).collect();
    }
    merged
}

/// Whether the bit of the k-th controller is set.
fn runs(bits: i64, k: usize) -> bool {
    bits >> k & 1 == 1
}

/// Copies `from`, a tick of a controller with `stages`, to the stages of the sequence.
fn with_stages(from: &ControllerTick, stages: &[usize], to: &mut ControllerTick) {
    let ControllerTick { t_ns, tick, run_id, mode, fault, fault_index, fault_value, n_ignored, .. } = *from;
    (to.t_ns, to.tick, to.run_id, to.n_ignored) = (t_ns, tick, run_id, n_ignored);
    (to.mode, to.fault, to.fault_index, to.fault_value) = (mode, fault, fault_index, fault_value);
    to.digest_parameters = from.digest_parameters;
    to.digest.fill(0);
    for (digest, stage) in from.digest.iter().zip(stages) {
        to.digest[*stage] = *digest;
    }
}

impl Controller for Sequence {
    fn name(&self) -> &'static str {
        NAME
    }

    fn stages(&self) -> &[&'static str] {
        &self.stages
    }

    /// Members that run in this tick receive the message; one that starts is in its initial state by then.
    fn receive(&mut self, input: &TickInput, channel: &str, data: &[u8]) -> bool {
        self.start(input.running);
        let mut is_used = false;
        for (_, member) in self.members.iter_mut().enumerate().filter(|(k, _)| runs(input.running, *k)) {
            is_used |= member.controller.receive(input, channel, data);
        }
        // The command before a start is of use to some controllers only.
        is_used || channel == channels::ROBOT_COMMAND
    }

    fn step_probed(&mut self, input: &TickInput, out: &mut Outbox, probe: &mut dyn Probe) {
        self.start(input.running);
        let Sequence { members, member_outbox, damping, status, of_member, digest_parameters, .. } = self;
        let active = (0..members.len()).rev().find(|&k| runs(input.running, k));
        out.clear();
        let mut put = Ok(());
        for (k, member) in members.iter_mut().enumerate() {
            if !runs(input.running, k) {
                continue;
            }
            member_outbox.clear();
            let is_active = active == Some(k);
            if is_active {
                let mut probe = StageProbe { probe: &mut *probe, stages: &member.stages };
                member.controller.step_probed(input, member_outbox, &mut probe);
            } else {
                member.controller.step(input, member_outbox);
            }
            for (channel, bytes) in member_outbox.iter() {
                if is_active && channel == channels::CONTROLLER_TICK && of_member.decode_into(bytes).is_ok() {
                    with_stages(of_member, &member.stages, status);
                    put = put.and_then(|()| out.put(channel, status));
                    continue;
                }
                let prefixed = || member.prefixed.iter().find(|(name, _)| *name == channel).map(|(_, name)| *name);
                let channel = if is_active { Some(channel) } else { prefixed() };
                out.put_bytes(channel.expect("controllers use channels of the table only"), bytes);
            }
        }
        let TickInput { t_ns, tick, run_id, .. } = *input;
        (self.t_ns, self.tick) = (t_ns, tick);
        if active.is_none() {
            (damping.t_ns, damping.tick, damping.run_id) = (t_ns, tick, run_id);
            (status.t_ns, status.tick, status.run_id, status.n_ignored) = (t_ns, tick, run_id, input.n_ignored);
            (status.mode, status.fault, status.fault_index, status.fault_value) =
                (ControllerTick::MODE_IDLE, ControllerTick::FAULT_CONTROLLER, -1, 0.0);
            status.digest.fill(0);
            status.digest[0] = input_digest(input);
            status.digest_parameters = *digest_parameters;
            put = put.and_then(|()| out.put(channels::ROBOT_COMMAND, damping));
            put = put.and_then(|()| out.put(channels::CONTROLLER_TICK, status));
        }
        put.expect("every array has had the length of its length field since construction");
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.state().encode(out).expect("`state` sets every length field");
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let Sequence { members, running, t_ns, tick, snapshot_buffer, .. } = self;
        let state = snapshot_buffer.get_mut();
        let read = state.decode_into(bytes).map_err(RestoreError::from).and_then(|()| {
            let (found, expected) = (state.parts.len(), members.len());
            if found != expected {
                return Err(RestoreError::Controllers { found, expected });
            }
            (*running, *t_ns, *tick) = (state.running, state.t_ns, state.tick);
            members.iter_mut().zip(&state.parts).try_for_each(|(member, part)| member.controller.restore(&part.data))
        });
        // A rejected snapshot may have changed the number of parts in the buffer.
        state.num_parts = i32::try_from(members.len()).expect("at most 63");
        state.parts.resize_with(members.len(), ControllerState::default);
        read
    }

    fn poison_workspace(&mut self) {
        self.members.iter_mut().for_each(|member| member.controller.poison_workspace());
        self.snapshot_buffer.get_mut().parts.iter_mut().for_each(|part| part.data.fill(0xff));
        self.member_outbox.clear();
    }

    /// The quantities of the controller that commands the robot.
    fn dump(&self) -> Dump {
        let active = self.members.iter().enumerate().rev().find(|(k, _)| runs(self.running, *k));
        active.map_or_else(Dump::default, |(_, member)| member.controller.dump())
    }
}
