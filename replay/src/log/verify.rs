//! Checks a log: what is damaged or lost and where, and whether its run can be replayed.

use super::sequence_gaps::{Gap, SequenceTracker, sequence_field, sequence_number};
use super::summary::seconds;
use super::{Cut, Damaged, EventRef, Format, Health, LogReader, RunClockFinder, Types, Zero};
use crate::Error;
use crate::engine::{Account, Judgement};
use lcmtypes::channels;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Result of a check.
#[derive(Debug, Clone, serde::Serialize)]
pub struct VerifyReport {
    /// Nothing is damaged, cut, lost or undecodable; and if the log is of a run, every tick of it can be replayed.
    pub good: bool,
    /// Format of the file.
    pub format: Format,
    /// Number of events.
    pub events: u64,
    /// Time from the earliest to the latest event, s.
    pub duration_s: f64,
    /// Event that defines time zero of the tools for this log.
    pub zero: Zero,
    /// Time zero in the clock of the log's events, ns.
    pub zero_t_ns: i64,
    /// Damaged ranges.
    pub damaged: Vec<Damaged>,
    /// The incomplete last record, if the file is cut.
    pub cut: Option<Cut>,
    /// Bytes in damaged ranges and the incomplete last record.
    pub bytes_skipped: u64,
    /// Lost messages over all channels, from the gaps in their sequence numbers.
    pub lost: u64,
    /// Messages that do not decode as the type of their fingerprint.
    pub undecodable: u64,
    /// Events with an earlier time than the event before them.
    pub times_backwards: u64,
    /// Channels by name.
    pub channels: Vec<ChannelReport>,
    /// Whether the run can be replayed.
    pub replay: ReplayCheck,
}

/// Result of a check of one channel.
#[derive(Debug, Clone, serde::Serialize)]
pub struct ChannelReport {
    /// Channel.
    pub name: String,
    /// Its known types.
    pub types: Vec<String>,
    /// Messages.
    pub count: u64,
    /// Field with the sequence number: `seq` or `tick`; `None` without one, or if the channel does not carry every number.
    pub counter: Option<&'static str>,
    /// Lost messages, from gaps in the sequence number.
    pub lost: Option<u64>,
    /// The first 1000 gaps.
    pub gaps: Vec<Gap>,
    /// Sequence numbers that occur more than once.
    pub duplicates: u64,
    /// Messages that arrived out of order.
    pub late: u64,
    /// Restarts of the sequence.
    pub restarts: u64,
    /// Messages that do not decode as their type.
    pub undecodable: u64,
}

/// Whether a run can be replayed from its log.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct ReplayCheck {
    /// Every tick from the first to the last can be replayed.
    pub complete: bool,
    /// Reasons why not.
    pub why: Vec<String>,
    /// Name of the controller.
    pub controller: Option<String>,
    /// Ticks with an input.
    pub ticks: u64,
    /// First tick.
    pub first_tick: Option<i64>,
    /// Ticks without an input.
    pub missing: u64,
    /// Ticks that can be computed: from tick 0 or a snapshot on, up to the next missing input.
    pub computable: u64,
    /// Recorded controller states from which a replay can start.
    pub snapshots: u64,
    /// Computable ticks with recorded outputs to compare with.
    pub outputs: u64,
    /// Messages that a replay does not use.
    #[serde(flatten)]
    pub account: Account,
}

/// Reads a log from start to end and decodes every message. `progress` receives the fraction read, 0 to 1.
///
/// # Errors
/// As [`LogReader::open`] and [`LogReader::read`].
pub fn verify(log: &Path, mut types: Types, progress: &mut dyn FnMut(f64)) -> Result<VerifyReport, Error> {
    let mut reader = LogReader::open(log)?;
    let (format, bytes) = (reader.format(), reader.bytes().max(1));
    let mut health = Health::default();
    let mut verifier = Verifier::default();
    while let Some(item) = reader.read()? {
        let Some(event) = health.note(item) else { continue };
        // The judgement reads the log again.
        if verifier.events.is_multiple_of(4096) {
            progress(0.5 * event.offset as f64 / bytes as f64);
        }
        types.learn(&event);
        verifier.add(&event, &types);
    }
    let report = verifier.report(log, format, health, &mut |part| progress(0.5 + 0.5 * part));
    progress(1.0);
    Ok(report)
}

