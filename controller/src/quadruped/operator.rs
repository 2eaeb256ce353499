//! Filters operator commands into references: limits, rate limits and low-pass filters.

use super::estimation::Estimate;
use super::gait::GaitRequest;
use super::modes::{ModeRequest, OperatorRequest};
use super::params::{DUTY, STEP_HEIGHT, SWING_FREQUENCY};
use super::state::{Cadence, Gait, State};
use crate::math::{low_pass, ramp, wrap_angle};
use crate::params::Params;
use crate::safety::{Fault, fault};
use lcmtypes::{ControllerTick, OperatorCommand};

/// Largest difference between the heading reference and the heading, rad.
const MAX_HEADING_LEAD: f64 = 0.3;

/// Updates the velocity, heading, trunk and height references in `state` from the operator's numbers, and returns the request to the gait.
///
/// Without a mode request the numbers count as zero. An unknown gait counts as the present gait: it comes from a newer operator program. If a gait
/// timing or step height is out of range, all three of them keep their present values, and the fault in `state` names the first.
pub fn update_references(
    params: &Params,
    estimate: &Estimate,
    state: &mut State,
    op: &OperatorCommand,
    request: &OperatorRequest,
    dt: f64,
) -> GaitRequest {
    let none = OperatorCommand::default();
    let op = if request.mode == ModeRequest::None { &none } else { op };
    let out_of_range = out_of_range(op);
    state.set_fault(request.rejected.or(out_of_range).unwrap_or_default());
    let walk = request.mode == ModeRequest::Walk;
    let steps = walk && state.gait_running && state.gait_clock >= 0.0;

    let limits = &params.foothold;
    let mut v = if steps { op.v_H } else { [0.0; 2] };
    let speed = (v[0] * v[0] + v[1] * v[1]).sqrt();
    if speed > limits.max_speed {
        // In this order an infinite `speed` (its square overflows) gives velocity 0, not NaN.
        let factor = limits.max_speed / speed;
        v = v.map(|x| x * factor);
    }
    let yaw_rate = if steps { op.yaw_rate.clamp(-limits.max_yaw_rate, limits.max_yaw_rate) } else { 0.0 };
    for (v_des, v) in state.v_H_des.iter_mut().zip(v) {
        let filtered = low_pass(*v_des, v, limits.command_time_constant, dt);
        *v_des = ramp(*v_des, filtered, limits.max_acceleration * dt);
    }
    state.yaw_rate_des = low_pass(state.yaw_rate_des, yaw_rate, limits.command_time_constant, dt);
    // The limited lead prevents windup of the heading reference while the base cannot turn.
    let yaw = estimate.base.rpy[2];
    let lead = wrap_angle(state.yaw_des + state.yaw_rate_des * dt - yaw);
    state.yaw_des = yaw + lead.clamp(-MAX_HEADING_LEAD, MAX_HEADING_LEAD);

    let trunk = &params.trunk;
    for (k, requested) in [op.roll, op.pitch].into_iter().enumerate() {
        let requested = requested.clamp(-trunk.max_orientation, trunk.max_orientation);
        state.rp_des[k] = ramp(state.rp_des[k], requested, trunk.max_orientation_rate * dt);
    }
    let requested = op.height_offset.clamp(-trunk.max_height_offset, trunk.max_height_offset);
    state.height_offset = ramp(state.height_offset, requested, trunk.max_height_rate * dt);

    let gait = match op.gait {
        OperatorCommand::GAIT_TROT => Gait::Trot,
        OperatorCommand::GAIT_CRAWL => Gait::Crawl,
        _ => state.gait,
    };
    let (cadence, step_height) = match op.step_height {
        _ if out_of_range.is_some() => (state.cadence(), 0.0),
        requested => {
            let height = if requested > 0.0 { requested } else { params.swing.height };
            (Cadence { swing_frequency: op.swing_frequency, duty: op.duty }, height)
        }
    };
    GaitRequest { walk, gait, cadence, step_height }
}

/// The first of swing frequency, duty factor and step height that is out of its range. 0 means "not commanded" and is in range.
fn out_of_range(op: &OperatorCommand) -> Option<Fault> {
    let numbers = [(op.swing_frequency, SWING_FREQUENCY), (op.duty, DUTY), (op.step_height, STEP_HEIGHT)];
    let index = numbers.iter().position(|(x, range)| *x != 0.0 && !(range.contains)(*x))?;
    fault(ControllerTick::FAULT_OPERATOR_RANGE, Some(index), numbers[index].0)
}
