//! The stack against the closed forms of Cartesian impedance control: Raiola et al. 2020, appendix, eqs. (4), (10), (15), (17).
//!
//! All nv coordinates of HyQ, base included, count as actuated here, as the appendix has it: no contacts, no gravity, and of the
//! torques what moves the masses, `M vd`. Expected values by dense linear algebra, without the stack.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{PARAMS, Rng, URDF};
use controller::math::{Rx, Ry, Rz};
use controller::model::{
    BaseState, FrameId, Kinematics, frame_jacobian, mass_matrix, point_bias_acceleration, point_jacobian_linear,
};
use controller::params::Params;
use controller::qp::{Backend, Qp};
use controller::quadruped::leg::Leg;
use controller::quadruped::robot::Robot;
use controller::stack::{Cartesian, CartesianConfig, Cascade, Rows, Term};
use nalgebra::{DMatrix, DVector, Vector3};

const CONFIGURATIONS: usize = 20;
/// Relative error allowed. The regularization below is what is left of it.
const ALLOWED: f64 = 1e-8;
const REGULARIZATION: f64 = 1e-13;

/// A robot at a random configuration: mass matrix, Jacobian and bias of a foot, impedance torques and force.
struct Case {
    M: DMatrix<f64>,
    J: DMatrix<f64>,
    Jd_v: DVector<f64>,
    tau_r: DVector<f64>,
    F_r: DVector<f64>,
}

fn robot() -> Robot {
    Robot::new(URDF, &Params::from_toml(PARAMS, "hyq.toml").unwrap().robot).unwrap()
}

fn random_kinematics(robot: &Robot, rng: &mut Rng) -> Kinematics {
    let mut kin = Kinematics::new(&robot.model);
    let base = BaseState {
        p_WB: Vector3::zeros(),
        R_WB: Rz(3.0 * rng.symmetric()) * Ry(rng.symmetric()) * Rx(rng.symmetric()),
        v_WB: Vector3::zeros(),
        w_WB_W: rng.vec3(1.0),
    };
    let q: Vec<f64> = robot.q_nominal.iter().map(|q| q + 0.3 * rng.symmetric()).collect();
    let qd: Vec<f64> = q.iter().map(|_| rng.symmetric()).collect();
    kin.update(&robot.model, &base, &q, &qd);
    kin
}

fn vector(n: usize, rng: &mut Rng, size: f64) -> DVector<f64> {
    DVector::from_fn(n, |_, _| size * rng.symmetric())
}

fn cases() -> Vec<Case> {
    let robot = robot();
    let (nv, mut rng) = (robot.model.nv(), Rng(10));
    let case = |_| {
        let kin = random_kinematics(&robot, &mut rng);
        let foot = robot.legs[Leg::RF].foot;
        let (mut M, mut J) = (DMatrix::zeros(nv, nv), DMatrix::zeros(3, nv));
        mass_matrix(&robot.model, &kin, &mut M);
        point_jacobian_linear(&robot.model, &kin, foot, &Vector3::zeros(), J.as_view_mut());
        let bias = point_bias_acceleration(&robot.model, &kin, foot, &Vector3::zeros());
        let Jd_v = DVector::from_row_slice(&bias.as_slice()[..3]);
        Case { M, J, Jd_v, tau_r: vector(nv, &mut rng, 50.0), F_r: vector(3, &mut rng, 100.0) }
    };
    (0..CONFIGURATIONS).map(case).collect()
}

/// Rows of the whole-robot kind: one dense block.
fn rows(A: &DMatrix<f64>, b: &DVector<f64>) -> Rows {
    let mut rows = Rows::new(A.ncols(), [(A.nrows(), (0..A.ncols()).collect())]);
    rows.switch(0, true);
    rows.A.copy_from(A);
    rows.b.copy_from(b);
    rows
}

/// Accelerations that a stack without constraints gives; one task a level, the most important first.
fn accelerations(tasks: &[Rows]) -> DVector<f64> {
    let nv = tasks[0].A.ncols();
    let mut pattern = Qp::zeros(nv, 0, 0);
    pattern.H.fill(1.0);
    let levels =
        tasks.iter().enumerate().map(|(task, rows)| vec![Term { task, weight: 1.0, takes: vec![true; rows.len()] }]);
    let regularization = DVector::from_element(nv, REGULARIZATION);
    let solver = |of_level: &Qp| Backend::ActiveSet.build(of_level, 100, 0.0);
    let mut stack = Cascade::new(levels.collect(), &pattern, regularization, solver);
    stack.build(tasks);
    stack.solve();
    let last = &stack.levels[tasks.len() - 1];
    assert!(last.solved(), "{:?}", last.info);
    last.x.clone()
}

