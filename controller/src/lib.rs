//! The controllers: rigid-body model, tasks, quadratic program, gait, estimators, and the step that ties them together.
//!
//! A controller is a function of parameters, state and input. Nothing here reads a clock, a file or the environment, starts a
//! thread, or allocates in a tick, so the inputs in a log are enough to run it again bit for bit.
//!
//! Where to read on: [`Controller`] is the contract with executors and the replay engine, [`quadruped`] the locomotion
//! controller, [`stack`] how its tasks are put together, [`model`] the rigid-body algorithms under it, [`params`] what can be set.
#![allow(non_snake_case, reason = "names carry frames, as in p_WF = p_WB + R_WB * p_BF: see ARCHITECTURE.md")]

mod dense;
pub mod digest;
pub mod dump;
pub mod handover;
pub mod hold;
pub mod math;
pub mod model;
pub mod outbox;
pub mod params;
pub mod qp;
pub mod quadruped;
pub mod sequence;
pub mod stack;

use lcmtypes::{ControllerInput, RunInfo};

pub use dump::Dump;
pub use lcmtypes::channels::Stage;
pub use outbox::Outbox;

/// Told when a stage of a tick is done. An executor's probe reads its clock then; the controller learns nothing from it.
pub trait Probe {
    /// `stage` has just been computed.
    fn stage_done(&mut self, stage: Stage);
}

/// The probe of who does not want to know.
pub struct NoProbe;

impl Probe for NoProbe {
    fn stage_done(&mut self, _: Stage) {}
}

/// A controller as executors and the replay engine see it: messages in, messages out.
pub trait Controller: Send {
    /// Name by which [`load`] finds it.
    fn name(&self) -> &'static str;

    /// One tick: a pure function of the state inside and of `input`. Fills `out` with the encoded output messages, always the
    /// same channels in the same order (but [`lcmtypes::channels::CONTROLLER_SNAPSHOT`], which comes once a second).
    ///
    /// Never fails: bad input leads to the safe state in the same tick, and the `controller_tick_t` of the tick says why.
    fn step_probed(&mut self, input: &ControllerInput, out: &mut Outbox, probe: &mut dyn Probe);

    /// [`Controller::step_probed`] without a probe.
    fn step(&mut self, input: &ControllerInput, out: &mut Outbox) {
        self.step_probed(input, out, &mut NoProbe);
    }

    /// Appends the whole state between two ticks as the bytes of an LCM message: equal to the CONTROLLER_SNAPSHOT that the last
    /// tick published, if it did.
    fn snapshot(&self, out: &mut Vec<u8>);

    /// Takes over a state written by [`Controller::snapshot`].
    ///
    /// # Errors
    /// If the bytes are not such a state, or one of another robot.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError>;

    /// Fills scratch memory with NaN and builds solvers afresh. Must not change a bit of what follows; tests call it.
    fn poison_workspace(&mut self);

    /// Every quantity that the last tick computed, by name. Not for use in a tick. A controller that shows nothing leaves this out.
    fn dump(&self) -> Dump {
        Dump::default()
    }
}

/// Why a snapshot cannot be taken over.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreError {
    /// Not the bytes of a state message.
    #[error("snapshot cannot be decoded: {0}")]
    Decode(#[from] lcmtypes::DecodeError),
    /// A state message of another robot.
    #[error("snapshot has {found} joints, the robot has {expected}")]
    Joints {
        /// Joints in the snapshot.
        found: usize,
        /// Joints of the model.
        expected: usize,
    },
    /// A state of another number of controllers.
    #[error("snapshot holds {found} controllers, the run has {expected}")]
    Parts {
        /// Controllers in the snapshot.
        found: usize,
        /// Controllers of the run.
        expected: usize,
    },
    /// A number that is none, where the control would compute with it.
    #[error("snapshot field {field} is not finite")]
    NotFinite {
        /// Field of the message.
        field: &'static str,
    },
    /// A value outside its meaning, such as an unknown leg state.
    #[error("snapshot field {field} is {found}, which means nothing")]
    Value {
        /// Field of the message.
        field: &'static str,
        /// What it holds.
        found: i64,
    },
}

/// Why a controller cannot be built from a run's description.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// No controller of this name.
    #[error("unknown controller \"{found}\", known: quadruped, hold, and several of them as sequence(hold, quadruped)")]
    UnknownController {
        /// Name asked for.
        found: String,
    },
    /// The URDF is unusable.
    #[error(transparent)]
    Model(#[from] model::ModelError),
    /// The parameters are unusable.
    #[error(transparent)]
    Params(#[from] params::ParamsError),
    /// The stack of tasks is unusable, or does not fit the robot.
    #[error(transparent)]
    Stack(#[from] stack::StackError),
    /// Several controllers that cannot be run together.
    #[error("a sequence of controllers: {what}")]
    Sequence {
        /// What is wrong.
        what: String,
    },
    /// Robot and parameters do not fit each other.
    #[error("robot \"{robot}\": {what}")]
    Robot {
        /// Name of the robot.
        robot: String,
        /// What does not fit.
        what: String,
    },
}

/// Builds the controller that `info` describes: its name, the robot's URDF text and the parameters' TOML text are all it reads.
///
/// # Errors
/// If the name is unknown, or the URDF or the parameters are unusable.
pub fn load(info: &RunInfo) -> Result<Box<dyn Controller>, LoadError> {
    match info.controller.as_str() {
        quadruped::NAME => Ok(Box::new(quadruped::Quadruped::new(&info.urdf, &info.params)?)),
        hold::NAME => Ok(Box::new(hold::Hold::new(&info.urdf, &info.params)?)),
        list if list.starts_with("sequence(") && list.ends_with(')') => {
            let names = &list["sequence(".len()..list.len() - 1];
            Ok(Box::new(sequence::Sequence::load(names, info)?))
        }
        other => Err(LoadError::UnknownController { found: other.to_owned() }),
    }
}
