//! Tracking errors of the base and the swing feet. Source: Raiola et al. 2020, Table 3.
//!
//! The source does not define whether its mean is that of the error or of the absolute error. Both are reported, and the rms, which is equal for both.

use serde::Serialize;

use super::reference::Reference;
use crate::math::Vec3;
use crate::run::{LEGS, Run, Tick};
use crate::stats::ErrorStats;
use robot_model::math::{log, rotation_of_rpy, wrap_angle};

/// Error = reference − measured, in the ticks of the modes `STANCE` and `WALK`. Angles in rad, lengths in m.
#[derive(Clone, Debug, Serialize)]
pub struct Tracking {
    /// Roll, rad.
    pub roll: Option<ErrorStats>,
    /// Pitch, rad.
    pub pitch: Option<ErrorStats>,
    /// Yaw, wrapped to (-π, π], rad.
    pub yaw: Option<ErrorStats>,
    /// Height of the base above the mean contact point of the stance feet, m.
    pub height: Option<ErrorStats>,
    /// Feet in the order LF RF LH RH; none of a robot that is not a quadruped.
    pub feet: Vec<FootTracking>,
}

/// Error of one foot relative to the base during its swings (states `SWING_UP` and `SWING_DOWN`), in H, m.
#[derive(Clone, Debug, Serialize)]
pub struct FootTracking {
    /// Name of the leg.
    pub leg: &'static str,
    /// Forward.
    pub x: Option<ErrorStats>,
    /// Leftward.
    pub y: Option<ErrorStats>,
    /// Upward.
    pub z: Option<ErrorStats>,
}

impl Tracking {
    pub(super) fn of(run: &Run, against: Reference) -> Self {
        let balancing = || run.ticks.iter().filter(|tick| tick.balances());
        let angle = |k: usize| ErrorStats::of(balancing().filter_map(|tick| rpy_error(tick, against).map(|e| e[k])));
        let foot = |leg: usize| {
            let errors: Vec<Vec3> =
                balancing().filter(|tick| tick.swings(leg)).filter_map(|tick| foot_error(tick, leg, against)).collect();
            let axis = |k: usize| ErrorStats::of(errors.iter().map(|e| e[k]));
            FootTracking { leg: LEGS[leg], x: axis(0), y: axis(1), z: axis(2) }
        };
        Self {
            roll: angle(0),
            pitch: angle(1),
            yaw: angle(2),
            height: ErrorStats::of(balancing().filter_map(|tick| height_error(tick, against))),
            feet: if run.has_feet() { (0..LEGS.len()).map(foot).collect() } else { Vec::new() },
        }
    }
}

/// Angle between reference and measured orientation of the base, rad; `None` in ticks without both.
///
/// ```text
/// e = | log(R_WB,des R_WB,measᵀ) |
/// ```
/// Source: the norm of the orientation error of Raiola et al. 2020, eq. (8).
pub fn orientation_error(tick: &Tick, against: Reference) -> Option<f64> {
    let base = tick.base.as_ref()?;
    let difference = rotation_of_rpy(base.rpy_des) * rotation_of_rpy(measured_rpy(tick, against)?).transpose();
    Some(log(&difference).norm())
}

fn measured_rpy(tick: &Tick, against: Reference) -> Option<Vec3> {
    match against {
        Reference::GroundTruth => Some(tick.truth.as_ref()?.rpy),
        Reference::Estimate => Some(tick.base.as_ref()?.rpy_est),
    }
}

fn rpy_error(tick: &Tick, against: Reference) -> Option<Vec3> {
    let (base, measured) = (tick.base.as_ref()?, measured_rpy(tick, against)?);
    Some(std::array::from_fn(|k| wrap_angle(base.rpy_des[k] - measured[k])))
}

fn height_error(tick: &Tick, against: Reference) -> Option<f64> {
    let base = tick.base.as_ref()?;
    let measured = match against {
        Reference::GroundTruth => tick.true_height()?,
        Reference::Estimate => base.height_est,
    };
    Some(base.height_des - measured)
}

fn foot_error(tick: &Tick, leg: usize, against: Reference) -> Option<Vec3> {
    let legs = tick.legs.as_ref()?;
    let measured = match against {
        Reference::GroundTruth => tick.truth.as_ref()?.p_BF_H(leg),
        Reference::Estimate => legs.p_BF_H_est[leg],
    };
    Some(std::array::from_fn(|k| legs.p_BF_H_des[leg][k] - measured[k]))
}
