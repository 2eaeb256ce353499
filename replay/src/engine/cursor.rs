//! A place in a replay that can be moved: every quantity of any tick.

use super::builder::Builder;
use super::runner::Runner;
use super::ticks::{Beside, Tick, Ticks};
use super::{Divergence, Options, Replay};
use crate::Error;
use crate::log::Event;
use controller::Dump;
use controller::dump::Value;
use lcmtypes::{ControllerInput, ParameterChange};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Pages that are kept: a minute of a usual log.
const PAGES: usize = 64;

/// Everything about one tick of a log and its replay.
#[derive(Debug, Clone)]
pub struct Moment {
    /// Tick.
    pub tick: i64,
    /// Its time, ns.
    pub t_ns: i64,
    /// Time since the run's first tick, s.
    pub since_s: f64,
    /// What the controller was given.
    pub input: ControllerInput,
    /// What it put out when it ran, as far as the log says, by channel.
    pub recorded: Vec<(Arc<str>, Vec<u8>)>,
    /// What it puts out now, by channel.
    pub replayed: Vec<(&'static str, Vec<u8>)>,
    /// TIMING and EVENT of the tick.
    pub beside: Vec<Event>,
    /// Where the two part, if they do.
    pub divergence: Option<Divergence>,
    /// Every quantity of the replayed tick.
    pub dump: Dump,
    /// The log holds the state after this tick.
    pub is_snapshot: bool,
}

impl Moment {
    /// The input as a tree of quantities.
    pub fn input_quantities(&self) -> Option<Value> {
        super::inputs::of_message(&self.input)
    }

    /// The message on a channel as replayed.
    pub fn replayed(&self, channel: &str) -> Option<&[u8]> {
        self.replayed.iter().find(|(c, _)| *c == channel).map(|(_, bytes)| &**bytes)
    }

    /// The message on a channel as recorded.
    pub fn recorded(&self, channel: &str) -> Option<&[u8]> {
        self.recorded.iter().find(|(c, _)| **c == *channel).map(|(_, bytes)| &**bytes)
    }
}

/// The ticks from behind one snapshot up to the next.
struct Page {
    /// Tick of the snapshot it begins behind, and the state; `None` at the beginning of a log.
    start: Option<(i64, Vec<u8>)>,
    /// Changes of parameters before it, in order.
    changes: Vec<ParameterChange>,
    ticks: Vec<Tick>,
}

/// A replay that stands at a tick.
pub struct Cursor<'r> {
    replay: &'r Replay<'r>,
    builder: Builder<'r>,
    own_state: bool,
    runner: Runner<'r>,
    reader: Ticks,
    /// State behind which the reader stands.
    behind: Option<(i64, Vec<u8>)>,
    /// Changes of parameters up to there.
    changes: Vec<ParameterChange>,
    /// By the number of their first tick.
    pages: BTreeMap<i64, Arc<Page>>,
    /// First tick of the page and index of the tick that comes next in it.
    place: Option<(i64, usize)>,
    first_tick: i64,
    last_tick: i64,
    snapshots: Vec<i64>,
    /// Quantities are wanted of the ticks gone to.
    dumps: bool,
}

