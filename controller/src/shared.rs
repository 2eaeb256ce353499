//! Joints that several components command: the first component of a run publishes one command for all of them.
//!
//! The commands of the others are delivered to it (`arms/ROBOT_COMMAND`) and hold until newer ones arrive. Each joint takes its row from the component
//! that it belongs to. So the command that a driver receives is a function of what the first component consumed, like everything else.
//!
//! | own mode | mode of another one | its joints | mode of the command |
//! |---|---|---|---|
//! | damping | any | damped | damping |
//! | idle, torque | none arrived yet | no torque | own |
//! | idle, torque | idle, torque, damping | as commanded | torque, if any component applies torque or damps; else idle |
//! | idle, torque | no newer command for [`PERIODS`] of its periods and its latency | damped, FAULT_COMPONENT | torque |

use crate::dump::Dump;
use crate::error::{LoadError, RestoreError};
use crate::interface::{Controller, Probe};
use crate::model::{JointKind, UrdfTree};
use crate::outbox::Outbox;
use crate::params::Params;
use lcmtypes::channels;
use lcmtypes::{
    ComponentInfo, ControllerState, ControllerTick, Message, RobotCommand, RunInfo, SharedState, TickInput,
};
use std::cell::{RefCell, RefMut};

/// Periods of a component after which its joints are damped if none of its commands arrives.
const PERIODS: i64 = 10;

/// A controller, and the commands of other components for their joints.
pub(crate) struct Shared {
    own: Box<dyn Controller>,
    others: Vec<Other>,
    /// Damping of each joint if its component has timed out, N m s/rad.
    damping: Vec<f64>,
    t_ns: i64,
    tick: i64,
    own_outbox: Outbox,
    command: RobotCommand,
    status: ControllerTick,
    /// Decoded first, so that a message that cannot be decoded changes nothing.
    received: RobotCommand,
    /// Preallocated message for writing and reading snapshots.
    snapshot_buffer: RefCell<SharedState>,
}

/// Another component that commands joints.
struct Other {
    /// Index in RUN_INFO.
    index: i32,
    /// Channel of its commands.
    channel: String,
    /// Its joints, index in the URDF's order of actuated joints.
    joints: Vec<usize>,
    /// Largest age of its newest command, ticks.
    max_age: i64,
    /// Its newest command, and the tick in which it was delivered; -1 before the first.
    command: RobotCommand,
    arrival_tick: i64,
}

impl Shared {
    /// - `own`: controller of the first component.
    /// - `info`: the run.
    ///
    /// # Errors
    /// [`LoadError::Component`] if a component names a joint that the robot does not have, or that another one commands.
    pub fn new(own: Box<dyn Controller>, info: &RunInfo) -> Result<Self, LoadError> {
        let params = Params::from_toml(info.params(), "parameters")?;
        let tree = UrdfTree::parse(&info.urdf, &params.robot.urdf)?;
        let joints = tree.joints.iter().filter(|joint| joint.kind != JointKind::Fixed);
        let names: Vec<&str> = joints.map(|joint| &*joint.name).collect();
        let mut owner: Vec<Option<&str>> = vec![None; names.len()];
        let mut others = Vec::new();
        for (index, component) in info.components.iter().enumerate().filter(|(_, one)| !one.joints.is_empty()) {
            let ComponentInfo { name, period_ticks, latency_ticks, .. } = component;
            let wrong = |what: String| LoadError::Component { component: name.clone(), what };
            let mut found = Vec::with_capacity(component.joints.len());
            for joint in &component.joints {
                let place = names.iter().position(|known| known == joint);
                let place = place.ok_or_else(|| wrong(format!("the robot has no joint \"{joint}\"")))?;
                if let Some(other) = owner[place].replace(name) {
                    return Err(wrong(format!("joint \"{joint}\" is commanded by component \"{other}\" already")));
                }
                found.push(place);
            }
            if index > 0 {
                others.push(Other {
                    index: i32::try_from(index).expect("a few components"),
                    channel: format!("{name}/{}", channels::ROBOT_COMMAND),
                    joints: found,
                    max_age: PERIODS * i64::from((*period_ticks).max(1)) + i64::from(*latency_ticks),
                    command: RobotCommand::zeros(names.len()),
                    arrival_tick: -1,
                });
            }
        }
        let mut initial = Vec::new();
        own.snapshot(&mut initial);
        let state = SharedState {
            own: ControllerState { size: 0, data: initial },
            n_others: i32::try_from(others.len()).expect("a few components"),
            arrival_tick: vec![-1; others.len()],
            commands: others.iter().map(|other| other.command.clone()).collect(),
            ..SharedState::default()
        };
        let n_stages = own.stages().len();
        Ok(Shared {
            own,
            others,
            damping: params.safety.damping_of(&params.robot.description(&tree)?),
            t_ns: 0,
            tick: -1,
            own_outbox: Outbox::new(),
            command: RobotCommand::zeros(names.len()),
            status: ControllerTick { digest: Vec::with_capacity(n_stages), ..ControllerTick::default() },
            received: RobotCommand::zeros(names.len()),
            snapshot_buffer: RefCell::new(state),
        })
    }

