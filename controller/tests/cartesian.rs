//! Cartesian tasks compared with numerical differences of the pose and with dense linear algebra.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{PARAMS, Rng, URDF};
use controller::math::{Rx, Ry, Rz};
use controller::model::{BaseState, FrameId, Kinematics, frame_jacobian, mass_matrix};
use controller::params::Params;
use controller::quadruped::robot::Robot;
use controller::stack::{ModelState, Rows, Task, Variables};
use controller::tasks::acceleration::{Cartesian, CartesianConfig};
use nalgebra::{DMatrix, DVector, Vector3};

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

/// Writes the rows of a task in the nominal pose, turned by a heading in the world.
fn fill(task: &mut Cartesian, robot: &Robot, kin: &Kinematics, M: &DMatrix<f64>, heading: f64, rows: &mut Rows) {
    let variables = Variables::new(robot.model.nv(), [], false);
    let h = DVector::zeros(robot.model.nv());
    let state = ModelState {
        model: &robot.model,
        contacts: &[],
        variables: &variables,
        q: &[],
        qd: &[],
        kin,
        M,
        h: &h,
        at: &[],
        loads: &[],
    };
    let mut reference = task.home();
    if task.in_world() {
        reference.R = Rz(heading) * reference.R;
    }
    task.update(&state, &reference, rows);
}

fn inverse(A: &DMatrix<f64>) -> DMatrix<f64> {
    A.clone().try_inverse().unwrap()
}

/// Rows of the relative pose of two links compared with its numerical derivatives.
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
    let (mut rows, M) = (task.rows(), DMatrix::identity(nv, nv));
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
        // The base rotates about a fixed axis, so its motion can be computed exactly.
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
        fill(&mut task, &robot, &at_time(0.0), &M, 0.0, &mut rows);
        let mut v = DVector::zeros(nv);
        v[5] = rate;
        v.rows_mut(6, robot.nj()).copy_from_slice(&qd);
        assert!((&rows.A * &v - twist(&at_time(0.0))).norm() < 1e-12);
        let h = 1e-5;
        let difference = (twist(&at_time(h)) - twist(&at_time(-h))) / (2.0 * h);
        assert!((&rows.b + &difference).norm() < 1e-8, "{} {difference}", rows.b);
        // A motion of the base moves both feet together: it does not enter.
        assert!(rows.A.columns(0, 3).norm() < 1e-12);
    }

    // At home the pose is the reference; after a small displacement, the stiffness acts against it.
    let mut stiff = Cartesian::new("span", &config(100.0), model, &home).unwrap();
    fill(&mut stiff, &robot, &home, &M, 0.0, &mut rows);
    assert!(rows.b.norm() < 1e-10);
    let mut moved = Kinematics::new(model);
    let q: Vec<f64> = robot.q_nominal.iter().map(|q| q + 1e-5 * rng.symmetric()).collect();
    moved.update(model, &BaseState::identity(), &q, &vec![0.0; robot.nj()]);
    fill(&mut stiff, &robot, &moved, &M, 0.0, &mut rows);
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
            let config = CartesianConfig { kp, kd, ..config(inertia) };
            let mut task = Cartesian::new("lean", &config, model, &home).unwrap();
            let mut rows = task.rows();
            fill(&mut task, &robot, &kin, &M, 0.3, &mut rows);
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
