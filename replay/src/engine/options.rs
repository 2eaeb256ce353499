//! Options of a replay.

use super::{Build, TimedOverride};
use controller::{Component, LoadError};
use lcmtypes::RunInfo;
use std::path::PathBuf;

/// Options of a replay.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Parameter overrides for the whole replay: dotted key and TOML value.
    pub set: Vec<(String, String)>,
    /// Parameter overrides from a tick or time on, in the order of time.
    pub timed_overrides: Vec<TimedOverride>,
    /// Text of another URDF; it must have the joints of the log's URDF.
    pub urdf: Option<String>,
    /// Largest torque difference of a joint for which a what-if replay is valid, N m; default [`DEFAULT_BOUND`](super::DEFAULT_BOUND).
    pub bound: Option<f64>,
    /// This build, to compare with the build that wrote the log.
    pub here: Option<Build>,
    /// Start after the last snapshot before this time, s since the run's first tick.
    pub from_s: Option<f64>,
    /// Stop after the last tick at or before this time, s since the run's first tick.
    pub to_s: Option<f64>,
    /// Number of threads; 0 and 1 use the calling thread. The report does not depend on it. Overrides and `out` use one thread.
    pub jobs: usize,
    /// Write a copy of the log with the replayed outputs instead of the recorded ones.
    pub out: Option<PathBuf>,
}

impl Options {
    /// Whether parameters or robot differ from the log.
    pub fn is_what_if(&self) -> bool {
        !self.set.is_empty() || !self.timed_overrides.is_empty() || self.urdf.is_some()
    }
}

/// Builds a controller from a run's description.
pub type Load<'a> = dyn Fn(&RunInfo) -> Result<Component, LoadError> + Sync + 'a;
