//! What a log is worth: what is in it, what is missing and where, and whether its run can be replayed.

use super::sequence_gaps::{Gap, SequenceTracker, sequence_field, sequence_number};
use super::summary::seconds;
use super::{Cut, Damaged, EventRef, Format, Health, LogReader, RunClockFinder, Types, Zero};
use crate::Error;
use lcmtypes::{Message, RunInfo, channels};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// The account of a log.
#[derive(Debug, Clone, serde::Serialize)]
pub struct VerifyReport {
    /// Nothing is damaged, cut, lost or undecodable, and if the log is of a run, every tick of it can be replayed.
    pub good: bool,
    /// Format of the file.
    pub format: Format,
    /// Messages.
    pub events: u64,
    /// From the earliest to the latest event, s.
    pub duration_s: f64,
    /// What time zero of the tools is for this log.
    pub zero: Zero,
    /// Time zero in the clock of the log's events, ns.
    pub zero_t_ns: i64,
    /// Stretches that could not be read.
    pub damaged: Vec<Damaged>,
    /// Where the file stops too early, if it does.
    pub cut: Option<Cut>,
    /// Bytes that are in no event for these two reasons.
    pub bytes_skipped: u64,
    /// Messages that their counters say are missing, over all channels.
    pub lost: u64,
    /// Messages that are not of the type that their first bytes say.
    pub undecodable: u64,
    /// Events with a time before that of the event in front of them.
    pub times_backwards: u64,
    /// Channels by name.
    pub channels: Vec<ChannelReport>,
    /// Whether the run can be replayed.
    pub replay: ReplayCheck,
}

/// The account of one channel.
#[derive(Debug, Clone, serde::Serialize)]
pub struct ChannelReport {
    /// Channel.
    pub name: String,
    /// Its types, if they are known here.
    pub types: Vec<String>,
    /// Messages.
    pub count: u64,
    /// Field that counts them: `seq` or `tick`; `None` if there is none, or not one that counts every message.
    pub counter: Option<&'static str>,
    /// Messages that the counter skips.
    pub lost: Option<u64>,
    /// Where it skips, the first thousand places.
    pub gaps: Vec<Gap>,
    /// Messages that came twice.
    pub duplicates: u64,
    /// Messages that came behind later ones.
    pub late: u64,
    /// Times that the counter began anew.
    pub restarts: u64,
    /// Messages that are not of their type.
    pub undecodable: u64,
}

/// Whether a run can be replayed from its log.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct ReplayCheck {
    /// From its first tick to its last, without a gap.
    pub complete: bool,
    /// What stands against it.
    pub why: Vec<String>,
    /// Name of the controller.
    pub controller: Option<String>,
    /// Ticks whose input is there.
    pub ticks: u64,
    /// The first of them.
    pub first_tick: Option<i64>,
    /// Ticks whose input is missing.
    pub missing: u64,
    /// Recorded states, from which a replay can start.
    pub snapshots: u64,
    /// Ticks whose outputs are there to be compared.
    pub outputs: u64,
}

/// Reads a log from end to end and decodes every message. `progress` is told which part has been read, 0 to 1.
///
/// # Errors
/// As [`LogReader::open`], or [`Error::Io`] on the way.
pub fn verify(log: &Path, mut types: Types, progress: &mut dyn FnMut(f64)) -> Result<VerifyReport, Error> {
    let mut reader = LogReader::open(log)?;
    let (format, bytes) = (reader.format(), reader.bytes().max(1));
    let mut health = Health::default();
    let mut account = Account::default();
    while let Some(item) = reader.read()? {
        let Some(event) = health.note(item) else { continue };
        if account.events.is_multiple_of(4096) {
            progress(event.offset as f64 / bytes as f64);
        }
        types.learn(&event);
        account.add(&event, &types);
    }
    progress(1.0);
    Ok(account.certificate(format, health))
}

#[derive(Default)]
struct Account {
    events: u64,
    times: Option<(i64, i64, i64)>,
    times_backwards: u64,
    channels: BTreeMap<Arc<str>, Lane>,
    run_info: Option<Result<RunInfo, String>>,
    clock: RunClockFinder,
    runs: u64,
}

#[derive(Default)]
struct Lane {
    types: Vec<(Option<u64>, Option<String>)>,
    counter: Option<&'static str>,
    numbers: SequenceTracker,
    count: u64,
    undecodable: u64,
    first_number: Option<i64>,
    bad_version: Option<u64>,
}

impl Account {
    fn add(&mut self, event: &EventRef<'_>, types: &Types) {
        self.events += 1;
        self.clock.see(event);
        let t = event.t_ns;
        let (first, last, before) = self.times.unwrap_or((t, t, t));
        self.times_backwards += u64::from(t < before);
        self.times = Some((first.min(t), last.max(t), t));
        if **event.channel == *channels::RUN_INFO {
            self.run_info(event.data);
        }
        let lane = match self.channels.get_mut(event.channel) {
            Some(lane) => lane,
            None => self.channels.entry(Arc::clone(event.channel)).or_default(),
        };
        lane.add(event, types);
    }

