//! The report of a replay.

use super::compare::{Divergence, Pair, largest_ulp};
use super::origin::Deviation;
use super::what_if::WhatIf;

/// The report of a replay; the JSON of `hoof replay --json`.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ReplayReport {
    /// At least one message was compared, and all are equal in every bit.
    pub identical: bool,
    /// Computed ticks.
    pub ticks: u64,
    /// Messages compared, including snapshots.
    pub messages_compared: u64,
    /// Compared messages that differ.
    pub messages_different: u64,
    /// Compared snapshots.
    pub snapshots_compared: u64,
    /// Computed messages that are not in the log, which may contain selected channels only.
    pub messages_not_recorded: u64,
    /// Ticks without any output in the log.
    pub unverifiable_ticks: u64,
    /// Ticks without input in the log.
    pub missing_input_ticks: u64,
    /// Ticks that were not computed because the state is unknown: from missing inputs to the next snapshot.
    pub skipped_ticks: u64,
    /// Messages ignored because they came after the inputs of 256 later ticks, or twice.
    pub late_messages: u64,
    /// Damaged parts of the log.
    pub damaged: u64,
    /// The log ends inside a record.
    pub cut: bool,
    /// Time of the first computed tick, controller clock, ns.
    pub first_t_ns: Option<i64>,
    /// Time of the last computed tick, controller clock, ns.
    pub last_t_ns: Option<i64>,
    /// Wall time of the replay, s.
    pub wall_seconds: f64,
    /// Replayed time divided by wall time.
    pub real_time_factor: f64,
    /// Differences between log and replay in build, parameters, robot and types.
    pub deviations: Vec<Deviation>,
    /// Ranges of ticks without input in the log, first and last.
    pub missing_ticks: Vec<(i64, i64)>,
    /// Largest difference of two floats, ulp. `None` if no floats differ, and for what-if replays.
    pub largest_ulp: Option<u64>,
    /// Comparison of a changed controller with the recorded one; only for what-if replays.
    pub what_if: Option<WhatIf>,
    /// The first difference.
    pub first_divergence: Option<Divergence>,
}

/// Counts of a replay. Those of different segments can be added in any order.
#[derive(Default)]
pub(super) struct Counts {
    pub ticks: u64,
    pub compared: u64,
    pub different: u64,
    pub snapshots: u64,
    pub not_recorded: u64,
    pub unverifiable: u64,
    pub missing: u64,
    pub skipped: u64,
    pub t_ns: Option<(i64, i64)>,
    pub gaps: Vec<(i64, i64)>,
    /// Whether to compute `ulp`: not for what-if replays.
    pub ulps: bool,
    pub ulp: Option<u64>,
    pub first: Option<Divergence>,
}

impl Counts {
    pub fn add(&mut self, other: Counts) {
        let Counts {
            ticks,
            compared,
            different,
            snapshots,
            not_recorded,
            unverifiable,
            missing,
            skipped,
            t_ns,
            gaps,
            ulps: _,
            ulp,
            first,
        } = other;
        self.ticks += ticks;
        self.compared += compared;
        self.different += different;
        self.snapshots += snapshots;
        self.not_recorded += not_recorded;
        self.unverifiable += unverifiable;
        self.missing = self.missing.saturating_add(missing);
        self.skipped += skipped;
        if let Some((from, to)) = t_ns {
            self.time(from);
            self.time(to);
        }
        self.gaps.extend(gaps);
        self.ulp = self.ulp.max(ulp);
        self.diverged(first);
    }

    /// Counts ticks without input, `first..=last`.
    pub fn missing(&mut self, first: i64, last: i64) {
        self.missing = self.missing.saturating_add(last.saturating_sub(first).saturating_add(1) as u64);
        match self.gaps.last_mut() {
            Some(gap) if gap.1.saturating_add(1) == first => gap.1 = last,
            _ => self.gaps.push((first, last)),
        }
    }

    /// Updates the largest difference of two floats.
    pub fn largest_ulp(&mut self, different: &[Pair]) {
        if self.ulps {
            self.ulp = self.ulp.max(different.iter().filter_map(largest_ulp).max());
        }
    }

    /// Adds the time of a computed tick.
    pub fn time(&mut self, t_ns: i64) {
        let (from, to) = self.t_ns.unwrap_or((t_ns, t_ns));
        self.t_ns = Some((from.min(t_ns), to.max(t_ns)));
    }

    /// Keeps the earlier divergence.
    fn diverged(&mut self, other: Option<Divergence>) {
        let earlier = match (&self.first, &other) {
            (Some(ours), Some(other)) => other.tick < ours.tick,
            (None, _) => true,
            (Some(_), None) => false,
        };
        if earlier {
            self.first = other;
        }
    }

    pub fn report(mut self, late_messages: u64, health: &crate::log::Health, wall_seconds: f64) -> ReplayReport {
        self.gaps.sort_unstable();
        let replayed = self.t_ns.map_or(0.0, |(from, to)| to.saturating_sub(from) as f64 * 1e-9);
        ReplayReport {
            identical: self.compared > 0 && self.first.is_none(),
            ticks: self.ticks,
            messages_compared: self.compared,
            messages_different: self.different,
            snapshots_compared: self.snapshots,
            messages_not_recorded: self.not_recorded,
            unverifiable_ticks: self.unverifiable,
            missing_input_ticks: self.missing,
            skipped_ticks: self.skipped,
            late_messages,
            damaged: health.damaged.len() as u64,
            cut: health.cut.is_some(),
            first_t_ns: self.t_ns.map(|t| t.0),
            last_t_ns: self.t_ns.map(|t| t.1),
            wall_seconds,
            real_time_factor: if wall_seconds > 0.0 { replayed / wall_seconds } else { 0.0 },
            deviations: Vec::new(),
            missing_ticks: self.gaps,
            largest_ulp: self.ulp,
            what_if: None,
            first_divergence: self.first,
        }
    }
}
