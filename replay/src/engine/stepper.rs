//! Steps one controller through a segment of a log and compares its outputs.

use super::builder::{Builder, PendingOverrides};
use super::compare::{Pair, attribute, is_same_tick};
use super::inputs::stage_inputs;
use super::report::Counts;
use super::ticks::Tick;
use super::what_if::Collector;
use crate::Error;
use controller::handover::take_over;
use controller::{Component, Outbox};
use lcmtypes::ParameterChange;
use lcmtypes::channels::{CONTROLLER_SNAPSHOT, ROBOT_COMMAND};
use std::sync::Arc;

/// A controller and the results of its replay.
pub(super) struct Stepper<'b> {
    builder: Builder<'b>,
    active: Built,
    /// A second controller. Restarts from a snapshot alternate between the two: state that is missing in a snapshot is then out of date in the restarted
    /// one, and differs with any number of threads.
    spare: Option<Built>,
    /// Timed overrides that are not applied yet.
    overrides: PendingOverrides,
    outbox: Outbox,
    state: Vec<u8>,
    /// The last tick that was identical, or whose snapshot was restored.
    agreed: Option<i64>,
    /// At least one tick was computed.
    has_stepped: bool,
    /// Do not restore snapshots that differ, as for a what-if replay.
    keep_state: bool,
    pub what_if: Option<Collector>,
    pub counts: Counts,
}

/// A controller, and the parameter changes that it is built with, in order.
struct Built {
    controller: Component,
    changes: Vec<ParameterChange>,
    /// Digest of its parameters.
    digest: i64,
}

impl Built {
    fn new(builder: &Builder, changes: Vec<ParameterChange>) -> Result<Self, Error> {
        Ok(Built { controller: builder.build(&changes)?, digest: builder.digest(&changes)?, changes })
    }
}

impl<'b> Stepper<'b> {
    /// A stepper before the first tick of a run.
    pub fn new(builder: &Builder<'b>, keep_state: bool) -> Result<Self, Error> {
        Ok(Stepper {
            builder: builder.clone(),
            active: Built::new(builder, Vec::new())?,
            spare: None,
            overrides: PendingOverrides::new(),
            outbox: Outbox::new(),
            state: Vec::new(),
            agreed: None,
            has_stepped: false,
            keep_state,
            what_if: None,
            counts: Counts { ulps: !keep_state, ..Counts::default() },
        })
    }

    /// Adds timed overrides.
    pub fn with_overrides(mut self, overrides: PendingOverrides) -> Self {
        self.overrides = overrides;
        self
    }

    /// Adds a collector of what-if statistics.
    pub fn with_collector(mut self, what_if: Option<Collector>) -> Self {
        self.what_if = what_if;
        self
    }

    /// Number of timed overrides that are not applied yet.
    pub fn pending_overrides(&self) -> usize {
        self.overrides.len()
    }

    /// Resets the counts; whether the state is known is kept.
    pub fn forget_differences(&mut self) {
        let continuity = std::mem::take(&mut self.counts.continuity);
        self.counts = Counts { continuity, ..Counts::default() };
    }

    /// The controller, after the last tick.
    pub fn controller(&self) -> &Component {
        &self.active.controller
    }

    /// Continues after `tick` with its snapshot and the parameters after `changes`, the parameter changes of the log up to there.
    pub fn start(&mut self, tick: i64, snapshot: &[u8], changes: &[ParameterChange]) -> Result<(), Error> {
        let applied: Vec<_> = changes.iter().filter(|change| self.builder.applies(change)).cloned().collect();
        if self.has_stepped {
            let spare = match self.spare.take() {
                Some(spare) => spare,
                None => Built::new(&self.builder, applied.clone())?,
            };
            self.spare = Some(std::mem::replace(&mut self.active, spare));
        }
        if self.active.changes != applied {
            self.active = Built::new(&self.builder, applied)?;
        }
        self.restore(tick, snapshot)
    }

    fn restore(&mut self, tick: i64, snapshot: &[u8]) -> Result<(), Error> {
        self.active.controller.restore(snapshot).map_err(|source| self.builder.restore_error(tick, source))?;
        self.counts.continuity.restored(tick);
        self.agreed = Some(tick);
        Ok(())
    }

