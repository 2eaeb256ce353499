//! One controller that is led through a stretch of a log.

use super::builder::{Builder, Later};
use super::compare::{Pair, attribute};
use super::inputs::stage_inputs;
use super::report::Tally;
use super::ticks::Tick;
use super::what_if::Collector;
use crate::Error;
use controller::handover::take_over;
use controller::{Controller, Outbox};
use lcmtypes::ParameterChange;
use lcmtypes::channels::{CONTROLLER_SNAPSHOT, ROBOT_COMMAND};

/// A controller, and what its replay has found so far.
pub(super) struct Runner<'b> {
    builder: Builder<'b>,
    controller: Box<dyn Controller>,
    /// Changes of parameters that the controller is built with, in the order in which they came.
    changes: Vec<ParameterChange>,
    /// Changes that are to come besides those of the log.
    later: Later,
    outbox: Outbox,
    state: Vec<u8>,
    /// Tick that should come next, if one has come.
    next: Option<i64>,
    /// The last tick that agreed with the record, or whose recorded state was taken over.
    agreed: Option<i64>,
    /// The state of the controller is not the one that the run had.
    lost: bool,
    /// Keep the own state where the recorded one differs: the run is to change, as with other parameters.
    own_state: bool,
    pub what_if: Option<Collector>,
    pub tally: Tally,
}

impl<'b> Runner<'b> {
    /// A runner before the first tick of a run.
    pub fn new(builder: &Builder<'b>, own_state: bool) -> Result<Self, Error> {
        Ok(Runner {
            builder: builder.clone(),
            controller: builder.build(&[])?,
            changes: Vec::new(),
            later: Later::new(),
            outbox: Outbox::new(),
            state: Vec::new(),
            next: None,
            agreed: None,
            lost: false,
            own_state,
            what_if: None,
            tally: Tally { ulps: !own_state, ..Tally::default() },
        })
    }

    /// Changes parameters on the way.
    pub fn then(mut self, later: Later) -> Self {
        self.later = later;
        self
    }

    /// Collects how far the controller goes from the one that ran.
    pub fn collecting(mut self, what_if: Option<Collector>) -> Self {
        self.what_if = what_if;
        self
    }

    /// Changes whose time has not come.
    pub fn still_to_come(&self) -> usize {
        self.later.len()
    }

    /// The controller, after the last tick.
    pub fn controller(&self) -> &dyn Controller {
        &*self.controller
    }

    /// Goes on behind `tick` with the state that was recorded then, and the parameters that held after the `changes` of the log up to there.
    pub fn start(&mut self, tick: i64, snapshot: &[u8], changes: &[ParameterChange]) -> Result<(), Error> {
        let followed = || changes.iter().filter(|change| self.builder.follows(change));
        if !self.changes.iter().eq(followed()) {
            self.changes = followed().cloned().collect();
            self.controller = self.builder.build(&self.changes)?;
        }
        self.restore(tick, snapshot)
    }

    fn restore(&mut self, tick: i64, snapshot: &[u8]) -> Result<(), Error> {
        self.controller.restore(snapshot).map_err(|source| self.builder.restore_error(tick, source))?;
        self.next = tick.checked_add(1);
        self.agreed = Some(tick);
        self.lost = false;
        Ok(())
    }