    /// Replaces the rows of the joints of other components in [`Shared::command`]. Returns index and age of a component that has timed out.
    fn merge(&mut self, tick: i64) -> Option<(i32, i64)> {
        let Shared { others, command, damping, .. } = self;
        if command.mode == RobotCommand::MODE_DAMPING {
            return None;
        }
        let (mut late, mut mode) = (None, command.mode);
        for other in others {
            let age = if other.arrival_tick < 0 { -1 } else { tick - other.arrival_tick };
            let timed_out = age > other.max_age || age < 0 && tick > other.max_age;
            if timed_out {
                late = late.or(Some((other.index, age)));
            }
            for &j in &other.joints {
                let from = &other.command;
                let rows = if timed_out {
                    [0.0, 0.0, 0.0, 0.0, damping[j]]
                } else if from.mode == RobotCommand::MODE_IDLE {
                    [0.0; 5]
                } else {
                    [from.tau[j], from.q_des[j], from.qd_des[j], from.kp[j], from.kd[j]]
                };
                [command.tau[j], command.q_des[j], command.qd_des[j], command.kp[j], command.kd[j]] = rows;
            }
            if timed_out || other.command.mode != RobotCommand::MODE_IDLE {
                mode = RobotCommand::MODE_TORQUE;
            }
        }
        command.mode = mode;
        late
    }

    /// Writes the state into the snapshot buffer.
    fn state(&self) -> RefMut<'_, SharedState> {
        let mut state = self.snapshot_buffer.borrow_mut();
        let SharedState { t_ns, tick, own, n_others: _, arrival_tick, commands } = &mut *state;
        (*t_ns, *tick) = (self.t_ns, self.tick);
        own.data.clear();
        self.own.snapshot(&mut own.data);
        own.size = i32::try_from(own.data.len()).expect("a state is far below 2 GB");
        for (k, other) in self.others.iter().enumerate() {
            arrival_tick[k] = other.arrival_tick;
            copy(&other.command, &mut commands[k]);
        }
        state
    }
}

/// Copies a command into the memory of another one: the derived `clone_from` would allocate.
fn copy(from: &RobotCommand, to: &mut RobotCommand) {
    let RobotCommand { t_ns, tick, run_id, mode, nj, tau, q_des, qd_des, kp, kd } = to;
    (*t_ns, *tick, *run_id, *mode, *nj) = (from.t_ns, from.tick, from.run_id, from.mode, from.nj);
    tau.clone_from(&from.tau);
    q_des.clone_from(&from.q_des);
    qd_des.clone_from(&from.qd_des);
    kp.clone_from(&from.kp);
    kd.clone_from(&from.kd);
}

