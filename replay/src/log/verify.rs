//! Checks a log: what is damaged or lost and where, and whether its run can be replayed.

use super::sequence_gaps::{Gap, SequenceTracker, sequence_field, sequence_number};
use super::summary::seconds;
use super::{Cut, Damaged, EventRef, Format, Health, LogReader, RunClockFinder, Types, Zero};
use crate::Error;
use crate::engine::{Account, Judgement};
use lcm_idl::Deviations;
use lcmtypes::channels;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Result of a check.
#[derive(Debug, Clone, serde::Serialize)]
pub struct VerifyReport {
    /// Nothing is damaged, cut, lost, reported as lost, or undecodable; and if the log is of a run, every tick of it can be replayed.
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
    /// Messages that LCM decodes although they deviate from the format.
    pub deviating: u64,
    /// Losses and omissions that the recorder reported in the log: the first 100.
    pub reported_losses: Vec<ReportedLoss>,
    /// Events with an earlier time than the event before them.
    pub times_backwards: u64,
    /// Channels by name.
    pub channels: Vec<ChannelReport>,
    /// Whether the run can be replayed.
    pub replay: ReplayCheck,
}

/// A loss that the recorder reported in an EVENT.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct ReportedLoss {
    /// Log time of the EVENT, ns.
    pub t_ns: i64,
    /// Its text.
    pub text: String,
}

/// Reports of losses that are listed.
const MAX_REPORTED: usize = 100;

/// Channels that are checked separately; further channels share one row.
const MAX_ROWS: usize = 10_000;

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
    /// Messages that LCM decodes although they deviate from the format, and the deviations of the first one.
    pub deviating: u64,
    /// See `deviating`.
    pub first_deviation: Option<String>,
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
    let mut reader = match LogReader::open(log) {
        // An LCM event log without events has no bytes, such as the recovery of a log that is cut inside its first event.
        Err(Error::EmptyFile { .. }) if Format::of_name(log).is_ok_and(|format| format == Format::LcmLog) => {
            return Ok(Verifier::default().report(log, Format::LcmLog, Health::default(), progress));
        }
        opened => opened?,
    };
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
    /// Channels beyond the limit.
    further: ChannelState,
    clock: RunClockFinder,
    reported_losses: Vec<ReportedLoss>,
}

#[derive(Default)]
struct ChannelState {
    types: Vec<(Option<u64>, Option<String>)>,
    counter: Option<&'static str>,
    sequence: SequenceTracker,
    count: u64,
    undecodable: u64,
    deviating: u64,
    first_deviation: Option<Deviations>,
}

impl Verifier {
    fn add(&mut self, event: &EventRef<'_>, types: &Types) {
        self.events += 1;
        self.clock.see(event);
        let t = event.t_ns;
        let (first, last, before) = self.times.unwrap_or((t, t, t));
        self.times_backwards += u64::from(t < before);
        self.times = Some((first.min(t), last.max(t), t));
        if **event.channel == *channels::EVENT && self.reported_losses.len() < MAX_REPORTED {
            self.reported_losses.extend(reported_loss(event, types));
        }
        if !self.channels.contains_key(event.channel) && self.channels.len() >= MAX_ROWS {
            self.further.add(event, types);
            // Each of these channels has its own numbers.
            self.further.sequence = SequenceTracker::default();
            return;
        }
        match self.channels.get_mut(event.channel) {
            Some(channel) => channel.add(event, types),
            None => self.channels.entry(Arc::clone(event.channel)).or_default().add(event, types),
        }
    }

    fn report(self, log: &Path, format: Format, health: Health, progress: &mut dyn FnMut(f64)) -> VerifyReport {
        let clock = self.clock.clock();
        let of_run = [channels::RUN_INFO, channels::CONTROLLER_INPUT];
        let is_run = of_run.iter().any(|channel| self.channels.contains_key(*channel));
        let replay = if is_run { ReplayCheck::of(log, progress) } else { ReplayCheck::without_run() };
        let mut channels: Vec<_> = self.channels.iter().map(|(name, channel)| channel.report(name)).collect();
        if self.further.count > 0 {
            channels.push(self.further.report("(further channels)"));
        }
        let lost = channels.iter().filter_map(|c| c.lost).sum();
        let undecodable = channels.iter().map(|c| c.undecodable).sum();
        let deviating = channels.iter().map(|c| c.deviating).sum();
        let is_recorded = self.reported_losses.is_empty();
        let good = health.is_good() && lost == 0 && undecodable == 0 && is_recorded && (replay.complete || !is_run);
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
            deviating,
            reported_losses: self.reported_losses,
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
        match ty.walk_lenient(event.data, |_, _| ()) {
            Ok(deviations) if deviations.is_none() => {}
            Ok(deviations) => {
                self.deviating += 1;
                self.first_deviation.get_or_insert(deviations);
            }
            Err(_) => {
                self.undecodable += 1;
                return;
            }
        }
        let counter = sequence_field(ty);
        self.counter = self.counter.or(counter);
        if let (Some(_), Some(number)) = (counter, sequence_number(event.data)) {
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
            deviating: self.deviating,
            first_deviation: self.first_deviation.map(|first| first.to_string()),
        }
    }
}

/// The loss that an EVENT reports: every warning of the recorder is one.
fn reported_loss(event: &EventRef<'_>, types: &Types) -> Option<ReportedLoss> {
    let (message, _) = types.of_message(event.channel, event.data)?.decode_lenient(event.data).ok()?;
    let level = message.get("level")?.as_i64()?;
    let is_loss = message.get("source")?.as_str() == Some(crate::record::SOURCE)
        && level >= i64::from(lcmtypes::Event::LEVEL_WARNING);
    is_loss.then_some(ReportedLoss { t_ns: event.t_ns, text: message.get("text")?.as_str()?.to_owned() })
}
