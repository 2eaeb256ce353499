//! Speed, distance walked, falls and faults.

use lcm_idl::ast::ConstantValue;
use lcmtypes::{ControllerTick, Message};
use serde::Serialize;

use super::reference::Reference;
use crate::math::from_w_to_h;
use crate::run::{Run, Tick};
use robot_model::math::WalkedDistance;

/// Roll or pitch above which a robot counts as fallen, rad.
const FALLEN_TILT: f64 = 0.6;
/// Fraction of the first height reference below which it counts as fallen.
const FALLEN_HEIGHT_SHARE: f64 = 0.5;
/// Height below which it counts as fallen if the log has no height reference, m.
const FALLEN_HEIGHT: f64 = 0.3;

/// Speeds in walking mode, and distance walked. Without ground truth, only the commands are known.
#[derive(Clone, Debug, Serialize)]
pub struct Locomotion {
    /// Time in walking mode, s.
    pub walking_s: f64,
    /// Mean commanded velocity in H (forward, leftward), m/s.
    pub commanded_velocity: Option<[f64; 2]>,
    /// Mean true velocity in H over the same ticks, m/s.
    pub true_velocity: Option<[f64; 2]>,
    /// Mean commanded yaw rate, rad/s.
    pub commanded_yaw_rate: Option<f64>,
    /// Mean true yaw rate over the same ticks, rad/s.
    pub true_yaw_rate: Option<f64>,
    /// Distance walked, m: horizontal length of the true path of the base, sampled once per second; see [`WalkedDistance`].
    pub distance_m: Option<f64>,
    /// Horizontal distance from the first to the last true position of the base, m.
    pub displacement_m: Option<f64>,
    /// Horizontal length of the true path of the base with every tick, body sway included, m.
    pub path_m: Option<f64>,
}

/// Falls, faults and limits reached.
#[derive(Clone, Debug, Serialize)]
pub struct Safety {
    /// The robot fell: roll or pitch above 0.6 rad in any mode except `IDLE`, or the base below half of its first height reference in the modes `STANCE` and
    /// `WALK`. In the other modes the base may be low. A robot that is not a quadruped has no height reference: half of its first height. A fixed base
    /// does not fall.
    pub fell: bool,
    /// Time of the fall, s since the first tick.
    pub fell_at_s: Option<f64>,
    /// Lowest height of the base above the mean of all four feet (ground truth) or above the stance feet (estimate), m. Of a robot that is not a
    /// quadruped: above its lowest contact.
    pub min_height_m: Option<f64>,
    /// Largest absolute roll or pitch, rad.
    pub max_tilt_rad: Option<f64>,
    /// Faults that the controller entered, in order of time.
    pub faults: Vec<Fault>,
    /// Ticks in which at least one torque was clamped after the solve.
    pub clamped_ticks: Option<u64>,
    /// Clamped torques, summed over joints and ticks.
    pub clamped_torques: Option<u64>,
}

/// A fault of the controller, as in `controller_tick_t`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fault {
    /// Time, s since the first tick.
    pub t_s: f64,
    /// Number of the tick.
    pub tick: i64,
    /// Name of the fault: the constant of `controller_tick_t` without its prefix, such as "state stale".
    pub fault: String,
    /// Index of joint, leg or row; -1: none.
    pub index: i32,
    /// Value that violated the check.
    pub value: f64,
}

impl Locomotion {
    pub(super) fn of(run: &Run, against: Reference) -> Self {
        let walking = || run.ticks.iter().filter(|tick| walks(tick));
        let commanded = |k: usize| mean(walking().filter_map(|t| t.base.as_ref().map(|b| b.v_H_des[k])));
        let measured =
            |k: usize| mean(walking().filter_map(|t| t.truth.as_ref().map(|w| from_w_to_h(w.rpy[2], w.v_WB)[k])));
        let positions: Vec<_> = run.ticks.iter().filter_map(|t| t.truth.as_ref().map(|w| (t.t_ns, w.p_WB))).collect();
        let mut walked = WalkedDistance::default();
        positions.iter().for_each(|&(t_ns, p_WB)| walked.add(t_ns, p_WB));
        Self {
            walking_s: walking().count() as f64 * run.period_s(),
            commanded_velocity: commanded(0).zip(commanded(1)).map(|(x, y)| [x, y]),
            true_velocity: measured(0).zip(measured(1)).map(|(x, y)| [x, y]),
            commanded_yaw_rate: mean(walking().filter_map(|t| t.base.as_ref().map(|b| b.yaw_rate_des))),
            true_yaw_rate: mean(walking().filter_map(|t| t.truth.as_ref().map(|w| w.w_WB_W[2]))),
            distance_m: walked.get(),
            displacement_m: positions.first().zip(positions.last()).map(|((_, a), (_, b))| horizontal_distance(a, b)),
            path_m: if against == Reference::GroundTruth { Self::path_m(run) } else { None },
        }
    }