#[track_caller]
fn assert_near(found: &DVector<f64>, expected: &DVector<f64>) {
    let off = (found - expected).norm() / expected.norm();
    assert!(off < ALLOWED, "off by {off:e}");
}

fn inverse(A: &DMatrix<f64>) -> DMatrix<f64> {
    A.clone().try_inverse().unwrap()
}

/// The posture in the norm of kinetic energy, `|vd - M⁻¹ tau_r|²_M`: its rows are `Lᵀ` of `M = L Lᵀ`.
fn posture(case: &Case) -> Rows {
    let L = case.M.clone().cholesky().unwrap().l();
    rows(&L.transpose(), &(L.transpose() * inverse(&case.M) * &case.tau_r))
}

/// Gains premultiplied by the inertia, `xdd = J M⁻¹ Jᵀ F_r - Jd v`.
fn task(case: &Case) -> Rows {
    let premultiplied = &case.J * inverse(&case.M) * case.J.transpose() * &case.F_r;
    rows(&case.J, &(premultiplied - &case.Jd_v))
}

#[test]
fn a4_a_posture_with_premultiplied_gains_gives_its_torques() {
    for case in cases() {
        let n = case.M.nrows();
        let single = rows(&DMatrix::identity(n, n), &(inverse(&case.M) * &case.tau_r));
        assert_near(&(&case.M * accelerations(&[single])), &case.tau_r);
    }
}

#[test]
fn a10_a_full_rank_task_with_premultiplied_gains_is_cartesian_impedance() {
    let mut rng = Rng(11);
    for case in cases() {
        // A task of as many rows as coordinates: the foot and random combinations, well conditioned.
        let n = case.M.nrows();
        let mut J = DMatrix::from_fn(n, n, |i, j| 0.1 * rng.symmetric() + if i == j { 1.0 } else { 0.0 });
        J.rows_mut(0, 3).copy_from(&case.J);
        let (F_r, Jd_v) = (vector(n, &mut rng, 100.0), vector(n, &mut rng, 1.0));
        let full = rows(&J, &(&J * inverse(&case.M) * J.transpose() * &F_r - &Jd_v));
        let expected = J.transpose() * &F_r - &case.M * inverse(&J) * &Jd_v;
        assert_near(&(&case.M * accelerations(&[full])), &expected);
    }
}

#[test]
fn a15_and_a17_a_task_above_a_posture_is_impedance_with_a_dynamically_consistent_null_space() {
    for case in cases() {
        let Case { M, J, Jd_v, tau_r, F_r } = &case;
        let (n, M_inv) = (M.nrows(), inverse(M));
        let Lambda = inverse(&(J * &M_inv * J.transpose()));
        let J_bar = &M_inv * J.transpose() * &Lambda;
        let I = DMatrix::<f64>::identity(n, n);
        let xdd = inverse(&Lambda) * F_r - Jd_v;

        let found = accelerations(&[task(&case), posture(&case)]);
        assert_near(&found, &(&J_bar * &xdd + (&I - &J_bar * J) * &M_inv * tau_r));
        let tau =
            J.transpose() * F_r - J.transpose() * &Lambda * Jd_v + (&I - J.transpose() * J_bar.transpose()) * tau_r;
        assert_near(&(M * found), &tau);
    }
}

