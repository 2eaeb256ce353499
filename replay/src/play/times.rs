//! Times of events in the clock that sets the pace.

use crate::Error;
use crate::log::{Event, LogReader, RunClock, Zero};
use lcm_idl::ast::{FieldType, Primitive};
use lcmtypes::channels::{self, Class};
use std::collections::BTreeMap;
use std::path::Path;

/// The clock that sets the pace.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TimeBase {
    /// The log time: when the event was received, with the jitter of the network.
    #[default]
    Receive,
    /// The sender's time: `t_ns` of the message.
    Publish,
    /// A constant period, by the controller's `tick`.
    Tick,
}

/// Computes the times of a log's events.
pub(super) struct Times {
    base: TimeBase,
    /// Control period, ns; only for [`TimeBase::Tick`].
    period_ns: i64,
    /// Which types start with `t_ns` and `tick`, by fingerprint.
    fields: BTreeMap<u64, Fields>,
    last_ns: Option<i64>,
}

#[derive(Clone, Copy, Default)]
struct Fields {
    t_ns: bool,
    tick: bool,
}

impl Times {
    /// # Errors
    /// [`Error::NoTicks`] for [`TimeBase::Tick`] and a log without ticks; those of [`LogReader`].
    pub fn new(path: &Path, base: TimeBase) -> Result<Self, Error> {
        let mut times = Times { base, period_ns: 0, fields: BTreeMap::new(), last_ns: None };
        if base == TimeBase::Tick {
            times.period_ns = times.period(path)?.ok_or_else(|| Error::NoTicks { path: path.into() })?;
        }
        Ok(times)
    }

    /// Time of an event, ns. A message without the selected time has that of the previous event; `None` if there is none.
    pub fn of(&mut self, event: &Event) -> Option<i64> {
        let own = match self.base {
            TimeBase::Receive => Some(event.t_ns),
            TimeBase::Publish => self.own(event).0,
            TimeBase::Tick => self.own(event).1.and_then(|tick| tick.checked_mul(self.period_ns)),
        };
        self.last_ns = own.or(self.last_ns);
        self.last_ns
    }

    /// `t_ns` and `tick` of a message. EVENT and RUN_INFO are skipped: their `t_ns` may be in another clock.
    fn own(&mut self, event: &Event) -> (Option<i64>, Option<i64>) {
        let is_meta = channels::find(&event.channel).is_some_and(|channel| channel.class == Class::Meta);
        let Some(fingerprint) = event.fingerprint().filter(|_| !is_meta) else { return (None, None) };
        let fields = *self.fields.entry(fingerprint).or_insert_with(|| Fields::of(fingerprint));
        let word = |at: usize| event.data.get(at..at + 8)?.first_chunk().map(|bytes| i64::from_be_bytes(*bytes));
        (word(8).filter(|_| fields.t_ns), word(16).filter(|_| fields.tick))
    }

    /// Time of the first event that has one, ns.
    pub fn first(&mut self, path: &Path) -> Result<Option<i64>, Error> {
        for event in LogReader::open(path)?.events() {
            if let Some(first_ns) = self.of(&event?) {
                self.last_ns = None;
                return Ok(Some(first_ns));
            }
        }
        Ok(None)
    }

    /// The run's first tick in the clock that sets the pace, ns; `None` for a log without it.
    pub fn zero(&self, clock: &RunClock) -> Option<i64> {
        match self.base {
            TimeBase::Receive => Some(clock.origin_ns()),
            TimeBase::Publish => clock.first_tick_ns(),
            TimeBase::Tick => (clock.zero() == Zero::FirstTick).then_some(0),
        }
    }

    /// Time from one tick to the next, from the first two ticks of the log.
    fn period(&mut self, path: &Path) -> Result<Option<i64>, Error> {
        let mut first = None;
        for event in LogReader::open(path)?.events() {
            let (Some(t_ns), Some(tick)) = self.own(&event?) else { continue };
            let (t0, tick0) = *first.get_or_insert((t_ns, tick));
            let (span, ticks) = (t_ns.saturating_sub(t0), tick.saturating_sub(tick0));
            if span > 0 && ticks > 0 {
                return Ok(Some(span / ticks));
            }
        }
        Ok(None)
    }
}

impl Fields {
    /// Checks whether a type starts with `int64_t t_ns`, and whether `int64_t tick` follows.
    fn of(fingerprint: u64) -> Self {
        let Some(ty) = lcmtypes::types().by_fingerprint(fingerprint) else { return Fields::default() };
        let is = |at: usize, name: &str| {
            ty.def().fields.get(at).is_some_and(|field| {
                *field.name == *name
                    && field.dims.is_empty()
                    && matches!(field.ty, FieldType::Primitive(Primitive::Int64))
            })
        };
        Fields { t_ns: is(0, "t_ns"), tick: is(0, "t_ns") && is(1, "tick") }
    }
}
