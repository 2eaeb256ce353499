//! Equivalence of the stack with closed-form impedance control, as relative errors. Source: Raiola et al. 2020, appendix A.
//!
//! With gains premultiplied by the inverse inertia, the quadratic programs of the stack give the torques of impedance control. All
//! coordinates count as actuated, base included; there are no contacts and no gravity; the compared torque is the inertial part `M vd`.
//! Expected values are computed by dense linear algebra, without the stack.

use controller::math::{Rng, Rx, Ry, Rz};
use controller::model::{BaseState, Kinematics, mass_matrix, point_bias_acceleration, point_jacobian_linear};
use controller::qp::Qp;
use controller::quadruped::leg::Leg;
use controller::quadruped::robot::Robot;
use controller::stack::{Cascade, Rows, Solver, Term};
use nalgebra::{DMatrix, DVector, Vector3};

/// Regularization of the programs: small enough that relative errors of 1e-8 are visible.
const REGULARIZATION: f64 = 1e-13;

/// Largest relative error of each equivalence over all configurations.
#[derive(Debug, Default)]
pub struct Errors {
    /// Eq. A(4): joint impedance.
    pub joint: f64,
    /// Eq. A(10): Cartesian impedance with a square Jacobian.
    pub cartesian: f64,
    /// Eqs. A(15) and A(17): a task above a posture, with the dynamically consistent null space.
    pub null_space: f64,
}

/// A robot at a random configuration, with random reference torques and forces.
struct Case {
    M: DMatrix<f64>,
    M_inv: DMatrix<f64>,
    J: DMatrix<f64>,
    Jd_v: DVector<f64>,
    tau_r: DVector<f64>,
    F_r: DVector<f64>,
}

/// Largest errors over `n` random configurations of a robot.
///
/// # Errors
/// A program without a solution, or a matrix that cannot be inverted.
pub fn errors(robot: &Robot, n: usize, seed: i64) -> anyhow::Result<Errors> {
    let (mut rng, mut errors) = (Rng::new(seed, "impedance"), Errors::default());
    for _ in 0..n {
        let case = Case::random(robot, &mut rng)?;
        errors.joint = errors.joint.max(case.joint()?);
        errors.cartesian = errors.cartesian.max(case.cartesian(&mut rng)?);
        errors.null_space = errors.null_space.max(case.null_space()?);
    }
    Ok(errors)
}

impl Case {
    fn random(robot: &Robot, rng: &mut Rng) -> anyhow::Result<Self> {
        let mut random = |size: f64| rng.uniform(-size, size);
        let nv = robot.model.nv();
        let base = BaseState {
            p_WB: Vector3::zeros(),
            R_WB: Rz(random(3.0)) * Ry(random(1.0)) * Rx(random(1.0)),
            v_WB: Vector3::zeros(),
            w_WB_W: Vector3::new(random(1.0), random(1.0), random(1.0)),
        };
        let q: Vec<f64> = robot.q_nominal.iter().map(|q| q + random(0.3)).collect();
        let qd: Vec<f64> = q.iter().map(|_| random(1.0)).collect();
        let mut kin = Kinematics::new(&robot.model);
        kin.update(&robot.model, &base, &q, &qd);
        let foot = robot.legs[Leg::RF].foot;
        let (mut M, mut J) = (DMatrix::zeros(nv, nv), DMatrix::zeros(3, nv));
        mass_matrix(&robot.model, &kin, &mut M);
        point_jacobian_linear(&robot.model, &kin, foot, &Vector3::zeros(), J.as_view_mut());
        let bias = point_bias_acceleration(&robot.model, &kin, foot, &Vector3::zeros());
        let Jd_v = DVector::from_row_slice(&bias.as_slice()[..3]);
        let tau_r = DVector::from_fn(nv, |_, _| random(50.0));
        let F_r = DVector::from_fn(3, |_, _| random(100.0));
        Ok(Case { M_inv: inverse(&M)?, M, J, Jd_v, tau_r, F_r })
    }

