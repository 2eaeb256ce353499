//! Inverse kinematics at velocity level: a model state, tasks and their hierarchy, solved and integrated.
//!
//! ```text
//! level k:  min_v Σ w |A v - b|² + λ |v|²     subject to  limits of the joints,  constraints that are tasks: A v = b;       q ← q ⊕ v dt
//! ```
//! Constraints that are tasks and contradict the limits of the joints become the first level: they are kept as well as the limits allow. If that has no solution
//! either, the joints stop. Source: Laurenzi 2020, sections 2.4, 5.2 and 5.3.

use super::stack_file::{JOINT_LIMITS, SELF_COLLISION, SelfCollisionFile, StackFile, wrong};
use super::task::{IkTask, UsedRows};
use crate::constraints::velocity::{JointLimits, SelfCollision, SelfCollisionParams};
use crate::error::LoadError;
use crate::hold::drive::posture_of;
use crate::math::quaternion;
use crate::model::{BaseState, FrameId, Kinematics, Model, NOMINAL, RobotDescription, UrdfTree, capsules};
use crate::qp::Qp;
use crate::qp::hierarchy::{Hierarchy, LevelReport, NullSpaceCascade, Sides};
use crate::stack::{Constraint, ConstraintRows, Formula, ModelState, Structure, Variables};
use lcmtypes::TaskMemory;
use nalgebra::{DMatrix, DVector, Vector3};

/// Limit of the iterations of a level.
const MOST_ITERATIONS: u32 = 200;

/// Model state: what is integrated.
#[derive(Clone, Debug, PartialEq)]
pub struct IkState {
    /// Origin of the base in the world, m.
    pub p_WB: Vector3<f64>,
    /// Orientation of the base, w x y z.
    pub q_WB: [f64; 4],
    /// Joint positions, rad or m.
    pub q: Vec<f64>,
    /// Velocities of the last step, nv.
    pub v: Vec<f64>,
}

impl IkState {
    /// At rest, the base in the world's origin.
    pub fn at(q: &[f64], nv: usize) -> Self {
        IkState { p_WB: Vector3::zeros(), q_WB: [1.0, 0.0, 0.0, 0.0], q: q.to_vec(), v: vec![0.0; nv] }
    }

    /// The base's pose, at rest.
    pub fn base(&self) -> BaseState {
        BaseState { p_WB: self.p_WB, R_WB: quaternion::to_rotation(self.q_WB), ..BaseState::identity() }
    }

    /// Moves by `v dt`: positions linearly, the orientation by the exponential map.
    pub fn integrate(&mut self, n_base: usize, dt: f64) {
        if n_base > 0 {
            let v = &self.v;
            self.p_WB += Vector3::new(v[0], v[1], v[2]) * dt;
            let turn = quaternion::from_rotation_vector([v[3] * dt, v[4] * dt, v[5] * dt]);
            self.q_WB = quaternion::normalized(quaternion::product(turn, self.q_WB));
        }
        for (q, v) in self.q.iter_mut().zip(&self.v[n_base..]) {
            *q += v * dt;
        }
    }
}

/// The constraint that links do not touch each other, for the nominal posture and the disabled pairs of a robot.
fn self_collision(
    file: &StackFile,
    robot: &RobotDescription,
    tree: &UrdfTree,
    of: &Structure<'_>,
) -> Result<SelfCollision, LoadError> {
    let model = of.model;
    let mut nominal = Kinematics::new(model);
    let zero = vec![0.0; model.nj()];
    nominal.update(model, &BaseState::identity(), &posture_of(robot, NOMINAL)?, &zero);
    let frames = |pair: &[String; 2]| Ok([model.frame(&pair[0])?, model.frame(&pair[1])?]);
    let disabled = robot.disabled_collisions.iter().map(frames).collect::<Result<Vec<[FrameId; 2]>, LoadError>>()?;
    let SelfCollisionFile { margin, threshold, gain, pairs } = file.self_collision;
    let params = SelfCollisionParams { margin, gain, threshold, rows: pairs };
    Ok(SelfCollision::new(of, capsules(tree, model)?, &nominal, &disabled, params))
}

