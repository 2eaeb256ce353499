//! Reads a log into a [`Run`] in one pass.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use controller::Unpacked;
use lcmtypes::{
    BaseTracking, ContactEstimate, ControllerInput, ControllerTick, GroundTruth, LegState, Message, RobotCommand,
    RobotState, RunInfo, Timing, WbcSolution,
};
use replay::log::{Health, LogReader, RunClockFinder};
use sha2::{Digest, Sha256};

use super::joints::Rows;
use super::thin::{MAX_EVENTS, MAX_TICKS, Thinning};
use super::{Consumed, Contact, Joints, Run, TICK_CHANNELS, Tick, Truth, Wbc};
use crate::fields::{Field, FieldReader};
use crate::robot::Robot;
use crate::{Error, Progress, Stage};

/// Result of a message.
pub(super) enum Taken {
    Yes,
    /// The message is the RUN_INFO of another run: reading stops.
    AnotherRun,
}

/// Messages read so far.
#[derive(Default)]
pub(super) struct Gathered {
    pub info: Option<RunInfo>,
    pub events: Vec<lcmtypes::Event>,
    /// In the order of time.
    pub ticks: Vec<Tick>,
    /// Ticks with messages after those of later ticks.
    pub stray: Vec<Tick>,
    pub truth: Vec<Truth>,
    pub joints: Joints,
    pub thinning: Thinning,
    /// What the controller has consumed.
    pub unpacked: Unpacked,
    /// Joint states by the clock of the driver: time and row. Used for a log without CONTROLLER_INPUT.
    pub raw: (Vec<(i64, u32)>, Rows),
}

pub(super) fn read(path: &Path, fields: &[Field], progress: &mut dyn FnMut(Progress)) -> Result<Run, Error> {
    let log_error = |source| Error::Log { path: path.to_owned(), source };
    let mut reader = LogReader::open(path).map_err(log_error)?;
    let total = reader.bytes();
    let (mut health, mut number) = (Health::default(), 0_u64);
    let (mut gathered, mut clock) = (Gathered::default(), RunClockFinder::default());
    let mut field_reader = FieldReader::new(fields);
    let mut channels: BTreeMap<String, u64> = BTreeMap::new();
    let mut notes = Vec::new();
    let mut undecodable: BTreeMap<String, (u64, String)> = BTreeMap::new();
    while let Some(item) = reader.read().map_err(log_error)? {
        let Some(event) = health.note(item) else { continue };
        number += 1;
        if number.is_multiple_of(4096) {
            progress(Progress { stage: Stage::Read, done: event.offset, total });
        }
        clock.see(&event);
        match gathered.take(event.channel, event.data) {
            Ok(Taken::Yes) => {
                field_reader.take(&event);
                match channels.get_mut(&**event.channel) {
                    Some(count) => *count += 1,
                    None => drop(channels.insert(event.channel.to_string(), 1)),
                }
            }
            Ok(Taken::AnotherRun) => {
                notes.push(format!("another run starts at byte {}; only the first run is reported", event.offset));
                break;
            }
            Err(why) => undecodable.entry(event.channel.to_string()).or_insert((0, why)).0 += 1,
        }
    }
    progress(Progress { stage: Stage::Read, done: total, total });
    if let Some(first) = health.damaged.first() {
        let (places, bytes) = (health.damaged.len(), health.bytes_skipped());
        notes.push(format!(
            "the log is damaged: {bytes} bytes in {places} places are lost; the first at byte {}: {}",
            first.offset, first.why
        ));
    }
    if let Some(cut) = &health.cut {
        notes.push(format!(
            "the log is cut at byte {}: the last {} bytes are an incomplete message",
            cut.offset, cut.bytes
        ));
    }
    for (channel, (count, why)) in undecodable {
        notes.push(format!("{count} messages on {channel} could not be decoded; the first: {why}"));
    }
    let clock = clock.clock();
    let (stride, events_dropped) = (gathered.thinning.stride, gathered.thinning.events_dropped);
    if stride > 1 {
        notes.push(format!(
            "the log has more than {MAX_TICKS} ticks: every {stride}-th tick is used, contact, timing, qp and clamped torques are left out, and the timeline lists \
             neither losses nor missed deadlines; a part of the log (hoof log trim) is reported with every tick"
        ));
    }
    if events_dropped > 0 {
        notes.push(format!("{events_dropped} EVENTs after the first {MAX_EVENTS} are left out"));
    }
    let (ticks, mut joints, info, events) = gathered.join(clock.first_tick_ns());
    let Some(first_tick_ns) = clock.first_tick_ns().or(ticks.first().map(|tick| tick.t_ns)) else {
        return Err(Error::NothingToReport {
            path: path.to_owned(),
            messages: channels.values().sum(),
            expected: TICK_CHANNELS.join(", "),
        });
    };
    let robot = info.as_ref().and_then(|info| {
        if info.urdf.is_empty() {
            return None;
        }
        let rejected = |error| notes.push(format!("no joint names, torque limits and animation: {error}"));
        Robot::parse(&info.urdf).map_err(rejected).ok()
    });
    let count = joints.in_messages();
    joints.names = robot
        .as_ref()
        .filter(|robot| robot.nj() == count)
        .map(|robot| robot.joint_names().map(str::to_owned).collect())
        .unwrap_or_else(|| (0..count).map(|joint| format!("joint {joint}")).collect());
    let fields = field_reader.finish(first_tick_ns);
    let sha256 = sha256(path)?;
    Ok(Run {
        path: path.to_owned(),
        sha256,
        first_tick_ns,
        info,
        robot,
        events,
        period_ns: period_ns(&ticks),
        ticks,
        stride,
        joints,
        fields,
        channels,
        notes,
    })
}

