//! The whole-body controller: constraints of a quadruped, the stack of tasks subject to them, and joint torques from the solution.
//!
//! ```text
//! x = [vd; F; s]:   minimize the tasks of `[stack] formula`, by weight or by priority, subject to its constraints
//! ```
//! Source: Raiola et al. 2020, eqs. (4), (6)-(15). The robot has four point contacts. The size of the programs is constant: a foot in swing keeps its
//! columns and rows, with zero force.
//!
//! The torque limits are not in the source. One slack `s` for all joints keeps the program feasible. Without `torque_limits` in the formula, the program
//! has no `s`.
//!
//! The tasks are in [`super::tasks`], the table of names in [`super::stack_table`], the constraints in [`crate::constraints`], levels and solvers in
//! [`crate::stack`].

use super::estimation::Estimate;
use super::foot_load::{carries, force_bounds};
use super::leg::{Leg, LegPhase, PerLeg};
use super::reference::References;
use super::robot::Robot;
use super::stack_table::{REGISTRY, TORQUE_LIMITS};
use super::state::State;
use super::tasks::{TaskInput, Tasks};
use super::timing::Timing;
use super::trunk::TrunkReference;
use crate::contact::{ContactLoad, FORCE_UNIT};
use crate::error::LoadError;
use crate::math::quaternion;
use crate::params::Params;
use crate::qp::{Backend, NamedViolation, Qp, QpInfo, QpStatus, RowNames, explain};
use crate::stack::{
    Cascade, Constraint, Formula, ModelState, Solver, StackError, Structure, Variables, pattern, update_all,
};
use lcmtypes::RobotState;
use nalgebra::{DVector, Matrix3, Vector3};

/// Weight of the squared torque slack, in units of the largest effort, relative to the largest weight of a task: 1 % of slack costs as much as a
/// contact acceleration of 1 m/s². A larger weight would let the program plan feet that slip.
const SLACK_WEIGHT: f64 = 1e4;

/// The quadratic programs of a tick and their solutions. Every tick overwrites all of them.
pub struct Wbc {
    /// The tasks.
    pub tasks: Tasks,
    /// The levels.
    pub stack: Cascade,
    /// Status of the solve.
    pub info: QpInfo,
    /// Solution, with forces in units of `FORCE_UNIT`.
    pub x: DVector<f64>,
    /// Vertical force bounds, N.
    pub f_z_bounds: PerLeg<(f64, f64)>,
    /// Accelerations, nv.
    pub vd: DVector<f64>,
    /// Contact forces, N.
    pub f_F_W: PerLeg<Vector3<f64>>,
    /// Joint torques before limits, nj, N m.
    pub tau: DVector<f64>,
    /// Slack of the torque limits, N m: no torque exceeds its limit by more. 0 without torque limits.
    pub torque_slack: f64,
    /// Unit of the slack variable: the largest finite effort, N m; without one, [`FORCE_UNIT`].
    slack_unit: f64,
    formula: Formula,
    variables: Variables,
    constraints: Vec<Box<dyn Constraint>>,
    loads: [ContactLoad; 4],
}

impl Wbc {
    /// Allocates memory and solvers for a robot.
    ///
    /// # Errors
    /// The stack does not fit the robot: an unknown task, row or link, or a task without effect.
    pub fn new(robot: &Robot, params: &Params) -> Result<Self, LoadError> {
        let (nv, nj) = (robot.model.nv(), robot.nj());
        let nan = |n| DVector::from_element(n, f64::NAN);
        let formula = Formula::parse(&params.stack.formula)?;
        let sizes = robot.contacts.0.iter().map(|contact| contact.size());
        let variables = Variables::new(nv, sizes, formula.has(TORQUE_LIMITS));
        let (tasks, levels) = Tasks::new(robot, params, &formula, &variables)?;
        let of = Structure { model: &robot.model, contacts: &robot.contacts.0, variables: &variables };
        let slack_unit = slack_unit(robot);
        let constraints: Vec<Box<dyn Constraint>> =
            REGISTRY.constraints_of(&formula).map(|entry| (entry.new)(&of, params, slack_unit)).collect();
        let pattern = pattern(&constraints, &variables, tasks.columns());
        let heaviest = formula.terms().fold(0.0_f64, |most, (_, term)| most.max(term.weight));
        let regularization = DVector::from_fn(variables.len(), |i, _| match i {
            _ if variables.motion().contains(&i) => params.wbc.regularization,
            _ if variables.forces().contains(&i) => params.wbc.regularization * (FORCE_UNIT * FORCE_UNIT),
            _ => SLACK_WEIGHT * heaviest,
        });
        let slack = variables.slack();
        let each = |of_level: &Qp| params.qp.solver.build(of_level, params.wbc.max_iterations, params.wbc.tolerance);
        let solver = match params.qp.solver {
            Backend::ActiveSet => Solver::Shared(params.wbc.max_iterations),
            Backend::Clarabel => Solver::Each(&each),
        };
        let columns = tasks.columns();
        let mut wbc = Wbc {
            tasks,
            stack: Cascade::new(levels, &pattern, regularization, columns, slack, &solver),
            info: QpInfo { status: QpStatus::Failed, iterations: 0, n_active: 0, row: None },
            x: nan(pattern.n()),
            f_z_bounds: PerLeg([(f64::NAN, f64::NAN); 4]),
            vd: nan(nv),
            f_F_W: PerLeg([Vector3::from_element(f64::NAN); 4]),
            tau: nan(nj),
            torque_slack: f64::NAN,
            slack_unit,
            formula,
            variables,
            constraints,
            loads: [ContactLoad::NONE; 4],
        };
        wbc.check_at_home(robot, params)?;
        Ok(wbc)
    }

