//! Which events of a log are wanted.

use super::EventRef;
use crate::Error;
use crate::record::{Filter, Pattern};
use lcmtypes::channels;
use std::sync::Arc;

/// Which events of a log are wanted: by channel and by time.
#[derive(Debug, Clone, Default)]
pub struct Selection {
    channels: Filter,
    from_ns: Option<i64>,
    to_ns: Option<i64>,
    /// RUN_INFO is wanted whatever its time, and changes of parameters before the time: without them a log cannot be read.
    always_run_info: bool,
    first_t_ns: Option<i64>,
    decided: Vec<(Arc<str>, bool)>,
}

impl Selection {
    /// - `channels`, `exclude`: regular expressions that a channel's whole name must match, or must not, as in LCM.
    /// - `from_s`, `to_s`: s since the first event of the log, both included.
    ///
    /// # Errors
    /// [`Error::Pattern`] for what is no regular expression.
    pub fn new(
        channels: Option<&str>,
        exclude: Option<&str>,
        from_s: Option<f64>,
        to_s: Option<f64>,
    ) -> Result<Self, Error> {
        let pattern = |text: Option<&str>| text.map(Pattern::new).transpose();
        let nanoseconds = |s: f64| (s * 1e9).round() as i64;
        Ok(Selection {
            channels: Filter { include: pattern(channels)?, exclude: pattern(exclude)? },
            from_ns: from_s.map(nanoseconds),
            to_ns: to_s.map(nanoseconds),
            ..Selection::default()
        })
    }

    /// Wants RUN_INFO whatever its time, and changes of parameters that came before.
    #[must_use]
    pub fn always_run_info(self) -> Self {
        Selection { always_run_info: true, ..self }
    }

    /// Whether an event is wanted. To be asked of every event, in the order of the log.
    pub fn wants(&mut self, event: &EventRef<'_>) -> bool {
        let since = event.t_ns.saturating_sub(*self.first_t_ns.get_or_insert(event.t_ns));
        if !self.wants_channel(event.channel) {
            return false;
        }
        let before_end = self.to_ns.is_none_or(|to| since <= to);
        let in_time = self.from_ns.is_none_or(|from| since >= from) && before_end;
        let needed = match &**event.channel {
            channels::RUN_INFO => true,
            channels::PARAMETER_CHANGE => before_end,
            _ => false,
        };
        in_time || self.always_run_info && needed
    }

    /// Whether a channel is wanted.
    pub fn wants_channel(&mut self, channel: &Arc<str>) -> bool {
        if let Some((_, wanted)) = self.decided.iter().find(|(known, _)| Arc::ptr_eq(known, channel)) {
            return *wanted;
        }
        let wanted = self.matches(channel);
        // A damaged file may look as if it had channels without end.
        if self.decided.len() < 1000 {
            self.decided.push((Arc::clone(channel), wanted));
        }
        wanted
    }

    /// Whether a channel of this name is wanted.
    pub fn matches(&self, channel: &str) -> bool {
        self.channels.takes(channel)
    }
}