/// Adds the rows that keep links apart. A pair that is too near separates as fast as the limits of the joints allow, so each row alone is feasible.
fn keep_apart(rows: &Qp, hierarchy: &mut Hierarchy) {
    let n = hierarchy.n();
    for row in 0..rows.d.len() {
        let numbers = (0..n).map(|j| rows.C[(row, j)]);
        if numbers.clone().all(|x| x == 0.0) {
            continue;
        }
        let bounds = hierarchy.lower.iter().zip(&hierarchy.upper);
        let least = numbers
            .clone()
            .zip(bounds)
            .fold(0.0, |sum, (x, (lower, upper))| if x == 0.0 { sum } else { sum + (x * lower).min(x * upper) });
        let sides = Sides { lower: f64::NEG_INFINITY, upper: rows.d[row].max(least), from: 0 };
        for (to, x) in hierarchy.general.push(sides).iter_mut().zip(numbers) {
            *to = x;
        }
    }
}

/// Tasks, hierarchy and solver.
pub struct Ik {
    model: Model,
    variables: Variables,
    kin: Kinematics,
    tasks: Vec<IkTask>,
    levels: Vec<Vec<UsedRows>>,
    /// Tasks that are constraints.
    constraints: Vec<usize>,
    limits: Option<JointLimits>,
    collision: Option<SelfCollision>,
    bounds: Qp,
    hierarchy: Hierarchy,
    solver: NullSpaceCascade,
    relaxed: Hierarchy,
    relaxed_solver: NullSpaceCascade,
    is_relaxed: bool,
    /// Whether the last tick solved a problem.
    has_solved: bool,
    selective: Option<crate::qp::hierarchy::Selective>,
    zero: Vec<f64>,
    no_mass: DMatrix<f64>,
    no_bias: DVector<f64>,
}

