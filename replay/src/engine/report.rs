//! What a replay found.

use super::compare::{Divergence, Pair, largest_ulp};
use super::origin::Deviation;
use super::what_if::WhatIf;

/// What a replay found. Serialises to the JSON that `hoof replay --json` prints.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ReplayReport {
    /// At least one message was compared, and every one was equal in every bit.
    pub identical: bool,
    /// Ticks that were computed again.
    pub ticks: u64,
    /// Messages, snapshots included, that were found in the log and computed again.
    pub messages_compared: u64,
    /// Those of them that differ.
    pub messages_different: u64,
    /// Snapshots among the messages compared.
    pub snapshots_compared: u64,
    /// Computed messages that the log does not hold: a log may be trimmed to some channels.
    pub messages_not_recorded: u64,
    /// Ticks of which the log holds no output at all.
    pub unverifiable_ticks: u64,
    /// Ticks whose input is not in the log.
    pub missing_input_ticks: u64,
    /// Ticks not computed because the state before them is unknown: between missing inputs and the next snapshot.
    pub skipped_ticks: u64,
    /// Messages that came behind the inputs of 256 later ticks, or twice, and were left out.
    pub late_messages: u64,
    /// Stretches of the log that could not be read.
    pub damaged: u64,
    /// The log stops inside a record.
    pub cut: bool,
    /// Time of the first tick computed, ns.
    pub first_t_ns: Option<i64>,
    /// Time of the last tick computed, ns.
    pub last_t_ns: Option<i64>,
    /// Wall time of the replay, s.
    pub wall_seconds: f64,
    /// Time replayed by wall time.
    pub real_time_factor: f64,
    /// What is not as it was when the log was written: build, parameters, robot, types.
    pub deviations: Vec<Deviation>,
    /// Stretches of ticks whose input is not in the log, first and last.
    pub missing_ticks: Vec<(i64, i64)>,
    /// Largest distance of two floats anywhere, in floats. `None` if no floats differ, and for what-if replays.
    pub largest_ulp: Option<u64>,
    /// How far a changed controller goes from the one that ran; only with changes.
    pub what_if: Option<WhatIf>,
    /// Where replay and record part first.
    pub first_divergence: Option<Divergence>,
}

/// What is counted on the way. Counts of different stretches of a log add up in any order.
#[derive(Default)]
pub(super) struct Tally {
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
    /// Wanted only where the run is not meant to differ.
    pub ulps: bool,
    pub ulp: Option<u64>,
    pub first: Option<Divergence>,
}

impl Tally {
    pub fn add(&mut self, other: Tally) {
        let Tally {
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

    /// Looks through messages that differ.
    pub fn largest_ulp(&mut self, different: &[Pair]) {
        if self.ulps {
            self.ulp = self.ulp.max(different.iter().filter_map(largest_ulp).max());
        }
    }

    /// Takes the time of a tick computed.
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
