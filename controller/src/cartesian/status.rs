//! TASK_STATUS: what every task wants, has and does not get, 50 times a second.

use super::ik::{Ik, IkState};
use super::stack_file::{StackFile, TaskType, WORLD};
use super::task::frame_of;
use crate::math::log;
use crate::model::Pose;
use crate::outbox::Outbox;
use crate::qp::{QpRow, QpStatus};
use crate::trajectory::{Mode, PoseGoal, Reference, TaskReference};
use lcmtypes::{CartesianState, LevelState, TaskMemory, TaskRequest, TaskState, TaskStatus, channels};

/// Time between two messages, ns.
const PERIOD_NS: i64 = 20_000_000;
/// Status of a level without a problem.
const NOT_REACHED: i8 = 3;
/// Longest name of a link for which memory is kept.
const LONGEST_NAME: usize = 64;

/// The message, with memory for all names.
pub struct Status {
    message: TaskStatus,
    /// Names of the joints at their lower and their upper limit.
    names: Vec<[String; 2]>,
    /// Memory for names of active limits.
    spare: Vec<String>,
}

impl Status {
    /// For the tasks of a stack.
    pub fn new(file: &StackFile, ik: &Ik) -> Self {
        let model = ik.model();
        let tasks: Vec<TaskState> = file
            .tasks
            .iter()
            .enumerate()
            .map(|(i, (name, task))| {
                let (m, k) = match task.kind {
                    TaskType::Cartesian => (7, 6),
                    TaskType::Com | TaskType::Gaze => (3, 3),
                    TaskType::AngularMomentum | TaskType::MinimumEffort | TaskType::Manipulability => (0, 0),
                    TaskType::Posture | TaskType::MinimumVelocity => (model.nj(), model.nj()),
                };
                TaskState {
                    name: name.clone(),
                    r#type: task.kind.name().to_owned(),
                    link: task.link.clone().unwrap_or_default(),
                    base_link: String::with_capacity(LONGEST_NAME),
                    level: ik.level_of(i).map_or(-1, |level| i8::try_from(level).unwrap_or(i8::MAX)),
                    m: super::count(m),
                    reference: vec![0.0; m],
                    actual: vec![0.0; m],
                    k: super::count(k),
                    error: vec![0.0; k],
                    ..TaskState::default()
                }
            })
            .collect();
        let n_levels = ik.reports_len();
        let levels: Vec<LevelState> = (0..n_levels)
            .map(|_| LevelState { active: Vec::with_capacity(model.nv()), ..LevelState::default() })
            .collect();
        let message = TaskStatus {
            n: super::count(tasks.len()),
            tasks,
            n_levels: super::count(levels.len()),
            levels,
            ..TaskStatus::default()
        };
        let names: Vec<[String; 2]> =
            model.joints.iter().map(|joint| [format!("-{}", joint.name), joint.name.clone()]).collect();
        let longest = names.iter().flatten().map(String::len).max().unwrap_or(0);
        let spare = (0..model.nv() * n_levels).map(|_| String::with_capacity(longest)).collect();
        Status { message, names, spare }
    }

    /// Whether a message is due, and when the last one was.
    pub fn is_due(&self, last_ns: &mut i64, t_ns: i64) -> bool {
        let is_due = t_ns.div_euclid(PERIOD_NS) != last_ns.div_euclid(PERIOD_NS);
        if is_due {
            *last_ns = t_ns;
        }
        is_due
    }

