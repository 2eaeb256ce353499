//! A controller with its input: what an executor steps and a replay computes again.

use super::unpack::{Unpacked, copy, empty_state};
use crate::dump::Dump;
use crate::error::RestoreError;
use crate::interface::{Controller, NoProbe, Probe};
use crate::outbox::Outbox;
use crate::time::snapshot_ticks;
use lcmtypes::channels::CONTROLLER_SNAPSHOT;
use lcmtypes::{ComponentState, ControllerInput, Message, TickInput};
use std::cell::RefCell;

/// Memory by which the state of a controller may grow without an allocation in a tick, bytes: way-points, for example.
const GROWTH: usize = 64 << 10;

/// A controller, and what holds of the messages delivered to it.
pub struct Component {
    controller: Box<dyn Controller>,
    unpacked: Unpacked,
    /// The state is published after each tick whose number leaves the second number when it is divided by the first.
    snapshots: (i64, i64),
    /// Preallocated message for writing and reading snapshots.
    snapshot_buffer: RefCell<ComponentState>,
}

impl Component {
    /// A component before its first tick.
    pub fn new(controller: Box<dyn Controller>) -> Self {
        let input = TickInput { state: empty_state(), ..TickInput::default() };
        let mut state = ComponentState { input, ..ComponentState::default() };
        controller.snapshot(&mut state.controller.data);
        state.controller.data.reserve(GROWTH);
        let snapshots = (snapshot_ticks(1), 0);
        Component { controller, unpacked: Unpacked::default(), snapshots, snapshot_buffer: RefCell::new(state) }
    }

    /// Publishes the state after ticks `at`, `at + every`, `at + 2 every`, ... instead of every [`snapshot_ticks`] of a component that runs in each
    /// base tick.
    #[must_use]
    pub fn with_snapshots(self, every: i64, at: i64) -> Self {
        Component { snapshots: (every, at), ..self }
    }

    /// Kind of its controller.
    pub fn name(&self) -> &'static str {
        self.controller.name()
    }

    /// Names of the stages of its tick, in the order of `controller_tick_t.digest`.
    pub fn stages(&self) -> &[&'static str] {
        self.controller.stages()
    }

    /// What its controller read in the last tick.
    pub fn input(&self) -> &TickInput {
        self.unpacked.input()
    }

    /// Computes one tick from the state and the delivered messages alone, and fills `out` with the encoded output messages; see
    /// [`Controller::step_probed`]. Every [`snapshot_ticks`] the last one is CONTROLLER_SNAPSHOT.
    // Not inlined: the guard of instruction counts looks for it in the profile.
    #[inline(never)]
    pub fn step_probed(&mut self, input: &ControllerInput, out: &mut Outbox, probe: &mut dyn Probe) {
        let Component { controller, unpacked, .. } = self;
        unpacked.update_with(input, |now, message| controller.receive(now, &message.channel, &message.data));
        controller.step_probed(unpacked.input(), out, probe);
        if input.tick % self.snapshots.0 == self.snapshots.1 {
            self.write_state();
            out.put(CONTROLLER_SNAPSHOT, &*self.snapshot_buffer.borrow())
                .expect("`write_state` sets every length field");
        }
    }

    /// [`Component::step_probed`] without a probe.
    pub fn step(&mut self, input: &ControllerInput, out: &mut Outbox) {
        self.step_probed(input, out, &mut NoProbe);
    }

    fn write_state(&self) {
        let mut state = self.snapshot_buffer.borrow_mut();
        let ComponentState { t_ns, tick, input, controller } = &mut *state;
        copy(self.unpacked.input(), input);
        (*t_ns, *tick) = (input.t_ns, input.tick);
        controller.data.clear();
        self.controller.snapshot(&mut controller.data);
        controller.size = i32::try_from(controller.data.len()).expect("a state is far below 2 GB");
    }

    /// Appends the complete state between two ticks to `out`, encoded as `component_state_t`. If the last tick published a CONTROLLER_SNAPSHOT, these
    /// are the same bytes.
    pub fn snapshot(&self, out: &mut Vec<u8>) {
        self.write_state();
        self.snapshot_buffer.borrow().encode(out).expect("`write_state` sets every length field");
    }

    /// Replaces the state by one that [`Component::snapshot`] wrote.
    ///
    /// # Errors
    /// The bytes are no valid state of this component, or belong to another robot; the component must not be used then.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), RestoreError> {
        let state = self.snapshot_buffer.get_mut();
        state.decode_into(bytes)?;
        self.controller.restore(&state.controller.data)?;
        copy(&state.input, &mut self.unpacked.input);
        Ok(())
    }

    /// [`Controller::poison_workspace`].
    pub fn poison_workspace(&mut self) {
        self.controller.poison_workspace();
    }

    /// Every quantity that the last tick computed, by name; see [`Controller::dump`].
    pub fn dump(&self) -> Dump {
        self.controller.dump()
    }
}

impl From<Box<dyn Controller>> for Component {
    fn from(controller: Box<dyn Controller>) -> Self {
        Component::new(controller)
    }
}
