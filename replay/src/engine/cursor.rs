//! Random access to a replay: every quantity of any tick.

use super::builder::Builder;
use super::seek::Places;
use super::stepper::Stepper;
use super::ticks::{Beside, Tick, Ticks};
use super::{Divergence, Options, Replay};
use crate::Error;
use crate::log::Event;
use controller::Dump;
use controller::dump::Value;
use lcmtypes::{ParameterChange, TickInput};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Number of cached pages: about 16 s of a log.
const PAGES: usize = 16;
/// Ticks up to which the reader reads on instead of starting at another place.
const NEAR: i64 = 5000;

/// One tick of a log and its replay.
#[derive(Debug, Clone)]
pub struct Moment {
    /// Tick.
    pub tick: i64,
    /// Its time, controller clock, ns.
    pub t_ns: i64,
    /// Time since the run's first tick, s.
    pub since_s: f64,
    /// What the controller read in this tick.
    pub input: TickInput,
    /// Recorded outputs by channel.
    pub recorded: Vec<(Arc<str>, Vec<u8>)>,
    /// Replayed outputs by channel.
    pub replayed: Vec<(&'static str, Vec<u8>)>,
    /// TIMING and EVENT of the tick.
    pub beside: Vec<Event>,
    /// The first difference, if any.
    pub divergence: Option<Divergence>,
    /// Every quantity of the replayed tick.
    pub dump: Dump,
    /// The log contains the state after this tick.
    pub is_snapshot: bool,
}

impl Moment {
    /// The input as a tree of quantities.
    pub fn input_quantities(&self) -> Option<Value> {
        super::inputs::of_message(&self.input)
    }

    /// Replayed message of a channel.
    pub fn replayed(&self, channel: &str) -> Option<&[u8]> {
        self.replayed.iter().find(|(c, _)| *c == channel).map(|(_, bytes)| &**bytes)
    }

    /// Recorded message of a channel.
    pub fn recorded(&self, channel: &str) -> Option<&[u8]> {
        self.recorded.iter().find(|(c, _)| **c == *channel).map(|(_, bytes)| &**bytes)
    }
}

/// The ticks after one snapshot up to and including the next.
struct Page {
    /// Tick and state of the snapshot before it; `None` at the start of a log.
    start: Option<(i64, Vec<u8>)>,
    /// Parameter changes before it, in order.
    changes: Vec<ParameterChange>,
    ticks: Vec<Tick>,
}

/// A replay with a position.
pub struct Cursor<'r> {
    replay: &'r Replay<'r>,
    builder: Builder<'r>,
    keep_state: bool,
    stepper: Stepper<'r>,
    reader: Ticks,
    /// Last snapshot that the reader has passed.
    last_snapshot: Option<(i64, Vec<u8>)>,
    /// Parameter changes up to there.
    changes: Vec<ParameterChange>,
    /// Cached pages by their first tick.
    pages: BTreeMap<i64, Arc<Page>>,
    /// First tick of the current page, and index of the next tick in it.
    place: Option<(i64, usize)>,
    first_tick: i64,
    last_tick: i64,
    places: Places,
    /// Whether to collect the quantities of a tick.
    dumps: bool,
}

impl<'r> Cursor<'r> {
    /// Reads start and end of an MCAP with an index, and a log without index as a whole. The position is before the first tick.
    ///
    /// - `options`: only `set` and `urdf` are used. `progress` receives the fraction of the file that was read.
    ///
    /// # Errors
    /// As [`Replay::run`].
    pub fn open(replay: &'r Replay<'r>, options: &Options, progress: &mut dyn FnMut(f64)) -> Result<Self, Error> {
        let options = Options { set: options.set.clone(), urdf: options.urdf.clone(), ..Options::default() };
        let (builder, keep_state) = (replay.builder(&options)?, options.is_what_if());
        let stepper = Stepper::new(&builder, keep_state)?;
        let mut places = Places::indexed(&replay.path, &replay.messages)?;
        let (first_tick, last_tick) = ends(replay, &mut places, progress)?;
        Ok(Cursor {
            replay,
            stepper,
            reader: Ticks::open(&replay.path, &replay.messages, Beside::ByTick)?,
            last_snapshot: None,
            changes: Vec::new(),
            pages: BTreeMap::new(),
            place: None,
            first_tick,
            last_tick,
            places,
            dumps: true,
            builder,
            keep_state,
        })
    }

    /// First tick of the log.
    pub fn first_tick(&self) -> i64 {
        self.first_tick
    }

    /// Last tick of the log.
    pub fn last_tick(&self) -> i64 {
        self.last_tick
    }

    /// The last tick before `tick` with a snapshot in the log.
    ///
    /// # Errors
    /// Those of reading the log.
    pub fn state_before(&mut self, tick: i64) -> Result<Option<i64>, Error> {
        Ok(self.page_from(tick)?.and_then(|page| page.start.as_ref().map(|(tick, _)| *tick)))
    }

