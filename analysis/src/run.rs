//! One run as a list of ticks: every message that a figure or a metric is made of, joined by time.
//!
//! Messages of the controller carry the time of their tick and meet on it exactly. Ground truth comes from the simulator's clock;
//! a tick takes the nearest one within half a control period. Whatever is missing is `None`: a log without truth, with a
//! channel filtered out or with gaps is drawn as far as it goes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lcmtypes::{
    BaseTracking, ContactEstimate, ControllerTick, Event, GroundTruth, LegState, Message, RunInfo, Timing, WbcSolution,
};

use crate::math::{Vec3, from_w_to_h, rpy_of_quaternion};
use replay::log::LogReader;

use crate::{Error, Progress, Stage};

/// Names of the legs, in the order of every array of four.
pub const LEGS: [&str; 4] = ["LF", "RF", "LH", "RH"];

/// Channels that a report is made of, one of which a log must hold.
const TICK_CHANNELS: [&str; 7] =
    ["BASE_TRACKING", "LEG_STATE", "CONTACT_ESTIMATE", "CONTROLLER_TICK", "WBC_SOLUTION", "TIMING", "GROUND_TRUTH"];

/// What the simulator knew at a tick; frames and units as in `ground_truth_t`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// Simulation time, ns.
    pub t_ns: i64,
    /// Origin of the base in W, m.
    pub p_WB: Vec3,
    /// Roll, pitch, yaw, rad: `R_WB = Rz(yaw) Ry(pitch) Rx(roll)`.
    pub rpy: Vec3,
    /// Velocity of the base in W, m/s.
    pub v_WB: Vec3,
    /// Angular velocity of the base in W, rad/s.
    pub w_WB_W: Vec3,
    /// Contact point of each foot in W, m.
    pub p_WF: [Vec3; 4],
    /// Force of the ground on each foot in W, N.
    pub f_F_W: [Vec3; 4],
    /// The foot touches the ground.
    pub contact: [bool; 4],
    /// A scenario pushes the base.
    pub pushed: bool,
}

impl Truth {
    /// `None` when the message has fewer than four feet.
    fn of(message: &GroundTruth) -> Option<Self> {
        let four = |v: &[[f64; 3]]| Some([*v.first()?, *v.get(1)?, *v.get(2)?, *v.get(3)?]);
        let contact = &message.contact;
        Some(Self {
            t_ns: message.t_ns,
            p_WB: message.p_WB,
            rpy: rpy_of_quaternion(message.q_WB_wxyz),
            v_WB: message.v_WB,
            w_WB_W: message.w_WB_W,
            p_WF: four(&message.p_WF)?,
            f_F_W: four(&message.f_F_W)?,
            contact: [*contact.first()?, *contact.get(1)?, *contact.get(2)?, *contact.get(3)?],
            pushed: message.f_push_W.iter().chain(&message.tau_push_W).any(|&x| x != 0.0),
        })
    }

    /// Foot relative to the base in H: the base's origin, z up, the base's heading.
    pub fn p_BF_H(&self, leg: usize) -> Vec3 {
        let p_BF_W = std::array::from_fn(|k| self.p_WF[leg][k] - self.p_WB[k]);
        from_w_to_h(self.rpy[2], p_BF_W)
    }
}

/// One control period: whatever the log holds of it.
#[derive(Clone, Debug, Default)]
pub struct Tick {
    /// Time of the tick, controller clock, ns.
    pub t_ns: i64,
    /// Time since the first tick of the run, s.
    pub t_s: f64,
    /// References and estimates of the base.
    pub base: Option<BaseTracking>,
    /// What the simulator knew.
    pub truth: Option<Truth>,
    /// Gait and swing.
    pub legs: Option<LegState>,
    /// Contact estimate.
    pub contact: Option<ContactEstimate>,
    /// The quadratic program's record; its acceleration is left out.
    pub wbc: Option<WbcSolution>,
    /// Mode and fault of the controller.
    pub status: Option<ControllerTick>,
    /// Wall-clock times.
    pub timing: Option<Timing>,
}

impl Tick {
    /// The leg swings along its ellipse (going up or down).
    pub fn swings(&self, leg: usize) -> bool {
        self.legs
            .as_ref()
            .is_some_and(|l| matches!(l.state[leg], LegState::STATE_SWING_UP | LegState::STATE_SWING_DOWN))
    }

    /// The controller commands the leg to stand; `None` when the log does not say.
    pub fn stands(&self, leg: usize) -> Option<bool> {
        self.legs.as_ref().map(|l| l.state[leg] == LegState::STATE_STANCE)
    }

    /// The controller balances: it stands or walks. A log without controller status counts as balancing throughout.
    pub fn balances(&self) -> bool {
        self.status.as_ref().is_none_or(|s| matches!(s.mode, ControllerTick::MODE_STANCE | ControllerTick::MODE_WALK))
    }

