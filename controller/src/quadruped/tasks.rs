//! The tasks of the quadruped, which fill the rows of the stack in every tick.
//!
//! | task    | rows | quantity                                                               |
//! |---------|------|------------------------------------------------------------------------|
//! | contact | 12   | acceleration of the contact points, x y z of LF RF LH RH, in W         |
//! | trunk   | 3    | angular acceleration of the base about x y z, in W                     |
//! | posture | nj   | joint accelerations, in URDF order                                     |
//! | relative_feet   | 12 | as contact, with feedback on the positions of the standing feet relative to each other |
//! | swing           | 12 | acceleration of the feet in swing relative to the base, x y z of LF RF LH RH, in W    |
//! | cone_center     | 8  | tangential contact forces, two of LF RF LH RH, N                       |
//! | internal_forces | 12 | contact forces without net force and moment, x y z of LF RF LH RH, N   |
//! | others  | 6    | tasks of `[stack.tasks]`: [`crate::tasks::acceleration::CartesianConfig`] |
//!
//! Contact, trunk and posture are computed in every tick, because messages contain their errors. A further task is computed if the formula names it. The table
//! is in [`super::stack_table`]; tasks for any robot are in [`crate::tasks`], those of a quadruped alone in `tasks/`.

pub(super) mod relative_feet;
pub(super) mod swing;
mod task;

pub use task::{FromLoads, QuadrupedTask, TaskInput};

use super::estimation::Estimate;
use super::foot_load::{carries, is_airborne};
use super::leg::{Leg, PerLeg};
use super::params::PostureParams;
use super::robot::Robot;
use super::stack_table::{NewTask, REGISTRY, SWING};
use super::state::State;
use super::trunk::TrunkReference;
use crate::error::LoadError;
use crate::math::Rz;
use crate::model::{BaseState, Kinematics};
use crate::params::Params;
use crate::stack::{Formula, Rows, StackError, Structure, Task, TaskConfig, TaskTerm, Term, Variables, is_name};
use crate::tasks::acceleration::{
    BaseOrientation, Cartesian, ContactsAtRest, OrientationReference, Posture, PostureReference,
};
use nalgebra::{DVector, Matrix3};

/// Number of tasks at the start of the table that are computed in every tick.
const N_BUILT_IN: usize = 3;
const CONTACT: usize = 0;
const TRUNK: usize = 1;
const POSTURE: usize = 2;

/// The tasks, their rows in a tick, and the right sides of the built-in tasks.
pub struct Tasks {
    /// Rows of contact, trunk and posture, of the further tasks in the formula, then of the tasks of `[stack.tasks]` in the order of their names.
    pub rows: Vec<Rows>,
    /// Task `trunk`, with its error and its right side.
    pub trunk: BaseOrientation,
    /// Task `posture`, with its right side.
    pub posture: Posture,
    posture_reference: PostureReference,
    contact: ContactsAtRest,
    names: Vec<String>,
    further: Vec<Box<dyn QuadrupedTask>>,
    cartesian: Vec<Cartesian>,
    /// Whether the task `swing` controls a leg in swing, instead of the posture task.
    cartesian_swing: PerLeg<bool>,
}

