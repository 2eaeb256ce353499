//! The whole-body controller: the weighted stack S1 as one quadratic program, and the torques of its solution.
//!
//! ```text
//! S1 = ( Σ_stance T_contact + T_trunk + T_posture ) << C_fb << C_fc << C_acc << C_Fc           x = [vd; F]
//! min_x  Σ_k w_k |A_k x - b_k|² + λ |x|²
//! ```
//! Source: Raiola et al. 2020, eqs. (4), (6)-(13), (15). The size is constant: a foot in swing keeps its columns and rows. Its force is
//! zero; an interior-point solver has no interior between two equal bounds, so the columns of that force are zeroed
//! everywhere but in its own bounds, released to ±[`RELEASED`]: the regularization then leaves exactly F = 0 to rounding, and it
//! is read as 0.

use super::estimation::Estimate;
use super::gait;
use super::leg::{Leg, PerLeg};
use super::reference::References;
use super::robot::Robot;
use super::state::State;
use crate::math::log;
use crate::params::{Params, PostureParams};
use crate::qp::{ClarabelSolver, Qp, QpInfo, QpSolver, QpStatus};
use lcmtypes::RobotState;
use nalgebra::{DVector, Matrix3, Vector3};

/// Forces are solved for in this unit, N, so that variables are of like size: F = `FORCE_UNIT` f.
const FORCE_UNIT: f64 = 100.0;
/// Half width of the bounds on the force of a foot in swing, in [`FORCE_UNIT`].
const RELEASED: f64 = 1.0;
/// Rows of the friction pyramid of a foot.
const ROWS_FC: usize = 5;

/// Trunk orientation reference.
#[derive(Clone, Copy, Debug)]
pub struct TrunkReference {
    /// Orientation.
    pub R_WB: Matrix3<f64>,
    /// Angular velocity, rad/s.
    pub w_WB_W: Vector3<f64>,
}

/// The program of a tick and what came of it. All of it is overwritten in every tick.
pub struct Wbc {
    /// The quadratic program.
    pub qp: Qp,
    /// Its solution, forces in their scaled unit.
    pub x: DVector<f64>,
    /// How the solve went.
    pub info: QpInfo,
    /// Vertical force bounds, N.
    pub f_z_bounds: PerLeg<(f64, f64)>,
    /// Orientation error, rotation vector in W, rad.
    pub e_o_W: Vector3<f64>,
    /// Right side of the postural task, nj, rad/s².
    pub qdd_posture: DVector<f64>,
    /// Right side of the trunk task, rad/s².
    pub wd_trunk: Vector3<f64>,
    /// Accelerations, nv.
    pub vd: DVector<f64>,
    /// Contact forces, N.
    pub f_F_W: PerLeg<Vector3<f64>>,
    /// Joint torques before limits, nj, N m.
    pub tau: DVector<f64>,
    solver: ClarabelSolver,
}

impl Wbc {
    /// Memory and solver for a robot.
    pub fn new(robot: &Robot, params: &Params) -> Self {
        let (nv, nj) = (robot.model.nv(), robot.nj());
        let nan = |n| DVector::from_element(n, f64::NAN);
        Wbc {
            qp: Qp::zeros(nv + 12, 6, ROWS_FC * 4),
            x: nan(nv + 12),
            info: QpInfo { status: QpStatus::Failed, iterations: 0, n_active: 0 },
            f_z_bounds: PerLeg([(f64::NAN, f64::NAN); 4]),
            e_o_W: Vector3::from_element(f64::NAN),
            qdd_posture: nan(nj),
            wd_trunk: Vector3::from_element(f64::NAN),
            vd: nan(nv),
            f_F_W: PerLeg([Vector3::from_element(f64::NAN); 4]),
            tau: nan(nj),
            solver: ClarabelSolver::new(&pattern(nv), params.wbc.max_iterations, params.wbc.tolerance),
        }
    }

