//! Steps one controller through a segment of a log and compares its outputs.

use super::builder::{Builder, PendingOverrides};
use super::compare::{Pair, attribute, is_same_tick};
use super::inputs::stage_inputs;
use super::report::Counts;
use super::ticks::Tick;
use super::what_if::Collector;
use crate::Error;
use controller::handover::take_over;
use controller::{Controller, Outbox};
use lcmtypes::ParameterChange;
use lcmtypes::channels::{CONTROLLER_SNAPSHOT, ROBOT_COMMAND};

/// A controller and the results of its replay.
pub(super) struct Stepper<'b> {
    builder: Builder<'b>,
    controller: Box<dyn Controller>,
    /// Parameter changes that the controller is built with, in order.
    changes: Vec<ParameterChange>,
    /// Timed overrides that are not applied yet.
    overrides: PendingOverrides,
    outbox: Outbox,
    state: Vec<u8>,
    /// Expected next tick; `None` before the first.
    next: Option<i64>,
    /// The last tick that was identical, or whose snapshot was restored.
    agreed: Option<i64>,
    /// The state of the controller is unknown.
    state_unknown: bool,
    /// Do not restore snapshots that differ, as for a what-if replay.
    keep_state: bool,
    pub what_if: Option<Collector>,
    pub counts: Counts,
}

impl<'b> Stepper<'b> {
    /// A stepper before the first tick of a run.
    pub fn new(builder: &Builder<'b>, keep_state: bool) -> Result<Self, Error> {
        Ok(Stepper {
            builder: builder.clone(),
            controller: builder.build(&[])?,
            changes: Vec::new(),
            overrides: PendingOverrides::new(),
            outbox: Outbox::new(),
            state: Vec::new(),
            next: None,
            agreed: None,
            state_unknown: false,
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

    /// The controller, after the last tick.
    pub fn controller(&self) -> &dyn Controller {
        &*self.controller
    }

    /// Continues after `tick` with its snapshot and the parameters after `changes`, the parameter changes of the log up to there.
    pub fn start(&mut self, tick: i64, snapshot: &[u8], changes: &[ParameterChange]) -> Result<(), Error> {
        let applied = || changes.iter().filter(|change| self.builder.applies(change));
        if !self.changes.iter().eq(applied()) {
            self.changes = applied().cloned().collect();
            self.controller = self.builder.build(&self.changes)?;
        }
        self.restore(tick, snapshot)
    }

    fn restore(&mut self, tick: i64, snapshot: &[u8]) -> Result<(), Error> {
        self.controller.restore(snapshot).map_err(|source| self.builder.restore_error(tick, source))?;
        self.next = tick.checked_add(1);
        self.agreed = Some(tick);
        self.state_unknown = false;
        Ok(())
    }

    /// Computes a tick. Returns the outputs, or `None` if the tick cannot be computed.
    ///
    /// # Errors
    /// [`Error::Restore`]; [`Error::Load`] for a parameter change that this build rejects.
    pub fn tick(&mut self, tick: &Tick) -> Result<Option<&Outbox>, Error> {
        self.change(tick)?;
        // Only at tick 0 the state is known without a snapshot.
        let begins_late = self.next.is_none() && tick.tick != 0;
        let gap = self.next.map_or(0, |next| tick.tick.saturating_sub(next) as u64 + u64::from(tick.input.is_none()));
        if gap > 0 {
            let last = if tick.input.is_none() { tick.tick } else { tick.tick - 1 };
            self.counts.missing(self.next.unwrap_or(tick.tick), last);
        }
        self.state_unknown |= gap > 0 || begins_late || tick.input.is_none();
        self.next = tick.tick.checked_add(1);
        let Some(input) = tick.input.as_ref() else {
            return self.try_restore(tick).map(|()| None);
        };
        if self.state_unknown {
            self.counts.skipped += 1;
            return self.try_restore(tick).map(|()| None);
        }
        self.outbox.clear();
        self.controller.step(input, &mut self.outbox);
        self.counts.ticks += 1;
        self.counts.time(input.t_ns);
        self.compare(tick, input.t_ns)?;
        Ok(Some(&self.outbox))
    }

    /// Hands over to a controller with new parameters if a change holds from this tick on.
    fn change(&mut self, tick: &Tick) -> Result<(), Error> {
        let count = self.changes.len();
        self.changes.extend(tick.changes.iter().filter(|change| self.builder.applies(change)).cloned());
        let since_s = tick.since_ns.unwrap_or_default() as f64 * 1e-9;
        while let Some((_, change)) = self.overrides.pop_front_if(|(when, _)| when.is_reached(tick.tick, since_s)) {
            self.changes.push(change);
        }
        if self.changes.len() == count {
            return Ok(());
        }
        let mut next = self.builder.build(&self.changes)?;
        take_over(&*self.controller, &mut *next, &mut self.state)
            .map_err(|source| self.builder.restore_error(tick.tick, source))?;
        self.controller = next;
        Ok(())
    }

    /// Restores the tick's snapshot, if it has one.
    fn try_restore(&mut self, tick: &Tick) -> Result<(), Error> {
        tick.snapshot().map_or(Ok(()), |snapshot| self.restore(tick.tick, snapshot))
    }

    fn compare(&mut self, tick: &Tick, t_ns: i64) -> Result<(), Error> {
        let snapshot = tick.snapshot();
        if snapshot.is_some() {
            self.state.clear();
            self.controller.snapshot(&mut self.state);
        }
        let t_s = tick.since_ns.unwrap_or_default() as f64 * 1e-9;
        let (outbox, state, counts) = (&self.outbox, &self.state, &mut self.counts);
        let is_what_if = self.builder.is_what_if;
        let mut different = Vec::new();
        let mut compared = 0;
        for (channel, recorded) in &tick.recorded {
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
        let is_recorded = |channel: &str| tick.recorded.iter().any(|(recorded, _)| **recorded == *channel);
        counts.not_recorded += outbox.iter().filter(|(channel, _)| !is_recorded(channel)).count() as u64;
        counts.compared += compared;
        counts.different += different.len() as u64;
        counts.unverifiable += u64::from(compared == 0);
        counts.largest_ulp(&different);
        // Sort by the order of the controller's outputs, which does not depend on the log.
        let place = |channel: &str| outbox.iter().position(|(c, _)| c == channel).unwrap_or(usize::MAX);
        different.sort_by_key(|pair| place(pair.channel));
        if counts.first.is_none()
            && let Some(mut first) = attribute(tick.tick, t_ns, t_s, &different, is_what_if)
        {
            first.last_agreed_tick = self.agreed;
            first.inputs = stage_inputs(first.stage, tick.input.as_ref(), &self.controller.dump());
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