    /// The first tick after `tick` with a snapshot in the log.
    ///
    /// # Errors
    /// Those of reading the log.
    pub fn state_after(&mut self, tick: i64) -> Result<Option<i64>, Error> {
        let page = self.page_from(tick.saturating_add(1))?;
        Ok(page.and_then(|page| page.ticks.last().filter(|last| last.snapshot().is_some()).map(|last| last.tick)))
    }

    /// Number of the last tick at or before a time, s since the run's first tick.
    ///
    /// # Errors
    /// Those of reading the log.
    pub fn tick_at(&mut self, since_s: f64) -> Result<i64, Error> {
        let since_ns = (since_s * 1e9).round() as i64;
        let place = self.places.before_time(&self.replay.clock, since_ns)?;
        let mut ticks = Ticks::open_at(&self.replay.path, &self.replay.messages, Beside::Nothing, place)?;
        let mut found = self.first_tick;
        while let Some(tick) = ticks.next()? {
            match &tick.input {
                Some(input) if self.replay.clock.since_ns(input.t_ns) > since_ns => break,
                Some(_) => found = tick.tick,
                None => {}
            }
        }
        Ok(found)
    }

    /// Goes to a tick, computing from the last snapshot before it or from the current position.
    ///
    /// # Errors
    /// [`Error::NoSuchTick`], [`Error::StateUnknown`], and those of reading the log.
    pub fn go_to(&mut self, tick: i64) -> Result<Moment, Error> {
        let missing =
            || Error::NoSuchTick { path: self.replay.path.clone(), tick, first: self.first_tick, last: self.last_tick };
        if !(self.first_tick..=self.last_tick).contains(&tick) {
            return Err(missing());
        }
        let missing = missing();
        let page = self.page_of(tick)?;
        let start = page.ticks[0].tick;
        let on = self.place.filter(|(at, next)| *at == start && page.ticks.get(*next).is_some_and(|t| t.tick <= tick));
        let mut next = match on {
            Some((_, next)) => next,
            None => {
                self.enter(&page)?;
                0
            }
        };
        while let Some(at) = page.ticks.get(next) {
            next += 1;
            self.place = Some((start, next));
            let moment = self.step(at, at.tick == tick)?;
            if at.tick == tick {
                return match (moment, &at.input) {
                    (Some(moment), _) => Ok(moment),
                    (None, None) => Err(missing),
                    (None, Some(_)) => Err(Error::StateUnknown { path: self.replay.path.clone(), tick }),
                };
            }
            if at.tick > tick {
                break;
            }
        }
        self.place = None;
        Err(missing)
    }

    /// Goes forward until `stop` returns true; the moments passed to `stop` contain no quantities. `None` at the end of the log or after `most`
    /// ticks.
    ///
    /// # Errors
    /// Those of reading the log.
    pub fn search(
        &mut self,
        from: i64,
        most: u64,
        stop: &mut dyn FnMut(&Moment) -> bool,
    ) -> Result<Option<Moment>, Error> {
        // Do not collect the quantities of ticks that are only passed.
        self.dumps = false;
        let found = self.pass(from, most, stop);
        self.dumps = true;
        let found = found?;
        Ok(found.map(|moment| Moment { dump: self.stepper.controller().dump(), ..moment }))
    }