    fn run_info(&mut self, data: &[u8]) {
        let info = RunInfo::decode(data).map_err(|why| why.to_string());
        // It may be repeated for those who come late; another one is another run.
        let same = matches!((&self.run_info, &info), (Some(Ok(known)), Ok(info)) if known == info);
        if !same {
            self.runs += 1;
            self.run_info.get_or_insert(info);
        }
    }

    fn certificate(self, format: Format, health: Health) -> VerifyReport {
        let (replay, clock) = (self.replayable(), self.clock.clock());
        let is_run = self.run_info.is_some() || self.channels.contains_key(channels::CONTROLLER_INPUT);
        let channels: Vec<_> = self.channels.iter().map(|(name, lane)| lane.account(name)).collect();
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

    fn replayable(&self) -> ReplayCheck {
        let mut replay = ReplayCheck::default();
        let mut why = Vec::new();
        match &self.run_info {
            None => why.push("no RUN_INFO: controller and parameters are unknown".to_owned()),
            Some(Err(error)) => why.push(format!("RUN_INFO: {error}")),
            Some(Ok(info)) => {
                replay.controller = Some(info.controller.clone());
                if let Err(error) = controller::load(info) {
                    why.push(format!("its controller cannot be built: {error}"));
                }
            }
        }
        if self.runs > 1 {
            why.push(format!("{} runs in one log: trim it to one", self.runs));
        }
        for known in channels::CHANNELS.iter().filter(|c| matches!(c.class, channels::Class::ReplayInput)) {
            if let Some(found) = self.channels.get(known.name).and_then(|lane| lane.bad_version) {
                let (name, today) = (known.name, known.fingerprint);
                why.push(format!("{name} is of another type version: {found:016x} in the log, {today:016x} today"));
            }
        }
        let count = |channel| self.channels.get(channel).map_or(0, |lane: &Lane| lane.count);
        replay.snapshots = count(channels::CONTROLLER_SNAPSHOT);
        replay.outputs = count(channels::CONTROLLER_TICK);
        match self.channels.get(channels::CONTROLLER_INPUT) {
            None => why.push("no CONTROLLER_INPUT: there is nothing to replay".to_owned()),
            Some(inputs) => {
                replay.ticks = inputs.count;
                replay.first_tick = inputs.first_number;
                replay.missing = inputs.numbers.missing();
                if replay.missing > 0 {
                    why.push(format!("the inputs of {} ticks are missing", replay.missing));
                }
                if inputs.first_number != Some(0) && replay.snapshots == 0 {
                    why.push("it begins in the middle of a run, without a CONTROLLER_SNAPSHOT".to_owned());
                }
                if replay.outputs == 0 {
                    why.push("no CONTROLLER_TICK: a replay would have nothing to compare with".to_owned());
                }
            }
        }
        ReplayCheck { complete: why.is_empty(), why, ..replay }
    }
}

impl Lane {
    fn add(&mut self, event: &EventRef<'_>, types: &Types) {
        self.count += 1;
        let fingerprint = event.fingerprint();
        let ty = fingerprint.and_then(|f| types.of(event.channel, f));
        if !self.types.iter().any(|(known, _)| *known == fingerprint) && self.types.len() < 100 {
            self.types.push((fingerprint, ty.map(|ty| ty.name().to_owned())));
            let known = channels::find(event.channel).filter(|known| Some(known.fingerprint) != fingerprint);
            self.bad_version = self.bad_version.or(known.map(|_| fingerprint.unwrap_or(0)));
        }
        let Some(ty) = ty else { return };
        if ty.walk(event.data, |_, _| ()).is_err() {
            self.undecodable += 1;
            return;
        }
        self.counter = self.counter.or_else(|| sequence_field(ty));
        if let (Some(_), Some(number)) = (sequence_field(ty), sequence_number(event.data)) {
            self.first_number.get_or_insert(number);
            self.numbers.add(number, event.t_ns);
        }
    }

    fn account(&self, name: &str) -> ChannelReport {
        let lost = self.numbers.lost().filter(|_| self.counter.is_some());
        ChannelReport {
            name: name.to_owned(),
            types: self.types.iter().filter_map(|(_, name)| name.clone()).collect(),
            count: self.count,
            counter: self.counter.filter(|_| lost.is_some()),
            lost,
            gaps: self.numbers.gaps().to_vec(),
            duplicates: if lost.is_some() { self.numbers.duplicates } else { 0 },
            late: if lost.is_some() { self.numbers.late } else { 0 },
            restarts: if lost.is_some() { self.numbers.restarts } else { 0 },
            undecodable: self.undecodable,
        }
    }
}
