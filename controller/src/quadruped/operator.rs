//! Filters operator commands into references: limits, rate limits and low-pass filters. What the legs can follow is in [`super::envelope`].

use super::envelope::{self, Followed, advance, is_reachable, step_factor};
use super::estimation::Estimate;
use super::gait::GaitRequest;
use super::modes::{ModeRequest, OperatorRequest};
use super::params::{DUTY, Gait, MOST_SWINGING, STEP_HEIGHT, SWING_FREQUENCY};
use super::robot::Robot;
use super::state::{Cadence, State};
use super::timing::Timing;
use crate::math::{low_pass, ramp, wrap_angle};
use crate::params::Params;
use crate::safety::{Fault, fault};
use lcmtypes::{ControllerTick, OperatorCommand};

/// Largest difference between the heading reference and the heading, rad.
const MAX_HEADING_LEAD: f64 = 0.3;
/// Relative excess of the present velocity over the limit of a gait up to which the robot may change to that gait.
const SPEED_TOLERANCE: f64 = 0.05;
/// Speed below which the robot may change to a gait that stays in place, m/s.
const AT_REST: f64 = 1e-3;
/// Difference of a number from its request or limit that is not reported, in its own unit.
const LIMITED: f64 = 1e-6;

/// Updates the velocity, heading, trunk and height references in `state` from the operator's numbers, and returns the request to the gait.
///
/// Without a mode request the numbers count as zero. An unknown gait counts as the present gait: it comes from a newer operator program. A number
/// out of its range is rejected, and the fault in `state` names the first one: swing frequency, duty factor and step height then keep their present
/// values together, and so do roll, pitch and height. Numbers in their ranges are followed within the limits of steps and legs; if a reference is
/// limited, the fault is FAULT_OPERATOR_LIMITED.
pub fn update_references(
    robot: &Robot,
    params: &Params,
    estimate: &Estimate,
    state: &mut State,
    op: &OperatorCommand,
    request: &OperatorRequest,
    dt: f64,
) -> GaitRequest {
    let none = OperatorCommand::default();
    let op = if request.mode == ModeRequest::None { &none } else { op };
    let gait = params.gait.gait(op.gait).unwrap_or(state.gait);
    let (timing_range, pose_range) = (timing_out_of_range(params, gait, op), pose_out_of_range(params, op));
    let requested = gait_request(params, state, gait, op, request, timing_range.is_some());

    let next = Timing::at(requested.gait, requested.cadence, params);
    let timing = if state.gait_running { Timing::of(state, params) } else { next };
    let walks = state.gait_running || requested.walk;
    let feet = envelope::feet(robot, estimate, walks);
    let changes = state.gait_running && requested.walk && changes_gait(state, &requested);
    // Ahead of a change of the gait, the pose also approaches what the next gait can reach.
    let fits = |followed: &Followed| {
        is_reachable(robot, params, walks.then_some(&timing), &feet, followed)
            && (!changes || can_begin(robot, params, &next, followed))
    };

    let steps = requested.walk && state.gait_running && state.gait_clock >= 0.0;
    let asked = if steps { [op.v_H[0], op.v_H[1], op.yaw_rate] } else { [0.0; 3] };
    let (mut allowed, reduced) = allowed_velocity(robot, params, &[timing, next], asked);
    if envelope::overreached(robot, params, estimate, state) {
        allowed = [0.0; 3];
    }
    let slower = follow_velocity(params, state, allowed, dt, fits);
    let pose = if pose_range.is_some() { None } else { Some([op.roll, op.pitch, op.height_offset]) };
    let lower = follow_pose(params, state, pose, dt, fits);

    // The limited lead prevents windup of the heading reference while the base cannot turn.
    let yaw = estimate.base.rpy[2];
    let lead = wrap_angle(state.yaw_des + state.yaw_rate_des * dt - yaw);
    state.yaw_des = yaw + lead.clamp(-MAX_HEADING_LEAD, MAX_HEADING_LEAD);

    let found = request.rejected.or(timing_range).or(pose_range).or(lower).or(reduced).or(slower);
    state.set_fault(found.unwrap_or_default());
    admitted(robot, params, state, &requested, &next)
}

/// The gait that the operator requests. If a number of its timing is out of range, the timing is the present one, and so is the gait if the requested
/// one does not keep two legs on the ground with that timing.
fn gait_request(
    params: &Params,
    state: &State,
    gait: Gait,
    op: &OperatorCommand,
    request: &OperatorRequest,
    keeps_timing: bool,
) -> GaitRequest {
    let walk = request.mode == ModeRequest::Walk;
    if keeps_timing {
        let cadence = state.cadence();
        let gait = if keeps_two_legs(params, gait, cadence.duty) { gait } else { state.gait };
        return GaitRequest { walk, gait, cadence, step_height: 0.0 };
    }
    let step_height = if op.step_height > 0.0 { op.step_height } else { params.swing.height };
    GaitRequest { walk, gait, cadence: Cadence { swing_frequency: op.swing_frequency, duty: op.duty }, step_height }
}