    /// Builds the program: tasks, constraints, bounds.
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
        self.qp.H.fill(0.0);
        self.qp.g.fill(0.0);
        self.contact_task(params, estimate, state);
        self.trunk_task(params, estimate, trunk);
        self.posture_task(robot, params, measured, estimate, references, state);
        self.regularize(params);
        self.base_dynamics(estimate, state);
        self.friction(params, estimate, state);
        self.bounds(params, state);
    }

    /// Solves it. Without a solution of finite numbers the status says so, and `x`, `vd`, `f_F_W` and `tau` are zero: what an iteration broke
    /// off with is no result, and the bits of a NaN are not the same on every machine.
    ///
    /// ```text
    /// tau = ( M vd + h - Jᵀ F ) at the joints
    /// ```
    /// Source: Raiola et al. 2020, eq. (3).
    pub fn solve(&mut self, estimate: &Estimate, state: &State) {
        self.info = self.solver.solve(&self.qp, &mut self.x);
        if self.solved() && !self.x.iter().all(|x| x.is_finite()) {
            self.info.status = QpStatus::Failed;
        }
        if !self.solved() {
            self.x.fill(0.0);
            self.vd.fill(0.0);
            self.f_F_W = PerLeg::default();
            self.tau.fill(0.0);
            return;
        }
        let nv = self.vd.len();
        self.vd.copy_from(&self.x.rows(0, nv));
        for leg in Leg::ALL {
            let at = nv + 3 * leg as usize;
            let f = Vector3::new(self.x[at], self.x[at + 1], self.x[at + 2]) * FORCE_UNIT;
            self.f_F_W[leg] = if carries(state, leg) { f } else { Vector3::zeros() };
        }
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

    /// Whether the last [`Wbc::solve`] has found a solution.
    pub fn solved(&self) -> bool {
        matches!(self.info.status, QpStatus::Solved | QpStatus::AlmostSolved)
    }

    /// Norms of what the three tasks leave: contact (m/s²), trunk (rad/s²), posture (rad/s²).
    pub fn residuals(&self, estimate: &Estimate, state: &State) -> [f64; 3] {
        let nv = self.vd.len();
        let mut contact = 0.0;
        for leg in Leg::ALL {
            if carries(state, leg) {
                let of_leg = &estimate.legs[leg];
                let mut a = of_leg.a_bias_W;
                for col in 0..nv {
                    a += of_leg.J.fixed_view::<3, 1>(0, col) * self.vd[col];
                }
                contact += a.dot(&a);
            }
        }
        let trunk = self.vd.fixed_rows::<3>(3) - self.wd_trunk;
        let mut posture = 0.0;
        for j in 0..nv - 6 {
            let e = self.vd[6 + j] - self.qdd_posture[j];
            posture += e * e;
        }
        [contact.sqrt(), trunk.dot(&trunk).sqrt(), posture.sqrt()]
    }

    /// Largest violation of the floating-base dynamics by the solution, N or N m.
    pub fn base_residual(&self) -> f64 {
        let mut worst = 0.0_f64;
        for row in 0..self.qp.b.len() {
            let left = (0..self.x.len()).fold(0.0, |sum, col| sum + self.qp.A[(row, col)] * self.x[col]);
            worst = worst.max((left - self.qp.b[row]).abs());
        }
        worst
    }

    /// `J vd = -a_bias` for every foot that carries load: no acceleration of the contact point, no feedback. Source: eq. (7).
    fn contact_task(&mut self, params: &Params, estimate: &Estimate, state: &State) {
        let w = params.wbc.weight_contact;
        let nv = self.vd.len();
        for leg in Leg::ALL {
            if !carries(state, leg) {
                continue;
            }
            let (J, a) = (&estimate.legs[leg].J, &estimate.legs[leg].a_bias_W);
            for col in 0..nv {
                for row in 0..=col {
                    let product = J.column(row).dot(&J.column(col));
                    if product != 0.0 {
                        self.qp.H[(row, col)] += w * product;
                    }
                }
                self.qp.g[col] += w * J.column(col).dot(a);
            }
        }
    }

    /// `wd = K_P e_o + K_D (w_des - w)`, e_o = log(R_des Rᵀ). Source: eq. (8), error and feedback both in W axes.
    fn trunk_task(&mut self, params: &Params, estimate: &Estimate, trunk: &TrunkReference) {
        self.e_o_W = log(&(trunk.R_WB * estimate.base.R_WB.transpose()));
        let e_w = trunk.w_WB_W - estimate.base.w_WB_W;
        let w = params.wbc.weight_trunk;
        for k in 0..3 {
            self.wd_trunk[k] = params.trunk.kp[k] * self.e_o_W[k] + params.trunk.kd[k] * e_w[k];
            self.qp.H[(3 + k, 3 + k)] += w;
            self.qp.g[3 + k] -= w * self.wd_trunk[k];
        }
    }

    /// `qdd = K_P (q_des - q) + K_D (qd_des - qd)`, in swing premultiplied by the leg's inverse inertia if asked. Source: eq. (9), appendix A.
    fn posture_task(
        &mut self,
        robot: &Robot,
        params: &Params,
        measured: &RobotState,
        estimate: &Estimate,
        references: &References,
        state: &State,
    ) {
        let w = params.wbc.weight_posture;
        for leg in Leg::ALL {
            let joints = robot.legs[leg].joints;
            let stance = state.leg_phase[leg].is_stance();
            let PostureParams { swing_kp, swing_kd, stance_kp, stance_kd, .. } = &params.posture;
            let (kp, kd) = if stance { (stance_kp, stance_kd) } else { (swing_kp, swing_kd) };
            let mut u = Vector3::zeros();
            for k in 0..3 {
                let j = joints[k];
                u[k] = kp[k] * (state.q_des[j] - measured.q[j]) + kd[k] * (references.qd_des[j] - measured.qd[j]);
            }
            if !stance && params.posture.swing_inertia {
                let M_leg = Matrix3::from_fn(|r, c| estimate.M[(6 + joints[r], 6 + joints[c])]);
                u = M_leg.try_inverse().map_or(Vector3::zeros(), |inverse| inverse * u);
            }
            for k in 0..3 {
                let j = joints[k];
                self.qdd_posture[j] = u[k];
                self.qp.H[(6 + j, 6 + j)] += w;
                self.qp.g[6 + j] -= w * u[k];
            }
        }
    }

    /// Adds λ on accelerations and forces and mirrors the upper triangle.
    fn regularize(&mut self, params: &Params) {
        let nv = self.vd.len();
        for i in 0..self.x.len() {
            let unit = if i < nv { 1.0 } else { FORCE_UNIT * FORCE_UNIT };
            self.qp.H[(i, i)] += params.wbc.regularization * unit;
            for j in 0..i {
                self.qp.H[(i, j)] = self.qp.H[(j, i)];
            }
        }
    }

    /// C_fb, the six rows of the floating base: `M_u vd - J_uᵀ F = -h_u`. Source: eq. (4).
    fn base_dynamics(&mut self, estimate: &Estimate, state: &State) {
        let nv = self.vd.len();
        for row in 0..6 {
            for col in 0..nv {
                self.qp.A[(row, col)] = estimate.M[(row, col)];
            }
            for leg in Leg::ALL {
                for k in 0..3 {
                    let there = if carries(state, leg) { estimate.legs[leg].J[(k, row)] } else { 0.0 };
                    self.qp.A[(row, nv + 3 * leg as usize + k)] = -there * FORCE_UNIT;
                }
            }
            self.qp.b[row] = -estimate.h[row];
        }
    }

    /// C_fc, the pyramid inside the friction cone, c = μ √2/2: `F·n ≥ f_min`, `|F·t1| ≤ c F·n`, `|F·t2| ≤ c F·n`. Source: eq. (10). The lower
    /// bound of stance stands on this row, so that slopes keep a positive normal force.
    fn friction(&mut self, params: &Params, estimate: &Estimate, state: &State) {
        let nv = self.vd.len();
        let c = params.wbc.friction * std::f64::consts::FRAC_1_SQRT_2;
        let n = estimate.n_W;
        let t1 = Vector3::y().cross(&n).normalize();
        let t2 = n.cross(&t1);
        for leg in Leg::ALL {
            let (row, col) = (ROWS_FC * leg as usize, nv + 3 * leg as usize);
            self.f_z_bounds[leg] = gait::force_bounds(state, params, estimate.M[(0, 0)], leg);
            let carries = carries(state, leg);
            let rows = [-n, t1 - n * c, -t1 - n * c, t2 - n * c, -t2 - n * c];
            for (i, direction) in rows.iter().enumerate() {
                for k in 0..3 {
                    self.qp.C[(row + i, col + k)] = if carries { direction[k] } else { 0.0 };
                }
                self.qp.d[row + i] = if carries { 0.0 } else { 1.0 };
            }
            if carries {
                self.qp.d[row] = -self.f_z_bounds[leg].0 / FORCE_UNIT;
            }
        }
    }

    /// C_acc and C_Fc: joint accelerations and forces. Source: eqs. (11)-(12), Table 2.
    fn bounds(&mut self, params: &Params, state: &State) {
        let nv = self.vd.len();
        for j in 6..nv {
            self.qp.lower[j] = -params.wbc.qdd_max;
            self.qp.upper[j] = params.wbc.qdd_max;
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
                self.qp.lower[at + k] = lower;
                self.qp.upper[at + k] = upper;
            }
        }
    }
}

/// A foot carries load while it is in stance.
fn carries(state: &State, leg: Leg) -> bool {
    state.leg_phase[leg].is_stance()
}

/// Where the program may ever have numbers.
fn pattern(nv: usize) -> Qp {
    let mut qp = Qp::zeros(nv + 12, 6, ROWS_FC * 4);
    qp.H.view_mut((0, 0), (nv, nv)).fill(1.0);
    qp.A.fill(1.0);
    for leg in 0..4 {
        qp.C.view_mut((ROWS_FC * leg, nv + 3 * leg), (ROWS_FC, 3)).fill(1.0);
    }
    for i in 6..nv + 12 {
        qp.lower[i] = -1.0;
        qp.upper[i] = 1.0;
    }
    qp
}