#[derive(Default)]
struct Verifier {
    events: u64,
    times: Option<(i64, i64, i64)>,
    times_backwards: u64,
    channels: BTreeMap<Arc<str>, ChannelState>,
    clock: RunClockFinder,
}

#[derive(Default)]
struct ChannelState {
    types: Vec<(Option<u64>, Option<String>)>,
    counter: Option<&'static str>,
    sequence: SequenceTracker,
    count: u64,
    undecodable: u64,
}

impl Verifier {
    fn add(&mut self, event: &EventRef<'_>, types: &Types) {
        self.events += 1;
        self.clock.see(event);
        let t = event.t_ns;
        let (first, last, before) = self.times.unwrap_or((t, t, t));
        self.times_backwards += u64::from(t < before);
        self.times = Some((first.min(t), last.max(t), t));
        let channel = match self.channels.get_mut(event.channel) {
            Some(channel) => channel,
            None => self.channels.entry(Arc::clone(event.channel)).or_default(),
        };
        channel.add(event, types);
    }

    fn report(self, log: &Path, format: Format, health: Health, progress: &mut dyn FnMut(f64)) -> VerifyReport {
        let clock = self.clock.clock();
        let of_run = [channels::RUN_INFO, channels::CONTROLLER_INPUT];
        let is_run = of_run.iter().any(|channel| self.channels.contains_key(*channel));
        let replay = if is_run { ReplayCheck::of(log, progress) } else { ReplayCheck::without_run() };
        let channels: Vec<_> = self.channels.iter().map(|(name, channel)| channel.report(name)).collect();
        let lost = channels.iter().filter_map(|c| c.lost).sum();
        let undecodable = channels.iter().map(|c| c.undecodable).sum();
        let good = health.is_good() && lost == 0 && undecodable == 0 && (replay.complete || !is_run);
        VerifyReport {
            good,
            format,
            events: self.events,
            duration_s: self.times.map_or(0.0, |(first, last, _)| seconds(first, last)),
            zero: clock.zero(),
            zero_t_ns: clock.origin_ns(),
            bytes_skipped: health.bytes_skipped(),
            damaged: health.damaged,
            cut: health.cut,
            lost,
            undecodable,
            times_backwards: self.times_backwards,
            channels,
            replay,
        }
    }
}

impl ReplayCheck {
    /// The judgement of a replay.
    fn of(log: &Path, progress: &mut dyn FnMut(f64)) -> Self {
        let found = Judgement::of(log, progress);
        let why = found.why();
        let Judgement { controller, ticks, first_tick, missing, snapshots, computable, outputs, account, .. } = found;
        let complete = why.is_empty();
        ReplayCheck { complete, why, controller, ticks, first_tick, missing, computable, snapshots, outputs, account }
    }

    /// The result for a log without a run.
    fn without_run() -> Self {
        let why = [channels::RUN_INFO, channels::CONTROLLER_INPUT].map(|channel| format!("no {channel}")).into();
        ReplayCheck { why, ..ReplayCheck::default() }
    }
}

impl ChannelState {
    fn add(&mut self, event: &EventRef<'_>, types: &Types) {
        self.count += 1;
        let fingerprint = event.fingerprint();
        let ty = fingerprint.and_then(|f| types.of(event.channel, f));
        if !self.types.iter().any(|(known, _)| *known == fingerprint) && self.types.len() < 100 {
            self.types.push((fingerprint, ty.map(|ty| ty.name().to_owned())));
        }
        let Some(ty) = ty else { return };
        if ty.walk(event.data, |_, _| ()).is_err() {
            self.undecodable += 1;
            return;
        }
        self.counter = self.counter.or_else(|| sequence_field(ty));
        if let (Some(_), Some(number)) = (sequence_field(ty), sequence_number(event.data)) {
            self.sequence.add(number, event.t_ns);
        }
    }

    fn report(&self, name: &str) -> ChannelReport {
        let lost = self.sequence.lost().filter(|_| self.counter.is_some());
        ChannelReport {
            name: name.to_owned(),
            types: self.types.iter().filter_map(|(_, name)| name.clone()).collect(),
            count: self.count,
            counter: self.counter.filter(|_| lost.is_some()),
            lost,
            gaps: self.sequence.gaps().to_vec(),
            duplicates: if lost.is_some() { self.sequence.duplicates } else { 0 },
            late: if lost.is_some() { self.sequence.late } else { 0 },
            restarts: if lost.is_some() { self.sequence.restarts } else { 0 },
            undecodable: self.undecodable,
        }
    }
}