/// The part of the request that the robot can follow now. It starts to walk, or changes gait or timing, when its references are within the limits of
/// the requested gait; until then the references move towards these limits.
fn admitted(robot: &Robot, params: &Params, state: &State, requested: &GaitRequest, next: &Timing) -> GaitRequest {
    if !requested.walk || (state.gait_running && !changes_gait(state, requested)) {
        return *requested;
    }
    let now = Followed::of(state);
    let is_slow = step_factor(robot, params, next, now.v_H, now.yaw_rate) * (1.0 + SPEED_TOLERANCE) >= 1.0
        || envelope::fastest(robot, now.v_H, now.yaw_rate) < AT_REST;
    if is_slow && can_begin(robot, params, next, &now) {
        *requested
    } else {
        GaitRequest { walk: state.gait_running, gait: state.gait, cadence: state.cadence(), ..*requested }
    }
}

/// Whether gait or timing of a request differ from those in use.
fn changes_gait(state: &State, requested: &GaitRequest) -> bool {
    requested.gait != state.gait || requested.cadence != state.cadence()
}

/// Whether the legs reach the pose of `followed` when the gait with timing `next` begins; the commanded velocity is zero then.
fn can_begin(robot: &Robot, params: &Params, next: &Timing, followed: &Followed) -> bool {
    let at_start = Followed { v_H: [0.0; 2], yaw_rate: 0.0, ..*followed };
    is_reachable(robot, params, Some(next), &envelope::virtual_feet(robot), &at_start)
}

/// Forward, leftward and yaw velocity after the limits of the parameters and of the step length in all of `timings`, and the fault if that is less
/// than `asked`.
fn allowed_velocity(robot: &Robot, params: &Params, timings: &[Timing], asked: [f64; 3]) -> ([f64; 3], Option<Fault>) {
    let limits = &params.foothold;
    let [mut x, mut y, yaw] = asked;
    let yaw = yaw.clamp(-limits.max_yaw_rate, limits.max_yaw_rate);
    let speed = (x * x + y * y).sqrt();
    if speed > limits.max_speed {
        // In this order an infinite `speed` (its square overflows) gives velocity 0, not NaN.
        let factor = limits.max_speed / speed;
        (x, y) = (x * factor, y * factor);
    }
    let factor = |timing| step_factor(robot, params, timing, [x, y], yaw);
    let factor = timings.iter().map(factor).fold(1.0, f64::min);
    let allowed = [x, y, yaw].map(|v| v * factor);
    (allowed, limited(VELOCITY, asked, allowed))
}

/// Moves the velocity references towards `allowed`, within the reach of the legs. Returns the fault if the legs do not reach `allowed`.
fn follow_velocity(
    params: &Params,
    state: &mut State,
    allowed: [f64; 3],
    dt: f64,
    fits: impl Fn(&Followed) -> bool,
) -> Option<Fault> {
    let limits = &params.foothold;
    let now = Followed::of(state);
    let towards = |[x, y, yaw]: [f64; 3]| {
        let filtered = |now, to| low_pass(now, to, limits.command_time_constant, dt);
        let ramped = |now, to| ramp(now, filtered(now, to), limits.max_acceleration * dt);
        Followed { v_H: [ramped(now.v_H[0], x), ramped(now.v_H[1], y)], yaw_rate: filtered(now.yaw_rate, yaw), ..now }
    };
    let candidate = towards(allowed);
    let next = advance(now, candidate, towards([0.0; 3]), state.tick, fits);
    (state.v_H_des, state.yaw_rate_des) = (next.v_H, next.yaw_rate);
    if next == candidate { None } else { limited(VELOCITY, allowed, [next.v_H[0], next.v_H[1], next.yaw_rate]) }
}

/// Moves roll, pitch and height on the straight line to `pose`, within the reach of the legs; without a pose they stay. Returns the fault if the legs
/// do not reach the pose.
fn follow_pose(
    params: &Params,
    state: &mut State,
    pose: Option<[f64; 3]>,
    dt: f64,
    fits: impl Fn(&Followed) -> bool,
) -> Option<Fault> {
    let trunk = &params.trunk;
    let now = Followed::of(state);
    let from = [now.rp[0], now.rp[1], now.height_offset];
    let towards = |to: [f64; 3]| {
        let rates = [trunk.max_orientation_rate, trunk.max_orientation_rate, trunk.max_height_rate];
        let is_near = (0..3).all(|k| (to[k] - from[k]).abs() <= rates[k] * dt);
        let part = (0..3).fold(1.0, |part: f64, k| {
            let left = (to[k] - from[k]).abs();
            if left > 0.0 { part.min(rates[k] * dt / left) } else { part }
        });
        let [roll, pitch, height_offset] =
            if is_near { to } else { [0, 1, 2].map(|k| from[k] + (to[k] - from[k]) * part) };
        Followed { rp: [roll, pitch], height_offset, ..now }
    };
    let pose = pose.unwrap_or(from);
    let candidate = towards(pose);
    let next = advance(now, candidate, towards([0.0; 3]), state.tick, fits);
    (state.rp_des, state.height_offset) = (next.rp, next.height_offset);
    if next == candidate { None } else { limited(POSE, pose, [next.rp[0], next.rp[1], next.height_offset]) }
}

