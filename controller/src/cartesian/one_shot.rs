//! One-shot inverse kinematics: joint positions for several poses at once.
//!
//! ```text
//! min over q of Σ |x(q) - x_d|², then |q - q_0|² among the solutions, subject to the limits of the joints
//! ```
//! Source: Laurenzi 2020, eqs. (2.18) and (2.22), with a strict priority instead of a small weight of the posture, so that a goal is met exactly. The steps are those of
//! [`super::Ik`]; a posture of the robot is the start.

use super::ik::{Ik, IkState};
use super::stack_file::{
    Feedback, JointLimitsFile, ReferenceLimits, SelfCollisionFile, StackFile, TaskFile, TaskType, WeightFile,
};
use crate::error::LoadError;
use crate::hold::drive::posture_of;
use crate::math::log;
use crate::model::{RobotDescription, UrdfTree};
use crate::stack::Formula;
use crate::trajectory::PoseGoal;
use std::fmt::Write as _;

/// Step, s, and gain, 1/s: each step reduces an error to a fifth.
const DT: f64 = 0.1;
const GAIN: f64 = 8.0;
/// Gain of the posture, 1/s.
const POSTURE_GAIN: f64 = 3.0;
/// Largest number of steps.
const MOST_STEPS: usize = 500;
/// The motion has ended if no joint moves by more than this in a step, rad or m.
const AT_REST: f64 = 1e-9;

/// A pose that a link must have.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// The link.
    pub link: String,
    /// Position in the world, m; `None`: the pose that the link has in the start posture.
    pub position: Option<[f64; 3]>,
    /// Orientation, w x y z; `None`: any, or that of the start posture without a position.
    pub q_wxyz: Option<[f64; 4]>,
}

/// How well a goal is met.
#[derive(Clone, Debug, PartialEq)]
pub struct Met {
    /// The link.
    pub link: String,
    /// Distance from the goal, m.
    pub position_error: f64,
    /// Angle from the goal, rad; 0 if any orientation will do.
    pub orientation_error: f64,
}

/// Result of [`one_shot`].
#[derive(Clone, Debug, PartialEq)]
pub struct OneShot {
    /// Base and joints.
    pub state: IkState,
    /// Each goal.
    pub goals: Vec<Met>,
    /// Number of steps.
    pub steps: usize,
}

/// Finds joint positions for goals. A floating base moves, too; it starts with the lowest contact on the ground.
///
/// - `posture`: name of the posture to start at and to stay near to.
///
/// # Errors
/// An unknown link or posture, a quaternion without norm 1.
pub fn one_shot(
    robot: &RobotDescription,
    tree: &UrdfTree,
    posture: &str,
    goals: &[Goal],
) -> Result<OneShot, LoadError> {
    let model = robot.model(tree)?;
    let (mut ik, mut memories) = Ik::new(&stack(posture, goals), robot, tree, &model)?;
    let mut state = IkState::at(&posture_of(robot, posture)?, model.nv());
    ik.place(&state);
    if model.nv_base() > 0 {
        let lowest = super::lowest(&ik, &super::contacts_of(robot, &model)?);
        if lowest < f64::INFINITY {
            state.p_WB.z = -lowest;
            ik.place(&state);
        }
    }
    ik.with_tasks(&state, |tasks, at| {
        for (task, memory) in tasks.iter_mut().zip(&mut memories) {
            task.reset(memory, at);
        }
    });
    let mut targets = Vec::new();
    for (k, goal) in goals.iter().enumerate() {
        let name = name_of(k);
        let at = ik.tasks().iter().position(|task| task.name == name).expect("the stack has a task for each goal");
        let target = ik.tasks()[at].change_pose(&mut memories[at], |reference| {
            let mut target = reference.motion().goal();
            target.p = goal.position.unwrap_or(target.p);
            target.q = goal.q_wxyz.unwrap_or(target.q);
            reference.set_pose(&target).map(|()| target)
        });
        let target = target
            .expect("a goal is a pose")
            .map_err(|error| super::stack_file::wrong(format!("goal of link {}: {error}", goal.link)))?;
        targets.push((at, target));
    }
    let mut steps = 0;
    let mut t_ns = 0;
    while steps < MOST_STEPS {
        steps += 1;
        t_ns += 100_000_000;
        ik.place(&state);
        ik.solve(&mut state, &mut memories, t_ns, DT);
        state.integrate(model.nv_base(), DT);
        if state.v.iter().all(|v| v.abs() * DT <= AT_REST) {
            break;
        }
    }
    ik.place(&state);
    let goals = goals.iter().zip(&targets).map(|(goal, (at, target))| {
        let memory = &memories[*at];
        let actual = PoseGoal::of(&ik.with_kin(|tasks, model, kin| tasks[*at].actual(memory, model, kin)));
        met(goal, target, &actual)
    });
    let goals = goals.collect();
    Ok(OneShot { state, goals, steps })
}

fn name_of(k: usize) -> String {
    format!("goal_{k:03}")
}

fn has_orientation(goal: &Goal) -> bool {
    goal.q_wxyz.is_some() || goal.position.is_none()
}

fn met(goal: &Goal, target: &PoseGoal, actual: &PoseGoal) -> Met {
    let distance = (0..3).fold(0.0, |sum, k| sum + (target.p[k] - actual.p[k]) * (target.p[k] - actual.p[k])).sqrt();
    let rotation = |pose: &PoseGoal| crate::math::quaternion::to_rotation(pose.q);
    let angle = log(&(rotation(target) * rotation(actual).transpose())).norm();
    Met {
        link: goal.link.clone(),
        position_error: distance,
        orientation_error: if has_orientation(goal) { angle } else { 0.0 },
    }
}

/// All goals above the posture.
fn stack(posture: &str, goals: &[Goal]) -> (StackFile, Formula) {
    let mut formula = String::new();
    let mut tasks = std::collections::BTreeMap::new();
    for (k, goal) in goals.iter().enumerate() {
        let plus = if k == 0 { "" } else { " + " };
        let rows = if has_orientation(goal) { "" } else { "[0,1,2]" };
        let _ = write!(formula, "{plus}{}{rows}", name_of(k));
        tasks.insert(name_of(k), task(TaskType::Cartesian, GAIN, Some(goal.link.clone()), None));
    }
    formula += if goals.is_empty() { "posture << joint_limits" } else { " / posture << joint_limits" };
    tasks.insert("posture".to_owned(), task(TaskType::Posture, POSTURE_GAIN, None, Some(posture.to_owned())));
    let file = StackFile {
        regularization: 1e-8,
        feedback: Feedback::Model,
        limits: JointLimitsFile::default(),
        self_collision: SelfCollisionFile::default(),
        selective: None,
        tasks,
        formula,
    };
    let parsed = Formula::parse(&file.formula).expect("written above");
    (file, parsed)
}

fn task(kind: TaskType, gain: f64, link: Option<String>, posture: Option<String>) -> TaskFile {
    TaskFile {
        kind,
        link,
        axis: None,
        base_link: super::stack_file::WORLD.to_owned(),
        local: false,
        posture,
        gain,
        orientation_gain: 1.0,
        weight: WeightFile::default(),
        active: true,
        limits: ReferenceLimits::default(),
        enabled_joints: Vec::new(),
        disabled_joints: Vec::new(),
    }
}
