//! Whether the run of a log can be replayed, without computing a tick: what `hoof log verify` says of it. Reading, grouping and continuity are those of a
//! replay, so the two agree.

use super::continuity::Continuity;
use super::expected::ExpectedOutputs;
use super::ticks::{Beside, Ticks};
use super::{Account, MissingOutputs, OtherParameters, Replay};
use crate::{Error, printable};
use controller::Unpacked;
use lcmtypes::EXTERNAL;
use std::path::Path;

/// What a replay of the whole log would find, apart from differences. The numbers are those of the first component.
#[derive(Debug, Default)]
pub(crate) struct Judgement {
    /// Name of the controller.
    pub controller: Option<String>,
    /// Ticks with an input.
    pub ticks: u64,
    /// First of them.
    pub first_tick: Option<i64>,
    /// Last of them.
    pub last_tick: Option<i64>,
    /// Ticks without an input.
    pub missing: u64,
    /// Ticks whose parameters are unknown.
    pub other_parameters: Option<OtherParameters>,
    /// Recorded states.
    pub snapshots: u64,
    /// Ticks that can be computed.
    pub computable: u64,
    /// Of these, ticks with a recorded output.
    pub outputs: u64,
    /// Outputs that are missing.
    pub missing_outputs: Vec<MissingOutputs>,
    /// Messages that a replay does not use.
    pub account: Account,
    /// Reasons why other components of the run cannot be replayed completely.
    pub of_others: Vec<String>,
    /// Why the log cannot be replayed at all.
    pub error: Option<Error>,
}

impl Judgement {
    /// Reads a log. `progress` receives the fraction read, 0 to 1.
    pub fn of(log: &Path, progress: &mut dyn FnMut(f64)) -> Self {
        let replay = match Replay::open(log) {
            Ok(replay) => replay,
            Err(error) => return Judgement { error: Some(error), ..Judgement::default() },
        };
        let components = replay.components();
        let parts = components.len().max(1) as f64;
        let mut first = Judgement::of_one(&replay, &mut |part| progress(part / parts));
        for (index, component) in components.iter().enumerate().skip(1).filter(|(_, one)| one.kind != EXTERNAL) {
            let mut bar = |part: f64| progress((index as f64 + part) / parts);
            let other = Judgement::of_one(&replay.view(index), &mut bar);
            // A short log may end before its first tick.
            let is_before = matches!(other.error, Some(Error::NoInput { .. }))
                && first.last_tick < Some(component.phase_ticks.into());
            if !is_before {
                let why = other.why().into_iter().map(|why| format!("component {}: {why}", printable(&component.name)));
                first.of_others.extend(why);
            }
        }
        first
    }

    /// Reads one component of a log.
    fn of_one(replay: &Replay, progress: &mut dyn FnMut(f64)) -> Self {
        let mut judgement = Judgement::default();
        if let Err(error) = judgement.read(replay, progress) {
            judgement.error = Some(error);
        }
        judgement
    }

    /// Reasons why the run cannot be replayed completely; empty if it can.
    pub fn why(&self) -> Vec<String> {
        let mut why: Vec<String> = self.error.iter().map(ToString::to_string).collect();
        if self.missing > 0 {
            why.push(format!("inputs of {} ticks are missing", self.missing));
        }
        why.extend(self.other_parameters.iter().map(OtherParameters::text));
        why.extend(self.missing_outputs.iter().map(MissingOutputs::text));
        why.extend(self.account.text());
        if self.error.is_none() && self.computable == 0 {
            why.push(format!("none of the {} ticks can be computed: no tick 0 and no CONTROLLER_SNAPSHOT", self.ticks));
        } else if self.error.is_none() && self.outputs == 0 {
            why.push("no outputs to compare with".to_owned());
        }
        why.extend(self.of_others.iter().cloned());
        why
    }

    fn read(&mut self, replay: &Replay, progress: &mut dyn FnMut(f64)) -> Result<(), Error> {
        let log = &*replay.path;
        self.controller = Some(replay.info.controller().to_owned());
        let builder = replay.builder(&super::Options::default())?;
        builder.build(&[])?;
        let (mut changes, mut digest) = (Vec::new(), builder.digest(&[])?);
        let mut ticks = Ticks::open(log, &replay.messages, Beside::Nothing)?;
        let bytes = super::file_length(log)?.max(1);
        let mut unpacked = Unpacked::default();
        let period_ticks = replay.info.components.first().map_or(1, |component| component.period_ticks);
        let snapshot_ticks = controller::time::snapshot_ticks(period_ticks);
        let (mut continuity, mut outputs) = (Continuity::default(), ExpectedOutputs::new(snapshot_ticks));
        while let Some(tick) = ticks.next()? {
            if tick.tick % 1024 == 0 {
                progress(ticks.offset as f64 / bytes as f64);
            }
            if !tick.changes.is_empty() {
                changes.extend(tick.changes.iter().cloned());
                builder.build(&changes)?;
                digest = builder.digest(&changes)?;
            }
            if tick.input.is_some() {
                self.ticks += 1;
                self.first_tick.get_or_insert(tick.tick);
                self.last_tick = Some(tick.tick);
            }
            // Also in ticks that cannot be computed: a message of them holds later.
            let running = tick.input.as_ref().map_or(0, |input| unpacked.update(input).running);
            if let Some(snapshot) = tick.snapshot() {
                unpacked.restore(snapshot);
            }
            if continuity.can_compute(&tick, tick.has_parameters(digest)) {
                self.computable += 1;
                self.outputs += u64::from(!tick.recorded.is_empty());
                outputs.take(tick.tick, running, tick.recorded.iter().map(|(channel, _)| channel));
            } else if tick.snapshot().is_some() {
                continuity.restored(tick.tick);
            }
            self.snapshots += u64::from(tick.snapshot().is_some());
        }
        (self.missing, self.other_parameters) = (continuity.missing, continuity.other_parameters);
        self.missing_outputs = outputs.counts().missing();
        self.account = ticks.account()?;
        if self.ticks == 0 {
            return Err(Error::NoInput { path: log.into() });
        }
        Ok(())
    }
}
