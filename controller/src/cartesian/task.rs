//! A task of a stack: its rows, and what it keeps.

use super::stack_file::{TaskFile, TaskType, WORLD, WeightFile, wrong};
use crate::error::{LoadError, RestoreError};
use crate::hold::drive::posture_of;
use crate::model::{FrameId, Kinematics, Model, Pose, RobotDescription, com};
use crate::qp::hierarchy::{GeneralRows, Level, Pick, Sides};
use crate::stack::{ModelState, Rows, Structure, Task, TaskTerm};
use crate::tasks::velocity::{
    AngularMomentum, CenterOfMass, Gaze, Manipulability, MinimumEffort, Motion, RelativePose, RelativePoseReference,
};
use crate::trajectory::{AxesReference, Reference, TaskReference};
use lcmtypes::TaskMemory;
use nalgebra::{Matrix3, Vector3};

/// A task.
pub struct IkTask {
    /// Name in the stack file.
    pub name: String,
    /// Kind.
    pub kind: TaskType,
    rows: Rows,
    form: Form,
    /// Each function that changes it writes it into the memory of the task.
    reference: Reference,
    /// Columns that picks may use.
    is_enabled: Vec<bool>,
    /// Right side of each joint's row, for joint tasks.
    joint_rates: Vec<f64>,
}

enum Form {
    Pose(RelativePose),
    Com(CenterOfMass),
    /// With its axis in the axes of the link.
    Gaze(Gaze, Vector3<f64>),
    AngularMomentum(AngularMomentum),
    Effort(MinimumEffort),
    Manipulability(Manipulability),
    Joints,
}

/// The rows of a task that a level uses.
#[derive(Clone, Debug)]
pub struct UsedRows {
    /// Index of the task.
    pub task: usize,
    /// Weight in the formula.
    pub weight: f64,
    takes: Vec<bool>,
}

