//! Tasks and constraints of the velocity level on an arm with a fixed base, and the posture task of the acceleration level on groups of any size.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::Rng;
use controller::constraints::velocity::JointLimits;
use controller::math::log;
use controller::model::{Base, BaseState, Kinematics, Model, UrdfTree, mass_matrix};
use controller::qp::{Backend, Qp};
use controller::stack::{
    Cascade, Constraint, ModelState, Solver, Structure, Task, Term, Variables, pattern, update_all,
};
use controller::tasks::acceleration::Posture;
use controller::tasks::velocity::{JointPositions, RelativePose, RelativePoseReference};
use nalgebra::{DMatrix, DVector, Vector6};

const ARM: &str = include_str!("../model/tests/data/arm.urdf");
const DT: f64 = 0.01;

fn arm() -> Model {
    Model::new(&UrdfTree::parse(ARM, "arm.urdf").unwrap(), Base::Fixed).unwrap()
}

fn kinematics(model: &Model, q: &[f64], qd: &[f64]) -> Kinematics {
    let mut kin = Kinematics::new(model);
    kin.update(model, &BaseState::identity(), q, qd);
    kin
}

/// A random posture inside the limits.
fn inside(model: &Model, rng: &mut Rng) -> Vec<f64> {
    let position = |lower: f64, upper: f64, x: f64| {
        let (lower, upper) = (lower.max(-1.0), upper.min(1.0));
        0.5 * (lower + upper) + 0.3 * x * (upper - lower)
    };
    model.joints.iter().map(|joint| position(joint.lower, joint.upper, rng.symmetric())).collect()
}

/// The tool reaches a pose, then a joint posture of lower priority is followed as far as it leaves the pose alone; no joint violates a limit.
#[test]
fn a_pose_above_a_posture_is_reached_inside_the_joint_limits() {
    let model = arm();
    let (nj, mut rng) = (model.nj(), Rng(8));
    let variables = Variables::velocities(model.nv());
    let of = Structure { model: &model, contacts: &[], variables: &variables };
    let (M, h) = (DMatrix::zeros(0, 0), DVector::zeros(0));
    let tool = model.frame("tool").unwrap();
    let mut at_limit = 0;
    for trial in 0..6 {
        let (mut q, goal, posture_goal) =
            (inside(&model, &mut rng), inside(&model, &mut rng), inside(&model, &mut rng));
        let end = kinematics(&model, &goal, &vec![0.0; nj]);
        let reference =
            RelativePoseReference { p: end.p_WF(&model, tool), R: end.R_WF(&model, tool), twist: Vector6::zeros() };
        // Towards the goal along the joints: the posture reference leads there, so that no local minimum is met.
        let followed: Vec<(f64, f64)> =
            if trial < 3 { &goal } else { &posture_goal }.iter().map(|q| (*q, 0.0)).collect();
        let mut pose = RelativePose::new(&of, tool, None, 5.0);
        let mut posture = JointPositions::new(&of, 5.0);
        let mut constraints: Vec<Box<dyn Constraint>> = vec![Box::new(JointLimits::new(&of, DT))];
        let mut tasks = [pose.rows(), posture.rows()];
        let term = |task: usize, n: usize, weight: f64| vec![Term { task, weight, takes: vec![true; n] }];
        let levels = vec![[term(0, 6, 1.0), term(1, nj, 1e-3)].concat()];
        let pattern = pattern(&constraints, &variables, variables.len());
        let each = |of_level: &Qp| Backend::ActiveSet.build(of_level, 200, 1e-10);
        let lambda = DVector::from_element(variables.len(), 1e-8);
        let mut stack = Cascade::new(levels, &pattern, lambda, variables.len(), None, &Solver::Each(&each));
        let (mut before, mut after) = (f64::NAN, f64::NAN);
        for step in 0..600 {
            let qd = vec![0.0; nj];
            let kin = kinematics(&model, &q, &qd);
            let (model, variables) = (&model, &variables);
            let state = ModelState {
                model,
                contacts: &[],
                variables,
                q: &q,
                qd: &qd,
                kin: &kin,
                M: &M,
                h: &h,
                at: &[],
                loads: &[],
            };
            pose.update(&state, &reference, &mut tasks[0]);
            posture.update(&state, &followed[..], &mut tasks[1]);
            update_all(&mut constraints, &state, stack.constraints());
            stack.build(&tasks);
            stack.solve(&tasks);
            let v = stack.solution().unwrap().x.clone();
            // The rows are the rate of the pose: compared with its difference along the solution.
            let eps = 1e-6;
            let moved: Vec<f64> = (0..nj).map(|j| q[j] + eps * v[j]).collect();
            let next = kinematics(model, &moved, &qd);
            let linear = (next.p_WF(model, tool) - kin.p_WF(model, tool)) / eps;
            let angular = log(&(next.R_WF(model, tool) * kin.R_WF(model, tool).transpose())) / eps;
            let rate = &tasks[0].A * &v;
            assert!(
                (rate.fixed_rows::<3>(0) - linear).norm() < 1e-4 && (rate.fixed_rows::<3>(3) - angular).norm() < 1e-4
            );
            for (j, joint) in model.joints.iter().enumerate() {
                q[j] += DT * v[j];
                assert!(v[j].abs() <= joint.velocity + 1e-8, "{} {}", joint.name, v[j]);
                assert!(q[j] >= joint.lower - 1e-9 && q[j] <= joint.upper + 1e-9, "{} {}", joint.name, q[j]);
                at_limit += usize::from(v[j].abs() > joint.velocity - 1e-6);
            }
            let error = tasks[0].b.norm() / 5.0;
            if step == 0 {
                before = error;
            }
            after = error;
        }
        assert!(trial >= 3 || after < 1e-2 * before.max(0.1), "{trial}: {before} {after}");
    }
    assert!(at_limit > 10, "{at_limit}");
}

