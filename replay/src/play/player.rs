//! The next event of a log and its due time.

use super::time_order::{OrderKind, OrderedEvents, TimeOrder};
use super::times::{TimeBase, Times};
use crate::Error;
use crate::log::{Event, Health, RunClock};
use crate::record::Filter;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Smallest step back in time that is a jump of the clock, ns.
const JUMP_NS: i64 = 10_000_000;

/// Options of a [`Player`].
#[derive(Debug, Clone)]
pub struct PlayOptions {
    /// The clock that sets the pace.
    pub base: TimeBase,
    /// Speed factor; `None`: as fast as possible.
    pub speed: Option<f64>,
    /// Start, ns since the run's first tick; `None`: the log's first event.
    pub from_ns: Option<i64>,
    /// End, ns since the run's first tick, exclusive; `None`: the log's last event.
    pub to_ns: Option<i64>,
    /// Restart at the end.
    pub repeat: bool,
    /// Channels to play.
    pub filter: Filter,
    /// New names of channels.
    pub rename: BTreeMap<String, String>,
}

impl Default for PlayOptions {
    fn default() -> Self {
        PlayOptions {
            base: TimeBase::Receive,
            speed: Some(1.0),
            from_ns: None,
            to_ns: None,
            repeat: false,
            filter: Filter::default(),
            rename: BTreeMap::new(),
        }
    }
}

/// Hands out the events of a log when they are due.
///
/// Log time is in ns since the run's first tick, as [`RunClock`] defines it, so it is negative before that tick. The caller's time
/// may come from any monotonic clock, in ns.
///
/// Between two seeks every event is returned once, in the order of [`TimeOrder`], regardless of pauses, steps and speed changes.
pub struct Player {
    path: PathBuf,
    options: PlayOptions,
    order: TimeOrder,
    events: OrderedEvents,
    times: Times,
    /// Sum of the jumps back in time so far, ns: later times are moved by it.
    jumped_ns: i64,
    /// Log time zero in the clock that sets the pace, ns.
    origin_ns: i64,
    /// Log time of the first event, ns.
    begin_ns: i64,
    /// Log time at which playing begins, ns.
    from_ns: i64,
    next: Option<Next>,
    /// The caller's time ...
    anchor_ns: i64,
    /// ... corresponds to this log time.
    anchor_log_ns: i64,
    paused: bool,
    played: u64,
}

struct Next {
    event: Event,
    /// Log time at which it is due: its own, or that of the previous event if that is later.
    at_ns: i64,
}

impl Player {
    /// Opens a log and goes to the start position. `now_ns`: the caller's time.
    ///
    /// # Errors
    /// As [`crate::log::LogReader::open`]; [`Error::NoTicks`] if [`PlayOptions::base`] is the time of the ticks and the log has no tick.
    pub fn open(path: impl AsRef<Path>, options: PlayOptions, now_ns: i64) -> Result<Self, Error> {
        let order = TimeOrder::of(path.as_ref())?;
        Self::open_with(path.as_ref(), options, &order, now_ns)
    }

    /// As [`Player::open`], with the order of the log's times.
    ///
    /// # Errors
    /// As [`Player::open`].
    pub fn open_with(path: &Path, options: PlayOptions, order: &TimeOrder, now_ns: i64) -> Result<Self, Error> {
        let mut times = Times::new(path, options.base)?;
        let sorted_ns = order.first_sorted_ns().filter(|_| options.base == TimeBase::Receive);
        let first_ns = sorted_ns.or(times.first(path)?).unwrap_or(0);
        let origin_ns = times.zero(&RunClock::read(path)?).unwrap_or(first_ns);
        let begin_ns = first_ns.saturating_sub(origin_ns);
        let from_ns = options.from_ns.unwrap_or(begin_ns);
        let events = OrderedEvents::open(path, order)?;
        let mut player = Player {
            path: path.into(),
            order: order.clone(),
            events,
            times,
            jumped_ns: 0,
            origin_ns,
            begin_ns,
            from_ns,
            next: None,
            anchor_ns: now_ns,
            anchor_log_ns: from_ns,
            paused: false,
            played: 0,
            options,
        };
        player.go_on_to(from_ns)?;
        Ok(player)
    }

    /// Due time of the next event in the caller's clock; a past time means now. `None` while paused and at the end.
    pub fn due_ns(&self) -> Option<i64> {
        let next = self.next.as_ref().filter(|_| !self.paused)?;
        Some(self.due_of(next.at_ns).unwrap_or(self.anchor_ns))
    }

    /// Whether all events were played.
    pub fn is_at_end(&self) -> bool {
        self.next.is_none()
    }

    /// Returns the next event, renamed if requested, whether it is due or not, and advances. With `repeat` it restarts at the end. `now_ns`:
    /// the caller's time.
    ///
    /// # Errors
    /// [`Error::Io`] if the log cannot be read.
    pub fn take(&mut self, now_ns: i64) -> Result<Option<Event>, Error> {
        let Some(Next { mut event, at_ns }) = self.next.take() else { return Ok(None) };
        self.played += 1;
        if self.paused {
            // A step moves the position, so that resuming continues here.
            self.anchor_log_ns = at_ns;
        }
        self.read_on(at_ns)?;
        if self.next.is_none() && self.options.repeat {
            // The next round starts when this one was due to end, so that lateness does not accumulate.
            let ended_ns = self.due_of(at_ns).filter(|_| !self.paused).unwrap_or(now_ns);
            self.go_back()?;
            self.go_on_to(self.from_ns)?;
            (self.anchor_ns, self.anchor_log_ns) = (ended_ns, self.from_ns);
        }
        if let Some(name) = self.options.rename.get(&*event.channel) {
            event.channel = name.as_str().into();
        }
        Ok(Some(event))
    }

