//! Torque, mechanical power and tracking errors of the joints, from measured torque and velocity.

use serde::Serialize;

use crate::robot::Robot;
use crate::run::{Run, Tick};
use crate::stats::ErrorStats;

/// Standard gravity, m/s².
const G: f64 = 9.806_65;

/// Mechanical power and work of all joints, and metrics of each joint.
#[derive(Clone, Debug, Serialize)]
pub struct Energy {
    /// Mean over time of `Σ τ q̇`, W.
    pub mean_power_w: f64,
    /// Mean over time of `Σ max(τ q̇, 0)`, W.
    pub mean_positive_power_w: f64,
    /// Time integral of `Σ max(τ q̇, 0)`, J.
    pub positive_work_j: f64,
    /// Cost of transport: positive work divided by `m g` times `Locomotion::path_m`. `null` without ground truth, without a URDF, or
    /// if the path is not longer than 0.5 m.
    pub cost_of_transport: Option<f64>,
    /// Largest ratio of torque to torque limit of any joint; `null` without limits in the URDF.
    pub max_torque_use: Option<f64>,
    /// Joints in the order of the URDF.
    pub joints: Vec<JointMetrics>,
}

/// One joint.
#[derive(Clone, Debug, Serialize)]
pub struct JointMetrics {
    /// Name.
    pub joint: String,
    /// Commanded − measured position, rad or m.
    pub position: Option<ErrorStats>,
    /// Commanded − measured velocity, rad/s or m/s.
    pub velocity: Option<ErrorStats>,
    /// Measured torque, N m or N, as statistics of the deviation from zero.
    pub torque: Option<ErrorStats>,
}

impl Energy {
    pub(super) fn of(run: &Run) -> Option<Self> {
        let powers: Vec<(f64, f64)> = run
            .ticks
            .iter()
            .filter_map(|tick| {
                let powers = joint_powers(run, tick)?;
                Some(powers.fold((0.0, 0.0), |(all, positive), p| (all + p, positive + p.max(0.0))))
            })
            .collect();
        if powers.is_empty() {
            return None;
        }
        let n = powers.len() as f64;
        let mean_positive_power_w = powers.iter().map(|p| p.1).sum::<f64>() / n;
        let positive_work_j = mean_positive_power_w * n * run.period_s();
        let mass_kg = run.robot.as_ref().map(Robot::mass_kg).filter(|&m| m > 0.0);
        let path_m = super::Locomotion::path_m(run).filter(|&m| m > 0.5);
        let joint = |k: usize| {
            let difference =
                |of: fn(crate::run::JointSample) -> f64| {
                    ErrorStats::of(run.ticks.iter().filter_map(|tick| {
                        Some(of(run.joints.commanded(tick, k)?) - of(run.joints.measured(tick, k)?))
                    }))
                };
            let torque = run.ticks.iter().filter_map(|tick| run.joints.measured(tick, k).map(|s| s.tau));
            JointMetrics {
                joint: run.joints.names[k].clone(),
                position: difference(|s| s.q),
                velocity: difference(|s| s.qd),
                torque: ErrorStats::of(torque),
            }
        };
        Some(Self {
            mean_power_w: powers.iter().map(|p| p.0).sum::<f64>() / n,
            mean_positive_power_w,
            positive_work_j,
            cost_of_transport: mass_kg.zip(path_m).map(|(m, d)| positive_work_j / (m * G * d)),
            max_torque_use: run.ticks.iter().filter_map(|tick| torque_use(run, tick)).reduce(f64::max),
            joints: (0..run.joints.count()).map(joint).collect(),
        })
    }
}

/// `τ q̇` of each joint at a tick, W; `None` without a measurement.
pub(crate) fn joint_powers<'a>(run: &'a Run, tick: &'a Tick) -> Option<impl Iterator<Item = f64> + 'a> {
    run.joints.measured(tick, 0)?;
    Some((0..run.joints.count()).filter_map(|joint| run.joints.measured(tick, joint).map(|s| s.tau * s.qd)))
}

/// Largest ratio of torque to torque limit of any joint at a tick; `None` without a measurement or limits.
pub(crate) fn torque_use(run: &Run, tick: &Tick) -> Option<f64> {
    let robot = run.robot.as_ref().filter(|robot| robot.nj() == run.joints.count())?;
    let shares = (0..robot.nj()).filter_map(|k| Some(run.joints.measured(tick, k)?.tau.abs() / robot.effort(k)?));
    shares.reduce(f64::max)
}