    /// Eq. A(4): with `K = M⁻¹ K'` the program gives the accelerations that the torques of `K'` cause.
    fn joint(&self) -> anyhow::Result<f64> {
        let n = self.M.nrows();
        let vd = accelerations(&[rows(&DMatrix::identity(n, n), &(&self.M_inv * &self.tau_r))])?;
        Ok(relative(&(&self.M * vd), &self.tau_r))
    }

    /// Eq. A(10): the reference acceleration `J M⁻¹ Jᵀ F_r - Jd v` gives the torque `Jᵀ F_r - M J⁻¹ Jd v`.
    fn cartesian(&self, rng: &mut Rng) -> anyhow::Result<f64> {
        // The rows of the foot, completed by random rows; well conditioned.
        let n = self.M.nrows();
        let mut J = DMatrix::from_fn(n, n, |i, j| 0.1 * rng.uniform(-1.0, 1.0) + if i == j { 1.0 } else { 0.0 });
        J.rows_mut(0, 3).copy_from(&self.J);
        let F_r = DVector::from_fn(n, |_, _| rng.uniform(-100.0, 100.0));
        let Jd_v = DVector::from_fn(n, |_, _| rng.uniform(-1.0, 1.0));
        let vd = accelerations(&[rows(&J, &(&J * &self.M_inv * J.transpose() * &F_r - &Jd_v))])?;
        Ok(relative(&(&self.M * vd), &(J.transpose() * &F_r - &self.M * inverse(&J)? * &Jd_v)))
    }

    /// Eq. A(17): `τ = Jᵀ F_r - Jᵀ Λ Jd v + (I - Jᵀ J̄ᵀ) τ_r`, with the posture weighted by W = M.
    fn null_space(&self) -> anyhow::Result<f64> {
        let Case { M, M_inv, J, Jd_v, tau_r, F_r } = self;
        let mobility = J * M_inv * J.transpose();
        let L = M.clone().cholesky().ok_or_else(|| anyhow::anyhow!("the mass matrix is not positive definite"))?.l();
        let task = rows(J, &(&mobility * F_r - Jd_v));
        let posture = rows(&L.transpose(), &(L.transpose() * M_inv * tau_r));
        let vd = accelerations(&[task, posture])?;

        let Lambda = inverse(&mobility)?;
        let J_bar = M_inv * J.transpose() * &Lambda;
        let I = DMatrix::<f64>::identity(M.nrows(), M.nrows());
        let tau =
            J.transpose() * F_r - J.transpose() * &Lambda * Jd_v + (I - J.transpose() * J_bar.transpose()) * tau_r;
        Ok(relative(&(M * vd), &tau))
    }
}

/// Task rows of one dense block, `A vd = b`.
fn rows(A: &DMatrix<f64>, b: &DVector<f64>) -> Rows {
    let mut rows = Rows::new(A.ncols(), [(A.nrows(), (0..A.ncols()).collect())]);
    rows.switch(0, true);
    rows.A.copy_from(A);
    rows.b.copy_from(b);
    rows
}

/// Accelerations of a stack without constraints; one task per level, highest priority first.
fn accelerations(tasks: &[Rows]) -> anyhow::Result<DVector<f64>> {
    let nv = tasks[0].A.ncols();
    let mut pattern = Qp::zeros(nv, 0, 0);
    pattern.H.fill(1.0);
    let levels =
        tasks.iter().enumerate().map(|(task, rows)| vec![Term { task, weight: 1.0, takes: vec![true; rows.len()] }]);
    let regularization = DVector::from_element(nv, REGULARIZATION);
    let mut stack = Cascade::new(levels.collect(), &pattern, regularization, nv, None, &Solver::Shared(100));
    stack.build(tasks);
    stack.solve(tasks);
    let last = &stack.levels[tasks.len() - 1];
    anyhow::ensure!(last.solved(), "the program of the last level has no solution: {:?}", last.info);
    Ok(last.x.clone())
}

fn inverse(A: &DMatrix<f64>) -> anyhow::Result<DMatrix<f64>> {
    A.clone().try_inverse().ok_or_else(|| anyhow::anyhow!("a matrix of {} rows cannot be inverted", A.nrows()))
}

fn relative(found: &DVector<f64>, expected: &DVector<f64>) -> f64 {
    (found - expected).norm() / expected.norm()
}