    fn pass(&mut self, from: i64, most: u64, stop: &mut dyn FnMut(&Moment) -> bool) -> Result<Option<Moment>, Error> {
        let end = self.last_tick.min(from.saturating_add_unsigned(most).saturating_sub(1));
        for tick in from..=end {
            match self.go_to(tick) {
                Ok(moment) if stop(&moment) => return Ok(Some(moment)),
                Ok(_) | Err(Error::NoSuchTick { .. } | Error::StateUnknown { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(None)
    }

    /// Restores the controller to the start of a page.
    fn enter(&mut self, page: &Page) -> Result<(), Error> {
        let mut stepper = Stepper::new(&self.builder, self.keep_state)?;
        if let Some((tick, state)) = &page.start {
            stepper.start(*tick, state, &page.changes)?;
        }
        self.stepper = stepper;
        Ok(())
    }

    /// Computes a tick; returns its moment only if requested.
    fn step(&mut self, tick: &Tick, is_requested: bool) -> Result<Option<Moment>, Error> {
        self.stepper.forget_differences();
        let done = self.stepper.tick(tick)?;
        let (Some(outbox), Some(input), true) = (done, &tick.input, is_requested) else { return Ok(None) };
        let replayed = outbox.iter().map(|(channel, bytes)| (channel, bytes.to_vec())).collect();
        Ok(Some(Moment {
            tick: tick.tick,
            t_ns: input.t_ns,
            since_s: self.replay.clock.since_ns(input.t_ns) as f64 * 1e-9,
            input: self.stepper.controller().input().clone(),
            recorded: tick.recorded.clone(),
            replayed,
            beside: tick.beside.clone(),
            divergence: self.stepper.counts.first.clone(),
            dump: if self.dumps { self.stepper.controller().dump() } else { Dump::default() },
            is_snapshot: tick.snapshot().is_some(),
        }))
    }

    /// The page that contains a tick.
    fn page_of(&mut self, tick: i64) -> Result<Arc<Page>, Error> {
        let page = self.page_from(tick)?.filter(|page| page.ticks[0].tick <= tick);
        let (path, first, last) = (&self.replay.path, self.first_tick, self.last_tick);
        page.ok_or_else(|| Error::NoSuchTick { path: path.clone(), tick, first, last })
    }

    /// The first page that ends at or after a tick.
    fn page_from(&mut self, tick: i64) -> Result<Option<Arc<Page>>, Error> {
        let holds = |page: &Arc<Page>| page.ticks.last().is_some_and(|last| last.tick >= tick);
        if let Some((_, page)) = self.pages.range(..=tick).next_back()
            && holds(page)
        {
            return Ok(Some(Arc::clone(page)));
        }
        let at = self.last_snapshot.as_ref().map(|(last, _)| *last);
        if !at.is_some_and(|at| (1..=NEAR).contains(&tick.saturating_sub(at))) {
            let place = self.places.before_tick(tick)?;
            self.read_from(place)?;
            // The place is wrong if snapshots are not in the order of their ticks.
            if place.is_some() && self.last_snapshot.as_ref().is_none_or(|(last, _)| *last >= tick) {
                self.read_from(None)?;
            }
        }
        while let Some(page) = self.read_page(tick)? {
            if holds(&page) {
                return Ok(Some(page));
            }
        }
        Ok(None)
    }

    /// Moves the reader to a place and, unless that is the start of the log, to the first snapshot from there on.
    fn read_from(&mut self, place: Option<u64>) -> Result<(), Error> {
        self.reader = Ticks::open_at(&self.replay.path, &self.replay.messages, Beside::ByTick, place)?;
        self.last_snapshot = None;
        self.changes.clear();
        while place.is_some() && self.last_snapshot.is_none() {
            let Some(tick) = self.reader.next()? else { break };
            self.changes.extend(tick.changes.iter().cloned());
            self.last_snapshot = tick.snapshot().map(|state| (tick.tick, state.to_vec()));
        }
        Ok(())
    }

    /// Reads and caches the next page. If the cache is full, removes the page farthest from `wanted`.
    fn read_page(&mut self, wanted: i64) -> Result<Option<Arc<Page>>, Error> {
        let mut ticks = Vec::new();
        let (start, changes) = (self.last_snapshot.take(), self.changes.clone());
        while let Some(tick) = self.reader.next()? {
            self.changes.extend(tick.changes.iter().cloned());
            let state = tick.snapshot().map(|state| (tick.tick, state.to_vec()));
            ticks.push(tick);
            if state.is_some() {
                self.last_snapshot = state;
                break;
            }
        }
        let Some(first) = ticks.first().map(|tick| tick.tick) else { return Ok(None) };
        let page = Arc::new(Page { start, changes, ticks });
        self.pages.insert(first, Arc::clone(&page));
        if self.pages.len() > PAGES {
            let far = |page: Option<(&i64, _)>| page.map_or(0, |(first, _)| first.abs_diff(wanted));
            if far(self.pages.first_key_value()) > far(self.pages.last_key_value()) {
                self.pages.pop_first();
            } else {
                self.pages.pop_last();
            }
        }
        Ok(Some(page))
    }
}

/// First and last tick with an input. A log without index is read as a whole, and its places are noted.
fn ends(replay: &Replay, places: &mut Places, progress: &mut dyn FnMut(f64)) -> Result<(i64, i64), Error> {
    let bytes = super::file_length(&replay.path)?.max(1);
    let last_place = places.before_end()?;
    let (mut first, mut last) = (None, None);
    // With an index: the start up to the first input, then the end.
    let parts: &[_] = if last_place.is_some() { &[(None, true), (last_place, false)] } else { &[(None, false)] };
    for &(place, is_start) in parts {
        let mut ticks = Ticks::open_at(&replay.path, &replay.messages, Beside::Nothing, place)?;
        while let Some(tick) = ticks.next()? {
            if !places.is_indexed() {
                places.scan(&replay.path, &tick);
            }
            if tick.input.is_some() {
                first = first.or(Some(tick.tick));
                last = last.max(Some(tick.tick));
                if is_start {
                    break;
                }
            }
            if tick.tick % 1024 == 0 {
                progress(ticks.offset as f64 / bytes as f64);
            }
        }
        if ticks.is_joined() {
            *places = Places::none();
        }
    }
    first.zip(last).ok_or_else(|| Error::NoInput { path: replay.path.clone() })
}