/// A joint outside its limits returns, at most at its largest speed; the interval is never empty.
#[test]
fn a_joint_outside_its_limits_returns() {
    let model = arm();
    let variables = Variables::velocities(model.nv());
    let of = Structure { model: &model, contacts: &[], variables: &variables };
    let mut constraints: Vec<Box<dyn Constraint>> = vec![Box::new(JointLimits::new(&of, DT))];
    let (M, h) = (DMatrix::zeros(0, 0), DVector::zeros(0));
    let qd = vec![0.0; model.nj()];
    for (beyond, back) in [(0.005, false), (0.5, true), (50.0, true)] {
        for side in [1.0, -1.0] {
            let q: Vec<f64> = model
                .joints
                .iter()
                .map(|joint| if side > 0.0 { joint.upper + beyond } else { joint.lower - beyond })
                .map(|q| if q.is_finite() { q } else { 0.0 })
                .collect();
            let kin = kinematics(&model, &q, &qd);
            let mut qp = pattern(&constraints, &variables, 0);
            let (model, variables) = (&model, &variables);
            let state = ModelState {
                model,
                contacts: &[],
                variables,
                q: &q,
                qd: &qd,
                kin: &kin,
                M: &M,
                h: &h,
                at: &[],
                loads: &[],
            };
            update_all(&mut constraints, &state, &mut qp);
            for (j, joint) in model.joints.iter().enumerate() {
                let (lower, upper) = (qp.lower[j], qp.upper[j]);
                assert!(lower <= upper && lower >= -joint.velocity && upper <= joint.velocity, "{}", joint.name);
                if joint.upper.is_finite() {
                    let outer = if side > 0.0 { upper } else { -lower };
                    let expected = -(beyond / DT).min(joint.velocity);
                    assert!((outer - expected).abs() < 1e-9, "{}: {outer} {expected}", joint.name);
                    assert!(!back || (outer + joint.velocity).abs() < 1e-9);
                }
            }
        }
    }
}

#[test]
fn the_inertia_of_a_group_of_any_size_premultiplies_its_feedback() {
    let model = arm();
    let (nj, mut rng) = (model.nj(), Rng(5));
    let variables = Variables::new(model.nv(), [], false);
    let of = Structure { model: &model, contacts: &[], variables: &variables };
    for groups in [
        vec![vec![0, 1, 2], vec![3, 4, 5, 6]],
        vec![(0..nj).collect::<Vec<_>>()],
        vec![vec![6, 0], vec![1, 2, 3, 4, 5]],
    ] {
        assert_eq!(groups.iter().map(Vec::len).sum::<usize>(), nj);
        let q: Vec<f64> = (0..nj).map(|_| rng.symmetric()).collect();
        let qd: Vec<f64> = (0..nj).map(|_| rng.symmetric()).collect();
        let kin = kinematics(&model, &q, &qd);
        let (mut M, h) = (DMatrix::zeros(nj, nj), DVector::zeros(nj));
        mass_matrix(&model, &kin, &mut M);
        let (model, variables) = (&model, &variables);
        let state = ModelState {
            model,
            contacts: &[],
            variables,
            q: &q,
            qd: &qd,
            kin: &kin,
            M: &M,
            h: &h,
            at: &[],
            loads: &[],
        };
        let mut task = Posture::new(&of, groups.clone());
        let mut rows = task.rows();
        let mut reference = task.reference();
        for to in [&mut reference.q, &mut reference.qd, &mut reference.qdd, &mut reference.kp, &mut reference.kd] {
            to.iter_mut().for_each(|x| *x = rng.symmetric());
        }
        for inertia in [false, true] {
            reference.inertia.fill(inertia);
            *reference.active.last_mut().unwrap() = !inertia;
            task.update(&state, &reference, &mut rows);
            for (i, group) in groups.iter().enumerate() {
                let n = group.len();
                let u = DVector::from_fn(n, |k, _| {
                    let j = group[k];
                    reference.kp[j] * (reference.q[j] - q[j]) + reference.kd[j] * (reference.qd[j] - qd[j])
                });
                let M_g = DMatrix::from_fn(n, n, |r, c| M[(group[r], group[c])]);
                let u = if inertia { M_g.try_inverse().unwrap() * u } else { u };
                for (k, &j) in group.iter().enumerate() {
                    let expected = u[k] + reference.qdd[j];
                    assert!((task.qdd[j] - expected).abs() < 1e-9 * expected.abs().max(1.0), "{groups:?} {j}");
                    let on = reference.active[i];
                    assert_eq!((rows.is_on(j), rows.b[j]), (on, if on { task.qdd[j] } else { 0.0 }));
                }
            }
        }
    }
}
