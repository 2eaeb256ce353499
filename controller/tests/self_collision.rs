//! Self-collision constraint on COMAN: its rows compared with differences of the distance, and motions that it keeps apart.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::Rng;
use controller::constraints::velocity::{JointLimits, SelfCollision, SelfCollisionParams};
use controller::model::{Base, BaseState, FrameId, Kinematics, Model, UrdfTree, capsules};
use controller::qp::{Backend, Qp};
use controller::stack::{
    Cascade, Constraint, ConstraintRows, ModelState, Solver, Structure, Task, Term, Variables, pattern, update_all,
};
use controller::tasks::velocity::JointPositions;
use nalgebra::{DMatrix, DVector};

const URDF: &str = include_str!("../../robots/coman/coman.urdf");
const PARAMS: SelfCollisionParams = SelfCollisionParams { margin: 0.01, gain: 10.0, threshold: 0.15, rows: 6 };

struct Coman {
    tree: UrdfTree,
    model: Model,
    variables: Variables,
}

impl Coman {
    fn new() -> Self {
        let tree = UrdfTree::parse(URDF, "coman.urdf").unwrap();
        let model = Model::new(&tree, Base::Floating).unwrap();
        let variables = Variables::velocities(model.nv());
        Coman { tree, model, variables }
    }

    fn kinematics(&self, q: &[f64]) -> Kinematics {
        let mut kin = Kinematics::new(&self.model);
        kin.update(&self.model, &BaseState::identity(), q, &vec![0.0; q.len()]);
        kin
    }

    fn constraint(&self, disabled: &[[FrameId; 2]], params: SelfCollisionParams) -> SelfCollision {
        let of = Structure { model: &self.model, contacts: &[], variables: &self.variables };
        let nominal = self.kinematics(&vec![0.0; self.model.nj()]);
        SelfCollision::new(&of, capsules(&self.tree, &self.model).unwrap(), &nominal, disabled, params)
    }