    /// True height of the base above the mean contact point of its stance feet, along the vertical, m. Stance is what the controller
    /// commands, or true contact where the log does not say; `None` without truth or without a stance foot.
    pub fn true_height(&self) -> Option<f64> {
        let truth = self.truth.as_ref()?;
        let stance = (0..4).filter(|&leg| self.stands(leg).unwrap_or(truth.contact[leg]));
        let (count, sum) = stance.fold((0_u32, 0.0), |(n, z), leg| (n + 1, z + truth.p_WF[leg][2]));
        (count > 0).then(|| truth.p_WB[2] - sum / f64::from(count))
    }

    /// Normal component of the true force on a foot, N, along the normal that the controller believes in (vertical if it is not logged).
    pub fn true_normal_force(&self, leg: usize) -> Option<f64> {
        let f = self.truth.as_ref()?.f_F_W[leg];
        let n = self.contact.as_ref().map_or([0.0, 0.0, 1.0], |c| c.n_W);
        Some(f[0] * n[0] + f[1] * n[1] + f[2] * n[2])
    }
}

/// A log, read and joined.
#[derive(Clone, Debug)]
pub struct Run {
    /// The log.
    pub path: PathBuf,
    /// What the log says of itself; `None` when it has no RUN_INFO.
    pub info: Option<RunInfo>,
    /// Events in the order of the log.
    pub events: Vec<Event>,
    /// Ticks in the order of time, at least one.
    pub ticks: Vec<Tick>,
    /// Messages per channel, of every channel.
    pub channels: BTreeMap<String, u64>,
    /// Anything a reader should know: damage, messages that could not be read, a second run in the same log.
    pub notes: Vec<String>,
}

/// What became of a message.
enum Taken {
    Yes,
    /// It announces another run: reading stops.
    AnotherRun,
}

/// Messages as they stand in the log.
#[derive(Default)]
struct Messages {
    base: Vec<BaseTracking>,
    truth: Vec<Truth>,
    legs: Vec<LegState>,
    contact: Vec<ContactEstimate>,
    wbc: Vec<WbcSolution>,
    status: Vec<ControllerTick>,
    timing: Vec<Timing>,
}

impl Run {
    /// Reads a log of any format. Damage and undecodable messages become notes, not errors; a log without any channel of
    /// ticks is [`Error::NothingToReport`]. A log of several runs yields the first.
    pub fn read(path: &Path, progress: &mut dyn FnMut(Progress)) -> Result<Self, Error> {
        let log_error = |source| Error::Log { path: path.to_owned(), source };
        let reader = LogReader::open(path).map_err(log_error)?;
        let total = reader.bytes();
        let mut events = reader.events();
        let mut run = Self {
            path: path.to_owned(),
            info: None,
            events: Vec::new(),
            ticks: Vec::new(),
            channels: BTreeMap::new(),
            notes: Vec::new(),
        };
        let mut messages = Messages::default();
        let mut unreadable: BTreeMap<String, (u64, String)> = BTreeMap::new();
        for (number, event) in events.by_ref().enumerate() {
            let event = event.map_err(log_error)?;
            if number.is_multiple_of(4096) {
                progress(Progress { stage: Stage::Read, done: event.offset, total });
            }
            match run.take(&event.channel, &event.data, &mut messages) {
                Ok(Taken::Yes) => *run.channels.entry(event.channel.to_string()).or_default() += 1,
                Ok(Taken::AnotherRun) => {
                    run.notes.push(format!("another run begins at byte {}; only the first is reported", event.offset));
                    break;
                }
                Err(why) => unreadable.entry(event.channel.to_string()).or_insert((0, why)).0 += 1,
            }
        }
        progress(Progress { stage: Stage::Read, done: total, total });
        let health = events.health();
        if let Some(first) = health.damaged.first() {
            let (stretches, bytes) = (health.damaged.len(), health.bytes_skipped());
            run.notes.push(format!(
                "the log is damaged: {bytes} bytes in {stretches} places are lost; the first, at byte {}: {}",
                first.offset, first.why
            ));
        }
        if let Some(cut) = &health.cut {
            run.notes.push(format!(
                "the log is cut at byte {}: its last {} bytes are no whole message",
                cut.offset, cut.bytes
            ));
        }
        for (channel, (count, why)) in unreadable {
            run.notes.push(format!("{count} messages on {channel} could not be read; the first: {why}"));
        }
        run.ticks = join(messages);
        if run.ticks.is_empty() {
            return Err(Error::NothingToReport {
                path: path.to_owned(),
                messages: run.channels.values().sum(),
                expected: TICK_CHANNELS.join(", "),
            });
        }
        Ok(run)
    }

