//! One run as a list of ticks: every message that a figure or a metric is made of, joined by time.
//!
//! Messages of the controller carry the time of their tick and meet on it exactly. Ground truth comes from the simulator's clock;
//! a tick takes the nearest one within half a control period. Whatever is missing is `None`: a log without truth, with a
//! channel filtered out or with gaps is drawn as far as it goes.

mod joints;
mod read;
mod tick;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lcmtypes::{Event, RunInfo};

pub use joints::{JointSample, Joints};
pub use tick::{Consumed, Contact, Legs, Status, Tick, Truth, Wbc};

use crate::fields::{Field, Samples};
use crate::robot::Robot;
use crate::{Error, Progress};

pub use lcmtypes::enum_names::LEGS;

/// Channels that a report is made of, one of which a log must hold.
pub const TICK_CHANNELS: [&str; 9] = [
    "BASE_TRACKING",
    "LEG_STATE",
    "CONTACT_ESTIMATE",
    "CONTROLLER_TICK",
    "CONTROLLER_INPUT",
    "ROBOT_COMMAND",
    "WBC_SOLUTION",
    "TIMING",
    "GROUND_TRUTH",
];

/// A log, read and joined.
#[derive(Clone, Debug)]
pub struct Run {
    /// The log.
    pub path: PathBuf,
    /// SHA-256 of the log's bytes, in hexadecimal digits, as `sha256sum` prints it.
    pub sha256: String,
    /// Time zero of all `t_s`: `t_ns` of the run's first tick, or of the first in the log where the run's is unknown.
    pub first_tick_ns: i64,
    /// What the log says of itself; `None` when it has no RUN_INFO.
    pub info: Option<RunInfo>,
    /// The robot, from the URDF in RUN_INFO; `None` without RUN_INFO, or if the model rejects the URDF: then a note gives the reason.
    pub robot: Option<Robot>,
    /// Events in the order of the log.
    pub events: Vec<Event>,
    /// Ticks in the order of time, at least one.
    pub ticks: Vec<Tick>,
    /// Joint signals of the ticks.
    pub joints: Joints,
    /// Fields that were asked for, by their texts such as `ROBOT_STATE.q[3]`.
    pub fields: BTreeMap<String, Samples>,
    /// Messages per channel, of every channel.
    pub channels: BTreeMap<String, u64>,
    /// Anything a reader should know: damage, messages that could not be read, a second run in the same log.
    pub notes: Vec<String>,
}

impl Run {
    /// Reads a log of any format. Damage and undecodable messages become notes, not errors; a log without any channel of
    /// ticks is [`Error::NothingToReport`]. A log of several runs yields the first.
    pub fn read(path: &Path, progress: &mut dyn FnMut(Progress)) -> Result<Self, Error> {
        Self::read_with(path, &[], progress)
    }

    /// As [`Run::read`], with samples of some fields of any channels.
    pub fn read_with(path: &Path, fields: &[Field], progress: &mut dyn FnMut(Progress)) -> Result<Self, Error> {
        read::read(path, fields, progress)
    }

    /// Name of the log's file, without its folder.
    pub fn name(&self) -> String {
        self.path.file_name().map_or_else(|| self.path.display().to_string(), |n| n.to_string_lossy().into_owned())
    }

    /// One value a tick, NaN where the log has none.
    pub fn series(&self, value: impl Fn(&Tick) -> Option<f64>) -> Vec<f64> {
        self.ticks.iter().map(|tick| value(tick).unwrap_or(f64::NAN)).collect()
    }

    /// Times of the ticks, s since the run's first tick.
    pub fn times(&self) -> Vec<f64> {
        self.ticks.iter().map(|tick| tick.t_s).collect()
    }

    /// Time of the first tick in the log, s since the run's first tick: 0 unless the log begins later.
    pub fn begin_s(&self) -> f64 {
        self.ticks.first().map_or(0.0, |tick| tick.t_s)
    }

    /// Time of the last tick in the log, s since the run's first tick.
    pub fn end_s(&self) -> f64 {
        self.ticks.last().map_or(0.0, |tick| tick.t_s)
    }

    /// Time from the first to the last tick in the log, s.
    pub fn duration_s(&self) -> f64 {
        self.end_s() - self.begin_s()
    }

    /// Median time between ticks, s; 0 for a single tick.
    pub fn period_s(&self) -> f64 {
        read::period_ns(&self.ticks) as f64 / 1e9
    }

    /// At least one message of the channel was read.
    pub fn has(&self, channel: &str) -> bool {
        self.channels.contains_key(channel)
    }

    /// Channels of a full report that this log does not hold.
    pub fn missing(&self) -> Vec<&'static str> {
        ["RUN_INFO"].into_iter().chain(TICK_CHANNELS).filter(|channel| !self.has(channel)).collect()
    }

    /// A number in the parameters of RUN_INFO, by its dotted key.
    pub fn parameter(&self, key: &str) -> Option<f64> {
        let table: toml::Table = self.info.as_ref()?.params.parse().ok()?;
        let mut parts = key.split('.');
        let first = table.get(parts.next()?)?;
        let value = parts.try_fold(first, |value, part| value.get(part))?;
        value.as_float().or_else(|| value.as_integer().map(|n| n as f64))
    }
}