impl Gathered {
    /// Adds a message; the error is the reason why it cannot be decoded.
    pub fn take(&mut self, channel: &str, data: &[u8]) -> Result<Taken, String> {
        if !self.thinning.takes(channel, data) {
            return Ok(Taken::Yes);
        }
        match channel {
            "RUN_INFO" => {
                let info = decode::<RunInfo>(data)?;
                match &self.info {
                    Some(first) if first.run_id == info.run_id => {}
                    Some(_) if !self.ticks.is_empty() => return Ok(Taken::AnotherRun),
                    // A recording may begin with the RUN_INFO of a run that has ended.
                    _ => self.info = Some(info),
                }
            }
            "EVENT" if self.events.len() < MAX_EVENTS => self.events.push(decode(data)?),
            "EVENT" => self.thinning.events_dropped += 1,
            "BASE_TRACKING" => {
                let m = decode::<BaseTracking>(data)?;
                let tick = self.at(m.t_ns);
                tick.base = Some(m);
            }
            "LEG_STATE" => {
                let m = decode::<LegState>(data)?;
                let tick = self.at(m.t_ns);
                tick.legs = Some(m.into());
            }
            "CONTACT_ESTIMATE" => {
                let m = decode::<ContactEstimate>(data)?;
                let tick = self.at(m.t_ns);
                tick.contact = Contact::of(m);
            }
            "WBC_SOLUTION" => {
                let m = decode::<WbcSolution>(data)?;
                let tick = self.at(m.t_ns);
                tick.wbc = Wbc::of(m);
            }
            "CONTROLLER_TICK" => {
                let m = decode::<ControllerTick>(data)?;
                let tick = self.at(m.t_ns);
                tick.status = Some(m.into());
            }
            "TIMING" => {
                let m = decode::<Timing>(data)?;
                let tick = self.at(m.t_ns);
                tick.timing = Some(m);
            }
            "CONTROLLER_INPUT" => {
                let consumed = decode::<ControllerInput>(data)?;
                let m = self.unpacked.update(&consumed);
                let row = self.joints.measured.push_state(&m.state)?;
                let age_s = m.t_ns.saturating_sub(m.state.t_ns) as f64 / 1e9;
                let found = Consumed { tick: m.tick, seq: m.state.seq, age_s };
                let tick = self.at(consumed.t_ns);
                tick.consumed = Some(found);
                tick.joint_rows[0] = Some(row);
            }
            "CONTROLLER_SNAPSHOT" => self.unpacked.restore(data),
            "ROBOT_COMMAND" => {
                let m = decode::<RobotCommand>(data)?;
                let row = self.joints.commanded.push_command(&m)?;
                self.at(m.t_ns).joint_rows[1] = Some(row);
            }
            // Not used beside CONTROLLER_INPUT.
            "ROBOT_STATE" if self.joints.in_inputs() == 0 => {
                if self.raw.0.len() >= 2 * self.thinning.max_ticks {
                    self.thin_raw();
                }
                let m = decode::<RobotState>(data)?;
                let row = self.raw.1.push_state(&m)?;
                self.raw.0.push((m.t_ns, row));
            }
            "GROUND_TRUTH" => {
                let message = decode::<GroundTruth>(data)?;
                if self.truth.len() >= self.thinning.max_truth {
                    self.thin_truth();
                }
                self.truth.push(Truth::of(&message));
            }
            _ => {}
        }
        Ok(Taken::Yes)
    }

