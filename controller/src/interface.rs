//! The interface between a controller and the programs that run it: executors and the replay engine.

use crate::dump::Dump;
use crate::error::RestoreError;
use crate::outbox::Outbox;
use lcmtypes::ControllerInput;
use lcmtypes::channels::Stage;

/// Receives a call at the end of each stage of a tick. An executor's probe reads a clock; the controller gets nothing back from it.
pub trait Probe {
    /// The controller has just computed `stage`.
    fn stage_done(&mut self, stage: Stage);
}

/// A probe that does nothing.
pub struct NoProbe;

impl Probe for NoProbe {
    fn stage_done(&mut self, _: Stage) {}
}

/// A controller: input message in, encoded output messages out.
pub trait Controller: Send {
    /// The name that [`crate::load`] accepts for this controller.
    fn name(&self) -> &'static str;

    /// Computes one tick from the state and `input` alone, updates the state, and fills `out` with the encoded output messages: the same channels
    /// in the same order in every tick, except [`lcmtypes::channels::CONTROLLER_SNAPSHOT`], which is published once a second.
    ///
    /// Never fails. After an invalid input the controller is in its safe state in the same tick, and the tick's `controller_tick_t` contains the
    /// fault code.
    fn step_probed(&mut self, input: &ControllerInput, out: &mut Outbox, probe: &mut dyn Probe);

    /// [`Controller::step_probed`] without a probe.
    fn step(&mut self, input: &ControllerInput, out: &mut Outbox) {
        self.step_probed(input, out, &mut NoProbe);
    }

    /// Appends the complete state between two ticks to `out`, encoded as an LCM message. If the last tick published a CONTROLLER_SNAPSHOT, these
    /// are the same bytes.
    fn snapshot(&self, out: &mut Vec<u8>);

    /// Replaces the state by one that [`Controller::snapshot`] wrote.
    ///
    /// # Errors
    /// The bytes are no valid state of this controller, or belong to another robot.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError>;

    /// Fills scratch memory with NaN and rebuilds the solvers. Later outputs must not change by a bit; tests call it before each tick.
    fn poison_workspace(&mut self);

    /// Returns every quantity that the last tick computed, by name; the default is an empty dump. It allocates: do not call it in a tick.
    fn dump(&self) -> Dump {
        Dump::default()
    }
}
