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
//! | others  | 6    | tasks of `[stack.tasks]`: [`crate::stack::CartesianConfig`]            |
//!
//! Contact, trunk and posture are computed in every tick, because messages contain their errors. A further task is one file in `tasks/` and one line in
//! `FURTHER`; it is computed if the formula names it.

mod cone_center;
mod forces;
mod internal_forces;
mod relative_feet;
mod swing;
mod task;

pub use forces::{FORCE_UNIT, force_column};
pub use internal_forces::net_wrench;
pub use task::{NewTask, Task, TaskInput};

use super::estimation::Estimate;
use super::foot_load::{carries, is_airborne};
use super::leg::{Leg, PerLeg};
use super::params::PostureParams;
use super::robot::Robot;
use super::state::State;
use super::trunk::TrunkReference;
use crate::error::LoadError;
use crate::math::log;
use crate::model::{BaseState, Kinematics};
use crate::params::Params;
use crate::stack::{Cartesian, Formula, Rows, StackError, TaskConfig, TaskTerm, Term, is_name};
use nalgebra::{DVector, Matrix3, Vector3};

const BUILT_IN: [&str; 3] = ["contact", "trunk", "posture"];
/// Further tasks: the name in a formula, and how it is built.
const FURTHER: [(&str, NewTask); 4] = [
    ("relative_feet", relative_feet::new),
    (SWING, swing::new),
    ("cone_center", cone_center::new),
    ("internal_forces", internal_forces::new),
];
/// Name of the Cartesian swing task.
const SWING: &str = "swing";
const CONTACT: usize = 0;
const TRUNK: usize = 1;
const POSTURE: usize = 2;

/// The tasks, their rows in a tick, and the right sides of the built-in tasks.
pub struct Tasks {
    /// Rows of contact, trunk and posture, of the further tasks in the formula, then of the tasks of `[stack.tasks]` in the order of their names.
    pub rows: Vec<Rows>,
    /// Orientation error, rotation vector in W, rad.
    pub e_o_W: Vector3<f64>,
    /// Right side of the posture task, nj, rad/s².
    pub qdd_posture: DVector<f64>,
    /// Right side of the trunk task, rad/s².
    pub wd_trunk: Vector3<f64>,
    names: Vec<String>,
    further: Vec<Box<dyn Task>>,
    cartesian: Vec<Cartesian>,
    /// Whether the task `swing` controls a leg in swing, instead of the posture task.
    cartesian_swing: PerLeg<bool>,
}

impl Tasks {
    /// Builds the built-in tasks of a robot, the further tasks that the formula names, and the tasks of `[stack.tasks]`.
    ///
    /// # Errors
    /// A task in the parameters has an invalid name, an unknown link, or a gain out of range.
    pub fn new(robot: &Robot, params: &Params, formula: &Formula) -> Result<Self, LoadError> {
        let (model, nv, nj) = (&robot.model, robot.model.nv(), robot.nj());
        let contact = Rows::new(nv, robot.legs.0.iter().map(|leg| (3, leg.columns())));
        let mut rows = vec![contact, Rows::selection(nv, 3..6), Rows::selection(nv, 6..nv)];
        let mut names: Vec<String> = BUILT_IN.map(str::to_owned).to_vec();
        let mut further = Vec::new();
        for (name, new) in FURTHER.iter().filter(|(name, _)| formula.terms().any(|(_, term)| term.task == *name)) {
            let (of_task, task) = new(robot);
            rows.push(of_task);
            names.push((*name).to_owned());
            further.push(task);
        }
        let mut home = Kinematics::new(model);
        home.update(model, &BaseState::identity(), &robot.q_nominal, &vec![0.0; nj]);
        let mut cartesian = Vec::new();
        for (name, config) in &params.stack.tasks {
            let wrong = |what| StackError::TaskName { task: name.clone(), what };
            if BUILT_IN.contains(&name.as_str()) || FURTHER.iter().any(|(further, _)| further == name) {
                return Err(wrong("the name of a built-in task").into());
            }
            if !is_name(name) {
                return Err(wrong("expected letters, digits and _, not starting with a digit").into());
            }
            let TaskConfig::Cartesian(config) = config;
            cartesian.push(Cartesian::new(name, config, model, &home)?);
            rows.push(Cartesian::rows(model));
            names.push(name.clone());
        }
        let nan = Vector3::from_element(f64::NAN);
        let qdd_posture = DVector::from_element(nj, f64::NAN);
        let cartesian_swing = PerLeg(Leg::ALL.map(|leg| (0..3).all(|k| formula.takes(SWING, 3 * leg as usize + k))));
        Ok(Tasks { rows, e_o_W: nan, qdd_posture, wd_trunk: nan, names, further, cartesian, cartesian_swing })
    }

