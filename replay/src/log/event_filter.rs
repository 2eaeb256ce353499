//! Selects the events of a log by channel and time.

use super::EventRef;
use super::run_clock::{EventTimes, RunClock};
use crate::Error;
use crate::record::{Filter, Pattern};
use lcmtypes::channels;
use std::path::Path;
use std::sync::Arc;

/// Channels that a replay needs besides CONTROLLER_INPUT.
const REPLAY: [&str; 3] = [channels::RUN_INFO, channels::PARAMETER_CHANGE, channels::CONTROLLER_SNAPSHOT];

/// Decisions that are cached per channel. A damaged file can appear to have an unlimited number of channels.
const MAX_CACHED: usize = 1000;

/// Selects events by channel and by time. The default accepts every event.
#[derive(Debug, Clone, Default)]
pub struct EventFilter {
    channels: Filter,
    from_ns: Option<i64>,
    to_ns: Option<i64>,
    keep_replay: bool,
    /// Times of the log that is read; `None` without a time limit.
    times: Option<EventTimes>,
    cached: Vec<(Arc<str>, bool)>,
}

impl EventFilter {
    /// - `channels`, `exclude`: regular expressions that the whole channel name must match, or must not match, as in LCM.
    /// - `from_s`, `to_s`: inclusive limits, s since the run's first tick. They have no effect before [`EventFilter::for_log`].
    ///
    /// # Errors
    /// [`Error::Pattern`] for an invalid regular expression.
    pub fn new(
        channels: Option<&str>,
        exclude: Option<&str>,
        from_s: Option<f64>,
        to_s: Option<f64>,
    ) -> Result<Self, Error> {
        let pattern = |text: Option<&str>| text.map(Pattern::new).transpose();
        let nanoseconds = |s: f64| (s * 1e9).round() as i64;
        Ok(EventFilter {
            channels: Filter { include: pattern(channels)?, exclude: pattern(exclude)? },
            from_ns: from_s.map(nanoseconds),
            to_ns: to_s.map(nanoseconds),
            ..EventFilter::default()
        })
    }

    /// If CONTROLLER_INPUT is selected, also accepts what its replay needs, unless `exclude` matches it: RUN_INFO at any time, PARAMETER_CHANGE up to
    /// the end time, CONTROLLER_SNAPSHOT.
    #[must_use]
    pub fn keep_replay(self) -> Self {
        EventFilter { keep_replay: self.matches(channels::CONTROLLER_INPUT), ..self }
    }

    /// The same filter for the events of one log: times are those of its [`RunClock`].
    ///
    /// # Errors
    /// As [`RunClock::read`].
    pub fn for_log(&self, log: &Path) -> Result<Self, Error> {
        let has_limit = self.from_ns.is_some() || self.to_ns.is_some();
        let times = has_limit.then(|| RunClock::read(log).map(EventTimes::new)).transpose()?;
        Ok(EventFilter { times, ..self.clone() })
    }

    /// Whether an event is selected.
    pub fn accepts(&mut self, event: &EventRef<'_>) -> bool {
        let since = self.times.as_mut().map(|times| times.of(event));
        if !self.accepts_channel(event.channel) {
            return false;
        }
        let before_end = since.zip(self.to_ns).is_none_or(|(since, to)| since <= to);
        let in_time = since.zip(self.from_ns).is_none_or(|(since, from)| since >= from) && before_end;
        let needed = match &**event.channel {
            channels::RUN_INFO => true,
            channels::PARAMETER_CHANGE => before_end,
            _ => false,
        };
        in_time || self.keep_replay && needed
    }

    /// Whether a channel is selected. The result is cached by the address of the name, as [`super::LogReader`] interns names.
    pub fn accepts_channel(&mut self, channel: &Arc<str>) -> bool {
        if let Some((_, accepted)) = self.cached.iter().find(|(known, _)| Arc::ptr_eq(known, channel)) {
            return *accepted;
        }
        let accepted = self.matches(channel);
        if self.cached.len() < MAX_CACHED {
            self.cached.push((Arc::clone(channel), accepted));
        }
        accepted
    }

    /// Whether a channel of this name is selected.
    pub fn matches(&self, channel: &str) -> bool {
        let needed = || REPLAY.contains(&channel) && !self.channels.excludes(channel);
        self.channels.takes(channel) || self.keep_replay && needed()
    }
}