/// Whether a command is for `nj` joints and can be applied.
fn is_valid(command: &RobotCommand, nj: usize) -> bool {
    let RobotCommand { mode, tau, q_des, qd_des, kp, kd, .. } = command;
    (RobotCommand::MODE_IDLE..=RobotCommand::MODE_DAMPING).contains(mode)
        && [tau, q_des, qd_des, kp, kd].iter().all(|values| values.len() == nj && values.iter().all(|x| x.is_finite()))
}

impl Controller for Shared {
    fn name(&self) -> &'static str {
        self.own.name()
    }

    fn stages(&self) -> &[&'static str] {
        self.own.stages()
    }

    /// A command of another component that is for another robot, or not finite, is ignored: the one before holds.
    fn receive(&mut self, input: &TickInput, channel: &str, data: &[u8]) -> bool {
        let Shared { others, received, command, .. } = self;
        let Some(other) = others.iter_mut().find(|other| other.channel == channel) else {
            return self.own.receive(input, channel, data);
        };
        let is_used = received.decode_into(data).is_ok() && is_valid(received, command.tau.len());
        if is_used {
            std::mem::swap(received, &mut other.command);
            other.arrival_tick = input.tick;
        }
        is_used
    }

    fn step_probed(&mut self, input: &TickInput, out: &mut Outbox, probe: &mut dyn Probe) {
        (self.t_ns, self.tick) = (input.t_ns, input.tick);
        self.own_outbox.clear();
        self.own.step_probed(input, &mut self.own_outbox, probe);
        let own = self.own_outbox.get(channels::ROBOT_COMMAND);
        let has_command = own.is_some_and(|bytes| self.command.decode_into(bytes).is_ok());
        let late = if has_command { self.merge(input.tick) } else { None };
        let Shared { own_outbox, command, status, .. } = self;
        out.clear();
        for (channel, bytes) in own_outbox.iter() {
            let put = match (channel, late) {
                (channels::ROBOT_COMMAND, _) if has_command => out.put(channel, command),
                (channels::CONTROLLER_TICK, Some((index, age))) if status.decode_into(bytes).is_ok() => {
                    if status.fault == ControllerTick::FAULT_NONE {
                        (status.fault, status.fault_index) = (ControllerTick::FAULT_COMPONENT, index);
                        #[expect(clippy::cast_precision_loss, reason = "an age in ticks")]
                        let age = age as f64;
                        status.fault_value = age;
                    }
                    out.put(channel, status)
                }
                _ => {
                    out.put_bytes(channel, bytes);
                    Ok(())
                }
            };
            put.expect("a decoded message has arrays of the length of their length fields");
        }
    }

    fn snapshot(&self, out: &mut Vec<u8>) {
        self.state().encode(out).expect("`state` sets every length field");
    }

    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let state = self.snapshot_buffer.get_mut();
        state.decode_into(bytes)?;
        let nj = self.command.tau.len();
        let (found, expected) = (state.commands.len(), self.others.len());
        if found != expected {
            return Err(RestoreError::Components { found, expected });
        }
        for command in &state.commands {
            let found = command.tau.len();
            if found != nj {
                return Err(RestoreError::Joints { found, expected: nj });
            }
            if !is_valid(command, nj) {
                return Err(RestoreError::NotFinite { field: "commands" });
            }
        }
        self.own.restore(&state.own.data)?;
        (self.t_ns, self.tick) = (state.t_ns, state.tick);
        for (k, other) in self.others.iter_mut().enumerate() {
            other.arrival_tick = state.arrival_tick[k];
            copy(&state.commands[k], &mut other.command);
        }
        Ok(())
    }

    fn poison_workspace(&mut self) {
        self.own.poison_workspace();
        for command in [&mut self.command, &mut self.received] {
            let RobotCommand { tau, q_des, qd_des, kp, kd, .. } = command;
            for values in [tau, q_des, qd_des, kp, kd] {
                values.fill(f64::NAN);
            }
        }
    }

    fn dump(&self) -> Dump {
        self.own.dump()
    }
}