    /// Calls `run` with the state at `q` and the velocities of the last step.
    fn at<T>(&self, q: &[f64], qd: &[f64], run: impl FnOnce(&ModelState<'_>) -> T) -> T {
        let (kin, M, h) = (self.kinematics(q), DMatrix::zeros(0, 0), DVector::zeros(0));
        let (model, variables) = (&self.model, &self.variables);
        let state = ModelState { model, contacts: &[], variables, q, qd, kin: &kin, M: &M, h: &h, at: &[], loads: &[] };
        run(&state)
    }

    /// The rows of a constraint at `q`.
    fn rows(&self, constraint: &mut SelfCollision, q: &[f64]) -> Qp {
        let mut qp = Qp::zeros(self.model.nv(), 0, constraint.size().inequalities);
        qp.C.fill(0.0);
        let rows = &mut ConstraintRows { qp: &mut qp, equality: 0, inequality: 0 };
        self.at(q, &vec![0.0; q.len()], |state| constraint.update(state, rows));
        qp
    }

    fn random(&self, rng: &mut Rng, size: f64) -> Vec<f64> {
        let within = |low: f64, high: f64, x: f64| 0.5 * (low + high) + 0.5 * (high - low) * x;
        self.model.joints.iter().map(|joint| within(joint.lower, joint.upper, size * rng.symmetric())).collect()
    }
}

fn distance(constraint: &SelfCollision, links: [FrameId; 2]) -> Option<f64> {
    constraint.nearest().iter().find(|near| near.links == links).map(|near| near.distance)
}

#[test]
fn rows_are_the_rate_of_the_distance() {
    let coman = Coman::new();
    let everything = SelfCollisionParams { threshold: 10.0, rows: 100, ..PARAMS };
    let mut constraint = coman.constraint(&[], everything);
    let (nv, mut rng, mut compared) = (coman.model.nv(), Rng(3), 0);
    for _ in 0..10 {
        let q = coman.random(&mut rng, 0.9);
        let qp = coman.rows(&mut constraint, &q);
        let near = constraint.nearest().to_vec();
        assert_eq!(near.len(), constraint.pairs());
        assert!(near.windows(2).all(|pair| pair[0].distance <= pair[1].distance));
        let qd: Vec<f64> = q.iter().map(|_| rng.symmetric()).collect();
        let v = DVector::from_iterator(nv, [0.0; 6].into_iter().chain(qd.iter().copied()));
        let dt = 1e-6;
        let mut distances = |dt: f64| {
            let moved: Vec<f64> = q.iter().zip(&qd).map(|(q, qd)| q + qd * dt).collect();
            coman.rows(&mut constraint, &moved);
            near.iter().map(|near| distance(&constraint, near.links).unwrap()).collect::<Vec<_>>()
        };
        let (before, after) = (distances(-dt), distances(dt));
        for (row, near) in near.iter().enumerate() {
            let rate = (after[row] - before[row]) / (2.0 * dt);
            // At a change of the nearest ends, the distance has a kink.
            let has_kink = ((after[row] - near.distance) - (near.distance - before[row])).abs() > 1e-9;
            if !has_kink {
                let found = (0..nv).fold(0.0, |sum, col| sum + qp.C[(row, col)] * v[col]);
                assert!((found + rate).abs() < 1e-6, "{found} {rate}");
                compared += 1;
            }
            assert!((qp.d[row] - 10.0 * (near.distance - 0.01)).abs() < 1e-12);
            assert!((0..6).all(|col| qp.C[(row, col)] == 0.0), "the base moves both links");
        }
        assert!(qp.d.rows(near.len(), 100 - near.len()).iter().all(|d| *d == 1.0));
    }
    assert!(compared > 9 * constraint.pairs(), "{compared} of {}", 10 * constraint.pairs());
}

/// The rows of a few pairs are the first of all, and those that are not used are 0.
#[test]
fn only_the_nearest_pairs_have_rows() {
    let coman = Coman::new();
    let mut all = coman.constraint(&[], SelfCollisionParams { threshold: 10.0, rows: 100, ..PARAMS });
    let params = SelfCollisionParams { threshold: 0.06, ..PARAMS };
    let mut few = coman.constraint(&[], params);
    let (mut rng, mut counts) = (Rng(4), [0; 7]);
    for _ in 0..50 {
        let q = coman.random(&mut rng, 0.9);
        let (all_rows, few_rows) = (coman.rows(&mut all, &q), coman.rows(&mut few, &q));
        let expected = all.nearest().iter().filter(|near| near.distance < params.threshold).take(params.rows).count();
        assert_eq!(few.nearest(), &all.nearest()[..expected]);
        assert_eq!(few_rows.C.rows(0, expected), all_rows.C.rows(0, expected));
        assert!(few_rows.C.rows(expected, PARAMS.rows - expected).iter().all(|x| *x == 0.0));
        counts[expected] += 1;
    }
    assert!(counts[..6].iter().sum::<i32>() > 0, "{counts:?}");
}

/// Neighbours, disabled pairs and those that touch in the nominal posture are left out.
#[test]
fn pairs_are_left_out() {
    let coman = Coman::new();
    let mut everything = coman.constraint(&[], SelfCollisionParams { threshold: 10.0, rows: 100, ..PARAMS });
    let zero = vec![0.0; coman.model.nj()];
    coman.rows(&mut everything, &zero);
    assert!(everything.nearest().iter().all(|near| near.distance >= PARAMS.margin));
    let pairs = everything.pairs();
    let [a, b] = everything.nearest()[0].links;
    for disabled in [[a, b], [b, a]] {
        assert_eq!(coman.constraint(&[disabled], PARAMS).pairs(), pairs - 1);
    }
    let strict =
        coman.constraint(&[], SelfCollisionParams { margin: everything.nearest()[0].distance + 1e-6, ..PARAMS });
    assert_eq!((strict.pairs(), strict.touching().len()), (pairs - 1, everything.touching().len() + 1));
    assert!(strict.touching().contains(&[a, b]));
}

/// Joints that move towards random postures: without the constraint links overlap, with it no pair comes nearer than the margin, and the joints keep their limits.
#[test]
fn links_do_not_touch_on_the_way_to_postures_in_which_they_would() {
    let coman = Coman::new();
    let (nj, nv, dt) = (coman.model.nj(), coman.model.nv(), 0.005);
    let of = Structure { model: &coman.model, contacts: &[], variables: &coman.variables };
    let mut least = [f64::INFINITY; 2];
    for (which, least) in least.iter_mut().enumerate() {
        let mut constraints: Vec<Box<dyn Constraint>> = vec![Box::new(JointLimits::new(&of, dt))];
        if which == 1 {
            constraints.push(Box::new(coman.constraint(&[], PARAMS)));
        }
        let mut watch = coman.constraint(&[], SelfCollisionParams { rows: 1, threshold: 10.0, ..PARAMS });
        let mut posture = JointPositions::new(&of, 5.0);
        let mut tasks = [posture.rows()];
        let levels = vec![vec![Term { task: 0, weight: 1.0, takes: vec![true; nj] }]];
        let pattern = pattern(&constraints, &coman.variables, nv);
        let each = |of_level: &Qp| Backend::ActiveSet.build(of_level, 200, 1e-10);
        let lambda = DVector::from_element(nv, 1e-6);
        let mut stack = Cascade::new(levels, &pattern, lambda, nv, None, &Solver::Each(&each));
        let mut rng = Rng(9);
        let mut q = vec![0.0; nj];
        for _ in 0..12 {
            let goal: Vec<(f64, f64)> = coman.random(&mut rng, 1.0).into_iter().map(|q| (q, 0.0)).collect();
            for _ in 0..200 {
                coman.at(&q, &vec![0.0; nj], |state| {
                    posture.update(state, &goal[..], &mut tasks[0]);
                    update_all(&mut constraints, state, stack.constraints());
                });
                stack.build(&tasks);
                stack.solve(&tasks);
                let v = &stack.solution().expect("a solution").x;
                q.iter_mut().enumerate().for_each(|(j, q)| *q += dt * v[6 + j]);
                coman.rows(&mut watch, &q);
                *least = least.min(watch.nearest().first().map_or(f64::INFINITY, |near| near.distance));
            }
        }
    }
    assert!(least[0] < -0.01 && least[1] > PARAMS.margin - 1e-3 && least[1] < PARAMS.margin + 0.01, "{least:?}");
}
