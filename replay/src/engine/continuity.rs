//! Which ticks of a log can be computed: those with an input, from tick 0 or a recorded state on, up to the next missing input.

use super::ticks::Tick;

/// Ranges of missing ticks that are listed.
const LISTED: usize = 1000;

/// Ticks whose recorded parameters differ from RUN_INFO with all changes in the log up to there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct OtherParameters {
    /// First such tick.
    pub first_tick: i64,
    /// Number of ticks.
    pub ticks: u64,
}

impl OtherParameters {
    /// One line for people.
    pub fn text(&self) -> String {
        let OtherParameters { first_tick, ticks } = self;
        format!(
            "a PARAMETER_CHANGE up to tick {first_tick} is missing or altered: the parameters of {ticks} ticks differ from RUN_INFO with the changes in the log"
        )
    }
}

/// Follows the ticks of a log in order. `hoof replay` and `hoof log verify` share it, so they judge a log alike.
#[derive(Debug, Clone, Default)]
pub(super) struct Continuity {
    /// Expected next tick; `None` before the first.
    next: Option<i64>,
    /// The state of the controller is unknown.
    is_unknown: bool,
    /// Ticks without input.
    pub missing: u64,
    /// Ticks with an input that cannot be computed, because the state or a parameter is unknown.
    pub skipped: u64,
    /// Ranges of ticks without input, first and last.
    gaps: Vec<(i64, i64)>,
    /// Ticks whose parameters are unknown.
    pub other_parameters: Option<OtherParameters>,
}

impl Continuity {
    /// Continues after `tick`, whose recorded state is known.
    pub fn restored(&mut self, tick: i64) {
        self.next = tick.checked_add(1);
        self.is_unknown = false;
    }

    /// Takes the next tick; returns whether it can be computed. If not, and the tick has a recorded state, the caller restores that state and calls
    /// [`Continuity::restored`].
    ///
    /// - `has_parameters`: the recorded parameters of the tick are RUN_INFO with the changes in the log.
    pub fn can_compute(&mut self, tick: &Tick, has_parameters: bool) -> bool {
        let has_input = tick.input.is_some();
        match self.next {
            // Without a snapshot, the state is known only at tick 0. A log that starts later may begin with outputs whose inputs were not recorded.
            None if !has_input && tick.tick != 0 => return false,
            None => self.is_unknown = tick.tick != 0,
            Some(_) => {}
        }
        let first = self.next.unwrap_or(tick.tick);
        let last = if has_input { tick.tick.saturating_sub(1) } else { tick.tick };
        if first <= last {
            self.missing = self.missing.saturating_add(last.abs_diff(first).saturating_add(1));
            self.gap(first, last);
            self.is_unknown = true;
        }
        self.next = tick.tick.checked_add(1);
        if has_input && !has_parameters {
            let other = OtherParameters { first_tick: tick.tick, ticks: 0 };
            self.other_parameters.get_or_insert(other).ticks += 1;
            self.is_unknown = true;
        }
        self.skipped += u64::from(has_input && self.is_unknown);
        has_input && !self.is_unknown
    }

    /// Adds the counts of another part of the log, in any order.
    pub fn add(&mut self, other: Continuity) {
        self.missing = self.missing.saturating_add(other.missing);
        self.skipped += other.skipped;
        self.gaps.extend(other.gaps);
        self.other_parameters = match (self.other_parameters, other.other_parameters) {
            (Some(a), Some(b)) => {
                Some(OtherParameters { first_tick: a.first_tick.min(b.first_tick), ticks: a.ticks + b.ticks })
            }
            (a, b) => a.or(b),
        };
    }

    /// The first ranges of ticks without input, in order.
    pub fn gaps(&self) -> Vec<(i64, i64)> {
        let mut sorted = self.gaps.clone();
        sorted.sort_unstable();
        let mut gaps = Vec::<(i64, i64)>::new();
        for (first, last) in sorted {
            match gaps.last_mut() {
                Some(gap) if gap.1.saturating_add(1) >= first => gap.1 = gap.1.max(last),
                _ => gaps.push((first, last)),
            }
        }
        gaps.truncate(LISTED);
        gaps
    }

    fn gap(&mut self, first: i64, last: i64) {
        if let Some(gap) = self.gaps.last_mut().filter(|gap| gap.1.saturating_add(1) == first) {
            gap.1 = last;
        } else if self.gaps.len() < LISTED {
            self.gaps.push((first, last));
        }
    }
}
