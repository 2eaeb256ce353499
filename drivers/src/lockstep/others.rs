//! The components beside the first one, in lockstep: each computes its tick in place, and its messages are logged.

use crate::DriverError;
use crate::components::{ComponentEntry, EXTERNAL, Others, Runner, Slot, build, slots};
use crate::live::message_ring;
use crate::watch::{ComponentEvent, ComponentWatch};
use lcmtypes::{OperatorCommand, RobotState, RunInfo};
use replay::record::EventSink;

/// The components of a run beside the first one.
pub struct LockstepOthers {
    others: Others,
    watch: ComponentWatch,
    /// The newest measurement that was delivered: one that a fault held back is not.
    newest: RobotState,
    /// Which controllers of a sequence run; see `running_t`.
    pub(super) running: i64,
}

impl LockstepOthers {
    /// Builds the components of a run beside the first one.
    ///
    /// - `entries`: their entries in the run file; empty if the run has no other components. External ones take no part.
    /// - `receives`: channels that the first component listens to.
    ///
    /// # Errors
    /// [`DriverError::Controller`] if one cannot be built.
    pub fn build(info: &RunInfo, entries: &[ComponentEntry], receives: &[String]) -> Result<Self, DriverError> {
        let runner = |(index, entry): (usize, &ComponentEntry)| {
            let is_external = entry.kind == EXTERNAL;
            if is_external { Ok(Runner::External) } else { build(info, index).map(Runner::in_place) }
        };
        let runners = (1..).zip(entries).map(runner).collect::<Result<_, _>>()?;
        // No message comes from another process.
        let (_, received) = message_ring(1);
        Ok(LockstepOthers {
            others: Others::new(slots(info, entries, receives), runners, received),
            watch: ComponentWatch::new(info),
            newest: RobotState::default(),
            running: 1,
        })
    }

    /// Sets which controllers of a sequence run, one bit each; without this call the first one.
    #[must_use]
    pub fn with_running(self, running: i64) -> Self {
        LockstepOthers { running, ..self }
    }

    /// Delivers an operator command to all components beside the first one.
    pub(super) fn operator(&mut self, t_ns: i64, op: &OperatorCommand) {
        self.others.operator(t_ns, op);
    }

    /// Computes and logs the ticks of all components that are due, and delivers what is due to the first one: [`LockstepOthers::of_first`].
    ///
    /// - `measured`: the measurement of the base tick, if one arrived.
    pub(super) fn tick(
        &mut self,
        t_ns: i64,
        base_tick: i64,
        measured: Option<&RobotState>,
        log: &mut dyn EventSink,
    ) -> Result<Vec<ComponentEvent>, DriverError> {
        let LockstepOthers { others, watch, newest, .. } = self;
        if let Some(measured) = measured.filter(|_| !watch.is_empty()) {
            newest.clone_from(measured);
        }
        let (mut events, mut logged) = (Vec::new(), Ok(()));
        others.tick((base_tick, t_ns), (newest, measured.is_some()), &mut |t_ns, channel, data| {
            events.extend(watch.update(channel, data));
            if logged.is_ok() {
                logged = log.write(channel, t_ns, data);
            }
        });
        logged?;
        Ok(events)
    }

    /// The messages that wait for the first component.
    pub(super) fn of_first(&mut self) -> &mut Slot {
        self.others.first()
    }
}
