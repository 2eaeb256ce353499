//! One run as a list of ticks: the messages that figures and metrics use, joined by time.
//!
//! Messages of the controller have the time of their tick, which joins them exactly. Ground truth has the time of the simulator: a tick uses the nearest
//! message within half a control period. Missing messages are `None`, so logs without ground truth, with fewer channels or with gaps are usable.

mod joints;
mod read;
mod thin;
mod tick;

use controller::quadruped::params::GaitParams;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use lcmtypes::{Event, RunInfo};

pub use joints::{JointSample, Joints};
pub use tick::{Consumed, Contact, Legs, Status, Tick, Truth, Wbc};

use crate::fields::{Field, Samples};
use crate::robot::Robot;
use crate::{Error, Progress};

pub use lcmtypes::enum_names::LEGS;

/// Channels that a report uses. A log must have at least one of them.
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

/// A log, decoded and joined.
#[derive(Clone, Debug)]
pub struct Run {
    /// Path of the log.
    pub path: PathBuf,
    /// SHA-256 of the file in hexadecimal digits, as printed by `sha256sum`.
    pub sha256: String,
    /// Time zero of all `t_s`: `t_ns` of the first tick of the run, or of the first tick in the log if that is unknown.
    pub first_tick_ns: i64,
    /// RUN_INFO; `None` if the log has none.
    pub info: Option<RunInfo>,
    /// The robot, from the URDF in RUN_INFO; `None` without RUN_INFO, or if the model rejects the URDF: then a note gives the reason.
    pub robot: Option<Robot>,
    /// Events in the order of the log.
    pub events: Vec<Event>,
    /// Ticks in the order of time, at least one. Of a long log every [`Run::stride`]-th, and those in which mode or fault change.
    pub ticks: Vec<Tick>,
    /// Numbers of the ticks are multiples of this; 1 if all ticks are read. A power of two.
    pub stride: i64,
    /// Median time between ticks, ns; computed once, because figures ask for it at every tick.
    period_ns: i64,
    /// Joint signals of the ticks.
    pub joints: Joints,
    /// Time series of the requested fields, by name such as `ROBOT_STATE.q[3]`.
    pub fields: BTreeMap<String, Samples>,
    /// Number of messages of each channel.
    pub channels: BTreeMap<String, u64>,
    /// Remarks: damage, messages that could not be decoded, a rejected URDF, a second run in the same log.
    pub notes: Vec<String>,
}

impl Run {
    /// Reads a log of any format. Damage and messages that cannot be decoded become notes. Of a log with several runs, the first is read.
    ///
    /// # Errors
    /// [`Error::Log`] or [`Error::ReadFile`] if the log cannot be read, [`Error::NothingToReport`] if it has none of [`TICK_CHANNELS`].
    pub fn read(path: &Path, progress: &mut dyn FnMut(Progress)) -> Result<Self, Error> {
        Self::read_with(path, &[], progress)
    }

    /// As [`Run::read`], with time series of `fields`.
    ///
    /// # Errors
    /// As [`Run::read`].
    pub fn read_with(path: &Path, fields: &[Field], progress: &mut dyn FnMut(Progress)) -> Result<Self, Error> {
        read::read(path, fields, progress)
    }

    /// Whether only a part of the ticks is read: then no metric counts ticks.
    pub fn is_thinned(&self) -> bool {
        self.stride > 1
    }

    /// File name of the log, without its folder.
    pub fn name(&self) -> String {
        self.path.file_name().map_or_else(|| self.path.display().to_string(), |n| n.to_string_lossy().into_owned())
    }

    /// One value per tick; NaN if the log has none.
    pub fn series(&self, value: impl Fn(&Tick) -> Option<f64>) -> Vec<f64> {
        self.ticks.iter().map(|tick| value(tick).unwrap_or(f64::NAN)).collect()
    }

    /// Times of the ticks, s since the first tick of the run.
    pub fn times(&self) -> Vec<f64> {
        self.ticks.iter().map(|tick| tick.t_s).collect()
    }

    /// Time of the first tick in the log, s since the first tick of the run; 0 unless the log starts later.
    pub fn begin_s(&self) -> f64 {
        self.ticks.first().map_or(0.0, |tick| tick.t_s)
    }

    /// Time of the last tick in the log, s since the first tick of the run.
    pub fn end_s(&self) -> f64 {
        self.ticks.last().map_or(0.0, |tick| tick.t_s)
    }

    /// Time from the first to the last tick in the log, s.
    pub fn duration_s(&self) -> f64 {
        self.end_s() - self.begin_s()
    }

    /// Median time between ticks, s; 0 for one tick.
    pub fn period_s(&self) -> f64 {
        self.period_ns as f64 / 1e9
    }

    /// True if the log has a message on the channel.
    pub fn has(&self, channel: &str) -> bool {
        self.channels.contains_key(channel)
    }

    /// Channels of a full report that are not in the log.
    pub fn missing(&self) -> Vec<&'static str> {
        ["RUN_INFO"].into_iter().chain(TICK_CHANNELS).filter(|channel| !self.has(channel)).collect()
    }

    /// The gaits in the parameters of RUN_INFO; without valid ones, the default gaits.
    pub fn gaits(&self) -> GaitParams {
        let read = || {
            let table: toml::Table = self.info.as_ref()?.params().parse().ok()?;
            let gaits: GaitParams = table.get("gait")?.clone().try_into().ok()?;
            gaits.check().ok().map(|()| gaits)
        };
        read().unwrap_or_default()
    }

    /// Whether the robot is a quadruped: its parameters have `robot.feet`. True for a log without RUN_INFO.
    pub fn has_feet(&self) -> bool {
        self.robot_table().is_none_or(|robot| robot.contains_key("feet"))
    }

    /// Whether the base of the robot is fixed to the world.
    pub fn has_fixed_base(&self) -> bool {
        let base = self.robot_table().and_then(|robot| Some(robot.get("base")?.as_str()? == "fixed"));
        base.unwrap_or(false)
    }

    fn robot_table(&self) -> Option<toml::Table> {
        let mut table: toml::Table = self.info.as_ref()?.params().parse().ok()?;
        match table.remove("robot")? {
            toml::Value::Table(robot) => Some(robot),
            _ => None,
        }
    }

    /// A number in the parameters of RUN_INFO, by dotted key.
    pub fn parameter(&self, key: &str) -> Option<f64> {
        let table: toml::Table = self.info.as_ref()?.params().parse().ok()?;
        let mut parts = key.split('.');
        let first = table.get(parts.next()?)?;
        let value = parts.try_fold(first, |value, part| value.get(part))?;
        value.as_float().or_else(|| value.as_integer().map(|n| n as f64))
    }
}