impl Tasks {
    /// Builds the built-in tasks of a robot, the further tasks that the formula names, and the tasks of `[stack.tasks]`. Returns them with the levels of the
    /// formula; their terms refer to [`Tasks::rows`] by index.
    ///
    /// # Errors
    /// A task in the parameters has an invalid name, an unknown link, or a gain out of range. The formula contains a name that is unknown or of a
    /// level that `variables` lack, or a row that a task does not have, or lacks a needed constraint.
    pub fn new(
        robot: &Robot,
        params: &Params,
        formula: &Formula,
        variables: &Variables,
    ) -> Result<(Self, Vec<Vec<Term>>), LoadError> {
        let model = &robot.model;
        let of = Structure { model, contacts: &robot.contacts.0, variables };
        let (contact, trunk) = (ContactsAtRest::new(&of), BaseOrientation::new(&of));
        let posture = Posture::new(&of, robot.legs.0.iter().map(|leg| leg.joints.to_vec()).collect());
        let mut rows = vec![contact.rows(), trunk.rows(), posture.rows()];
        let mut names: Vec<String> = REGISTRY.tasks[..N_BUILT_IN].iter().map(|entry| entry.name.to_owned()).collect();
        let mut further = Vec::new();
        for entry in REGISTRY.tasks.iter().filter(|entry| formula.terms().any(|(_, term)| term.task == entry.name)) {
            if let NewTask::Further(new) = entry.new {
                let task = new(&of, robot);
                rows.push(task.rows());
                names.push(entry.name.to_owned());
                further.push(task);
            }
        }
        let mut home = Kinematics::new(model);
        home.update(model, &BaseState::identity(), &robot.q_nominal, &vec![0.0; robot.nj()]);
        let mut cartesian = Vec::new();
        for (name, config) in &params.stack.tasks {
            let wrong = |what| StackError::TaskName { task: name.clone(), what };
            if REGISTRY.tasks.iter().any(|entry| entry.name == name) {
                return Err(wrong("the name of a built-in task").into());
            }
            if !is_name(name) {
                return Err(wrong("expected letters, digits and _, not starting with a digit").into());
            }
            let TaskConfig::Cartesian(config) = config;
            let task = Cartesian::new(name, config, model, &home)?;
            rows.push(task.rows());
            cartesian.push(task);
            names.push(name.clone());
        }
        let own: Vec<&str> = params.stack.tasks.keys().map(String::as_str).collect();
        REGISTRY.check(formula, &own, variables)?;
        let levels = levels(formula, &names, &rows)?;
        let cartesian_swing = PerLeg(Leg::ALL.map(|leg| (0..3).all(|k| formula.takes(SWING, 3 * leg as usize + k))));
        let posture_reference = posture.reference();
        let tasks =
            Tasks { rows, trunk, posture, posture_reference, contact, names, further, cartesian, cartesian_swing };
        Ok((tasks, levels))
    }

