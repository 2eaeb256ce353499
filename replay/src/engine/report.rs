//! The report of a replay.

use super::account::Account;
use super::compare::{Divergence, Pair, largest_ulp};
use super::continuity::{Continuity, OtherParameters};
use super::origin::Deviation;
use super::outputs::{MissingOutputs, OutputCounts};
use super::release_violation::ReleaseViolations;
use super::what_if::WhatIf;

/// The report of a replay; the JSON of `hoof replay --json`.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ReplayReport {
    /// At least one message was compared, and all compared ones are equal in every bit.
    pub identical: bool,
    /// From the first tick with a known state to the end, every tick was computed and no output is missing, late, doubled or undecodable.
    pub complete: bool,
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
    /// Outputs that are missing in the log, by channel. A channel with less than half of the computed messages is not listed: it was recorded as
    /// samples or in part.
    pub missing_outputs: Vec<MissingOutputs>,
    /// Ticks that were not computed because their parameters are unknown: a PARAMETER_CHANGE is missing in the log.
    pub other_parameters: Option<OtherParameters>,
    /// Messages that are not used.
    #[serde(flatten)]
    pub account: Account,
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
    /// Violations of the release rule; only for the whole log of a run with several components.
    pub release_violations: ReleaseViolations,
    /// The first difference.
    pub first_divergence: Option<Divergence>,
    /// The components of the run, or the one that was replayed. `identical` and `complete` are the conjunctions of those that were replayed.
    /// `ticks`, times, `missing_ticks` and `deviations` are those of the first one; `first_divergence` is the earliest one; all other fields are for all of
    /// them together. Channels of the others have their names in front.
    pub components: Vec<ComponentReport>,
}

/// The replay of one component.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ComponentReport {
    /// Name of the component in RUN_INFO.
    pub name: String,
    /// It was replayed: false for one of another program, and for one without a tick in the part.
    pub replayed: bool,
    /// Computed ticks.
    pub ticks: u64,
    /// At least one message was compared, and all compared ones are equal in every bit.
    pub identical: bool,
    /// As `complete` of the report.
    pub complete: bool,
    /// Results of other components that were late in the computed ticks.
    pub late_results: u64,
    /// The first difference.
    pub first_divergence: Option<Divergence>,
}

/// Counts of a replay. Those of different segments can be added in any order.
#[derive(Default)]
pub(super) struct Counts {
    pub ticks: u64,
    pub late_results: u64,
    pub compared: u64,
    pub different: u64,
    pub snapshots: u64,
    pub unverifiable: u64,
    pub continuity: Continuity,
    pub t_ns: Option<(i64, i64)>,
    pub outputs: OutputCounts,
    /// Whether to compute `ulp`: not for what-if replays.
    pub ulps: bool,
    pub ulp: Option<u64>,
    pub first: Option<Divergence>,
}

impl Counts {
    pub fn add(&mut self, other: Counts) {
        let Counts {
            ticks,
            late_results,
            compared,
            different,
            snapshots,
            unverifiable,
            continuity,
            t_ns,
            outputs,
            ulps: _,
            ulp,
            first,
        } = other;
        self.ticks += ticks;
        self.late_results += late_results;
        self.compared += compared;
        self.different += different;
        self.snapshots += snapshots;
        self.unverifiable += unverifiable;
        self.continuity.add(continuity);
        if let Some((from, to)) = t_ns {
            self.time(from);
            self.time(to);
        }
        self.outputs.add(outputs);
        self.ulp = self.ulp.max(ulp);
        self.diverged(first);
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

    /// - `name`: name of the component.
    pub fn report(
        self,
        name: String,
        account: Account,
        health: &crate::log::Health,
        wall_seconds: f64,
    ) -> ReplayReport {
        let (missing_outputs, missing_ticks) = (self.outputs.missing(), self.continuity.gaps());
        let Continuity { missing, skipped, other_parameters, .. } = self.continuity;
        let is_whole = missing == 0 && other_parameters.is_none() && missing_outputs.is_empty();
        let replayed = self.t_ns.map_or(0.0, |(from, to)| to.saturating_sub(from) as f64 * 1e-9);
        let complete = is_whole && account.is_complete() && health.is_good();
        let component = ComponentReport {
            name,
            replayed: true,
            ticks: self.ticks,
            identical: self.compared > 0 && self.first.is_none(),
            complete,
            late_results: self.late_results,
            first_divergence: self.first.clone(),
        };
        ReplayReport {
            identical: component.identical,
            complete,
            ticks: self.ticks,
            messages_compared: self.compared,
            messages_different: self.different,
            snapshots_compared: self.snapshots,
            messages_not_recorded: self.outputs.not_recorded(),
            unverifiable_ticks: self.unverifiable,
            missing_input_ticks: missing,
            skipped_ticks: skipped,
            missing_outputs,
            other_parameters,
            account,
            damaged: health.damaged.len() as u64,
            cut: health.cut.is_some(),
            first_t_ns: self.t_ns.map(|t| t.0),
            last_t_ns: self.t_ns.map(|t| t.1),
            wall_seconds,
            real_time_factor: if wall_seconds > 0.0 { replayed / wall_seconds } else { 0.0 },
            deviations: Vec::new(),
            missing_ticks,
            largest_ulp: self.ulp,
            what_if: None,
            release_violations: ReleaseViolations::default(),
            first_divergence: self.first,
            components: vec![component],
        }
    }
}
