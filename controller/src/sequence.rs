//! Several controllers as one, run in order, each started and stopped while the others run.
//!
//! Which of them are started is part of the input ([`ControllerInput::running`], a bit each), so a replay needs to know nothing more.
//! The last of those that run has the robot: its messages go out as they are. The messages of the others go out beside it, on channels
//! with their name in front, `hold/ROBOT_COMMAND`: a controller can be tried on a robot that another one moves. With none started the joints
//! are damped.
//!
//! | from | when | to | what is done |
//! |---|---|---|---|
//! | stopped | its bit is set | running | it begins as on the first tick of a run, in the same tick |
//! | running | its bit is set | running | a step |
//! | running | its bit is not set | stopped | its state is forgotten |

use crate::params::Params;
use crate::{Controller, LoadError, Outbox, Probe, RestoreError};
use lcmtypes::channels::{self, CONTROLLER_SNAPSHOT};
use lcmtypes::{ControllerInput, ControllerState, ControllerTick, Message, RobotCommand, RunInfo, SequenceState};
use std::cell::{RefCell, RefMut};
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

/// Name of the kind; a run names its controllers too: `sequence(hold, quadruped)`.
pub const NAME: &str = "sequence";
/// Ticks between two snapshots of the state.
const SNAPSHOT_TICKS: i64 = 1000;
/// Controllers that the bits of `running` can tell apart, the sign left alone.
const MAX_PARTS: usize = 63;

/// Several controllers, in the order in which they run.
pub struct Sequence {
    parts: Vec<Part>,
    /// The bits of the last tick.
    running: i64,
    t_ns: i64,
    tick: i64,
    of_part: Outbox,
    damping: RobotCommand,
    /// Through which the states go in and out, kept so that no memory is asked for then.
    passage: RefCell<SequenceState>,
}

struct Part {
    controller: Box<dyn Controller>,
    /// Its state before its first tick.
    unused: Vec<u8>,
    /// Channels, and their names while another controller has the robot.
    aside: Vec<(&'static str, &'static str)>,
}

impl Sequence {
    /// Puts controllers together.
    ///
    /// - `damping`: what the joints are told while no controller runs.
    ///
    /// # Errors
    /// None or too many of them, or two of one name.
    pub fn new(controllers: Vec<Box<dyn Controller>>, damping: RobotCommand) -> Result<Self, LoadError> {
        let wrong = |what: String| LoadError::Sequence { what };
        if controllers.is_empty() || controllers.len() > MAX_PARTS {
            return Err(wrong(format!("{} controllers, expected 1 to {MAX_PARTS}", controllers.len())));
        }
        let mut names = BTreeSet::new();
        let mut parts = Vec::with_capacity(controllers.len());
        for controller in controllers {
            let name = controller.name();
            if !names.insert(name) {
                return Err(wrong(format!("controller \"{name}\" stands there twice")));
            }
            let mut unused = Vec::new();
            controller.snapshot(&mut unused);
            let aside = channels::CHANNELS.iter().map(|c| (c.name, interned(format!("{name}/{}", c.name)))).collect();
            parts.push(Part { controller, unused, aside });
        }
        let num_parts = i32::try_from(parts.len()).expect("there are few");
        // A state has the same size in every tick.
        let of_part = |part: &Part| ControllerState { size: 0, data: part.unused.clone() };
        let passage = SequenceState { num_parts, parts: parts.iter().map(of_part).collect(), ..Default::default() };
        let (of_part, passage) = (Outbox::new(), RefCell::new(passage));
        Ok(Sequence { parts, running: 0, t_ns: 0, tick: -1, of_part, damping, passage })
    }

    /// Builds the controllers that a list such as `hold, quadruped` names, for the robot and with the parameters of the run.
    ///
    /// # Errors
    /// A name that is unknown or stands there twice; what a controller says of the URDF and the parameters.
    pub fn load(list: &str, info: &RunInfo) -> Result<Self, LoadError> {
        let build = |name: &str| crate::load(&RunInfo { controller: name.trim().to_owned(), ..info.clone() });
        let controllers = list.split(',').map(build).collect::<Result<_, _>>()?;
        let params = Params::from_toml(&info.params, "parameters")?;
        let nj = params.robot.posture.len();
        let zeros = || vec![0.0; nj];
        let damping = RobotCommand {
            mode: RobotCommand::MODE_DAMPING,
            nj: i32::try_from(nj).expect("robots have fewer than 2^31 joints"),
            tau: zeros(),
            q_des: zeros(),
            qd_des: zeros(),
            kp: zeros(),
            kd: vec![params.safety.damping; nj],
            ..RobotCommand::default()
        };
        Self::new(controllers, damping)
    }