impl IkTask {
    /// Builds a task, and the memory that it starts with.
    ///
    /// # Errors
    /// A link, joint or posture is unknown, or the number of weights is wrong.
    pub fn new(
        name: &str,
        file: &TaskFile,
        robot: &RobotDescription,
        of: &Structure<'_>,
    ) -> Result<(Self, TaskMemory), LoadError> {
        let model = of.model;
        let key = |key: &str| format!("task.{name}.{key}");
        let frame =
            |field: &str, link: &str| model.frame(link).map_err(|error| wrong(format!("{}: {error}", key(field))));
        let disabled = disabled_columns(name, file, model)?;
        let nj = model.nj();
        let mut memory = TaskMemory {
            name: name.to_owned(),
            active: file.active,
            base_link: -1,
            gain: file.gain,
            ..TaskMemory::default()
        };
        let limits = file.limits.of_pose();
        let links = || -> Result<(FrameId, Option<FrameId>), LoadError> {
            let link = frame("link", file.link.as_deref().unwrap_or_default())?;
            let base = if file.base_link == WORLD { None } else { Some(frame("base_link", &file.base_link)?) };
            if let Some(base) = base.filter(|base| model.moves(link, *base)) {
                let (base, link) = (model.frame_name(base), model.frame_name(link));
                return Err(wrong(format!("{}: {base} is moved by {link}", key("base_link"))));
            }
            Ok((link, base))
        };
        let (form, rows, reference) = match file.kind {
            TaskType::Cartesian => {
                let (link, base) = links()?;
                memory.base_link = index_of(base);
                let mut task = RelativePose::new(of, link, base, file.gain);
                (task.orientation_gain, task.local, task.disabled) =
                    (file.orientation_gain, file.local, disabled.clone());
                let rows = task.rows();
                (Form::Pose(task), rows, Reference::of_pose(limits))
            }
            TaskType::Com => {
                let mut task = CenterOfMass::new(of, file.gain);
                task.disabled.clone_from(&disabled);
                let rows = task.rows();
                (Form::Com(task), rows, Reference::of_pose(limits))
            }
            TaskType::Posture => {
                let goals = posture_of(robot, file.posture.as_deref().unwrap_or(crate::model::NOMINAL))?;
                (Form::Joints, Rows::new(0, []), Reference::of_joints(&goals, limits))
            }
            TaskType::MinimumVelocity => (Form::Joints, Rows::new(0, []), Ok(Reference::None)),
            TaskType::Gaze => {
                let (link, base) = links()?;
                memory.base_link = index_of(base);
                let axis = Vector3::from(file.axis.unwrap_or_default()).normalize();
                let mut task = Gaze::new(of, link, &axis, base, file.gain);
                task.disabled.clone_from(&disabled);
                let rows = task.rows();
                (Form::Gaze(task, axis), rows, Reference::of_pose(limits))
            }
            TaskType::AngularMomentum => {
                let mut task = AngularMomentum::new(of);
                task.disabled.clone_from(&disabled);
                let rows = task.rows();
                (Form::AngularMomentum(task), rows, Ok(Reference::None))
            }
            TaskType::MinimumEffort => {
                let task = MinimumEffort::new(of, file.gain);
                let rows = task.rows();
                (Form::Effort(task), rows, Ok(Reference::None))
            }
            TaskType::Manipulability => {
                let task = Manipulability::new(name, of, links()?, Motion::Position, file.gain)?;
                let rows = task.rows();
                (Form::Manipulability(task), rows, Ok(Reference::None))
            }
        };
        let reference = reference.map_err(|error| wrong(format!("{}: {error}", key("limits"))))?;
        let mut is_enabled = vec![true; model.nv()];
        disabled.iter().for_each(|&column| is_enabled[column] = false);
        let task = IkTask {
            name: name.to_owned(),
            kind: file.kind,
            rows,
            form,
            reference,
            is_enabled,
            joint_rates: vec![0.0; nj],
        };
        let size = task.size();
        memory.weights = match &file.weight {
            WeightFile::One(weight) => vec![*weight; size],
            WeightFile::Each(weights) if weights.len() == size => weights.clone(),
            WeightFile::Each(weights) => {
                return Err(wrong(format!("{}: {} numbers, expected 1 or {size}", key("weight"), weights.len())));
            }
        };
        memory.n_weights = i32::try_from(size).expect("a task's rows");
        memory.reference = vec![0.0; task.reference.size()];
        memory.n_reference = i32::try_from(task.reference.size()).expect("a few numbers for each joint");
        task.reference.write(&mut memory.reference);
        Ok((task, memory))
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        match &self.form {
            Form::Pose(task) => task.size(),
            Form::Com(task) => task.size(),
            Form::Gaze(task, _) => task.size(),
            Form::AngularMomentum(task) => task.size(),
            Form::Effort(task) => task.size(),
            Form::Manipulability(task) => task.size(),
            Form::Joints => self.joint_rates.len(),
        }
    }

    /// Number of rows for which a level needs dense memory.
    pub fn dense_rows(&self) -> usize {
        self.rows.len()
    }

    /// The controlled link of a pose.
    pub fn link(&self) -> Option<FrameId> {
        match &self.form {
            Form::Pose(task) => Some(task.link),
            Form::Gaze(task, _) => Some(task.link),
            _ => None,
        }
    }

    /// The reference.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// Takes the reference from its memory.
    ///
    /// # Errors
    /// As [`Reference::check`]; nothing changes then.
    pub fn read(&mut self, memory: &TaskMemory) -> Result<(), RestoreError> {
        self.reference.read(&memory.reference)
    }

    /// Changes the reference.
    pub fn change<T>(&mut self, memory: &mut TaskMemory, change: impl FnOnce(&mut Reference) -> T) -> T {
        let changed = change(&mut self.reference);
        self.reference.write(&mut memory.reference);
        changed
    }

