//! The whole-body controller: constraints of a quadruped, the stack of tasks subject to them, and joint torques from the solution.
//!
//! ```text
//! x = [vd; F; s]:   minimize the tasks of `[stack] formula`, by weight or by priority, subject to C_fb, C_fc, C_acc, C_Fc, C_tau
//! ```
//! Source: Raiola et al. 2020, eqs. (4), (6)-(15). The size of the programs is constant: a foot in swing keeps its columns and rows, with zero force.
//! Equal lower and upper bounds would leave no interior for an interior-point solver. Therefore the columns of that force are zero except in its
//! own bounds, which are ±`RELEASED`. The regularization then gives F = 0 up to rounding, and the force is read as 0.
//!
//! C_tau is not in the source: each joint torque stays within what its drive can do at the measured velocity. One slack `s` for all joints keeps
//! the program feasible. Without C_tau in the formula, the program has neither these rows nor `s`.
//!
//! The tasks are in [`super::tasks`], levels and solvers in [`crate::stack`].

use super::estimation::Estimate;
use super::foot_load::{carries, force_bounds};
use super::ground;
use super::leg::{Leg, LegPhase, PerLeg};
use super::reference::References;
use super::robot::Robot;
use super::state::State;
use super::tasks::{FORCE_UNIT, TaskInput, Tasks};
use super::timing::Timing;
use super::trunk::TrunkReference;
use crate::error::LoadError;
use crate::math::quaternion;
use crate::params::Params;
use crate::qp::{Backend, NamedViolation, Qp, QpInfo, QpStatus, RowNames, explain};
use crate::stack::{Cascade, Constraint, Formula, Solver, StackError};
use lcmtypes::RobotState;
use nalgebra::{DVector, Matrix3, Vector3};