    /// Takes one message in; the error says why it could not be decoded.
    fn take(&mut self, channel: &str, data: &[u8], messages: &mut Messages) -> Result<Taken, String> {
        match channel {
            "RUN_INFO" => {
                let info = decode::<RunInfo>(data)?;
                match &self.info {
                    Some(first) if *first != info => return Ok(Taken::AnotherRun),
                    Some(_) => {}
                    None => self.info = Some(info),
                }
            }
            "EVENT" => self.events.push(decode(data)?),
            "BASE_TRACKING" => messages.base.push(decode(data)?),
            "GROUND_TRUTH" => {
                let message = decode::<GroundTruth>(data)?;
                let n_feet = message.n_feet;
                messages.truth.push(Truth::of(&message).ok_or_else(|| format!("{n_feet} feet, expected 4"))?);
            }
            "LEG_STATE" => messages.legs.push(decode(data)?),
            "CONTACT_ESTIMATE" => messages.contact.push(decode(data)?),
            "WBC_SOLUTION" => messages.wbc.push(WbcSolution { nv: 0, vd: Vec::new(), ..decode(data)? }),
            "CONTROLLER_TICK" => messages.status.push(decode(data)?),
            "TIMING" => messages.timing.push(decode(data)?),
            _ => {}
        }
        Ok(Taken::Yes)
    }

    /// One value a tick, NaN where the log has none.
    pub fn series(&self, value: impl Fn(&Tick) -> Option<f64>) -> Vec<f64> {
        self.ticks.iter().map(|tick| value(tick).unwrap_or(f64::NAN)).collect()
    }

    /// Times of the ticks, s since the first.
    pub fn times(&self) -> Vec<f64> {
        self.ticks.iter().map(|tick| tick.t_s).collect()
    }

    /// Length of the run, s.
    pub fn duration_s(&self) -> f64 {
        self.ticks.last().map_or(0.0, |tick| tick.t_s)
    }

    /// Median time between ticks, s; 0 for a single tick.
    pub fn period_s(&self) -> f64 {
        period_ns(&self.ticks.iter().map(|tick| tick.t_ns).collect::<Vec<_>>()) as f64 / 1e9
    }

    /// At least one message of the channel was read.
    pub fn has(&self, channel: &str) -> bool {
        self.channels.contains_key(channel)
    }

    /// Channels of a full report that this log does not hold.
    pub fn missing(&self) -> Vec<&'static str> {
        ["RUN_INFO"].into_iter().chain(TICK_CHANNELS).filter(|channel| !self.has(channel)).collect()
    }
}

fn decode<M: Message>(data: &[u8]) -> Result<M, String> {
    M::decode(data).map_err(|e| e.to_string())
}

/// Ticks at every time that a message of the controller carries, or at the times of truth when there is none.
fn join(mut messages: Messages) -> Vec<Tick> {
    messages.truth.sort_by_key(|m| m.t_ns);
    let mut times: Vec<i64> = Vec::new();
    times.extend(messages.base.iter().map(|m| m.t_ns));
    times.extend(messages.legs.iter().map(|m| m.t_ns));
    times.extend(messages.contact.iter().map(|m| m.t_ns));
    times.extend(messages.wbc.iter().map(|m| m.t_ns));
    times.extend(messages.status.iter().map(|m| m.t_ns));
    times.extend(messages.timing.iter().map(|m| m.t_ns));
    if times.is_empty() {
        times.extend(messages.truth.iter().map(|m| m.t_ns));
    }
    times.sort_unstable();
    times.dedup();
    let Some(&t0_ns) = times.first() else { return Vec::new() };
    let tolerance_ns = period_ns(&times) / 2;
    let mut ticks: Vec<Tick> =
        times.iter().map(|&t_ns| Tick { t_ns, t_s: (t_ns - t0_ns) as f64 / 1e9, ..Tick::default() }).collect();

    let tick_at = |t_ns: i64| times.binary_search(&t_ns).expect("the grid holds the time of every message");
    for m in messages.base {
        let at = tick_at(m.t_ns);
        ticks[at].base = Some(m);
    }
    for m in messages.legs {
        let at = tick_at(m.t_ns);
        ticks[at].legs = Some(m);
    }
    for m in messages.contact {
        let at = tick_at(m.t_ns);
        ticks[at].contact = Some(m);
    }
    for m in messages.wbc {
        let at = tick_at(m.t_ns);
        ticks[at].wbc = Some(m);
    }
    for m in messages.status {
        let at = tick_at(m.t_ns);
        ticks[at].status = Some(m);
    }
    for m in messages.timing {
        let at = tick_at(m.t_ns);
        ticks[at].timing = Some(m);
    }
    for tick in &mut ticks {
        tick.truth = nearest(&messages.truth, tick.t_ns, tolerance_ns).cloned();
    }
    ticks
}

/// The truth nearest in time, if it is within the tolerance; `truth` is in order of time.
fn nearest(truth: &[Truth], t_ns: i64, tolerance_ns: i64) -> Option<&Truth> {
    let after = truth.partition_point(|m| m.t_ns < t_ns);
    let candidates = truth.get(after.saturating_sub(1)..)?.iter().take(2);
    let distance = |m: &&Truth| m.t_ns.abs_diff(t_ns);
    candidates.min_by_key(distance).filter(|m| distance(m) <= tolerance_ns.unsigned_abs())
}

/// Median step of sorted times, ns; 0 for fewer than two.
fn period_ns(times: &[i64]) -> i64 {
    let mut steps: Vec<i64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = steps.len() / 2;
    if steps.is_empty() { 0 } else { *steps.select_nth_unstable(middle).1 }
}