impl<'r> Cursor<'r> {
    /// Reads the log once, to learn what is in it, and stands before its first tick.
    ///
    /// - `options`: `set` and `urdf` are followed, the rest is not. `progress` is told which part of the file has been read.
    ///
    /// # Errors
    /// As [`Replay::run`].
    pub fn open(replay: &'r Replay<'r>, options: &Options, progress: &mut dyn FnMut(f64)) -> Result<Self, Error> {
        let options = Options { set: options.set.clone(), urdf: options.urdf.clone(), ..Options::default() };
        let (builder, own_state) = (Builder::new(replay, &options)?, options.asks_what_if());
        let runner = Runner::new(&builder, own_state)?;
        let bytes = super::file_length(&replay.path)?.max(1);
        let mut ticks = Ticks::open(&replay.path, Beside::Nothing)?;
        let (mut first, mut last, mut snapshots) = (None, 0, Vec::new());
        while let Some(tick) = ticks.next()? {
            if tick.input.is_some() {
                first.get_or_insert(tick.tick);
                last = tick.tick;
            }
            if tick.snapshot().is_some() {
                snapshots.push(tick.tick);
            }
            if tick.tick % 1024 == 0 {
                progress(ticks.offset as f64 / bytes as f64);
            }
        }
        let Some(first_tick) = first else { return Err(Error::NoInput { path: replay.path.clone() }) };
        Ok(Cursor {
            replay,
            runner,
            reader: Ticks::open(&replay.path, Beside::ByTick)?,
            behind: None,
            changes: Vec::new(),
            pages: BTreeMap::new(),
            place: None,
            first_tick,
            last_tick: last,
            snapshots,
            dumps: true,
            builder,
            own_state,
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

    /// Ticks whose states the log holds.
    pub fn snapshots(&self) -> &[i64] {
        &self.snapshots
    }

    /// Number of the last tick at or before a time, s since the run's first tick.
    ///
    /// # Errors
    /// Those of reading the log.
    pub fn tick_at(&mut self, since_s: f64) -> Result<i64, Error> {
        let since_ns = (since_s * 1e9).round() as i64;
        let mut ticks = Ticks::open(&self.replay.path, Beside::Nothing)?;
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

    /// Goes to a tick: from the last recorded state before it, or on from where it stands.
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

    /// Goes on tick by tick until `stop`, which is shown no quantities, says so. `None` if the log ends before, or `stop` never does within `most` ticks.
    ///
    /// # Errors
    /// Those of reading the log.
    pub fn search(
        &mut self,
        from: i64,
        most: u64,
        stop: &mut dyn FnMut(&Moment) -> bool,
    ) -> Result<Option<Moment>, Error> {
        // Quantities of ticks that are passed by are not put together.
        self.dumps = false;
        let found = self.pass(from, most, stop);
        self.dumps = true;
        let found = found?;
        Ok(found.map(|moment| Moment { dump: self.runner.controller().dump(), ..moment }))
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

    /// Puts the controller before the first tick of a page.
    fn enter(&mut self, page: &Page) -> Result<(), Error> {
        let mut runner = Runner::new(&self.builder, self.own_state)?;
        if let Some((tick, state)) = &page.start {
            runner.start(*tick, state, &page.changes)?;
        }
        self.runner = runner;
        Ok(())
    }

    /// Computes a tick; the moment is put together only if it is looked at.
    fn step(&mut self, tick: &Tick, looked_at: bool) -> Result<Option<Moment>, Error> {
        self.runner.tally = super::Tally::default();
        let done = self.runner.tick(tick)?;
        let (Some(outbox), Some(input), true) = (done, &tick.input, looked_at) else { return Ok(None) };
        let replayed = outbox.iter().map(|(channel, bytes)| (channel, bytes.to_vec())).collect();
        Ok(Some(Moment {
            tick: tick.tick,
            t_ns: input.t_ns,
            since_s: self.replay.clock.since_ns(input.t_ns) as f64 * 1e-9,
            input: input.clone(),
            recorded: tick.recorded.clone(),
            replayed,
            beside: tick.beside.clone(),
            divergence: self.runner.tally.first.clone(),
            dump: if self.dumps { self.runner.controller().dump() } else { Dump::default() },
            is_snapshot: tick.snapshot().is_some(),
        }))
    }

    /// The page that a tick stands on.
    fn page_of(&mut self, tick: i64) -> Result<Arc<Page>, Error> {
        let holds = |page: &Arc<Page>| page.ticks.last().is_some_and(|last| last.tick >= tick);
        if let Some((_, page)) = self.pages.range(..=tick).next_back()
            && holds(page)
        {
            return Ok(Arc::clone(page));
        }
        // If the reader has passed it, and the page is forgotten, it begins again.
        for again in [false, true] {
            if again {
                self.reader = Ticks::open(&self.replay.path, Beside::ByTick)?;
                self.behind = None;
                self.changes.clear();
            }
            if self.behind.as_ref().is_some_and(|(behind, _)| *behind >= tick) {
                continue;
            }
            while let Some(page) = self.read_page(tick)? {
                if holds(&page) && page.ticks[0].tick <= tick {
                    return Ok(page);
                }
            }
        }
        Err(Error::NoSuchTick { path: self.replay.path.clone(), tick, first: self.first_tick, last: self.last_tick })
    }

    /// Reads the next page; of those that are kept, the one farthest from `wanted` is forgotten.
    fn read_page(&mut self, wanted: i64) -> Result<Option<Arc<Page>>, Error> {
        let mut ticks = Vec::new();
        let (start, changes) = (self.behind.take(), self.changes.clone());
        while let Some(tick) = self.reader.next()? {
            self.changes.extend(tick.changes.iter().cloned());
            let state = tick.snapshot().map(|state| (tick.tick, state.to_vec()));
            ticks.push(tick);
            if state.is_some() {
                self.behind = state;
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