/// Half width of the bounds on the force of a foot in swing, in [`FORCE_UNIT`].
const RELEASED: f64 = 1.0;
/// Rows of the friction pyramid of a foot.
const ROWS_FC: usize = 5;
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
        let tasks = Tasks::new(robot, params, &formula)?;
        let levels = tasks.levels(&formula)?;
        let pattern = pattern(robot, &formula, tasks.columns());
        let heaviest = formula.terms().fold(0.0_f64, |most, (_, term)| most.max(term.weight));
        let regularization = DVector::from_fn(pattern.n(), |i, _| match i {
            _ if i < nv => params.wbc.regularization,
            _ if i < nv + 12 => params.wbc.regularization * (FORCE_UNIT * FORCE_UNIT),
            _ => SLACK_WEIGHT * heaviest,
        });
        let efforts = robot.model.joints.iter().map(|joint| joint.effort).filter(|effort| effort.is_finite());
        let slack = formula.has(Constraint::TorqueLimits).then_some(nv + 12);
        let largest = efforts.fold(0.0, f64::max);
        let slack_unit = if largest > 0.0 { largest } else { FORCE_UNIT };
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
        self.tasks.update(&TaskInput { robot, params, measured, estimate, references, state }, trunk);
        self.base_dynamics(estimate, state);
        self.friction(params, estimate, state);
        self.bounds(params, state);
        self.torque_limits(robot, measured, estimate, state);
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
            let at = nv + 3 * leg as usize;
            let f = Vector3::new(self.x[at], self.x[at + 1], self.x[at + 2]) * FORCE_UNIT;
            self.f_F_W[leg] = if carries(state, leg) { f } else { Vector3::zeros() };
        }
        self.torque_slack = self.x.get(nv + 12).map_or(0.0, |slack| slack * self.slack_unit);
        for j in 0..self.tau.len() {
            let row = 6 + j;
            let mut tau = estimate.h[row];
            for col in 0..nv {
                tau += estimate.M[(row, col)] * self.vd[col];
            }
            for leg in Leg::ALL {
                tau -= estimate.legs[leg].J.column(row).dot(&self.f_F_W[leg]);
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
        let base = ["force x", "force y", "force z", "moment x", "moment y", "moment z"];
        let sides = ["normal force", "friction t1+", "friction t1-", "friction t2+", "friction t2-"];
        let mut variables: Vec<String> = ["base x", "base y", "base z", "base roll", "base pitch", "base yaw"]
            .map(|v| format!("acceleration of {v}"))
            .to_vec();
        variables.extend(robot.model.joints.iter().map(|joint| format!("acceleration of {}", joint.name)));
        let by_foot = |names: &[&str]| -> Vec<String> {
            Leg::ALL.iter().flat_map(|leg| names.iter().map(move |name| format!("{name} of {}", leg.name()))).collect()
        };
        variables.extend(by_foot(&["force x", "force y", "force z"]));
        let mut inequalities = by_foot(&sides);
        if self.formula.has(Constraint::TorqueLimits) {
            variables.push("torque slack".to_owned());
            let joints = || robot.model.joints.iter().map(|joint| &joint.name);
            inequalities.extend(joints().map(|name| format!("largest torque of {name}")));
            inequalities.extend(joints().map(|name| format!("smallest torque of {name}")));
        }
        let mut equalities = base.map(|row| format!("base dynamics, {row}")).to_vec();
        let above = self.stack.levels.iter().map(|level| level.qp.b.len() - base.len()).max().unwrap_or(0);
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

    /// C_fb, the six rows of the floating base: `M_u vd - J_uᵀ F = -h_u`. Source: eq. (4).
    fn base_dynamics(&mut self, estimate: &Estimate, state: &State) {
        let nv = self.vd.len();
        let qp = self.stack.constraints();
        for row in 0..6 {
            for col in 0..nv {
                qp.A[(row, col)] = estimate.M[(row, col)];
            }
            for leg in Leg::ALL {
                for k in 0..3 {
                    let there = if carries(state, leg) { estimate.legs[leg].J[(k, row)] } else { 0.0 };
                    qp.A[(row, nv + 3 * leg as usize + k)] = -there * FORCE_UNIT;
                }
            }
            qp.b[row] = -estimate.h[row];
        }
    }

    /// C_fc, the pyramid inside the friction cone, `c = μ √2/2`: `F·n ≥ f_min`, `|F·t1| ≤ c F·n`, `|F·t2| ≤ c F·n`. Source: eq. (10). The lower force
    /// bound of stance is the right side of the first row, so that the normal force is positive on slopes too.
    fn friction(&mut self, params: &Params, estimate: &Estimate, state: &State) {
        let nv = self.vd.len();
        let wanted = self.formula.has(Constraint::Friction);
        let qp = self.stack.constraints();
        let c = params.wbc.friction * std::f64::consts::FRAC_1_SQRT_2;
        let n = estimate.n_W;
        let [t1, t2] = ground::tangents(&n);
        let timing = Timing::of(state, params);
        for leg in Leg::ALL {
            let (row, col) = (ROWS_FC * leg as usize, nv + 3 * leg as usize);
            self.f_z_bounds[leg] = force_bounds(state, params, &timing, estimate.M[(0, 0)], leg);
            let carries = wanted && carries(state, leg);
            let rows = [-n, t1 - n * c, -t1 - n * c, t2 - n * c, -t2 - n * c];
            for (i, direction) in rows.iter().enumerate() {
                for k in 0..3 {
                    qp.C[(row + i, col + k)] = if carries { direction[k] } else { 0.0 };
                }
                qp.d[row + i] = if carries { 0.0 } else { 1.0 };
            }
            if carries {
                qp.d[row] = -self.f_z_bounds[leg].0 / FORCE_UNIT;
            }
        }
    }

    /// C_acc and C_Fc: bounds on joint accelerations and forces. Source: eqs. (11)-(12), Table 2.
    fn bounds(&mut self, params: &Params, state: &State) {
        let nv = self.vd.len();
        let qp = self.stack.constraints();
        if self.formula.has(Constraint::JointAcceleration) {
            for j in 6..nv {
                qp.lower[j] = -params.wbc.qdd_max;
                qp.upper[j] = params.wbc.qdd_max;
            }
        }
        for leg in Leg::ALL {
            let at = nv + 3 * leg as usize;
            let limits = if carries(state, leg) {
                let xy = params.wbc.f_xy_max / FORCE_UNIT;
                [(-xy, xy), (-xy, xy), (0.0, self.f_z_bounds[leg].1 / FORCE_UNIT)]
            } else {
                [(-RELEASED, RELEASED); 3]
            };
            for (k, (lower, upper)) in limits.into_iter().enumerate() {
                qp.lower[at + k] = lower;
                qp.upper[at + k] = upper;
            }
        }
    }

    /// C_tau: `least ≤ tau ≤ most`, softened by the slack, with `tau = M vd + h - Jᵀ F` at the joints. First the rows of the largest torques, then
    /// those of the smallest. An infinite limit has a row of zeros.
    ///
    /// ```text
    /// (M vd - Jᵀ F)_j - s ≤ most_j - h_j         -(M vd - Jᵀ F)_j - s ≤ h_j - least_j
    /// ```
    fn torque_limits(&mut self, robot: &Robot, measured: &RobotState, estimate: &Estimate, state: &State) {
        if !self.formula.has(Constraint::TorqueLimits) {
            return;
        }
        let (nv, nj, slack_unit) = (self.vd.len(), self.tau.len(), self.slack_unit);
        let qp = self.stack.constraints();
        for (leg, of_leg) in robot.legs.iter() {
            let carries = carries(state, leg);
            for j in of_leg.joints {
                let (upper, lower) = (ROWS_FC * 4 + j, ROWS_FC * 4 + nj + j);
                let (least, most) = robot.model.joints[j].torque_range(measured.qd[j]);
                let (above, below) = (most.is_finite(), least.is_finite());
                let mut write = |col: usize, value: f64| {
                    qp.C[(upper, col)] = if above { value } else { 0.0 };
                    qp.C[(lower, col)] = if below { -value } else { 0.0 };
                };
                for col in (0..6).chain(of_leg.joints.map(|k| 6 + k)) {
                    write(col, estimate.M[(6 + j, col)]);
                }
                for k in 0..3 {
                    let there = if carries { estimate.legs[leg].J[(k, 6 + j)] } else { 0.0 };
                    write(nv + 3 * leg as usize + k, -there * FORCE_UNIT);
                }
                let h = estimate.h[6 + j];
                for (row, limited, side) in [(upper, above, most - h), (lower, below, h - least)] {
                    qp.d[row] = if limited { side } else { 1.0 };
                    qp.C[(row, nv + 12)] = if limited { -slack_unit } else { 0.0 };
                }
            }
        }
    }
}

/// The elements of the quadratic programs that can be non-zero.
///
/// - `columns`: variables that the tasks may couple.
fn pattern(robot: &Robot, formula: &Formula, columns: usize) -> Qp {
    let (nv, nj) = (robot.model.nv(), robot.nj());
    let limited = formula.has(Constraint::TorqueLimits);
    let mut qp = Qp::zeros(nv + 12 + usize::from(limited), 6, ROWS_FC * 4 + if limited { 2 * nj } else { 0 });
    qp.H.view_mut((0, 0), (columns, columns)).fill(1.0);
    qp.A.columns_mut(0, nv + 12).fill(1.0);
    for (leg, of_leg) in robot.legs.iter().filter(|_| limited) {
        let forces = (0..3).map(|k| nv + 3 * leg as usize + k);
        let cols: Vec<usize> = (0..6).chain(of_leg.joints.map(|j| 6 + j)).chain(forces).chain([nv + 12]).collect();
        for j in of_leg.joints {
            for &col in &cols {
                qp.C[(ROWS_FC * 4 + j, col)] = 1.0;
                qp.C[(ROWS_FC * 4 + nj + j, col)] = 1.0;
            }
        }
    }
    for leg in 0..4 {
        qp.C.view_mut((ROWS_FC * leg, nv + 3 * leg), (ROWS_FC, 3)).fill(1.0);
    }
    let bounded = formula.has(Constraint::JointAcceleration);
    for i in if bounded { 6 } else { nv }..nv + 12 {
        qp.lower[i] = -1.0;
        qp.upper[i] = 1.0;
    }
    qp
}