    /// Converts a formula to levels; their terms refer to [`Tasks::rows`] by index.
    ///
    /// # Errors
    /// An unknown task, or a row that the task does not have.
    pub fn levels(&self, formula: &Formula) -> Result<Vec<Vec<Term>>, StackError> {
        let term = |term: &TaskTerm| {
            let TaskTerm { task, weight, rows, column } = term;
            let Some(place) = self.names.iter().position(|name| name == task) else {
                let of_robot = self.names[BUILT_IN.len() + self.further.len()..].iter().map(String::as_str);
                let known = BUILT_IN.into_iter().chain(FURTHER.map(|(name, _)| name)).chain(of_robot);
                let (task, known) = (task.clone(), known.collect::<Vec<_>>().join(", "));
                return Err(StackError::UnknownTask { column: *column, task, known });
            };
            let n = self.rows[place].len();
            let mut takes = vec![rows.is_none(); n];
            for &row in rows.iter().flatten() {
                let outside = || StackError::RowOutside { column: *column, task: task.clone(), row, last: n - 1 };
                *takes.get_mut(row).ok_or_else(outside)? = true;
            }
            Ok(Term { task: place, weight: *weight, takes })
        };
        formula.levels.iter().map(|level| level.iter().map(term).collect()).collect()
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
        let TaskInput { robot, params, estimate, state, .. } = *input;
        self.contact(estimate, state);
        self.trunk(robot, params, estimate, trunk, state);
        self.posture(input);
        let (further, cartesian) = self.rows[BUILT_IN.len()..].split_at_mut(self.further.len());
        for (task, rows) in self.further.iter_mut().zip(further) {
            task.fill(input, rows);
        }
        for (task, rows) in self.cartesian.iter_mut().zip(cartesian) {
            task.fill(&robot.model, &estimate.kin, &estimate.M, state.yaw_des, rows);
        }
    }

    /// Norms of the residuals of the built-in tasks at `vd`: contact (m/s²), trunk (rad/s²), posture (rad/s², joints that it controls).
    pub fn residuals(&self, vd: &DVector<f64>, estimate: &Estimate, state: &State) -> [f64; 3] {
        let nv = vd.len();
        let mut contact = 0.0;
        for leg in Leg::ALL {
            if carries(state, leg) {
                let of_leg = &estimate.legs[leg];
                let mut a = of_leg.a_bias_W;
                for col in 0..nv {
                    a += of_leg.J.fixed_view::<3, 1>(0, col) * vd[col];
                }
                contact += a.dot(&a);
            }
        }
        let trunk = vd.fixed_rows::<3>(3) - self.wd_trunk;
        let mut posture = 0.0;
        for j in (0..nv - 6).filter(|j| self.rows[POSTURE].is_on(*j)) {
            let e = vd[6 + j] - self.qdd_posture[j];
            posture += e * e;
        }
        [contact.sqrt(), trunk.dot(&trunk).sqrt(), posture.sqrt()]
    }