    /// Builds the quadratic programs: tasks, constraints and bounds.
    pub fn build(
        &mut self,
        robot: &Robot,
        params: &Params,
        measured: &RobotState,
        estimate: &Estimate,
        trunk: &TrunkReference,
        references: &References,
        state: &State,
    ) {
        let timing = Timing::of(state, params);
        for leg in Leg::ALL {
            self.f_z_bounds[leg] = force_bounds(state, params, &timing, estimate.M[(0, 0)], leg);
            self.loads[leg as usize] = load(carries(state, leg), params.wbc.f_xy_max, self.f_z_bounds[leg]);
        }
        let Wbc { tasks, stack, variables, constraints, loads, .. } = self;
        let model = ModelState {
            model: &robot.model,
            contacts: &robot.contacts.0,
            variables,
            q: &measured.q,
            qd: &measured.qd,
            kin: &estimate.kin,
            M: &estimate.M,
            h: &estimate.h,
            at: &estimate.contacts.0,
            loads: &loads[..],
        };
        tasks.update(&TaskInput { robot, params, measured, estimate, references, state, model }, trunk);
        update_all(constraints, &model, stack.constraints());
        self.stack.build(&self.tasks.rows);
    }

    /// Solves the quadratic programs. If the first level has no finite solution, the status says so, and `x`, `vd`, `f_F_W` and `tau` are zero.
    ///
    /// ```text
    /// tau = rows of ( M vd + h - Jᵀ F ) at the joints
    /// ```
    /// Source: Raiola et al. 2020, eq. (3).
    pub fn solve(&mut self, estimate: &Estimate, state: &State) {
        self.stack.solve(&self.tasks.rows);
        self.info = self.stack.info();
        let Some(level) = self.stack.solution() else {
            self.x.fill(0.0);
            self.vd.fill(0.0);
            self.f_F_W = PerLeg::default();
            self.tau.fill(0.0);
            self.torque_slack = 0.0;
            return;
        };
        self.x.copy_from(&level.x);
        let nv = self.vd.len();
        self.vd.copy_from(&self.x.rows(0, nv));
        for leg in Leg::ALL {
            let at = self.variables.force(leg as usize).start;
            let f = Vector3::new(self.x[at], self.x[at + 1], self.x[at + 2]) * FORCE_UNIT;
            self.f_F_W[leg] = if carries(state, leg) { f } else { Vector3::zeros() };
        }
        self.torque_slack = self.variables.slack().map_or(0.0, |slack| self.x[slack] * self.slack_unit);
        for j in 0..self.tau.len() {
            let row = 6 + j;
            let mut tau = estimate.h[row];
            for col in 0..nv {
                tau += estimate.M[(row, col)] * self.vd[col];
            }
            for leg in Leg::ALL {
                tau -= estimate.contacts[leg].J.column(row).dot(&self.f_F_W[leg]);
            }
            self.tau[j] = tau;
        }
    }

    /// Whether the last [`Wbc::solve`] has found a solution, at least for the first level.
    pub fn solved(&self) -> bool {
        self.stack.solution().is_some()
    }

    /// Largest violation of the floating-base dynamics by the solution, N or N m.
    pub fn base_residual(&self) -> f64 {
        let constraints = &self.stack.levels[0].qp;
        let mut worst = 0.0_f64;
        for row in 0..constraints.b.len() {
            let left = (0..self.x.len()).fold(0.0, |sum, col| sum + constraints.A[(row, col)] * self.x[col]);
            worst = worst.max((left - constraints.b[row]).abs());
        }
        worst
    }

