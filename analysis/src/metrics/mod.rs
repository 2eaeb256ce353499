//! Metrics of a run, computed from the log alone: the content of `metrics.json`.
//!
//! The structure is stable: keys are only added, and a changed meaning increments [`Metrics::schema`]. Units are in the keys, or in the documentation of the
//! structure. A quantity that cannot be computed from the log is `null`.

mod contact;
mod energy;
mod locomotion;
mod reference;
mod slip;
mod timing;
mod tracking;

use serde::Serialize;

pub(crate) use contact::touchdown_delays_ms;
pub use contact::{ContactMetrics, LegContact, Touchdowns};
pub use energy::{Energy, JointMetrics};
pub(crate) use energy::{joint_powers, torque_use};
pub use locomotion::{Fault, Locomotion, Safety};
pub use reference::Reference;
pub use slip::FootSlip;
pub use timing::{Qp, QpStatus, StageTime, TimingMetrics};
pub(crate) use timing::{period_us, qp_stage, skipped, stage_us, tick_us};
pub use tracking::{FootTracking, Tracking, orientation_error};

use crate::run::{Run, TICK_CHANNELS};

/// All metrics of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Metrics {
    /// Version of this structure: 2. In version 1, `locomotion.distance_m` was what is now `displacement_m`.
    pub schema: u32,
    /// Robot, controller, build and length of the run.
    pub run: RunSummary,
    /// Signal that errors are computed against.
    pub measured_against: Reference,
    /// Channels of a full report that are not in the log.
    pub missing_channels: Vec<&'static str>,
    /// Remarks on the log: damage, messages that could not be decoded, further runs.
    pub notes: Vec<String>,
    /// Tracking errors of the base and the swing feet.
    pub tracking: Tracking,
    /// Estimated and true contact; `null` without ground truth or without estimate, and for a log of which only a part of the ticks is used.
    pub contact: Option<ContactMetrics>,
    /// Speeds and distance.
    pub locomotion: Locomotion,
    /// Falls, faults and limits reached.
    pub safety: Safety,
    /// Torque, power and tracking of joints; `null` without joint states.
    pub energy: Option<Energy>,
    /// Slip of the feet, in the order LF RF LH RH; `null` without ground truth, and for a robot that is not a quadruped.
    pub slip: Option<[FootSlip; 4]>,
    /// Durations of the ticks; `null` without TIMING, and for a log of which only a part of the ticks is used.
    pub timing: Option<TimingMetrics>,
    /// The quadratic program; `null` without WBC_SOLUTION, and for a log of which only a part of the ticks is used.
    pub qp: Option<Qp>,
}

/// Content of RUN_INFO, and length of the run. Texts are empty if the log has no RUN_INFO.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunSummary {
    /// SHA-256 of the log.
    pub log_sha256: String,
    /// Robot.
    pub robot: String,
    /// The robot is a quadruped: contacts, swing feet and gaits have their rows.
    pub quadruped: bool,
    /// Controller.
    pub controller: String,
    /// Scenario.
    pub scenario: String,
    /// Seed of terrain and noise.
    pub seed: i64,
    /// Git commit of the build.
    pub revision: String,
    /// The working tree of the build had uncommitted changes.
    pub dirty: bool,
    /// Compiler.
    pub toolchain: String,
    /// Profile and target.
    pub build: String,
    /// Host, kernel, CPU.
    pub host: String,
    /// Real-time settings of the loop.
    pub realtime: String,
    /// Ticks in the log.
    pub ticks: u64,
    /// Time from first to last tick, s.
    pub duration_s: f64,
    /// Median time between ticks, s.
    pub period_s: f64,
}

impl Metrics {
    /// Computes the metrics of a run.
    pub fn of(run: &Run) -> Self {
        let measured_against = Reference::of(run);
        Self {
            schema: 2,
            run: summary(run),
            measured_against,
            missing_channels: run.missing(),
            notes: run.notes.clone(),
            tracking: Tracking::of(run, measured_against),
            contact: if run.is_thinned() || !run.has_feet() { None } else { ContactMetrics::of(run) },
            locomotion: Locomotion::of(run, measured_against),
            safety: Safety::of(run, measured_against),
            energy: Energy::of(run),
            slip: if run.has_feet() { slip::of(run) } else { None },
            timing: if run.is_thinned() { None } else { TimingMetrics::of(run) },
            qp: if run.is_thinned() { None } else { Qp::of(run) },
        }
    }

    /// The structure as indented JSON, ending in a newline.
    pub fn to_json(&self) -> String {
        let text = serde_json::to_string_pretty(self).expect("a structure of numbers, texts and lists is always JSON");
        text + "\n"
    }
}

fn summary(run: &Run) -> RunSummary {
    let info = run.info.clone().unwrap_or_default();
    RunSummary {
        log_sha256: run.sha256.clone(),
        robot: info.robot.clone(),
        quadruped: run.has_feet(),
        controller: info.controller().to_owned(),
        scenario: info.scenario_name,
        seed: info.seed,
        revision: info.revision,
        dirty: info.dirty,
        toolchain: info.toolchain,
        build: info.build,
        host: info.host,
        realtime: info.realtime,
        ticks: if run.is_thinned() {
            TICK_CHANNELS.iter().filter_map(|channel| run.channels.get(*channel)).max().copied().unwrap_or(0)
        } else {
            run.ticks.len() as u64
        },
        duration_s: run.duration_s(),
        period_s: run.period_s(),
    }
}