    /// `J vd = -a_bias` for each foot that carries load: the contact point is not accelerated. There is no feedback. Source: eq. (7).
    fn contact(&mut self, estimate: &Estimate, state: &State) {
        let rows = &mut self.rows[CONTACT];
        for leg in Leg::ALL {
            rows.switch(leg as usize, carries(state, leg));
            if carries(state, leg) {
                let at = 3 * leg as usize;
                rows.A.rows_mut(at, 3).copy_from(&estimate.legs[leg].J);
                for k in 0..3 {
                    rows.b[at + k] = -estimate.legs[leg].a_bias_W[k];
                }
            }
        }
    }

    /// `wd = K_P e_o + K_D (w_des - w)`, `e_o = log(R_des Rᵀ)`, in W axes. Source: eq. (8).
    fn trunk(&mut self, robot: &Robot, params: &Params, estimate: &Estimate, trunk: &TrunkReference, state: &State) {
        let kd = trunk_damping(robot, params, &estimate.base.R_WB);
        self.e_o_W = log(&(trunk.R_WB * estimate.base.R_WB.transpose()));
        let e_w = trunk.w_WB_W - estimate.base.w_WB_W;
        for k in 0..3 {
            self.wd_trunk[k] = params.trunk.kp[k] * self.e_o_W[k] + kd[k] * e_w[k];
            let rows = &mut self.rows[TRUNK];
            rows.switch(k, !is_airborne(state));
            if !is_airborne(state) {
                rows.A[(k, 3 + k)] = 1.0;
                rows.b[k] = self.wd_trunk[k];
            }
        }
    }

    /// `qdd = qdd_des + K_P (q_des - q) + K_D (qd_des - qd)`; the gains are premultiplied by the leg's inverse inertia if the parameters say so.
    /// Source: eq. (9), appendix A. With `posture.feed_forward`, `qdd_des` is the acceleration of the swing reference, and 0 in stance; the
    /// source has none. A swinging leg that the task `swing` controls has no rows.
    fn posture(&mut self, input: &TaskInput<'_>) {
        let TaskInput { robot, params, measured, estimate, references, state } = *input;
        for (leg, stance) in PerLeg(state.leg_state.0.map(|phase| phase.is_stance())).iter() {
            let joints = robot.legs[leg].joints;
            let PostureParams { swing_kp, swing_kd, swing_inertia, stance_kp, stance_kd, stance_inertia, .. } =
                &params.posture;
            let (kp, kd, inertia) =
                if *stance { (stance_kp, stance_kd, stance_inertia) } else { (swing_kp, swing_kd, swing_inertia) };
            let on = *stance || !self.cartesian_swing[leg];
            let mut u = Vector3::zeros();
            for k in 0..3 {
                let j = joints[k];
                u[k] = kp[k] * (state.q_des[j] - measured.q[j]) + kd[k] * (references.qd_des[j] - measured.qd[j]);
            }
            if *inertia {
                let M_leg = Matrix3::from_fn(|r, c| estimate.M[(6 + joints[r], 6 + joints[c])]);
                u = M_leg.try_inverse().map_or(Vector3::zeros(), |inverse| inverse * u);
            }
            for k in 0..3 {
                let qdd = if params.posture.feed_forward { u[k] + state.qdd_des[joints[k]] } else { u[k] };
                self.qdd_posture[joints[k]] = qdd;
                let rows = &mut self.rows[POSTURE];
                rows.switch(joints[k], on);
                if on {
                    rows.A[(joints[k], 6 + joints[k])] = 1.0;
                    rows.b[joints[k]] = qdd;
                }
            }
        }
    }
}

/// Damping of the trunk task about the axes of W, 1/s: that of the parameters, as far as it does not exceed `trunk.max_damping` as a torque.
pub fn trunk_damping(robot: &Robot, params: &Params, R_WB: &Matrix3<f64>) -> [f64; 3] {
    let I_W = R_WB * robot.trunk_inertia * R_WB.transpose();
    [0, 1, 2].map(|k| params.trunk.kd[k].min(params.trunk.max_damping / I_W[(k, k)]))
}
