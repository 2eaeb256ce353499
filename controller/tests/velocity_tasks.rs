//! Tasks of the velocity level compared with Jacobians that Pinocchio computed (`scripts/pinocchio_fixtures.py`), on Centauro and COMAN.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::Rng;
use controller::math::{Rx, Ry, Rz, atan2, cos, log, sin};
use controller::model::{Base, BaseState, FrameId, JointInfo, Kinematics, Model, UrdfTree, gravity_force};
use controller::stack::{ModelState, Rows, StackError, Structure, Task, Variables};
use controller::tasks::velocity::{
    AngularMomentum, CenterOfMass, Gaze, Manipulability, MinimumEffort, MinimumVelocity, Motion, RelativePose,
    RelativePoseReference,
};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3, Vector6};
use serde_json::Value;

const CENTAURO: [&str; 2] =
    [include_str!("../../robots/centauro/centauro.urdf"), include_str!("../model/tests/data/centauro.json")];
const COMAN: [&str; 2] =
    [include_str!("../../robots/coman/coman.urdf"), include_str!("../model/tests/data/coman.json")];
/// Relative to the largest entry: both sides compute in f64, in different order. The positions of the last state are near 1000 m.
const TOLERANCE: f64 = 1e-11;

/// A robot at a state.
struct At {
    model: Model,
    base: BaseState,
    q: Vec<f64>,
    qd: Vec<f64>,
    kin: Kinematics,
}

impl At {
    fn new(urdf: &str, base: BaseState, q: Vec<f64>, qd: Vec<f64>) -> Self {
        let model = Model::new(&UrdfTree::parse(urdf, "urdf").unwrap(), Base::Floating).unwrap();
        let mut kin = Kinematics::new(&model);
        kin.update(&model, &base, &q, &qd);
        At { model, base, q, qd, kin }
    }

    /// Moved by `v dt`; the orientation of the base by the rotation vector in W.
    fn moved(&self, v: &DVector<f64>, dt: f64) -> Self {
        let turn = Vector3::new(v[3], v[4], v[5]) * dt;
        let angle = turn.norm();
        let K = turn.cross_matrix();
        let R = if angle > 0.0 {
            Matrix3::identity() + K * (sin(angle) / angle) + K * K * ((1.0 - cos(angle)) / (angle * angle))
        } else {
            Matrix3::identity()
        };
        let base = BaseState {
            p_WB: self.base.p_WB + Vector3::new(v[0], v[1], v[2]) * dt,
            R_WB: R * self.base.R_WB,
            ..self.base
        };
        let q: Vec<f64> = self.q.iter().enumerate().map(|(j, q)| q + v[6 + j] * dt).collect();
        let mut kin = Kinematics::new(&self.model);
        kin.update(&self.model, &base, &q, &self.qd);
        At { model: self.model.clone(), base, q, qd: self.qd.clone(), kin }
    }

    /// The rows of a task, allocated by it and then filled with rubbish: it must write all that it uses.
    fn rows<T: Task>(&self, task: &mut T, reference: &T::Reference) -> Rows {
        let mut rows = task.rows();
        self.update(task, reference, &mut rows);
        rows
    }

    fn update<T: Task>(&self, task: &mut T, reference: &T::Reference, rows: &mut Rows) {
        let variables = Variables::velocities(self.model.nv());
        let (M, h) = (DMatrix::zeros(0, 0), DVector::zeros(0));
        let At { model, q, qd, kin, .. } = self;
        let state =
            ModelState { model, contacts: &[], variables: &variables, q, qd, kin, M: &M, h: &h, at: &[], loads: &[] };
        task.update(&state, reference, rows);
    }

