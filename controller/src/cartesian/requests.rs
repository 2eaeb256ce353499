//! Requests to tasks: each is checked completely, then carried out; a refused one changes nothing.

use super::stack_file::{ReferenceLimits, WORLD};
use super::task::{IkTask, frame_of, index_of};
use crate::math::quaternion;
use crate::model::{FrameId, Kinematics, Model, Pose};
use crate::stack::ModelState;
use crate::trajectory::{MAX_WAYPOINTS, Mode, PoseGoal, ReferenceError, TaskReference, ValueError, Waypoint};
use lcmtypes::{RequestReply, TaskMemory, TaskRequest, TaskWaypoint};
use nalgebra::Vector6;
use std::collections::BTreeMap;

/// Largest position, m, and velocity, m/s and rad/s, of a request.
const LARGEST: f64 = 1e3;
/// Largest time of a way-point, s.
const LONGEST: f64 = 1e5;

/// Why a request is refused: code and reason.
pub type Refusal = (i8, &'static str);

const OUT_OF_RANGE: i8 = RequestReply::CODE_OUT_OF_RANGE;
const WRONG_STATE: i8 = RequestReply::CODE_WRONG_STATE;
const UNKNOWN: i8 = RequestReply::CODE_UNKNOWN_NAME;
const NO_POSE: Refusal = (WRONG_STATE, "the task has no pose");
/// Reason for a wrong number of way-points.
const WAYPOINTS: &str = "expected 1 to 32 way-points";

/// Carries out a request.
///
/// - `postures`: joint positions of the robot's named postures.
///
/// # Errors
/// The code and reason of the refusal.
pub fn carry_out(
    request: &TaskRequest,
    tasks: &mut [IkTask],
    memories: &mut [TaskMemory],
    postures: &BTreeMap<String, Vec<f64>>,
    state: &ModelState<'_>,
    t_ns: i64,
) -> Result<(), Refusal> {
    let at = tasks.iter().position(|task| task.name == request.task).ok_or((UNKNOWN, "no task of this name"))?;
    let (task, memory) = (&mut tasks[at], &mut memories[at]);
    match request.operation {
        TaskRequest::POSE => {
            let [pose] = &request.poses[..] else { return Err((OUT_OF_RANGE, "expected one pose")) };
            let set =
                |reference: &mut TaskReference| reference.set_pose(&goal(request, pose, reference)?).map_err(refusal);
            task.change_pose(memory, set).ok_or(NO_POSE)??;
        }
        TaskRequest::WAYPOINTS => {
            task.change_pose(memory, |reference| waypoints(request, reference)).ok_or(NO_POSE)??;
        }
        TaskRequest::VELOCITY => {
            let twist: [f64; 6] = request.values[..].try_into().map_err(|_| (OUT_OF_RANGE, "expected six values"))?;
            if !twist.iter().all(|x| x.abs() <= LARGEST) {
                return Err((OUT_OF_RANGE, "a velocity is not finite or above 1000"));
            }
            let set = |reference: &mut TaskReference| reference.set_velocity(&Vector6::from(twist), t_ns);
            task.change_pose(memory, set).ok_or(NO_POSE)?.map_err(refusal)?;
        }
        TaskRequest::MODE => {
            let position = f64::from(TaskRequest::MODE_POSITION);
            let mode = match request.values[..] {
                [value] if value == position => Mode::Position,
                [value] if value == f64::from(TaskRequest::MODE_VELOCITY) => Mode::Velocity,
                _ => return Err((OUT_OF_RANGE, "expected MODE_POSITION or MODE_VELOCITY")),
            };
            let pose = task.actual(memory, state.model, state.kin);
            task.change_pose(memory, |reference| reference.set_mode(mode, &pose)).ok_or(NO_POSE)?;
        }
        TaskRequest::BASE_LINK => base_link(&request.name, task, memory, state)?,
        TaskRequest::ACTIVATE => {
            let active = match request.values[..] {
                [0.0] => false,
                [1.0] => true,
                _ => return Err((OUT_OF_RANGE, "expected 0 or 1")),
            };
            if active && !memory.active {
                task.reset(memory, state);
            }
            memory.active = active;
        }
        TaskRequest::WEIGHT => {
            let values = &request.values[..];
            if !values.iter().all(|x| (1e-9..=1e9).contains(x)) {
                return Err((OUT_OF_RANGE, "a weight is not from 1e-9 to 1e9"));
            }
            match values {
                [weight] => memory.weights.fill(*weight),
                _ if values.len() == memory.weights.len() => memory.weights.copy_from_slice(values),
                _ => return Err((OUT_OF_RANGE, "expected one weight, or one for each row")),
            }
        }
        TaskRequest::GAIN => match request.values[..] {
            [gain] if (0.0..=1e4).contains(&gain) => memory.gain = gain,
            _ => return Err((OUT_OF_RANGE, "expected a gain from 0 to 10000 1/s")),
        },
        TaskRequest::LIMITS => match ReferenceLimits::of_values(&request.values) {
            Some(limits) => task.change(memory, |reference| reference.set_limits(limits.of_pose())).map_err(refusal)?,
            None => return Err((OUT_OF_RANGE, "expected four or six limits")),
        },
        TaskRequest::RESET => task.reset(memory, state),
        TaskRequest::POSTURE => {
            let posture = postures.get(&request.name).ok_or((UNKNOWN, "no posture of this name"));
            let changed = task.change_posture(memory, |reference| reference.set_goals(posture?).map_err(refusal));
            changed.ok_or((WRONG_STATE, "the task is not a posture task"))??;
        }
        _ => return Err((OUT_OF_RANGE, "unknown operation")),
    }
    Ok(())
}

/// The pose of a request in the axes of the base link.
fn goal(request: &TaskRequest, pose: &TaskWaypoint, reference: &TaskReference) -> Result<PoseGoal, Refusal> {
    if !pose.position.iter().all(|x| x.abs() <= LARGEST) {
        return Err((OUT_OF_RANGE, "a position is not finite or above 1000 m"));
    }
    let goal = PoseGoal { p: pose.position, q: pose.q_wxyz };
    if !request.relative {
        return Ok(goal);
    }
    let from = reference.motion().goal();
    let p = std::array::from_fn(|k| from.p[k] + goal.p[k]);
    Ok(PoseGoal { p, q: quaternion::product(goal.q, from.q) })
}

fn waypoints(request: &TaskRequest, reference: &mut TaskReference) -> Result<(), Refusal> {
    let mut points = [Waypoint { t: 0.0, pose: PoseGoal::IDENTITY }; MAX_WAYPOINTS];
    let Some(points) = points.get_mut(..request.poses.len()) else {
        return Err((OUT_OF_RANGE, WAYPOINTS));
    };
    for (to, from) in points.iter_mut().zip(&request.poses) {
        if from.time > LONGEST {
            return Err((OUT_OF_RANGE, "a time is above 100000 s"));
        }
        *to = Waypoint { t: from.time, pose: goal(request, from, reference)? };
    }
    reference.set_waypoints(points).map_err(refusal)
}

/// Why a reference refuses a request.
fn refusal(error: ReferenceError) -> Refusal {
    match error {
        ReferenceError::Mode { expected, .. } if expected == Mode::Position.name() => {
            (WRONG_STATE, "the task is in velocity mode")
        }
        ReferenceError::Mode { .. } => (WRONG_STATE, "the task is in position mode"),
        ReferenceError::Value(error) | ReferenceError::Waypoint { error, .. } => match error {
            ValueError::NotFinite { .. } => (OUT_OF_RANGE, "a number is not finite"),
            ValueError::NotUnit { .. } => (OUT_OF_RANGE, "a quaternion does not have norm 1"),
        },
        ReferenceError::Count { .. } => (OUT_OF_RANGE, WAYPOINTS),
        ReferenceError::Time { .. } => (OUT_OF_RANGE, "the times are not positive and increasing"),
        ReferenceError::Limit { .. } => (OUT_OF_RANGE, "a limit is not positive"),
        ReferenceError::Length { .. } => (OUT_OF_RANGE, "expected one number for each joint"),
    }
}

fn base_link(name: &str, task: &mut IkTask, memory: &mut TaskMemory, state: &ModelState<'_>) -> Result<(), Refusal> {
    let Some(link) = task.link() else { return Err((WRONG_STATE, "the task has no base link")) };
    let ModelState { model, kin, .. } = state;
    let base = if name == WORLD { None } else { Some(link_of(model, name).ok_or((UNKNOWN, "no link of this name"))?) };
    if base.is_some_and(|base| model.moves(link, base)) {
        return Err((OUT_OF_RANGE, "the controlled link moves the base link"));
    }
    let pose = |base: Option<FrameId>| base.map_or(Pose::identity(), |base| world_pose(model, kin, base));
    let (old, new) = (pose(frame_of(model, memory.base_link)), pose(base));
    let R_cW = new.R.transpose();
    let X_cb = Pose { p: R_cW * (old.p - new.p), R: R_cW * old.R };
    memory.base_link = index_of(base);
    task.change_pose(memory, |reference| reference.set_base_link(&X_cb)).ok_or(NO_POSE)
}

fn link_of(model: &Model, name: &str) -> Option<FrameId> {
    model.frames().find(|(_, known)| *known == name).map(|(id, _)| id)
}

fn world_pose(model: &Model, kin: &Kinematics, link: FrameId) -> Pose {
    Pose { p: kin.p_WF(model, link), R: kin.R_WF(model, link) }
}