    /// Names of the controllers, in the order in which they run: bit k of [`ControllerInput::running`] is the k-th.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.parts.iter().map(|part| part.controller.name())
    }

    /// The state, in the memory for it.
    fn state(&self) -> RefMut<'_, SequenceState> {
        let mut state = self.passage.borrow_mut();
        (state.t_ns, state.tick, state.running) = (self.t_ns, self.tick, self.running);
        for (k, (part, of_part)) in self.parts.iter().zip(&mut state.parts).enumerate() {
            of_part.data.clear();
            // One that does not run will begin anew, whatever is left in it: after a panic that is half a tick which no replay computes.
            if runs(self.running, k) {
                part.controller.snapshot(&mut of_part.data);
            } else {
                of_part.data.extend_from_slice(&part.unused);
            }
            of_part.size = i32::try_from(of_part.data.len()).expect("a state is far below 2 GB");
        }
        state
    }
}

/// Whether the k-th controller runs.
fn runs(bits: i64, k: usize) -> bool {
    bits >> k & 1 == 1
}

/// The name, kept as long as the process lives, once: a run's messages name their channel without copying it.
fn interned(name: String) -> &'static str {
    static NAMES: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = names.get(&*name) {
        return known;
    }
    let name: &'static str = name.leak();
    names.insert(name);
    name
}

impl Controller for Sequence {
    fn name(&self) -> &'static str {
        NAME
    }

    fn step_probed(&mut self, input: &ControllerInput, out: &mut Outbox, probe: &mut dyn Probe) {
        let Sequence { parts, running, of_part, damping, .. } = self;
        let leader = (0..parts.len()).rev().find(|&k| runs(input.running, k));
        out.clear();
        let mut put = Ok(());
        for (k, part) in parts.iter_mut().enumerate() {
            if !runs(input.running, k) {
                continue;
            }
            if !runs(*running, k) {
                part.controller.restore(&part.unused).expect("it wrote this state itself");
            }
            of_part.clear();
            let leads = leader == Some(k);
            if leads {
                part.controller.step_probed(input, of_part, probe);
            } else {
                part.controller.step(input, of_part);
            }
            for (channel, bytes) in of_part.iter().filter(|(channel, _)| *channel != CONTROLLER_SNAPSHOT) {
                let aside = || part.aside.iter().find(|(name, _)| *name == channel).map(|(_, aside)| *aside);
                let channel = if leads { Some(channel) } else { aside() };
                out.put_bytes(channel.expect("controllers put their messages on channels of the table"), bytes);
            }
        }
        let ControllerInput { t_ns, tick, .. } = *input;
        (self.running, self.t_ns, self.tick) = (input.running, t_ns, tick);
        if leader.is_none() {
            (damping.t_ns, damping.tick) = (t_ns, tick);
            let digest_input = crate::quadruped::digest_of_input(input);
            let status = ControllerTick {
                t_ns,
                tick,
                mode: ControllerTick::MODE_IDLE,
                fault: ControllerTick::FAULT_CONTROLLER,
                fault_index: -1,
                digest_input,
                ..Default::default()
            };
            put = put.and_then(|()| out.put(channels::ROBOT_COMMAND, damping));
            put = put.and_then(|()| out.put(channels::CONTROLLER_TICK, &status));
        }
        if tick % SNAPSHOT_TICKS == 0 {
            put = put.and_then(|()| out.put(CONTROLLER_SNAPSHOT, &*self.state()));
        }
        put.expect("every array has the length that its length field says since construction");
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.state().encode(out).expect("the arrays have just been made");
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let Sequence { parts, running, t_ns, tick, passage, .. } = self;
        let state = passage.get_mut();
        let read = state.decode_into(bytes).map_err(RestoreError::from).and_then(|()| {
            let (found, expected) = (state.parts.len(), parts.len());
            if found != expected {
                return Err(RestoreError::Parts { found, expected });
            }
            (*running, *t_ns, *tick) = (state.running, state.t_ns, state.tick);
            parts.iter_mut().zip(&state.parts).try_for_each(|(part, state)| part.controller.restore(&state.data))
        });
        // What was refused may have had other parts.
        state.num_parts = i32::try_from(parts.len()).expect("there are few");
        state.parts.resize_with(parts.len(), ControllerState::default);
        read
    }

    fn poison_workspace(&mut self) {
        self.parts.iter_mut().for_each(|part| part.controller.poison_workspace());
        self.passage.get_mut().parts.iter_mut().for_each(|part| part.data.fill(0xff));
        self.of_part.clear();
    }

    /// The quantities of the controller that has the robot.
    fn dump(&self) -> crate::Dump {
        let leader = self.parts.iter().enumerate().rev().find(|(k, _)| runs(self.running, *k));
        leader.map_or_else(crate::Dump::default, |(_, part)| part.controller.dump())
    }
}