    /// Fills the message. The model is placed at `model`.
    pub fn fill(&mut self, ik: &mut Ik, model: &IkState, state: &CartesianState, run_id: i64) {
        let Status { message, names, spare } = self;
        (message.t_ns, message.tick, message.run_id) = (state.t_ns, state.tick, run_id);
        (message.p_WB, message.q_WB_wxyz, message.relaxed) = (state.p_WB, state.q_WB_wxyz, ik.is_relaxed());
        for (i, (to, memory)) in message.tasks.iter_mut().zip(&state.tasks).enumerate() {
            task_state(to, i, memory, ik, model);
        }
        let n_base = ik.model().nv_base();
        let has_solved = ik.has_solved();
        for (level, to) in message.levels.iter_mut().enumerate() {
            spare.append(&mut to.active);
            (to.status, to.rows, to.rank, to.iterations, to.residual, to.n_active) = (NOT_REACHED, 0, 0, 0, 0.0, 0);
            if has_solved {
                to.rows = super::count(ik.rows_of(level));
                to.residual = ik.residual_of(level, &model.v);
            }
        }
        if !has_solved {
            return;
        }
        let (reports, active) = ik.reports();
        for (to, report) in message.levels.iter_mut().zip(reports) {
            to.status = match report.status {
                Some(QpStatus::Solved | QpStatus::AlmostSolved) => 0,
                Some(QpStatus::Infeasible) => 1,
                Some(QpStatus::Failed) => 2,
                None => NOT_REACHED,
            };
            (to.rank, to.iterations) =
                (super::count(report.rank), i32::try_from(report.iterations).unwrap_or(i32::MAX));
        }
        for (level, row) in active {
            let name = match row {
                QpRow::Lower(i) if i >= n_base => &names[i - n_base][0],
                QpRow::Upper(i) if i >= n_base => &names[i - n_base][1],
                _ => continue,
            };
            if let (Some(to), Some(mut text)) = (message.levels.get_mut(level), spare.pop()) {
                text.clear();
                text.push_str(name);
                to.active.push(text);
            }
        }
        for to in &mut message.levels {
            to.n_active = super::count(to.active.len());
        }
    }

    /// Adds the message to the outputs of the tick.
    pub fn put(&self, out: &mut Outbox) {
        out.put(channels::TASK_STATUS, &self.message).expect("every length field is set with its array");
    }
}

fn task_state(to: &mut TaskState, i: usize, memory: &TaskMemory, ik: &mut Ik, model: &IkState) {
    (to.active, to.gain) = (memory.active, memory.gain);
    to.weight = memory.weights.first().copied().unwrap_or(0.0);
    to.base_link.clear();
    if !to.link.is_empty() {
        let of = ik.model();
        to.base_link.push_str(frame_of(of, memory.base_link).map_or(WORLD, |link| of.frame_name(link)));
    }
    let has_residual = memory.active && ik.has_solved();
    let actual = ik.with_kin(|tasks, of, kin| tasks[i].actual(memory, of, kin));
    let task = &ik.tasks()[i];
    to.residual = if has_residual { task.residual(&model.v) } else { 0.0 };
    match task.reference() {
        Reference::Pose(reference) => return pose_state(to, reference, &actual),
        Reference::Joints(references) => {
            to.reference.iter_mut().zip(references.axes()).for_each(|(to, axis)| *to = axis.p);
        }
        Reference::None if to.m == 0 => return,
        Reference::None => to.reference.copy_from_slice(&model.q),
    }
    to.actual.copy_from_slice(&model.q);
    for ((error, reference), actual) in to.error.iter_mut().zip(&to.reference).zip(&to.actual) {
        *error = reference - actual;
    }
}

/// Mode, way-points, pose and error of a pose, or of a position, which has only the first three numbers.
fn pose_state(to: &mut TaskState, reference: &TaskReference, actual: &Pose) {
    to.mode = match reference.mode() {
        Mode::Position => TaskRequest::MODE_POSITION,
        Mode::Velocity => TaskRequest::MODE_VELOCITY,
    };
    (to.waypoint, to.progress) = reference.progress().map_or((-1, 0.0), |at| (super::count(at.segment), at.fraction));
    for (numbers, pose) in [(&mut to.reference, reference.motion().goal()), (&mut to.actual, PoseGoal::of(actual))] {
        numbers.iter_mut().zip(pose.p.iter().chain(&pose.q)).for_each(|(to, x)| *to = *x);
    }
    let wanted = reference.motion().pose();
    let (way, turn) = (wanted.p - actual.p, log(&(wanted.R * actual.R.transpose())));
    to.error.iter_mut().zip(way.iter().chain(turn.iter())).for_each(|(to, x)| *to = *x);
}