    /// The quadratic program of a level (from 0) in the last [`Wbc::solve`]. It allocates: do not call it in a tick.
    pub fn program(&self, level: usize) -> Qp {
        self.stack.program(level, &self.tasks.rows)
    }

    /// Finds the first level (from 0) for which the last [`Wbc::solve`] has no solution, and the constraints that contradict each other. `None` if all
    /// levels have a solution, or if no contradiction can be found.
    pub fn explain(&self, robot: &Robot) -> Option<(usize, Vec<NamedViolation>)> {
        let failed = self.stack.levels.iter().position(|level| level.info.is_some() && !level.solved())?;
        Some((failed, explain(&self.program(failed), &self.row_names(robot))?))
    }

    /// Names of the rows and variables of the quadratic programs.
    pub(super) fn row_names(&self, robot: &Robot) -> RowNames {
        let mut variables: Vec<String> = ["base x", "base y", "base z", "base roll", "base pitch", "base yaw"]
            .map(|v| format!("acceleration of {v}"))
            .to_vec();
        variables.extend(robot.model.joints.iter().map(|joint| format!("acceleration of {}", joint.name)));
        for contact in &robot.contacts.0 {
            variables.extend(["force x", "force y", "force z"].map(|force| format!("{force} of {}", contact.name)));
        }
        if self.variables.slack().is_some() {
            variables.push("torque slack".to_owned());
        }
        let (mut equalities, mut inequalities) = (Vec::new(), Vec::new());
        for [equal, unequal] in self.constraints.iter().map(|constraint| constraint.names()) {
            equalities.extend(equal);
            inequalities.extend(unequal);
        }
        let above = self.stack.levels.iter().map(|level| level.qp.b.len() - equalities.len()).max().unwrap_or(0);
        equalities.extend((0..above).map(|row| format!("result of the levels above, direction {row}")));
        RowNames { equalities, inequalities, variables }
    }

    /// Checks that every term has an effect in the nominal posture, on all feet or with a diagonal pair in swing.
    fn check_at_home(&mut self, robot: &Robot, params: &Params) -> Result<(), StackError> {
        let mut estimate = Estimate::new(robot);
        let nj = robot.nj();
        let mut measured = RobotState { q: robot.q_nominal.clone(), ..RobotState::zeros(nj, 1, 0) };
        measured.q_WI_wxyz[0] = quaternion::from_rotation(&robot.R_IB.transpose());
        estimate.update(robot, &measured);
        let trunk = TrunkReference { R_WB: Matrix3::identity(), w_WB_W: Vector3::zeros() };
        let mut references = References::new(robot);
        references.qd_des.fill(0.0);
        let mut state = State::new(nj);
        let mut free = [const { Vec::new() }; 2];
        for (phase, free) in [LegPhase::Stance, LegPhase::SwingUp].into_iter().zip(&mut free) {
            (state.leg_state[Leg::LF], state.leg_state[Leg::RH]) = (phase, phase);
            self.build(robot, params, &measured, &estimate, &trunk, &references, &state);
            *free = self.stack.free_rows(&self.tasks.rows).concat();
        }
        let [standing, swinging] = free;
        for (((k, term), standing), swinging) in self.formula.terms().zip(standing).zip(swinging) {
            if standing == 0 && swinging == 0 {
                let rows = term.rows.as_ref().map_or_else(|| self.tasks.len_of(&term.task), Vec::len);
                return Err(StackError::NeverActs { column: term.column, task: term.task.clone(), level: k + 1, rows });
            }
        }
        Ok(())
    }
}

/// What a foot may carry.
///
/// - `f_xy`: largest horizontal force along x and y, N.
/// - `f_z`: bounds of the vertical force, N. The lower one limits the normal force.
fn load(active: bool, f_xy: f64, f_z: (f64, f64)) -> ContactLoad {
    let mut load = ContactLoad { active, least_normal: f_z.0, ..ContactLoad::NONE };
    load.lower[..3].copy_from_slice(&[-f_xy, -f_xy, 0.0]);
    load.upper[..3].copy_from_slice(&[f_xy, f_xy, f_z.1]);
    load
}

/// The largest finite effort of a joint, N m; without one, [`FORCE_UNIT`].
fn slack_unit(robot: &Robot) -> f64 {
    let efforts = robot.model.joints.iter().map(|joint| joint.effort).filter(|effort| effort.is_finite());
    let largest = efforts.fold(0.0, f64::max);
    if largest > 0.0 { largest } else { FORCE_UNIT }
}
