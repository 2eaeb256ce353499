//! The interface between a controller and the programs that run it: executors and the replay engine.

use crate::dump::Dump;
use crate::error::RestoreError;
use crate::outbox::Outbox;
use lcmtypes::TickInput;

/// Receives a call at the end of each stage of a tick. An executor's probe reads a clock; the controller gets nothing back from it.
pub trait Probe {
    /// The controller has just computed a stage.
    ///
    /// - `stage`: index in [`Controller::stages`].
    fn stage_done(&mut self, stage: usize);
}

/// A probe that does nothing.
pub struct NoProbe;

impl Probe for NoProbe {
    fn stage_done(&mut self, _: usize) {}
}

/// A controller: input in, encoded output messages out. A [`crate::runtime::Component`] makes the input from the messages that are delivered.
pub trait Controller: Send {
    /// The name that [`crate::load`] accepts for this controller.
    fn name(&self) -> &'static str;

    /// Names of the stages of a tick, in the order of execution: the order of `controller_tick_t.digest` and `timing_t.stage_ns`.
    fn stages(&self) -> &[&'static str];

    /// Takes a message on a channel that [`crate::runtime`] does not unpack, before the step of its tick; what the controller keeps of it is state.
    /// Returns false if the controller does not know the channel, or cannot decode the message.
    ///
    /// - `input`: that of the tick, apart from `n_ignored`.
    fn receive(&mut self, _input: &TickInput, _channel: &str, _data: &[u8]) -> bool {
        false
    }

    /// Computes one tick from the state and `input` alone, updates the state, and fills `out` with the encoded output messages: the same channels
    /// in the same order in every tick.
    ///
    /// Never fails. After an invalid input the controller is in its safe state in the same tick, and the tick's `controller_tick_t` contains the
    /// fault code.
    fn step_probed(&mut self, input: &TickInput, out: &mut Outbox, probe: &mut dyn Probe);

    /// [`Controller::step_probed`] without a probe.
    fn step(&mut self, input: &TickInput, out: &mut Outbox) {
        self.step_probed(input, out, &mut NoProbe);
    }

    /// Appends the complete state between two ticks to `out`, encoded as an LCM message.
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