/// Index of roll in faults of the operator command; pitch and height follow.
const POSE: usize = 3;
/// Index of the forward velocity in faults of the operator command; leftward velocity and yaw rate follow.
const VELOCITY: usize = 6;

/// FAULT_OPERATOR_LIMITED for the first number that is not followed; its value is what is followed.
fn limited(first: usize, asked: [f64; 3], followed: [f64; 3]) -> Option<Fault> {
    let k = (0..3).find(|&k| (asked[k] - followed[k]).abs() > LIMITED)?;
    fault(ControllerTick::FAULT_OPERATOR_LIMITED, Some(first + k), followed[k])
}

/// Whether two legs stand at every moment of a gait with a commanded duty factor; 0 is the duty factor of the parameters, which have been checked.
fn keeps_two_legs(params: &Params, gait: Gait, duty: f64) -> bool {
    duty == 0.0 || params.gait.timing(gait).most_swinging(duty).1 <= MOST_SWINGING
}

/// The first of swing frequency, duty factor and step height that is out of its range. 0 means "not commanded" and is in range. A duty factor with
/// which fewer than two legs stand at some moment of the gait is out of range too.
fn timing_out_of_range(params: &Params, gait: Gait, op: &OperatorCommand) -> Option<Fault> {
    let numbers = [(op.swing_frequency, SWING_FREQUENCY), (op.duty, DUTY), (op.step_height, STEP_HEIGHT)];
    let index = (0..3).find(|&k| {
        let (x, range) = &numbers[k];
        *x != 0.0 && (!(range.contains)(*x) || (k == 1 && !keeps_two_legs(params, gait, *x)))
    })?;
    fault(ControllerTick::FAULT_OPERATOR_RANGE, Some(index), numbers[index].0)
}

/// The first of roll, pitch and height that exceeds the limit of the parameters.
fn pose_out_of_range(params: &Params, op: &OperatorCommand) -> Option<Fault> {
    let trunk = &params.trunk;
    let numbers = [
        (op.roll, trunk.max_orientation),
        (op.pitch, trunk.max_orientation),
        (op.height_offset, trunk.max_height_offset),
    ];
    let index = numbers.iter().position(|(x, limit)| x.abs() > limit + LIMITED)?;
    fault(ControllerTick::FAULT_OPERATOR_RANGE, Some(POSE + index), numbers[index].0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::{add_gaits, apply_overrides};

    const FURTHER: &str = "[gait.quick]\nduty = 0.85\nswing_frequency = 4.0\nlift_off_phase = [0.0, 0.1, 0.2, 0.3]\n";

    #[test]
    fn no_command_leaves_fewer_than_two_legs_on_the_ground() {
        let hyq = include_str!("../../../robots/hyq/hyq.toml");
        let text = apply_overrides(&add_gaits(hyq, FURTHER, "quick.toml").unwrap(), &[]).unwrap();
        let params = Params::from_toml(&text, "test").unwrap();
        let quick = params.gait.named("quick").unwrap();
        let walk = OperatorRequest { mode: ModeRequest::Walk, rejected: None };
        let mut state = State::new(12);
        let requested = |state: &State, swing_frequency: f64, duty: f64| {
            let op = OperatorCommand { gait: quick.number(), swing_frequency, duty, ..OperatorCommand::default() };
            let rejected = timing_out_of_range(&params, quick, &op);
            let request = gait_request(&params, state, quick, &op, &walk, rejected.is_some());
            (rejected.map(|fault| fault.index), request.gait, request.cadence.duty)
        };
        assert_eq!(requested(&state, 0.0, 0.0), (None, quick, 0.0));
        assert_eq!(requested(&state, 0.0, 0.8), (None, quick, 0.8), "two legs swing");
        assert_eq!(requested(&state, 0.0, 0.6), (Some(1), quick, 0.0), "four legs would swing");
        // With a rejected frequency the present duty factor stays, with which the gait cannot be walked.
        assert_eq!(requested(&state, 99.0, 0.0), (Some(0), quick, 0.0));
        state.duty = 0.6;
        assert_eq!(requested(&state, 99.0, 0.0), (Some(0), Gait::TROT, 0.6));
    }
}