    /// Horizontal length of the true path of the base with every tick, m; `None` without ground truth.
    pub(super) fn path_m(run: &Run) -> Option<f64> {
        let mut positions = run.ticks.iter().filter_map(|t| t.truth.as_ref().map(|w| w.p_WB));
        let mut last = positions.next()?;
        Some(positions.fold(0.0, |way, p| {
            let step = horizontal_distance(&last, &p);
            last = p;
            way + step
        }))
    }
}

/// Horizontal distance of two points, m.
fn horizontal_distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

impl Safety {
    /// Falls, faults and limits of a run.
    pub fn of_run(run: &Run) -> Self {
        Self::of(run, Reference::of(run))
    }

    pub(super) fn of(run: &Run, against: Reference) -> Self {
        let mut references = run.ticks.iter().filter_map(|tick| tick.base.as_ref().map(|b| b.height_des));
        let has_feet = run.has_feet();
        let postures: Vec<(&Tick, f64, f64)> = run
            .ticks
            .iter()
            .filter_map(|tick| posture(tick, against, has_feet).map(|(tilt, height)| (tick, tilt, height)))
            .collect();
        let first = if has_feet { references.find(|&h| h > 0.0) } else { postures.first().map(|posture| posture.2) };
        let floor = first.map_or(FALLEN_HEIGHT, |height| FALLEN_HEIGHT_SHARE * height);
        let is_fixed = run.has_fixed_base();
        let is_idle = |tick: &Tick| tick.status.is_some_and(|s| s.mode == ControllerTick::MODE_IDLE);
        let fallen = |(tick, tilt, height): &&(&Tick, f64, f64)| {
            !is_fixed && (!is_idle(tick) && *tilt > FALLEN_TILT || tick.balances() && *height < floor)
        };
        let fell_at_s = postures.iter().find(fallen).map(|(tick, ..)| tick.t_s);
        let clamps: Vec<u64> = run
            .ticks
            .iter()
            .filter_map(|tick| tick.wbc.as_ref().map(|w| u64::try_from(w.n_clamped).unwrap_or(0)))
            .collect();
        let logged = !clamps.is_empty() && !run.is_thinned();
        Self {
            fell: fell_at_s.is_some(),
            fell_at_s,
            min_height_m: postures
                .iter()
                .map(|p| p.2)
                .reduce(f64::min)
                .filter(|height| height.is_finite() && !is_fixed),
            max_tilt_rad: postures.iter().map(|p| p.1).reduce(f64::max),
            faults: faults(run),
            clamped_ticks: logged.then(|| clamps.iter().filter(|&&n| n > 0).count() as u64),
            clamped_torques: logged.then(|| clamps.iter().sum()),
        }
    }
}

/// Tilt (rad) and height (m) of the base. The height of a quadruped is above all four feet, because a robot that lies on its belly may have no stance
/// foot; that of another robot is above its lowest contact.
fn posture(tick: &Tick, against: Reference, has_feet: bool) -> Option<(f64, f64)> {
    let (rpy, height) = match against {
        Reference::GroundTruth => {
            let truth = tick.truth.as_ref()?;
            let heights = truth.p_WF.iter().map(|p| p[2]);
            let ground = if has_feet {
                heights.sum::<f64>() / 4.0
            } else {
                // Contacts that the robot does not have are at NaN. Without any, the height is that in W.
                heights.filter(|z| z.is_finite()).reduce(f64::min).unwrap_or(0.0)
            };
            (truth.rpy, truth.p_WB[2] - ground)
        }
        Reference::Estimate => {
            let base = tick.base.as_ref()?;
            (base.rpy_est, base.height_est)
        }
    };
    Some((rpy[0].abs().max(rpy[1].abs()), height))
}

fn walks(tick: &Tick) -> bool {
    tick.status.as_ref().is_some_and(|s| s.mode == ControllerTick::MODE_WALK)
}

fn mean(samples: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = samples.fold((0_u64, 0.0), |(n, sum), x| (n + 1, sum + x));
    (count > 0).then(|| sum / count as f64)
}

/// Every change of the fault code to a fault.
fn faults(run: &Run) -> Vec<Fault> {
    let mut last = ControllerTick::FAULT_NONE;
    let mut faults = Vec::new();
    for tick in &run.ticks {
        let Some(status) = &tick.status else { continue };
        if status.fault != last && status.fault != ControllerTick::FAULT_NONE {
            faults.push(Fault {
                t_s: tick.t_s,
                tick: status.tick,
                fault: fault_name(status.fault),
                index: status.fault_index,
                value: status.fault_value,
            });
        }
        last = status.fault;
    }
    faults
}

/// Name of a fault code, from the constants of `controller_tick_t`: `FAULT_STATE_STALE` is "state stale".
pub(crate) fn fault_name(code: i32) -> String {
    let tick = lcmtypes::types().by_name(ControllerTick::TYPE);
    let constants = tick.iter().flat_map(|ty| &ty.def().constants);
    let fault = constants.filter(|c| c.value == ConstantValue::Int32(code)).find_map(|c| c.name.strip_prefix("FAULT_"));
    let name = fault.map(|name| name.to_lowercase().replace('_', " "));
    name.unwrap_or_else(|| format!("unknown fault {code}"))
}