impl Ik {
    /// Builds tasks and solver from a stack file. Returns the memories that the tasks start with, too.
    ///
    /// # Errors
    /// The stack does not fit the robot: an unknown task, link, joint or posture.
    pub fn new(
        (file, formula): &(StackFile, Formula),
        robot: &RobotDescription,
        tree: &UrdfTree,
        model: &Model,
    ) -> Result<(Self, Vec<TaskMemory>), LoadError> {
        let variables = Variables::velocities(model.nv());
        let of = Structure { model, contacts: &[], variables: &variables };
        let (mut tasks, mut memories) = (Vec::new(), Vec::new());
        for (name, task) in &file.tasks {
            let (task, memory) = IkTask::new(name, task, robot, &of)?;
            tasks.push(task);
            memories.push(memory);
        }
        let find = |name: &str| {
            tasks.iter().position(|task| task.name == name).ok_or_else(|| {
                let known = file.tasks.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
                wrong(format!("formula: no task \"{name}\", expected one of {known}"))
            })
        };
        let mut levels = Vec::new();
        for level in &formula.levels {
            let used = level.iter().map(|term| {
                let index = find(&term.task)?;
                tasks[index].used(index, term)
            });
            levels.push(used.collect::<Result<Vec<_>, LoadError>>()?);
        }
        let mut constraints = Vec::new();
        let (mut has_limits, mut collision) = (false, None);
        for term in &formula.constraints {
            if term.name == JOINT_LIMITS {
                has_limits = true;
                continue;
            }
            if term.name == SELF_COLLISION {
                collision = Some(self_collision(file, robot, tree, &of)?);
                continue;
            }
            let index = find(&term.name)?;
            if !tasks[index].has_pose() {
                return Err(wrong(format!("formula: task \"{}\" of joints cannot be a constraint", term.name)));
            }
            constraints.push(index);
        }
        for (i, task) in tasks.iter().enumerate() {
            if !constraints.contains(&i) && !levels.iter().flatten().any(|used| used.task == i) {
                return Err(wrong(format!("task \"{}\" is not in the formula", task.name)));
            }
        }
        let nv = model.nv();
        let dense = |used: &Vec<UsedRows>| used.iter().map(|used| tasks[used.task].dense_rows()).sum::<usize>();
        let rows: Vec<usize> = levels.iter().map(dense).collect();
        let held: usize = constraints.iter().map(|&i| tasks[i].dense_rows()).sum();
        let pairs = collision.as_ref().map_or(0, |collision| collision.size().inequalities);
        let mut hierarchy = Hierarchy::with_capacity(nv, &rows, held + pairs);
        hierarchy.regularization = file.regularization;
        let mut relaxed = Hierarchy::with_capacity(nv, &[&[held][..], &rows].concat(), pairs);
        relaxed.regularization = file.regularization;
        let limits =
            has_limits.then(|| JointLimits::new(&of, 1.0).with(file.limits.velocity, file.limits.acceleration));
        let ik = Ik {
            kin: Kinematics::new(model),
            solver: NullSpaceCascade::new(&hierarchy, MOST_ITERATIONS, false),
            relaxed_solver: NullSpaceCascade::new(&relaxed, MOST_ITERATIONS, false),
            bounds: Qp::zeros(nv, 0, pairs),
            variables,
            tasks,
            levels,
            constraints,
            limits,
            collision,
            hierarchy,
            relaxed,
            is_relaxed: false,
            has_solved: false,
            selective: file.selective,
            zero: vec![0.0; model.nj()],
            no_mass: DMatrix::zeros(0, 0),
            no_bias: DVector::zeros(0),
            model: model.clone(),
        };
        Ok((ik, memories))
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The tasks, in the order of their names.
    pub fn tasks(&mut self) -> &mut [IkTask] {
        &mut self.tasks
    }

    /// Kinematics of the last [`Ik::place`].
    pub fn kin(&self) -> &Kinematics {
        &self.kin
    }

    /// Level of a task, from 0; `None` for a constraint.
    pub fn level_of(&self, task: usize) -> Option<usize> {
        self.levels.iter().position(|level| level.iter().any(|used| used.task == task))
    }

    /// Number of rows of a level in the last problem.
    pub fn rows_of(&self, level: usize) -> usize {
        self.hierarchy.levels[level].len()
    }

    /// `√(Σ w (a v - b)²)` of a level in the last problem.
    pub fn residual_of(&self, level: usize, v: &[f64]) -> f64 {
        self.hierarchy.levels[level].residual(v)
    }

    /// The last reports of the levels of the formula, and the constraints that are active, with their level.
    pub fn reports(&self) -> (&[LevelReport], impl Iterator<Item = (usize, crate::qp::QpRow)>) {
        let (solver, first) = if self.is_relaxed { (&self.relaxed_solver, 1) } else { (&self.solver, 0) };
        let active = solver.active().iter().filter(move |(level, _)| *level >= first);
        (&solver.reports()[first..], active.map(move |(level, row)| (level - first, *row)))
    }

    /// Whether there is a problem of this tick: rows, residuals and reports of an earlier one are no function of state and input.
    pub fn has_solved(&self) -> bool {
        self.has_solved
    }

    /// Forgets the problem of the last tick.
    pub fn begin_tick(&mut self) {
        self.has_solved = false;
        self.is_relaxed = false;
    }

    /// Whether the constraints that are tasks were relaxed.
    pub fn is_relaxed(&self) -> bool {
        self.is_relaxed
    }

    /// Computes the kinematics of a state.
    pub fn place(&mut self, state: &IkState) {
        self.kin.update(&self.model, &state.base(), &state.q, &self.zero);
    }

    /// Calls a function with the tasks and the placed model.
    pub fn with_tasks<T>(&mut self, state: &IkState, run: impl FnOnce(&mut [IkTask], &ModelState<'_>) -> T) -> T {
        let Ik { model, variables, kin, tasks, no_mass, no_bias, .. } = self;
        let qd = &state.v[model.nv_base()..];
        let at = ModelState {
            model,
            contacts: &[],
            variables,
            q: &state.q,
            qd,
            kin,
            M: no_mass,
            h: no_bias,
            at: &[],
            loads: &[],
        };
        run(tasks, &at)
    }

    /// Advances the references, builds the problem, solves it and writes the velocities. False if it has no solution: then the velocities are 0. Does not
    /// allocate. [`Ik::place`] must have been called with the same state.
    ///
    /// - `t_ns`, `dt`: time of the tick, and time since the last one, s.
    pub fn solve(&mut self, state: &mut IkState, memories: &mut [TaskMemory], t_ns: i64, dt: f64) -> bool {
        self.with_tasks(state, |tasks, at| {
            for (task, memory) in tasks.iter_mut().zip(memories.iter_mut()) {
                task.update(memory, at, t_ns, dt);
            }
        });
        self.has_solved = dt > 0.0;
        if dt <= 0.0 {
            state.v.fill(0.0);
            return true;
        }
        self.limit(state, dt);
        let Ik { tasks, levels, constraints, hierarchy, solver, selective, collision, bounds, .. } = self;
        hierarchy.general.clear();
        for &i in constraints.iter().filter(|i| memories[**i].active) {
            tasks[i].add_as_constraint(&mut hierarchy.general);
        }
        if collision.is_some() {
            keep_apart(bounds, hierarchy);
        }
        for (level, used) in hierarchy.levels.iter_mut().zip(levels.iter()) {
            level.clear();
            level.selective = *selective;
            for used in used.iter().filter(|used| memories[used.task].active) {
                tasks[used.task].add_to(level, used, &memories[used.task]);
            }
        }
        solver.solve(hierarchy);
        self.is_relaxed = false;
        if solver.solved() {
            state.v.copy_from_slice(solver.x());
            return true;
        }
        if hierarchy.general.is_empty() {
            state.v.fill(0.0);
            return false;
        }
        self.solve_relaxed(state)
    }

    /// The constraints that are tasks as the first level.
    fn solve_relaxed(&mut self, state: &mut IkState) -> bool {
        let Ik { hierarchy, relaxed, relaxed_solver, .. } = self;
        relaxed.lower.copy_from_slice(&hierarchy.lower);
        relaxed.upper.copy_from_slice(&hierarchy.upper);
        let (first, below) = relaxed.levels.split_at_mut(1);
        first[0].clear();
        relaxed.general.clear();
        for (c, sides) in hierarchy.general.iter() {
            if sides.is_equality() {
                first[0].push(sides.upper, 1.0).copy_from_slice(c);
            } else {
                relaxed.general.push(sides).copy_from_slice(c);
            }
        }
        for (to, from) in below.iter_mut().zip(&hierarchy.levels) {
            to.copy_from(from);
        }
        relaxed_solver.solve(relaxed);
        self.is_relaxed = relaxed_solver.solved();
        if self.is_relaxed {
            state.v.copy_from_slice(relaxed_solver.x());
        } else {
            state.v.fill(0.0);
        }
        self.is_relaxed
    }

    fn limit(&mut self, state: &IkState, dt: f64) {
        if let Some(mut collision) = self.collision.take() {
            let mut bounds = std::mem::replace(&mut self.bounds, Qp::zeros(0, 0, 0));
            self.with_tasks(state, |_, at| {
                collision.update(at, &mut ConstraintRows { qp: &mut bounds, equality: 0, inequality: 0 });
            });
            (self.collision, self.bounds) = (Some(collision), bounds);
        }
        let Some(mut limits) = self.limits.take() else { return };
        limits.set_dt(dt);
        let mut bounds = std::mem::replace(&mut self.bounds, Qp::zeros(0, 0, 0));
        self.with_tasks(state, |_, at| {
            limits.update(at, &mut ConstraintRows { qp: &mut bounds, equality: 0, inequality: 0 });
        });
        self.hierarchy.lower.copy_from_slice(bounds.lower.as_slice());
        self.hierarchy.upper.copy_from_slice(bounds.upper.as_slice());
        (self.limits, self.bounds) = (Some(limits), bounds);
    }

    /// Number of levels of the formula.
    pub fn reports_len(&self) -> usize {
        self.levels.len()
    }

    /// Calls a function with the tasks, the model and its kinematics.
    pub fn with_kin<T>(&mut self, run: impl FnOnce(&mut [IkTask], &Model, &Kinematics) -> T) -> T {
        run(&mut self.tasks, &self.model, &self.kin)
    }

    /// Fills scratch memory with NaN.
    pub fn poison(&mut self) {
        self.solver.poison();
        self.relaxed_solver.poison();
    }
}
