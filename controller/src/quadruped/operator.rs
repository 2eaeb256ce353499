//! What the operator asks for, made into references: limits, ramps and filters.

use super::estimation::Estimate;
use super::gait::Wish;
use super::modes::{self, Asked};
use super::safety;
use super::state::{Cadence, Fault, Gait, State};
use super::terrain;
use super::wbc::TrunkReference;
use crate::math::{Rx, Ry, Rz, low_pass, ramp, wrap_angle};
use crate::params::{DUTY, Params, STEP_HEIGHT, SWING_FREQUENCY};
use lcmtypes::{ControllerTick, OperatorCommand};
use nalgebra::Vector3;

/// Largest lead of the heading reference over the heading, rad.
const MAX_HEADING_LEAD: f64 = 0.3;

/// Ramps and filters the operator's numbers into the state; says what is wished of the gait.
///
/// The numbers of a command that asks for nothing ([`modes::asked`]) are not looked at. A gait without meaning counts as the present one: it comes
/// from a newer operator, not from a broken one. Timing and step height out of range are refused together: those in use stay, and the fault
/// code names the first.
pub fn follow(
    params: &Params,
    estimate: &Estimate,
    state: &mut State,
    op: &OperatorCommand,
    asked: &Asked,
    dt: f64,
) -> Wish {
    let none = OperatorCommand::default();
    let op = if asked.wish == modes::Wish::None { &none } else { op };
    let out_of_range = out_of_range(op);
    state.fault = asked.refused.or(out_of_range).unwrap_or_default();
    let walk = asked.wish == modes::Wish::Walk;
    let steps = walk && state.gait_running && state.gait_clock >= 0.0;

    let limits = &params.foothold;
    let mut v = if steps { op.v_H } else { [0.0; 2] };
    let speed = (v[0] * v[0] + v[1] * v[1]).sqrt();
    if speed > limits.max_speed {
        // In this order a speed too large to be squared gives 0, not NaN.
        let part = limits.max_speed / speed;
        v = v.map(|x| x * part);
    }
    let yaw_rate = if steps { op.yaw_rate.clamp(-limits.max_yaw_rate, limits.max_yaw_rate) } else { 0.0 };
    for (v_des, v) in state.v_H_des.iter_mut().zip(v) {
        let filtered = low_pass(*v_des, v, limits.command_time_constant, dt);
        *v_des = ramp(*v_des, filtered, limits.max_acceleration * dt);
    }
    state.yaw_rate_des = low_pass(state.yaw_rate_des, yaw_rate, limits.command_time_constant, dt);
    // The heading reference waits for the robot rather than winding up against a base that cannot turn.
    let yaw = estimate.base.rpy[2];
    let ahead = wrap_angle(state.yaw_des + state.yaw_rate_des * dt - yaw);
    state.yaw_des = yaw + ahead.clamp(-MAX_HEADING_LEAD, MAX_HEADING_LEAD);

    let trunk = &params.trunk;
    for (k, wished) in [op.roll, op.pitch].into_iter().enumerate() {
        let wished = wished.clamp(-trunk.max_orientation, trunk.max_orientation);
        state.rp_des[k] = ramp(state.rp_des[k], wished, trunk.max_orientation_rate * dt);
    }
    let wished = op.height_offset.clamp(-trunk.max_height_offset, trunk.max_height_offset);
    state.height_offset = ramp(state.height_offset, wished, trunk.max_height_rate * dt);

    let gait = match op.gait {
        OperatorCommand::GAIT_TROT => Gait::Trot,
        OperatorCommand::GAIT_CRAWL => Gait::Crawl,
        _ => state.gait,
    };
    let (cadence, step_height) = match op.step_height {
        _ if out_of_range.is_some() => (state.cadence, 0.0),
        wished => {
            let height = if wished > 0.0 { wished } else { params.swing.height };
            (Cadence { swing_frequency: op.swing_frequency, duty: op.duty }, height)
        }
    };
    Wish { walk, gait, cadence, step_height }
}

/// The first number of gait and swing that is outside the range that it has in the parameters too; 0 is none.
fn out_of_range(op: &OperatorCommand) -> Option<Fault> {
    let numbers = [(op.swing_frequency, SWING_FREQUENCY.0), (op.duty, DUTY.0), (op.step_height, STEP_HEIGHT.0)];
    let index = numbers.iter().position(|&(x, fits)| x != 0.0 && !fits(x))?;
    safety::fault(ControllerTick::FAULT_OPERATOR_RANGE, Some(index), numbers[index].0)
}

/// `R_des = Rz(yaw_des) R_HT Ry(pitch_des) Rx(roll_des)`, `R_HT` the ground's inclination: it turns at the commanded yaw rate, with the ramps of
/// roll and pitch, and with the estimate of the ground.
pub fn trunk_reference(state: &State, rp_rate: [f64; 2], gradient_rate: [f64; 2]) -> TrunkReference {
    let [roll, pitch] = state.rp_des;
    let R_ground = Rz(state.yaw_des) * terrain::inclination(terrain::turned(state.gradient_W, state.yaw_des));
    let R_pitch = R_ground * Ry(pitch);
    let n_W = terrain::normal(state.gradient_W);
    // Rate of the normal but for a part along it, which turns nothing.
    let nd_W = Vector3::new(-gradient_rate[0], -gradient_rate[1], 0.0) * n_W.z;
    TrunkReference {
        R_WB: R_pitch * Rx(roll),
        w_WB_W: R_pitch * Vector3::x() * rp_rate[0]
            + R_ground * Vector3::y() * rp_rate[1]
            + n_W.cross(&nd_W)
            + Vector3::z() * state.yaw_rate_des,
    }
}