    /// Changes the reference of a pose or a position. `None` for a task of joints.
    pub fn change_pose<T>(
        &mut self,
        memory: &mut TaskMemory,
        change: impl FnOnce(&mut TaskReference) -> T,
    ) -> Option<T> {
        self.change(memory, |reference| match reference {
            Reference::Pose(reference) => Some(change(reference)),
            Reference::Joints(_) | Reference::None => None,
        })
    }

    /// Changes the references of the joints. `None` for another task than a posture.
    pub fn change_posture<T>(
        &mut self,
        memory: &mut TaskMemory,
        change: impl FnOnce(&mut AxesReference) -> T,
    ) -> Option<T> {
        self.change(memory, |reference| match reference {
            Reference::Joints(reference) => Some(change(reference)),
            Reference::Pose(_) | Reference::None => None,
        })
    }

    /// Whether the reference is a pose or a position, which way-points and velocities can move.
    pub fn has_pose(&self) -> bool {
        matches!(self.form, Form::Pose(_) | Form::Com(_) | Form::Gaze(..))
    }

    /// Rows that a term of a formula uses.
    ///
    /// # Errors
    /// A row that the task does not have.
    pub fn used(&self, index: usize, term: &TaskTerm) -> Result<UsedRows, LoadError> {
        let size = self.size();
        let takes = match &term.rows {
            None => vec![true; size],
            Some(rows) => {
                if let Some(row) = rows.iter().find(|row| **row >= size) {
                    return Err(wrong(format!("formula: {}[{row}], expected a row from 0 to {}", term.task, size - 1)));
                }
                (0..size).map(|row| rows.contains(&row)).collect()
            }
        };
        Ok(UsedRows { task: index, weight: term.weight, takes })
    }

    /// The present pose of the model, in the axes of the base link of `memory`.
    pub fn actual(&mut self, memory: &TaskMemory, model: &Model, kin: &Kinematics) -> Pose {
        match &mut self.form {
            Form::Pose(task) => {
                task.relative_to = frame_of(model, memory.base_link);
                let (p, R) = task.pose(model, kin);
                Pose { p, R }
            }
            Form::Com(_) => Pose { p: com(kin), R: Matrix3::identity() },
            // The point of the axis at 1 m.
            Form::Gaze(task, axis) => {
                let p = kin.p_WF(model, task.link) + kin.R_WF(model, task.link) * *axis;
                let p = frame_of(model, memory.base_link)
                    .map_or(p, |base| kin.R_WF(model, base).transpose() * (p - kin.p_WF(model, base)));
                Pose { p, R: Matrix3::identity() }
            }
            _ => Pose::identity(),
        }
    }

    /// Makes the present pose of the model the reference. That of a posture moves from the present posture to its goal.
    pub fn reset(&mut self, memory: &mut TaskMemory, state: &ModelState<'_>) {
        let pose = self.actual(memory, state.model, state.kin);
        self.change(memory, |reference| reference.reset(&pose, state.q));
    }

    /// Advances the reference by `dt` seconds and writes the rows.
    pub fn update(&mut self, memory: &mut TaskMemory, state: &ModelState<'_>, t_ns: i64, dt: f64) {
        let IkTask { form, reference, rows, joint_rates, .. } = self;
        match (form, &mut *reference) {
            (Form::Pose(task), Reference::Pose(reference)) => {
                let (Pose { p, R }, twist) = reference.update(dt, t_ns);
                (task.relative_to, task.gain) = (frame_of(state.model, memory.base_link), memory.gain);
                task.update(state, &RelativePoseReference { p, R, twist }, rows);
            }
            (Form::Com(task), Reference::Pose(reference)) => {
                let (pose, twist) = reference.update(dt, t_ns);
                task.gain = memory.gain;
                task.update(state, &(pose.p, twist.fixed_rows::<3>(0).into_owned()), rows);
            }
            (Form::Gaze(task, _), Reference::Pose(reference)) => {
                let (pose, twist) = reference.update(dt, t_ns);
                (task.relative_to, task.gain) = (frame_of(state.model, memory.base_link), memory.gain);
                task.update(state, &(pose.p, twist.fixed_rows::<3>(0).into_owned()), rows);
            }
            (Form::AngularMomentum(task), _) => task.update(state, &Vector3::zeros(), rows),
            (Form::Effort(task), _) => {
                task.gain = memory.gain;
                task.update(state, &(), rows);
            }
            (Form::Manipulability(task), _) => {
                task.gain = memory.gain;
                task.update(state, &(), rows);
            }
            (_, Reference::Joints(reference)) => {
                reference.update(dt);
                for ((rate, axis), q) in joint_rates.iter_mut().zip(reference.axes()).zip(state.q) {
                    *rate = axis.v + memory.gain * (axis.p - q);
                }
            }
            // Joint velocities that are kept small.
            _ => {}
        }
        reference.write(&mut memory.reference);
    }