    /// Pauses.
    pub fn pause(&mut self, now_ns: i64) {
        self.anchor_log_ns = self.position_ns(now_ns);
        self.paused = true;
    }

    /// Resumes.
    pub fn resume(&mut self, now_ns: i64) {
        if std::mem::take(&mut self.paused) {
            self.anchor_ns = now_ns;
        }
    }

    /// Whether it is paused.
    pub fn is_paused(&self) -> bool {
        self.paused
    }

    /// Changes the speed; values that are not finite and positive are ignored.
    pub fn set_speed(&mut self, speed: f64, now_ns: i64) {
        if speed.is_finite() && speed > 0.0 {
            self.anchor_log_ns = self.position_ns(now_ns);
            self.anchor_ns = now_ns;
            self.options.speed = Some(speed);
        }
    }

    /// Speed factor; `None`: as fast as possible.
    pub fn speed(&self) -> Option<f64> {
        self.options.speed
    }

    /// Seeks to a log time within the played part: the next event is the first due at or after it.
    ///
    /// # Errors
    /// As [`crate::log::LogReader::read`].
    pub fn seek(&mut self, to_ns: i64, now_ns: i64) -> Result<(), Error> {
        let mut to_ns = to_ns.max(self.from_ns);
        if to_ns < self.position_ns(now_ns) || self.next.is_none() {
            self.go_back()?;
        }
        self.go_on_to(to_ns)?;
        if self.next.is_none() && self.options.repeat {
            // With `repeat`, a position after the end is the start.
            to_ns = self.from_ns;
            self.go_back()?;
            self.go_on_to(to_ns)?;
        }
        (self.anchor_ns, self.anchor_log_ns) = (now_ns, to_ns);
        Ok(())
    }

    /// Log time of the first event, ns.
    pub fn begin_ns(&self) -> i64 {
        self.begin_ns
    }

    /// Current log time, ns.
    pub fn position_ns(&self, now_ns: i64) -> i64 {
        match (self.options.speed, &self.next) {
            _ if self.paused => self.anchor_log_ns,
            (Some(speed), Some(_)) => {
                self.anchor_log_ns.saturating_add(scaled(now_ns.saturating_sub(self.anchor_ns), speed))
            }
            (None, Some(next)) => next.at_ns,
            (_, None) => self.anchor_log_ns,
        }
    }

    /// Number of returned events.
    pub fn played(&self) -> u64 {
        self.played
    }

    /// Damage of the log found so far.
    pub fn health(&self) -> &Health {
        self.events.health()
    }

    /// Converts a log time to the caller's clock; `None` if events are never waited for.
    fn due_of(&self, at_ns: i64) -> Option<i64> {
        let speed = self.options.speed?;
        Some(self.anchor_ns.saturating_add(scaled(at_ns - self.anchor_log_ns, 1.0 / speed)))
    }

    fn go_back(&mut self) -> Result<(), Error> {
        self.events = OrderedEvents::open(&self.path, &self.order)?;
        self.jumped_ns = 0;
        self.times = Times::new(&self.path, self.options.base)?;
        self.next = None;
        Ok(())
    }

    /// Skips events that are due before `at_ns`.
    fn go_on_to(&mut self, at_ns: i64) -> Result<(), Error> {
        while self.next.as_ref().is_none_or(|next| next.at_ns < at_ns) {
            let from_ns = self.next.take().map_or(i64::MIN, |next| next.at_ns);
            self.read_on(from_ns)?;
            if self.next.is_none() {
                break;
            }
        }
        Ok(())
    }

    /// Reads the next selected event. `from_ns`: due time of the previous one.
    fn read_on(&mut self, from_ns: i64) -> Result<(), Error> {
        self.next = None;
        while let Some(event) = self.events.next()? {
            let time_ns = self.times.of(&event);
            let own_ns = time_ns.map_or(self.begin_ns, |time| time.saturating_sub(self.origin_ns));
            let mut at_ns = own_ns.saturating_add(self.jumped_ns);
            if self.order.kind() == OrderKind::JumpsBack && at_ns < from_ns.saturating_sub(JUMP_NS) {
                // After a jump, time continues where it was.
                self.jumped_ns = from_ns.saturating_sub(own_ns);
                at_ns = from_ns;
            }
            let at_ns = at_ns.max(from_ns);
            if self.options.to_ns.is_some_and(|to| at_ns >= to) {
                return Ok(());
            }
            if self.options.filter.takes(&event.channel) {
                self.next = Some(Next { event, at_ns });
                return Ok(());
            }
        }
        Ok(())
    }
}

#[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "exact to far below 1 us for hours")]
fn scaled(ns: i64, factor: f64) -> i64 {
    if factor == 1.0 { ns } else { (ns as f64 * factor) as i64 }
}