    /// Names of the tasks, in the order of [`Tasks::rows`].
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.names.iter().map(String::as_str)
    }

    /// Number of leading variables in which the rows may have non-zero entries: accelerations, and forces if the formula names a task of forces.
    pub fn columns(&self) -> usize {
        self.rows.iter().map(|rows| rows.A.ncols()).fold(0, usize::max)
    }

    /// Number of rows of a task; 0 for an unknown name.
    pub fn len_of(&self, task: &str) -> usize {
        self.names.iter().zip(&self.rows).find(|(name, _)| *name == task).map_or(0, |(_, rows)| rows.len())
    }

    /// Fills the rows of all tasks.
    pub fn update(&mut self, input: &TaskInput<'_>, trunk: &TrunkReference) {
        let TaskInput { robot, params, estimate, state, model, .. } = *input;
        self.contact.update(&model, &(), &mut self.rows[CONTACT]);
        let reference = OrientationReference {
            R_WB: trunk.R_WB,
            w_WB_W: trunk.w_WB_W,
            kp: params.trunk.kp,
            kd: trunk_damping(robot, params, &estimate.base.R_WB),
            active: !is_airborne(state),
        };
        self.trunk.update(&model, &reference, &mut self.rows[TRUNK]);
        self.set_posture(input);
        self.posture.update(&model, &self.posture_reference, &mut self.rows[POSTURE]);
        let (further, cartesian) = self.rows[N_BUILT_IN..].split_at_mut(self.further.len());
        for (task, rows) in self.further.iter_mut().zip(further) {
            task.fill(input, rows);
        }
        for (task, rows) in self.cartesian.iter_mut().zip(cartesian) {
            let mut reference = task.home();
            if task.in_world() {
                reference.R = Rz(state.yaw_des) * reference.R;
            }
            task.update(&model, &reference, rows);
        }
    }

    /// Norms of the residuals of the built-in tasks at `vd`: contact (m/s²), trunk (rad/s²), posture (rad/s², joints that it controls).
    pub fn residuals(&self, vd: &DVector<f64>, estimate: &Estimate, state: &State) -> [f64; 3] {
        let nv = vd.len();
        let mut contact = 0.0;
        for leg in Leg::ALL {
            if carries(state, leg) {
                let of_foot = &estimate.contacts[leg];
                let mut a = of_foot.linear_bias();
                for col in 0..nv {
                    a += of_foot.J.fixed_view::<3, 1>(0, col) * vd[col];
                }
                contact += a.dot(&a);
            }
        }
        let trunk = vd.fixed_rows::<3>(3) - self.trunk.wd;
        let mut posture = 0.0;
        for j in (0..nv - 6).filter(|j| self.rows[POSTURE].is_on(*j)) {
            let e = vd[6 + j] - self.posture.qdd[j];
            posture += e * e;
        }
        [contact.sqrt(), trunk.dot(&trunk).sqrt(), posture.sqrt()]
    }

    /// Writes the reference of the posture task. With `posture.feed_forward` it contains the acceleration of the swing reference, which is 0 in stance;
    /// the source has none. A swinging leg that the task `swing` controls has no rows.
    fn set_posture(&mut self, input: &TaskInput<'_>) {
        let TaskInput { robot, params, references, state, .. } = *input;
        let to = &mut self.posture_reference;
        let PostureParams { swing_kp, swing_kd, swing_inertia, stance_kp, stance_kd, stance_inertia, .. } =
            &params.posture;
        to.q.copy_from_slice(&state.q_des);
        to.qd.copy_from_slice(references.qd_des.as_slice());
        for leg in Leg::ALL {
            let stance = state.leg_state[leg].is_stance();
            let (kp, kd, inertia) =
                if stance { (stance_kp, stance_kd, stance_inertia) } else { (swing_kp, swing_kd, swing_inertia) };
            to.inertia[leg as usize] = *inertia;
            to.active[leg as usize] = stance || !self.cartesian_swing[leg];
            for (k, j) in robot.legs[leg].joints.into_iter().enumerate() {
                (to.kp[j], to.kd[j]) = (kp[k], kd[k]);
                to.qdd[j] = if params.posture.feed_forward { state.qdd_des[j] } else { -0.0 };
            }
        }
    }
}

/// Converts a formula to levels; their terms refer to the tasks by index.
///
/// # Errors
/// A row that a task does not have.
fn levels(formula: &Formula, names: &[String], rows: &[Rows]) -> Result<Vec<Vec<Term>>, StackError> {
    let term = |term: &TaskTerm| {
        let TaskTerm { task, weight, rows: taken, column } = term;
        let place = names.iter().position(|name| name == task).expect("the registry knows every name of the formula");
        let n = rows[place].len();
        let mut takes = vec![taken.is_none(); n];
        for &row in taken.iter().flatten() {
            let outside = || StackError::RowOutside { column: *column, task: task.clone(), row, last: n - 1 };
            *takes.get_mut(row).ok_or_else(outside)? = true;
        }
        Ok(Term { task: place, weight: *weight, takes })
    };
    formula.levels.iter().map(|level| level.iter().map(term).collect()).collect()
}

/// Damping of the trunk task about the axes of W, 1/s: that of the parameters, as far as it does not exceed `trunk.max_damping` as a torque.
pub fn trunk_damping(robot: &Robot, params: &Params, R_WB: &Matrix3<f64>) -> [f64; 3] {
    let I_W = R_WB * robot.trunk_inertia * R_WB.transpose();
    [0, 1, 2].map(|k| params.trunk.kd[k].min(params.trunk.max_damping / I_W[(k, k)]))
}
