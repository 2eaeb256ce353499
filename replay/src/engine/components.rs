//! Replays all components of a run, one after the other, into one report, and checks what they delivered to each other.

use super::report::{ComponentReport, ReplayReport};
use super::run_messages::RunMessages;
use super::{Account, Divergence, Options, Replay, release_rule};
use crate::Error;
use lcmtypes::{ComponentInfo, EXTERNAL};

/// Replays the components of a run.
///
/// # Errors
/// As [`Replay::run`].
pub(super) fn run(replay: &Replay, options: &Options, progress: &mut dyn FnMut(f64)) -> Result<ReplayReport, Error> {
    let components = replay.components();
    let parts = components.len() as f64;
    let (mut report, last_base_tick) = replay.run_one(options, &mut |part| progress(part / parts))?;
    for (index, component) in components.iter().enumerate().skip(1) {
        if component.kind == EXTERNAL {
            report.components.push(not_replayed(component, true));
            continue;
        }
        let found = replay.view(index).run_one(options, &mut |part| progress((index as f64 + part) / parts));
        match found {
            Ok((other, _)) => report.add(other),
            // A part of a log, or a short one, may end before its first tick.
            Err(Error::NoInput { .. }) => {
                report.components.push(not_replayed(component, last_base_tick < i64::from(component.phase_ticks)));
            }
            Err(Error::BeyondEnd { .. }) => report.components.push(not_replayed(component, true)),
            Err(source) => {
                return Err(Error::Component { name: component.name.clone(), source: Box::new(source) });
            }
        }
    }
    if options.from_s.is_none() && options.to_s.is_none() {
        report.release_violations = release_rule::check(&replay.path, &replay.recorded)?;
    }
    let replayed = || report.components.iter().filter(|component| component.replayed);
    report.identical = replayed().all(|component| component.identical);
    report.complete = report.components.iter().all(|component| component.complete);
    Ok(report)
}

fn not_replayed(component: &ComponentInfo, complete: bool) -> ComponentReport {
    let name = component.name.clone();
    ComponentReport {
        name,
        replayed: false,
        ticks: 0,
        identical: false,
        complete,
        late_results: 0,
        first_divergence: None,
    }
}

impl ReplayReport {
    /// Names all channels as in the log.
    pub(super) fn qualify(&mut self, messages: &RunMessages) {
        let name = |channel: &mut String| *channel = messages.in_log(channel);
        self.missing_outputs.iter_mut().for_each(|missing| name(&mut missing.channel));
        self.account.other_types.iter_mut().for_each(|other| name(&mut other.channel));
        let of_components = self.components.iter_mut().filter_map(|component| component.first_divergence.as_mut());
        for Divergence { channel, also, .. } in self.first_divergence.iter_mut().chain(of_components) {
            name(channel);
            also.iter_mut().for_each(|difference| name(&mut difference.channel));
        }
    }

    /// Adds the report of another component.
    fn add(&mut self, other: ReplayReport) {
        self.messages_compared += other.messages_compared;
        self.messages_different += other.messages_different;
        self.snapshots_compared += other.snapshots_compared;
        self.messages_not_recorded += other.messages_not_recorded;
        self.unverifiable_ticks += other.unverifiable_ticks;
        self.missing_input_ticks = self.missing_input_ticks.saturating_add(other.missing_input_ticks);
        self.skipped_ticks += other.skipped_ticks;
        self.missing_outputs.extend(other.missing_outputs);
        self.other_parameters = self.other_parameters.or(other.other_parameters);
        self.account.add(other.account);
        self.largest_ulp = self.largest_ulp.max(other.largest_ulp);
        self.wall_seconds += other.wall_seconds;
        let replayed_seconds =
            self.last_t_ns.zip(self.first_t_ns).map_or(0.0, |(to, from)| to.saturating_sub(from) as f64 * 1e-9);
        self.real_time_factor = if self.wall_seconds > 0.0 { replayed_seconds / self.wall_seconds } else { 0.0 };
        let is_earlier = |ours: &Divergence, other: &Divergence| ours.t_ns <= other.t_ns;
        self.first_divergence = match (self.first_divergence.take(), other.first_divergence) {
            (Some(ours), Some(other)) => Some(if is_earlier(&ours, &other) { ours } else { other }),
            (ours, other) => ours.or(other),
        };
        self.components.extend(other.components.into_iter().map(|component| {
            // A part between two of its ticks has none.
            let replayed = component.ticks > 0 || !component.complete;
            ComponentReport { replayed, ..component }
        }));
    }
}

impl Account {
    /// Adds the account of another component.
    fn add(&mut self, other: Account) {
        let Account {
            late_messages,
            doubled_messages,
            undecodable_messages,
            outputs_without_input,
            rejected_changes,
            first_rejected_change,
            foreign_messages,
            unused,
            other_types,
        } = other;
        self.late_messages += late_messages;
        self.doubled_messages += doubled_messages;
        self.undecodable_messages += undecodable_messages;
        self.outputs_without_input += outputs_without_input;
        self.rejected_changes += rejected_changes;
        self.first_rejected_change = self.first_rejected_change.take().or(first_rejected_change);
        self.foreign_messages += foreign_messages;
        self.unused.extend(unused);
        self.other_types.extend(other_types);
    }
}