/// Pose of one link in the frame of another as rows of the stack see it, and what its differences say.
#[test]
fn a_relative_task_is_the_second_derivative_of_the_relative_pose() {
    let robot = robot();
    let (model, nv) = (&robot.model, robot.model.nv());
    let mut home = Kinematics::new(model);
    home.update(model, &BaseState::identity(), &robot.q_nominal, &vec![0.0; robot.nj()]);
    let config = |gains: f64| CartesianConfig {
        link: "rf_foot".to_owned(),
        relative_to: Some("lh_foot".to_owned()),
        kp: [gains; 6],
        kd: [0.0; 6],
        inertia: false,
    };
    let mut task = Cartesian::new("span", &config(0.0), model, &home).unwrap();
    let (mut rows, M) = (Cartesian::rows(model), DMatrix::identity(nv, nv));
    let (at, to): (FrameId, FrameId) = (model.frame("rf_foot").unwrap(), model.frame("lh_foot").unwrap());

    // Velocity in the axes of the other foot; its difference along a motion with vd = 0 is -b.
    let twist = |kin: &Kinematics| {
        let R = kin.R_WF(model, to).transpose();
        let p = kin.p_WF(model, at) - kin.p_WF(model, to);
        let v = kin.v_WF(model, at) - kin.v_WF(model, to) - kin.w_WF_W(model, to).cross(&p);
        let w = kin.w_WF_W(model, at) - kin.w_WF_W(model, to);
        DVector::from_iterator(6, (R * v).iter().chain((R * w).iter()).copied())
    };
    let mut rng = Rng(12);
    for _ in 0..10 {
        let q: Vec<f64> = robot.q_nominal.iter().map(|q| q + 0.3 * rng.symmetric()).collect();
        let qd: Vec<f64> = q.iter().map(|_| rng.symmetric()).collect();
        // The base turns about a fixed axis, so that it can be moved on exactly.
        let (angle, rate) = (rng.symmetric(), rng.symmetric());
        let at_time = |t: f64| {
            let mut kin = Kinematics::new(model);
            let q: Vec<f64> = q.iter().zip(&qd).map(|(q, qd)| q + qd * t).collect();
            let base = BaseState {
                p_WB: Vector3::zeros(),
                R_WB: Rz(angle + rate * t),
                v_WB: Vector3::zeros(),
                w_WB_W: Vector3::z() * rate,
            };
            kin.update(model, &base, &q, &qd);
            kin
        };
        task.fill(model, &at_time(0.0), &M, 0.0, &mut rows);
        let mut v = DVector::zeros(nv);
        v[5] = rate;
        v.rows_mut(6, robot.nj()).copy_from_slice(&qd);
        assert!((&rows.A * &v - twist(&at_time(0.0))).norm() < 1e-12);
        let h = 1e-5;
        let difference = (twist(&at_time(h)) - twist(&at_time(-h))) / (2.0 * h);
        assert!((&rows.b + &difference).norm() < 1e-8, "{} {difference}", rows.b);
        // Moving both feet together says nothing: the base has no part in it.
        assert!(rows.A.columns(0, 3).norm() < 1e-12);
    }

    // At home the pose is the reference; a little off it, stiffness pulls back.
    let mut stiff = Cartesian::new("span", &config(100.0), model, &home).unwrap();
    stiff.fill(model, &home, &M, 0.0, &mut rows);
    assert!(rows.b.norm() < 1e-10);
    let mut moved = Kinematics::new(model);
    let q: Vec<f64> = robot.q_nominal.iter().map(|q| q + 1e-5 * rng.symmetric()).collect();
    moved.update(model, &BaseState::identity(), &q, &vec![0.0; robot.nj()]);
    stiff.fill(model, &moved, &M, 0.0, &mut rows);
    let dq = DVector::from_iterator(
        nv,
        std::iter::repeat_n(0.0, 6).chain(q.iter().zip(&robot.q_nominal).map(|(q, n)| q - n)),
    );
    let expected = &rows.A * dq * -100.0;
    assert!((&rows.b - &expected).norm() < 1e-3 * expected.norm(), "{} {expected}", rows.b);
}

#[test]
fn the_inertia_option_premultiplies_with_the_inertia_at_the_link() {
    let robot = robot();
    let (model, nv) = (&robot.model, robot.model.nv());
    let mut home = Kinematics::new(model);
    home.update(model, &BaseState::identity(), &robot.q_nominal, &vec![0.0; robot.nj()]);
    let config = |inertia| CartesianConfig {
        link: "trunk".to_owned(),
        relative_to: None,
        kp: [0.0, 0.0, 0.0, 1.0, 2.0, 3.0],
        kd: [0.0, 0.0, 0.0, 4.0, 5.0, 6.0],
        inertia,
    };
    let mut rng = Rng(13);
    for _ in 0..10 {
        let kin = random_kinematics(&robot, &mut rng);
        let mut M = DMatrix::zeros(nv, nv);
        mass_matrix(model, &kin, &mut M);
        let filled = |inertia, kp: [f64; 6], kd: [f64; 6]| {
            let mut rows = Cartesian::rows(model);
            let config = CartesianConfig { kp, kd, ..config(inertia) };
            Cartesian::new("lean", &config, model, &home).unwrap().fill(model, &kin, &M, 0.3, &mut rows);
            rows
        };
        let CartesianConfig { kp, kd, .. } = config(true);
        let (plain, premultiplied, bias) =
            (filled(false, kp, kd), filled(true, kp, kd), filled(false, [0.0; 6], [0.0; 6]));
        let mut J = DMatrix::zeros(6, nv);
        frame_jacobian(model, &kin, model.frame("trunk").unwrap(), &mut J);
        assert_eq!(plain.A, J);
        let expected = &J * inverse(&M) * J.transpose() * (&plain.b - &bias.b) + &bias.b;
        let off = (&premultiplied.b - &expected).norm() / expected.norm();
        assert!(off < 1e-10, "off by {off:e}");
    }
}