    /// Adds the rows to a level.
    pub fn add_to(&self, level: &mut Level, used: &UsedRows, memory: &TaskMemory) {
        if let Form::Joints = self.form {
            let base = self.is_enabled.len() - self.joint_rates.len();
            for (j, rate) in self.joint_rates.iter().enumerate().filter(|(j, _)| used.takes[*j]) {
                if self.is_enabled[base + j] {
                    let weight = used.weight * memory.weights[j];
                    level.push_pick(Pick { column: base + j, factor: 1.0, b: *rate, weight });
                }
            }
            return;
        }
        for row in (0..self.rows.len()).filter(|row| used.takes[*row]) {
            let to = level.push(self.rows.b[row], used.weight * memory.weights[row]);
            self.copy_row(row, to);
        }
    }

    /// Adds the rows as equality constraints.
    pub fn add_as_constraint(&self, general: &mut GeneralRows) {
        for row in 0..self.rows.len() {
            let side = self.rows.b[row];
            let to = general.push(Sides { lower: side, upper: side, from: 0 });
            self.copy_row(row, to);
        }
    }

    fn copy_row(&self, row: usize, to: &mut [f64]) {
        let (a, rows) = (self.rows.A.as_slice(), self.rows.len());
        for (to, a) in to.iter_mut().zip(a[row..].iter().step_by(rows)) {
            *to = *a;
        }
    }

    /// Norm of `A v - b` over its rows.
    pub fn residual(&self, v: &[f64]) -> f64 {
        let square = |x: f64| x * x;
        if let Form::Joints = self.form {
            let base = self.is_enabled.len() - self.joint_rates.len();
            let rows = self.joint_rates.iter().enumerate().filter(|(j, _)| self.is_enabled[base + j]);
            return rows.fold(0.0, |sum, (j, rate)| sum + square(v[base + j] - rate)).sqrt();
        }
        let left = |row: usize| (0..v.len()).fold(-self.rows.b[row], |sum, col| sum + self.rows.A[(row, col)] * v[col]);
        (0..self.rows.len()).fold(0.0, |sum, row| sum + square(left(row))).sqrt()
    }
}

/// Columns of the joints that a task does not move.
fn disabled_columns(name: &str, file: &TaskFile, model: &Model) -> Result<Vec<usize>, LoadError> {
    let column = |joint: &String| {
        let id = model.joint(joint).map_err(|error| wrong(format!("task.{name}: {error}")))?;
        Ok(model.v_index(id))
    };
    if file.enabled_joints.is_empty() {
        return file.disabled_joints.iter().map(column).collect();
    }
    let enabled = file.enabled_joints.iter().map(column).collect::<Result<Vec<_>, LoadError>>()?;
    Ok((0..model.nv()).filter(|column| !enabled.contains(column)).collect())
}

/// The index of a link in a message; -1 for the world.
pub fn index_of(link: Option<FrameId>) -> i32 {
    link.map_or(-1, |link| i32::try_from(link.index()).expect("a robot's links"))
}

/// The link of an index in a message.
pub fn frame_of(model: &Model, index: i32) -> Option<FrameId> {
    model.frame_at(usize::try_from(index).ok()?)
}