    /// The tick at a time, added if missing.
    fn at(&mut self, t_ns: i64) -> &mut Tick {
        let fresh = || Tick { t_ns, ..Tick::default() };
        if self.ticks.len() >= self.thinning.max_ticks {
            self.thin();
        }
        let last = self.ticks.last().map(|tick| tick.t_ns);
        if last.is_none_or(|last| last < t_ns) {
            self.ticks.push(fresh());
        }
        let end = self.ticks.len() - 1;
        if self.ticks[end].t_ns == t_ns {
            return &mut self.ticks[end];
        }
        match self.ticks.binary_search_by_key(&t_ns, |tick| tick.t_ns) {
            Ok(found) => &mut self.ticks[found],
            Err(_) => {
                self.stray.push(fresh());
                let end = self.stray.len() - 1;
                &mut self.stray[end]
            }
        }
    }

    /// Ticks at the times of all messages of the controller, or at the times of ground truth if there are none. Their `t_s` is relative to `first_tick_ns`,
    /// or to the first of them if it is `None`.
    pub fn join(mut self, first_tick_ns: Option<i64>) -> (Vec<Tick>, Joints, Option<RunInfo>, Vec<lcmtypes::Event>) {
        self.truth.sort_by_key(|m| m.t_ns);
        let mut ticks = self.ticks;
        if ticks.is_empty() && self.stray.is_empty() {
            ticks.extend(self.truth.iter().map(|m| Tick { t_ns: m.t_ns, ..Tick::default() }));
            ticks.dedup_by_key(|tick| tick.t_ns);
        }
        if !self.stray.is_empty() {
            ticks.append(&mut self.stray);
            ticks.sort_by_key(|tick| tick.t_ns);
            ticks.dedup_by(|later, kept| {
                let same = later.t_ns == kept.t_ns;
                if same {
                    kept.absorb(std::mem::take(later));
                }
                same
            });
        }
        let t0_ns = first_tick_ns.or(ticks.first().map(|tick| tick.t_ns)).unwrap_or(0);
        let tolerance_ns = period_ns(&ticks) / 2;
        let consumed = ticks.iter().any(|tick| tick.joint_rows[0].is_some());
        let (mut raw, rows) = self.raw;
        raw.sort_unstable();
        for tick in &mut ticks {
            tick.t_s = tick.t_ns.saturating_sub(t0_ns) as f64 / 1e9;
            tick.truth = nearest(&self.truth, |m| m.t_ns, tick.t_ns, tolerance_ns).cloned();
            if !consumed {
                tick.joint_rows[0] = nearest(&raw, |m| m.0, tick.t_ns, tolerance_ns).map(|&(_, row)| row);
            }
        }
        if !consumed {
            self.joints.measured = rows;
        }
        (ticks, self.joints, self.info, self.events)
    }
}

fn decode<M: Message>(data: &[u8]) -> Result<M, String> {
    M::decode(data).map_err(|e| e.to_string())
}

/// Index of the first message at or after a time, in messages in the order of time.
pub(super) fn first_from<T>(messages: &[T], time: impl Fn(&T) -> i64, t_ns: i64) -> usize {
    messages.partition_point(|m| time(m) < t_ns)
}

/// The message nearest in time, if it is within the tolerance. `messages` are in order of time.
fn nearest<T>(messages: &[T], time: impl Fn(&T) -> i64, t_ns: i64, tolerance_ns: i64) -> Option<&T> {
    let after = first_from(messages, &time, t_ns);
    let candidates = messages.get(after.saturating_sub(1)..)?.iter().take(2);
    let distance = |m: &&T| time(m).abs_diff(t_ns);
    candidates.min_by_key(distance).filter(|m| distance(m) <= tolerance_ns.unsigned_abs())
}

/// Median step between ticks, ns; 0 for fewer than two ticks.
fn period_ns(ticks: &[Tick]) -> i64 {
    let mut steps: Vec<i64> = ticks.windows(2).map(|pair| pair[1].t_ns.saturating_sub(pair[0].t_ns)).collect();
    let middle = steps.len() / 2;
    if steps.is_empty() { 0 } else { *steps.select_nth_unstable(middle).1 }
}

/// SHA-256 of a file.
fn sha256(path: &Path) -> Result<String, Error> {
    let failed = |source| Error::ReadFile { path: path.to_owned(), source };
    let mut file = std::fs::File::open(replay::log::split_run(path).0).map_err(failed)?;
    let (mut hash, mut block) = (Sha256::new(), vec![0; 1 << 16]);
    loop {
        let read = file.read(&mut block).map_err(failed)?;
        if read == 0 {
            break;
        }
        hash.update(&block[..read]);
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}