    /// Calls `make` with what a task is built from.
    fn built<T>(&self, make: impl FnOnce(&Structure<'_>) -> T) -> T {
        let variables = Variables::velocities(self.model.nv());
        make(&Structure { model: &self.model, contacts: &[], variables: &variables })
    }

    fn frame(&self, link: &str) -> FrameId {
        self.model.frame(link).unwrap()
    }
}

/// The states of a robot with what Pinocchio computed there.
fn stored([urdf, fixture]: [&str; 2]) -> Vec<(At, Value)> {
    let fixture: Value = serde_json::from_str(fixture).unwrap();
    let of = |stored: &Value| {
        let state = &stored["state"];
        let vector = |key: &str| Vector3::from_column_slice(&numbers(&state[key]));
        let base = BaseState {
            p_WB: vector("p_WB"),
            R_WB: Matrix3::from_row_slice(&numbers(&state["R_WB"])),
            v_WB: vector("v_WB"),
            w_WB_W: vector("w_WB_W"),
        };
        (At::new(urdf, base, numbers(&state["q"]), numbers(&state["qd"])), stored["expected"].clone())
    };
    fixture["states"].as_array().unwrap().iter().map(of).collect()
}

/// A random state near the origin.
fn random(urdf: &str, rng: &mut Rng) -> At {
    let n = Model::new(&UrdfTree::parse(urdf, "urdf").unwrap(), Base::Floating).unwrap().nj();
    let base = BaseState {
        p_WB: rng.vec3(1.0),
        R_WB: Rz(3.0 * rng.symmetric()) * Ry(rng.symmetric()) * Rx(rng.symmetric()),
        ..BaseState::identity()
    };
    let q = (0..n).map(|_| rng.symmetric()).collect();
    At::new(urdf, base, q, vec![0.0; n])
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}

fn matrix(value: &Value) -> DMatrix<f64> {
    let rows = value.as_array().unwrap().len();
    let numbers = numbers(value);
    DMatrix::from_row_slice(rows, numbers.len() / rows, &numbers)
}

/// Pose and Jacobian of a frame by Pinocchio; without a name those of the world.
fn frame_of(expected: &Value, link: Option<&str>, nv: usize) -> (Vector3<f64>, Matrix3<f64>, DMatrix<f64>) {
    let Some(link) = link else { return (Vector3::zeros(), Matrix3::identity(), DMatrix::zeros(6, nv)) };
    let frame = &expected["frames"][link];
    let p = Vector3::from_column_slice(&numbers(&frame["p_WF"]));
    (p, Matrix3::from_row_slice(&numbers(&frame["R_WF"])), matrix(&frame["jacobian"]))
}

fn near(what: &str, found: &DMatrix<f64>, expected: &DMatrix<f64>) {
    let error = (found - expected).abs().max();
    assert!(error <= TOLERANCE * expected.abs().max().max(1.0), "{what}: {error}");
}

/// `blkdiag(R, R)`.
fn turned(R: &Matrix3<f64>, rows: &DMatrix<f64>) -> DMatrix<f64> {
    let mut turn = DMatrix::zeros(6, 6);
    turn.fixed_view_mut::<3, 3>(0, 0).copy_from(R);
    turn.fixed_view_mut::<3, 3>(3, 3).copy_from(R);
    turn * rows
}

/// Spec of the relative Jacobian, with dense matrices: `[I 0 -I [r]x; 0 I 0 -I] [J_d; J_b]` in W axes.
fn relative(J_d: &DMatrix<f64>, J_b: &DMatrix<f64>, r: &Vector3<f64>) -> DMatrix<f64> {
    let mut J = J_d - J_b;
    let shifted = J.rows(0, 3) + r.cross_matrix() * J_b.rows(3, 3);
    J.rows_mut(0, 3).copy_from(&shifted);
    J
}

#[test]
fn rows_of_a_relative_pose_are_those_of_pinocchios_jacobians() {
    let mut compared = 0;
    for robot in [CENTAURO, COMAN] {
        for (at, expected) in stored(robot) {
            let (model, nv) = (&at.model, at.model.nv());
            let links: Vec<&str> = expected["frames"].as_object().unwrap().keys().map(String::as_str).collect();
            let mut rng = Rng(1);
            for &link in &links {
                for other in [None].into_iter().chain(links.iter().map(|link| Some(*link))) {
                    let (p_d, R_d, J_d) = frame_of(&expected, Some(link), nv);
                    let (p_b, R_b, J_b) = frame_of(&expected, other, nv);
                    let r = p_d - p_b;
                    let reference = RelativePoseReference {
                        p: R_b.transpose() * r + rng.vec3(1.0),
                        R: Rz(0.4) * R_b.transpose() * R_d,
                        twist: Vector6::from_fn(|_, _| rng.symmetric()),
                    };
                    let to = other.map(|link| at.frame(link));
                    let mut task = at.built(|of| RelativePose::new(of, at.frame(link), to, 5.0));
                    // In the axes of b; the error of the orientation is 0.4 rad about its z axis.
                    let J = turned(&R_b.transpose(), &relative(&J_d, &J_b, &r));
                    let mut e = DMatrix::zeros(6, 1);
                    e.rows_mut(0, 3).copy_from(&(reference.p - R_b.transpose() * r));
                    e[5] = 0.4;
                    let twist = DMatrix::from_column_slice(6, 1, reference.twist.as_slice());
                    let rows = at.rows(&mut task, &reference);
                    let what = format!("{link} in {other:?}");
                    near(&what, &rows.A, &J);
                    near(&what, &column(&rows.b), &(&twist + &e * 5.0));

                    task.local = true;
                    task.orientation_gain = 0.25;
                    e[5] = 0.1;
                    let turn = R_d.transpose() * R_b;
                    let rows = at.rows(&mut task, &reference);
                    near(&what, &rows.A, &turned(&turn, &J));
                    near(&what, &column(&rows.b), &turned(&turn, &(&twist + &e * 5.0)));

                    task.local = false;
                    let (near_half, far_half): (Vec<usize>, Vec<usize>) = (0..nv).partition(|col| col % 2 == 0);
                    task.disabled.clone_from(&far_half);
                    let rows = at.rows(&mut task, &reference);
                    assert!(far_half.iter().all(|&col| rows.A.column(col).iter().all(|x| *x == 0.0)));
                    for col in near_half {
                        near(&what, &rows.A.columns(col, 1).into(), &J.columns(col, 1).into());
                    }
                    compared += 1;
                }
            }
            assert_eq!(model.nv(), nv);
        }
    }
    assert_eq!(compared, 2 * 2 * 5 * 6);
}

fn column(b: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(b.len(), 1, b.as_slice())
}

/// The other link is replaced between two ticks: nothing of the first remains, and the columns of the base appear.
#[test]
fn the_other_link_can_change_between_ticks() {
    let at = random(CENTAURO[0], &mut Rng(2));
    let [hand, imu] = ["arm2_8", "imu_link"].map(|link| at.frame(link));
    let reference = RelativePoseReference { p: Vector3::zeros(), R: Matrix3::identity(), twist: Vector6::zeros() };
    let mut task = at.built(|of| RelativePose::new(of, hand, Some(imu), 1.0));
    let mut rows = task.rows();
    at.update(&mut task, &reference, &mut rows);
    assert!(rows.is_on(0) && rows.A.columns(0, 6).iter().all(|x| *x == 0.0));
    for other in [None, Some(at.frame("wheel_1")), Some(hand), Some(imu)] {
        task.relative_to = other;
        at.update(&mut task, &reference, &mut rows);
        let fresh = at.rows(&mut at.built(|of| RelativePose::new(of, hand, other, 1.0)), &reference);
        assert_eq!((&rows.A, &rows.b), (&fresh.A, &fresh.b));
        assert_eq!(rows.A.columns(0, 3).iter().any(|x| *x != 0.0), other.is_none());
    }
}

/// `A v` is the rate of the pose along `v`, for rows in the axes of the other link and of the link itself.
#[test]
fn rows_of_a_relative_pose_are_its_rate() {
    let mut rng = Rng(3);
    for _ in 0..10 {
        let at = random(COMAN[0], &mut rng);
        let (hand, foot) = (at.frame("LSoftHand"), at.frame("r_sole"));
        for (other, local) in [(None, false), (Some(foot), false), (Some(foot), true), (None, true)] {
            let mut task = at.built(|of| RelativePose::new(of, hand, other, 1.0));
            task.local = local;
            let (p, R) = task.pose(&at.model, &at.kin);
            let rows = at.rows(&mut task, &RelativePoseReference { p, R, twist: Vector6::zeros() });
            assert!(rows.b.norm() < 1e-12);
            let v = DVector::from_fn(at.model.nv(), |_, _| rng.symmetric());
            let dt = 1e-6;
            let (before, after) = (at.moved(&v, -dt), at.moved(&v, dt));
            let ((p0, R0), (p1, R1)) = (task.pose(&at.model, &before.kin), task.pose(&at.model, &after.kin));
            let to = if local { R.transpose() } else { Matrix3::identity() };
            let (linear, angular) = (to * (p1 - p0) / (2.0 * dt), to * log(&(R1 * R0.transpose())) / (2.0 * dt));
            let rate = &rows.A * &v;
            assert!((rate.rows(0, 3) - linear).norm() < 1e-8 && (rate.rows(3, 3) - angular).norm() < 1e-8);
        }
    }
}

/// In the world and relative to a link: compared with Pinocchio's Jacobians and, for the error, its centre of mass.
#[test]
fn rows_of_the_center_of_mass_are_those_of_pinocchios_jacobians() {
    for robot in [CENTAURO, COMAN] {
        for (at, expected) in stored(robot) {
            let nv = at.model.nv();
            let (J_C, c) = (matrix(&expected["com_jacobian"]), Vector3::from_column_slice(&numbers(&expected["com"])));
            let mut task = at.built(|of| CenterOfMass::new(of, 4.0));
            let links: Vec<&str> = expected["frames"].as_object().unwrap().keys().map(String::as_str).collect();
            for other in [None].into_iter().chain(links.into_iter().map(Some)) {
                let (p_b, R_b, J_b) = frame_of(&expected, other, nv);
                let mut J_d = DMatrix::zeros(6, nv);
                J_d.rows_mut(0, 3).copy_from(&J_C);
                let J = turned(&R_b.transpose(), &relative(&J_d, &J_b, &(c - p_b)));
                let (e, v) = (Vector3::new(0.1, -0.2, 0.3), Vector3::new(1.0, 2.0, 3.0));
                task.relative_to = other.map(|link| at.frame(link));
                let rows = at.rows(&mut task, &(R_b.transpose() * (c - p_b) + e, v));
                near("com", &rows.A, &J.rows(0, 3).into());
                near("com", &column(&rows.b), &DMatrix::from_column_slice(3, 1, (v + e * 4.0).as_slice()));
            }
            task.relative_to = None;
            task.disabled = vec![2, nv - 1];
            let rows = at.rows(&mut task, &(c, c));
            assert!(rows.A.column(2).norm() == 0.0 && rows.A.column(nv - 1).norm() == 0.0 && rows.A[(0, 0)] != 0.0);
        }
    }
}

#[test]
fn rows_of_the_angular_momentum_are_those_of_pinocchios_matrix() {
    for robot in [CENTAURO, COMAN] {
        for (at, expected) in stored(robot) {
            let mut task = at.built(AngularMomentum::new);
            let rows = at.rows(&mut task, &Vector3::new(1.0, 2.0, 3.0));
            near("A_G", &rows.A, &matrix(&expected["centroidal_momentum_matrix"]).rows(3, 3).into());
            assert_eq!(rows.b.as_slice(), [1.0, 2.0, 3.0]);
        }
    }
}

/// Angle between the axis and the direction to the target.
fn gaze_angle(at: &At, link: FrameId, axis: &Vector3<f64>, target_W: &Vector3<f64>) -> f64 {
    let (a, d) = (at.kin.R_WF(&at.model, link) * axis, target_W - at.kin.p_WF(&at.model, link));
    atan2(a.cross(&d).norm(), a.dot(&d))
}

/// Motions that satisfy the rows reduce the angle at `k` times the angle, also from behind, while the target moves.
#[test]
fn the_gaze_angle_decays_at_its_gain_from_any_side() {
    let mut rng = Rng(4);
    let axis = Vector3::new(0.6, 0.0, 0.8);
    let mut largest = 0.0_f64;
    for trial in 0..60 {
        let at = random(COMAN[0], &mut rng);
        let (link, foot) = (at.frame("LSoftHand"), at.frame("r_sole"));
        let other = (trial % 2 == 0).then_some(foot);
        let frame_of = |at: &At| match other {
            None => (Vector3::zeros(), Matrix3::identity()),
            Some(other) => (at.kin.p_WF(&at.model, other), at.kin.R_WF(&at.model, other)),
        };
        let (target, v_target) = (rng.vec3(2.0), rng.vec3(1.0));
        let mut task = at.built(|of| Gaze::new(of, link, &axis, other, 3.0));
        let rows = at.rows(&mut task, &(target, v_target));
        // A random solution of the two rows.
        let free = DVector::from_fn(at.model.nv(), |_, _| rng.symmetric());
        let (A, b) = (&rows.A, &rows.b);
        let v = &free + A.transpose() * (A * A.transpose()).try_inverse().unwrap() * (b - A * &free);
        let angle_at = |dt: f64| {
            let moved = at.moved(&v, dt);
            let (p, R) = frame_of(&moved);
            gaze_angle(&moved, link, &axis, &(p + R * (target + v_target * dt)))
        };
        let (angle, dt) = (angle_at(0.0), 1e-6);
        let rate = (angle_at(dt) - angle_at(-dt)) / (2.0 * dt);
        assert!((rate + 3.0 * angle).abs() < 1e-5, "{trial}: {rate} at {angle}");
        largest = largest.max(angle);
    }
    assert!(largest > 2.5, "{largest}");
}

#[test]
fn a_target_behind_gives_the_full_angle_and_one_at_the_link_none() {
    let at = random(CENTAURO[0], &mut Rng(5));
    let link = at.frame("arm1_8");
    let p = at.kin.p_WF(&at.model, link);
    let a: Vector3<f64> = at.kin.R_WF(&at.model, link).column(2).into();
    let mut task = at.built(|of| Gaze::new(of, link, &Vector3::z(), None, 1.0));
    for (target, angle) in [(p - a, std::f64::consts::PI), (p + a, 0.0)] {
        let rows = at.rows(&mut task, &(target, Vector3::zeros()));
        assert!((rows.b.norm() - angle).abs() < 1e-9, "{}", rows.b);
    }
    let rows = at.rows(&mut task, &(p, Vector3::zeros()));
    assert!(!rows.is_on(0) && rows.A.norm() == 0.0 && rows.b.norm() == 0.0);
    task.disabled = vec![0, 3];
    let rows = at.rows(&mut task, &(p - a * 2.0, Vector3::zeros()));
    assert!(rows.A.columns(0, 1).norm() + rows.A.columns(3, 1).norm() == 0.0 && rows.A.columns(4, 1).norm() > 0.0);
}

/// Compared with Pinocchio's gravity torques and their derivative.
#[test]
fn the_minimum_effort_descends_the_gradient_of_the_weighted_torques() {
    for robot in [CENTAURO, COMAN] {
        for (at, expected) in stored(robot) {
            let nj = at.model.nj();
            let (G, g) = (matrix(&expected["gravity_derivative"]), numbers(&expected["gravity_force"]));
            let mut task = at.built(|of| MinimumEffort::new(of, 2.0));
            let weighted =
                DVector::from_fn(nj, |i, _| g[6 + i] / (at.model.joints[i].effort * at.model.joints[i].effort));
            let rows = at.rows(&mut task, &());
            near("effort", &column(&rows.b), &column(&(G.transpose() * weighted * -2.0)));
            assert!(rows.b.norm() > 1e-3 && rows.A.columns(6, nj).is_identity(0.0));
        }
    }
}

/// The gradient of the effort compared with differences of the effort.
#[test]
fn the_effort_decreases_along_its_task() {
    let mut rng = Rng(6);
    for _ in 0..5 {
        let at = random(COMAN[0], &mut rng);
        let effort = |at: &At| {
            let mut g = DVector::zeros(at.model.nv());
            gravity_force(&at.model, &at.kin, &mut g);
            let square = |(i, joint): (usize, &JointInfo)| g[6 + i] * g[6 + i] / (joint.effort * joint.effort);
            0.5 * at.model.joints.iter().enumerate().map(square).sum::<f64>()
        };
        let mut task = at.built(|of| MinimumEffort::new(of, 1.0));
        let rows = at.rows(&mut task, &());
        let mut v = DVector::zeros(at.model.nv());
        v.rows_mut(6, at.model.nj()).copy_from(&rows.b);
        let dt = 1e-6;
        let rate = (effort(&at.moved(&v, dt)) - effort(&at.moved(&v, -dt))) / (2.0 * dt);
        assert!((rate + rows.b.norm_squared()).abs() < 1e-6 * rate.abs().max(1.0), "{rate}");
        assert!(rate < 0.0);
    }
}

/// `√det(J Jᵀ)` of Pinocchio's Jacobians, and its gradient compared with differences, for chains that go through the trunk and for one that is singular.
#[test]
fn the_manipulability_and_its_gradient() {
    let mut rng = Rng(7);
    for (at, expected) in stored(COMAN) {
        let nv = at.model.nv();
        for (link, base, motion) in [
            ("LSoftHand", None, Motion::Pose),
            ("LSoftHand", Some("r_sole"), Motion::Pose),
            ("r_sole", Some("l_sole"), Motion::Position),
        ] {
            let rows = if motion == Motion::Pose { 6 } else { 3 };
            let chain = (at.frame(link), base.map(|link| at.frame(link)));
            let mut task = at.built(|of| Manipulability::new("reach", of, chain, motion, 1.0)).unwrap();
            let base_jacobian = match base {
                Some(_) => frame_of(&expected, base, nv),
                // The root link: its origin moves with the base alone.
                None => (at.base.p_WB, at.base.R_WB, DMatrix::identity(6, nv)),
            };
            let (p, _, J) = frame_of(&expected, Some(link), nv);
            let J = relative(&J, &base_jacobian.2, &(p - base_jacobian.0));
            let J = J.view((0, 6), (rows, nv - 6));
            let expected = (J * J.transpose()).determinant().sqrt();
            let (found, _) = task.evaluate(&at.model, &at.kin);
            assert!((found - expected).abs() < 1e-9 * expected.max(1e-3), "{link} {base:?}: {found} {expected}");

            let near = random(COMAN[0], &mut rng);
            let columns: Vec<usize> = (0..nv).filter(|col| task.rows().A.column(*col).norm() > 0.0).collect();
            let (_, gradient) = task.evaluate(&near.model, &near.kin);
            let by_row = DVector::from_column_slice(gradient);
            let gradient = task.rows().A.transpose() * by_row;
            for col in columns {
                let (mut v, dt) = (DVector::zeros(nv), 1e-5);
                v[col] = 1.0;
                let mut value = |dt: f64| {
                    let moved = near.moved(&v, dt);
                    task.evaluate(&moved.model, &moved.kin).0
                };
                let slope = (value(dt) - value(-dt)) / (2.0 * dt);
                assert!((slope - gradient[col]).abs() < 1e-7, "{link} {base:?} {col}: {slope} {}", gradient[col]);
            }
            let rows = near.rows(&mut task, &());
            let slope = task.evaluate(&near.model, &near.kin).1.to_vec();
            assert_eq!(rows.b.as_slice(), slope);
        }
    }
}

#[test]
fn a_singular_chain_has_no_gradient_and_a_short_one_is_refused() {
    let n = Model::new(&UrdfTree::parse(COMAN[0], "urdf").unwrap(), Base::Floating).unwrap().nj();
    // A leg with a straight knee is singular: hip, knee and ankle lie on a line.
    let at = At::new(COMAN[0], BaseState::identity(), vec![0.0; n], vec![0.0; n]);
    let foot = at.frame("r_sole");
    let mut task = at.built(|of| Manipulability::new("reach", of, (foot, None), Motion::Pose, 1.0)).unwrap();
    let (m, gradient) = task.evaluate(&at.model, &at.kin);
    assert!(m < 1e-6 && gradient.iter().all(|slope| *slope == 0.0), "{m}");
    let imu = at.frame("imu_link");
    let short = at.built(|of| Manipulability::new("reach", of, (imu, None), Motion::Position, 1.0));
    assert!(
        matches!(short.err(), Some(StackError::ShortChain { task, link, needed: 3, .. }) if task == "reach" && link == "imu_link")
    );
}

#[test]
fn the_minimum_velocity_stops_everything() {
    let at = random(COMAN[0], &mut Rng(8));
    let rows = at.rows(&mut at.built(MinimumVelocity::new), &());
    assert!(rows.A.is_identity(0.0) && rows.b.norm() == 0.0 && rows.A.nrows() == at.model.nv());
}