    /// Takes a tick. Gives back what the controller put out, if it could be computed.
    ///
    /// # Errors
    /// [`Error::Restore`]; [`Error::Load`] for a change of parameters that this build cannot follow.
    pub fn tick(&mut self, tick: &Tick) -> Result<Option<&Outbox>, Error> {
        self.change(tick)?;
        // A controller is new at tick 0; at any other one it has a past.
        let begins_late = self.next.is_none() && tick.tick != 0;
        let gap = self.next.map_or(0, |next| tick.tick.saturating_sub(next) as u64 + u64::from(tick.input.is_none()));
        if gap > 0 {
            let last = if tick.input.is_none() { tick.tick } else { tick.tick - 1 };
            self.tally.missing(self.next.unwrap_or(tick.tick), last);
        }
        self.lost |= gap > 0 || begins_late || tick.input.is_none();
        self.next = tick.tick.checked_add(1);
        let Some(input) = tick.input.as_ref() else {
            return self.find_again(tick).map(|()| None);
        };
        if self.lost {
            self.tally.skipped += 1;
            return self.find_again(tick).map(|()| None);
        }
        self.outbox.clear();
        self.controller.step(input, &mut self.outbox);
        self.tally.ticks += 1;
        self.tally.time(input.t_ns);
        self.compare(tick, input.t_ns)?;
        Ok(Some(&self.outbox))
    }

    /// Has a controller with other parameters take over, if a change holds from this tick on.
    fn change(&mut self, tick: &Tick) -> Result<(), Error> {
        let count = self.changes.len();
        self.changes.extend(tick.changes.iter().filter(|change| self.builder.follows(change)).cloned());
        let since_s = tick.since_ns.unwrap_or_default() as f64 * 1e-9;
        while let Some((_, change)) = self.later.pop_front_if(|(when, _)| when.has_come(tick.tick, since_s)) {
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

    fn find_again(&mut self, tick: &Tick) -> Result<(), Error> {
        tick.snapshot().map_or(Ok(()), |snapshot| self.restore(tick.tick, snapshot))
    }

    fn compare(&mut self, tick: &Tick, t_ns: i64) -> Result<(), Error> {
        let snapshot = tick.snapshot();
        if snapshot.is_some() {
            self.state.clear();
            self.controller.snapshot(&mut self.state);
        }
        let t_s = tick.since_ns.unwrap_or_default() as f64 * 1e-9;
        let (outbox, state, tally) = (&self.outbox, &self.state, &mut self.tally);
        let mut different = Vec::new();
        let mut compared = 0;
        for (channel, recorded) in &tick.recorded {
            let is_snapshot = **channel == *CONTROLLER_SNAPSHOT;
            let replayed = if is_snapshot { Some(&state[..]) } else { outbox.get(channel) };
            compared += 1;
            tally.snapshots += u64::from(is_snapshot);
            if replayed != Some(recorded) {
                different.push(Pair { channel, recorded: Some(recorded), replayed });
            }
        }
        let is_recorded = |channel: &str| tick.recorded.iter().any(|(recorded, _)| **recorded == *channel);
        tally.not_recorded += outbox.iter().filter(|(channel, _)| !is_recorded(channel)).count() as u64;
        tally.compared += compared;
        tally.different += different.len() as u64;
        tally.unverifiable += u64::from(compared == 0);
        tally.largest_ulp(&different);
        // In the order in which the controller puts them out, whatever the order of the log.
        let place = |channel: &str| outbox.iter().position(|(c, _)| c == channel).unwrap_or(usize::MAX);
        different.sort_by_key(|pair| place(pair.channel));
        if tally.first.is_none()
            && let Some(mut first) = attribute(tick.tick, t_ns, t_s, &different)
        {
            first.last_agreed_tick = self.agreed;
            first.inputs = stage_inputs(first.stage, tick.input.as_ref(), &self.controller.dump());
            tally.first = Some(first);
        }
        if compared > 0 && different.is_empty() {
            self.agreed = Some(tick.tick);
        }
        if let Some(what_if) = &mut self.what_if {
            let recorded = tick.recorded.iter().find(|(channel, _)| **channel == *ROBOT_COMMAND);
            what_if.tick((tick.tick, t_ns, t_s), recorded.map(|(_, bytes)| &**bytes), outbox);
        }
        // From a snapshot on, a replay is that of the record again, so that every stretch of the log is judged by itself.
        match snapshot {
            Some(snapshot) if !self.own_state && snapshot != self.state => self.restore(tick.tick, snapshot),
            _ => Ok(()),
        }
    }
}