    /// Computes a tick. Returns the outputs, or `None` if the tick cannot be computed.
    ///
    /// # Errors
    /// [`Error::Restore`]; [`Error::Load`] for a parameter change that this build rejects.
    pub fn tick(&mut self, tick: &Tick) -> Result<Option<&Outbox>, Error> {
        self.change(tick)?;
        let has_parameters = self.builder.is_what_if || tick.has_parameters(self.active.digest);
        let can_compute = self.counts.continuity.can_compute(tick, has_parameters);
        let Some(input) = tick.input.as_ref().filter(|_| can_compute) else {
            if let Some(snapshot) = tick.snapshot() {
                self.restore(tick.tick, snapshot)?;
            }
            return Ok(None);
        };
        self.has_stepped = true;
        self.outbox.clear();
        self.active.controller.step(input, &mut self.outbox);
        self.counts.ticks += 1;
        self.counts.late_results += input.late.len() as u64;
        self.counts.time(input.t_ns);
        self.compare(tick, input.t_ns)?;
        Ok(Some(&self.outbox))
    }

    /// Hands over to a controller with new parameters if a change holds from this tick on.
    fn change(&mut self, tick: &Tick) -> Result<(), Error> {
        let count = self.active.changes.len();
        self.active.changes.extend(tick.changes.iter().filter(|change| self.builder.applies(change)).cloned());
        let since_s = tick.since_ns.unwrap_or_default() as f64 * 1e-9;
        while let Some((_, change)) = self.overrides.pop_front_if(|(when, _)| when.is_reached(tick.tick, since_s)) {
            self.active.changes.push(change);
        }
        if self.active.changes.len() == count {
            return Ok(());
        }
        let mut next = self.builder.build(&self.active.changes)?;
        take_over(&self.active.controller, &mut next, &mut self.state)
            .map_err(|source| self.builder.restore_error(tick.tick, source))?;
        (self.active.controller, self.active.digest) = (next, self.builder.digest(&self.active.changes)?);
        Ok(())
    }

    fn compare(&mut self, tick: &Tick, t_ns: i64) -> Result<(), Error> {
        let snapshot = tick.snapshot();
        if snapshot.is_some() {
            self.state.clear();
            self.active.controller.snapshot(&mut self.state);
        }
        let t_s = tick.since_ns.unwrap_or_default() as f64 * 1e-9;
        let (outbox, state, counts) = (&self.outbox, &self.state, &mut self.counts);
        let is_what_if = self.builder.is_what_if;
        let mut different = Vec::new();
        let mut compared = 0;
        let of_controller = |(channel, _): &&(Arc<str>, _)| outbox.get(channel).is_some();
        for (channel, recorded) in tick.recorded.iter().chain(tick.candidates.iter().filter(of_controller)) {
            let is_snapshot = **channel == *CONTROLLER_SNAPSHOT;
            let replayed = if is_snapshot { Some(&state[..]) } else { outbox.get(channel) };
            compared += 1;
            counts.snapshots += u64::from(is_snapshot);
            let is_same =
                |replayed: &[u8]| replayed == &**recorded || is_what_if && is_same_tick(channel, recorded, replayed);
            if !replayed.is_some_and(is_same) {
                different.push(Pair { channel, recorded: Some(recorded), replayed });
            }
        }
        let is_recorded =
            |channel: &str| tick.recorded.iter().chain(&tick.candidates).any(|(recorded, _)| **recorded == *channel);
        outbox.iter().for_each(|(channel, _)| counts.outputs.count(channel, tick.tick, is_recorded(channel)));
        counts.compared += compared;
        counts.different += different.len() as u64;
        counts.unverifiable += u64::from(compared == 0);
        counts.largest_ulp(&different);
        // Sort by the order of the controller's outputs, which does not depend on the log.
        let place = |channel: &str| outbox.iter().position(|(c, _)| c == channel).unwrap_or(usize::MAX);
        different.sort_by_key(|pair| place(pair.channel));
        if counts.first.is_none()
            && let Some(mut first) = attribute(tick.tick, t_ns, t_s, &different, self.builder.stages(), is_what_if)
        {
            first.last_agreed_tick = self.agreed;
            first.inputs = stage_inputs(&first.stage, self.active.controller.input(), &self.active.controller.dump());
            counts.first = Some(first);
        }
        if compared > 0 && different.is_empty() {
            self.agreed = Some(tick.tick);
        }
        if let Some(what_if) = &mut self.what_if {
            let recorded = tick.recorded.iter().find(|(channel, _)| **channel == *ROBOT_COMMAND);
            what_if.tick((tick.tick, t_ns, t_s), recorded.map(|(_, bytes)| &**bytes), outbox);
        }
        // Restore a snapshot that differs, so that each segment of the log is compared on its own.
        match snapshot {
            Some(snapshot) if !self.keep_state && snapshot != self.state => self.restore(tick.tick, snapshot),
            _ => Ok(()),
        }
    }
}
