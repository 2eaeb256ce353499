//! The components beside the first one, in lockstep: each computes its tick at once, and its results are delivered after its latency.

use crate::DriverError;
use crate::components::{ComponentEntry, EXTERNAL, Releases, Slot, slots};
use crate::stage_clock::StageClock;
use crate::watch::{ModeEvent, ModeWatch};
use controller::{Component, Outbox};
use lcmtypes::{ControllerTick, Message, OperatorCommand, RobotState, RunInfo, channels};
use replay::record::EventSink;

/// The components of a run beside the first one.
pub struct Others {
    /// Those of all components, the first one included: it runs elsewhere, but its messages wait here.
    slots: Vec<Slot>,
    /// Those beside the first one; `None` for an external one, which takes no part.
    components: Vec<Option<Running>>,
    /// The newest measurement.
    newest: RobotState,
    results: Releases,
    outbox: Outbox,
    bytes: Vec<u8>,
    /// Which controllers of a sequence run; see `running_t`.
    pub(super) running: i64,
}

struct Running {
    component: Component,
    clock: StageClock,
    modes: ModeWatch,
}

/// What a component reports in a tick: its name, and the event.
pub(super) type Report = (String, ModeEvent);

impl Others {
    /// Builds the components of a run beside the first one.
    ///
    /// - `entries`: their entries in the run file; empty if the run has no other components.
    /// - `receives`: channels that the first component listens to.
    ///
    /// # Errors
    /// [`DriverError::Controller`] if one cannot be built.
    pub fn build(info: &RunInfo, entries: &[ComponentEntry], receives: &[String]) -> Result<Self, DriverError> {
        let mut components = Vec::new();
        for (index, component) in info.components.iter().enumerate().skip(1) {
            if component.kind == EXTERNAL {
                components.push(None);
                continue;
            }
            let built = controller::load(&info.of_component(index)).map_err(|source| DriverError::Controller {
                robot: format!("component {}", component.name),
                source: Box::new(source),
            })?;
            let clock = StageClock::new(built.stages().len());
            let modes = ModeWatch::new(info.joints.clone());
            components.push(Some(Running { component: built, clock, modes }));
        }
        Ok(Others {
            slots: slots(info, entries, receives),
            components,
            newest: RobotState::default(),
            results: Releases::default(),
            outbox: Outbox::new(),
            bytes: Vec::new(),
            running: 1,
        })
    }

    /// Sets which controllers of a sequence run, one bit each; without this call the first one.
    #[must_use]
    pub fn with_running(self, running: i64) -> Self {
        Others { running, ..self }
    }

    /// Delivers an operator command to all components.
    pub(super) fn operator(&mut self, t_ns: i64, op: &OperatorCommand) -> Result<(), DriverError> {
        Ok(self.slots.iter_mut().skip(1).try_for_each(|slot| slot.put_operator(t_ns, op))?)
    }

    /// Computes the ticks of all components that are due, and delivers what is due to the first one: [`Others::of_first`].
    ///
    /// - `measured`: the measurement of the base tick, if one arrived.
    pub(super) fn tick(
        &mut self,
        t_ns: i64,
        base_tick: i64,
        measured: Option<&RobotState>,
        log: &mut dyn EventSink,
    ) -> Result<Vec<Report>, DriverError> {
        let mut reports = Vec::new();
        let Others { slots, components, newest, results, outbox, bytes, .. } = self;
        if let Some(measured) = measured.filter(|_| !components.is_empty()) {
            newest.clone_from(measured);
        }
        for slot in slots.iter_mut() {
            slot.has_new_state |= measured.is_some();
        }
        for (k, running) in components.iter_mut().enumerate() {
            let Some(Running { component, clock, modes }) = running else { continue };
            let at = k + 1;
            if !slots[at].is_due(base_tick) {
                continue;
            }
            results.release(base_tick, t_ns, slots);
            let slot = &mut slots[at];
            if slot.has_new_state {
                slot.has_new_state = false;
                slot.inbox.put(channels::ROBOT_STATE, t_ns, newest)?;
            }
            slot.inbox.stamp(t_ns, slot.tick);
            write(bytes, log, slot.channel(channels::CONTROLLER_INPUT), t_ns, slot.inbox.input())?;
            clock.start();
            component.step_probed(slot.inbox.input(), outbox, clock);
            let due_tick = base_tick + slot.latency_ticks;
            for (channel, data) in outbox.iter() {
                let channel = slots[at].channel(channel);
                log.write(channel, t_ns, data)?;
                if slots.iter().any(|slot| slot.listens_to(channel)) {
                    results.put(due_tick, channel, data);
                }
            }
            let slot = &mut slots[at];
            let timing = clock.timing(t_ns, slot.tick);
            write(bytes, log, slot.channel(channels::TIMING), t_ns, timing)?;
            if let Some(tick) = outbox.get(channels::CONTROLLER_TICK) {
                let event = modes.update(&ControllerTick::decode(tick)?);
                reports.extend(event.map(|event| (slot.name.clone(), event)));
            }
            slot.inbox.clear();
            slot.tick += 1;
        }
        results.release(base_tick, t_ns, slots);
        Ok(reports)
    }

    /// The messages that wait for the first component.
    pub(super) fn of_first(&mut self) -> &mut Slot {
        &mut self.slots[0]
    }
}

fn write(
    bytes: &mut Vec<u8>,
    log: &mut dyn EventSink,
    channel: &str,
    t_ns: i64,
    message: &impl Message,
) -> Result<(), DriverError> {
    bytes.clear();
    message.encode(bytes)?;
    log.write(channel, t_ns, bytes)?;
    Ok(())
}
