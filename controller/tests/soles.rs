//! Soles: the rows of a sole against the forces of its four corners, and a humanoid on two soles with the constraints and tasks for any robot.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::Rng;
use controller::constraints::acceleration::{BaseDynamics, JointAcceleration};
use controller::constraints::force::{ForceBounds, Friction, TorqueLimits};
use controller::contact::{Contact, ContactLoad, ContactState, FORCE_UNIT};
use controller::math::{Rx, Ry, Rz};
use controller::model::description::ContactGeometry;
use controller::model::{
    Base, BaseState, GRAVITY, Kinematics, Model, RobotDescription, UrdfTree, bias_force, com, mass_matrix,
};
use controller::qp::{Backend, ClarabelSolver, Qp, QpSolver, QpStatus};
use controller::stack::{
    Cascade, Constraint, ConstraintRows, ModelState, Size, Solver, Structure, Task, Term, Variables, pattern,
    update_all,
};
use controller::tasks::acceleration::{BaseOrientation, ContactsAtRest, OrientationReference, Posture};
use controller::tasks::force::InternalForces;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3, Vector6};

const BODY: &str = r#"<robot name="body"><link name="body"><inertial><mass value="3"/>
<inertia ixx="0.02" iyy="0.03" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;
const X: [f64; 2] = [-0.08, 0.14];
const Y: [f64; 2] = [-0.05, 0.06];
/// Friction of the pyramids, and the coefficient whose inner pyramid it is.
const C: f64 = 0.5;

/// Whether a wrench is a sum of corner forces inside their pyramids, by a program over the twelve corner forces.
fn corners_can_give(wrench: &Vector6<f64>, R: &Matrix3<f64>) -> bool {
    let mut qp = Qp::zeros(12, 6, 20);
    for (corner, (x, y)) in [(X[0], Y[0]), (X[0], Y[1]), (X[1], Y[0]), (X[1], Y[1])].into_iter().enumerate() {
        let p = R * Vector3::new(x, y, 0.0);
        for k in 0..3 {
            let col = 3 * corner + k;
            let (force, moment) = (Vector3::ith(k, 1.0), p.cross(&Vector3::ith(k, 1.0)));
            for axis in 0..3 {
                (qp.A[(axis, col)], qp.A[(3 + axis, col)]) = (force[axis], moment[axis]);
            }
            qp.H[(col, col)] = 1e-3;
            let (t1, t2, n) = (R[(k, 0)], R[(k, 1)], R[(k, 2)]);
            for (i, a) in [-n, t1 - C * n, -t1 - C * n, t2 - C * n, -t2 - C * n].into_iter().enumerate() {
                qp.C[(5 * corner + i, col)] = a;
            }
        }
    }
    qp.b.copy_from(wrench);
    let mut program = qp.clone();
    for pattern in [&mut program.A, &mut program.C, &mut program.H] {
        pattern.fill(1.0);
    }
    let mut x = DVector::zeros(12);
    let info = ClarabelSolver::new(&program, 200, 1e-10).solve(&qp, &mut x);
    match info.status {
        QpStatus::Solved | QpStatus::AlmostSolved => true,
        QpStatus::Infeasible => false,
        QpStatus::Failed => panic!("{info:?} {wrench}"),
    }
}

fn sole(R: &Matrix3<f64>) -> (Contact, ContactState) {
    let model = Model::new(&UrdfTree::parse(BODY, "body.urdf").unwrap(), Base::Floating).unwrap();
    let contact = Contact::new("sole", &model, model.frame("body").unwrap(), &ContactGeometry::Sole { x: X, y: Y });
    let mut kin = Kinematics::new(&model);
    kin.update(&model, &BaseState { R_WB: *R, ..BaseState::identity() }, &[], &[]);
    let mut at = contact.state(&model);
    contact.update(&model, &kin, &Vector3::z(), &mut at);
    (contact, at)
}

/// The rows hold if and only if corner forces with these pyramids give the wrench; every row but the first decides alone for some wrench. (The first, `f_z ≥ 0`, follows
/// from the rows of the centre of pressure, and carries the least normal force.)
#[test]
fn the_rows_of_a_sole_are_the_wrenches_of_four_corners() {
    let mut rng = Rng(61);
    let (mut inside, mut alone) = (0, [0; 17]);
    for trial in 0..1500 {
        let R = Rz(3.0 * rng.symmetric()) * Ry(0.4 * rng.symmetric()) * Rx(0.4 * rng.symmetric());
        let (contact, at) = sole(&R);
        assert_eq!(contact.friction_names().len(), 17);
        // Wrenches about the centre of the rectangle, as large as the rows allow alone; then about the origin, in W.
        let (hx, hy) = (0.5 * (X[1] - X[0]), 0.5 * (Y[1] - Y[0]));
        let wide = if trial % 2 == 0 { 1.15 } else { 0.8 };
        let mut part = |limit: f64| wide * limit * rng.symmetric();
        let f = Vector3::new(part(C), part(C), 1.0);
        let center = Vector3::new(0.5 * (X[0] + X[1]), 0.5 * (Y[0] + Y[1]), 0.0);
        let m = Vector3::new(part(hy), part(hx), part(C * (hx + hy))) + center.cross(&f);
        let (f, m) = (R * f, R * m);
        let wrench = Vector6::new(f.x, f.y, f.z, m.x, m.y, m.z);
        let mut excess = [0.0; 17];
        contact.friction(&at, C, &mut |row, a| excess[row] = (0..6).map(|k| a[k] * wrench[k]).sum());
        let worst = excess.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if worst.abs() < 1e-4 {
            continue;
        }
        assert_eq!(worst <= 0.0, corners_can_give(&wrench, &R), "{excess:?}");
        inside += usize::from(worst <= 0.0);
        if excess.iter().filter(|e| **e > 0.0).count() == 1 {
            alone[excess.iter().position(|e| *e > 0.0).unwrap()] += 1;
        }
    }
    assert!(inside > 300, "{inside}");
    assert!(alone[1..].iter().all(|n| *n > 0), "{alone:?}");
}

const COMAN: (&str, &str) =
    (include_str!("../../robots/coman_plus/coman_plus.urdf"), include_str!("../../robots/coman_plus/coman_plus.toml"));

/// Which constraint has rows of the wrong sign.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wrong {
    None,
    Dynamics,
    Friction,
    Bounds,
    Acceleration,
    Torque,
}

/// A constraint with the wrong sign: `b`, the rows of `C` and the bounds of its variables are negated.
struct Negated(Box<dyn Constraint>);

impl Constraint for Negated {
    fn size(&self) -> Size {
        self.0.size()
    }

    fn pattern(&self, rows: &mut ConstraintRows<'_>) {
        self.0.pattern(rows);
    }

    fn update(&mut self, state: &ModelState<'_>, rows: &mut ConstraintRows<'_>) {
        let before = (rows.qp.lower.clone(), rows.qp.upper.clone());
        self.0.update(state, rows);
        let Size { equalities, inequalities } = self.size();
        rows.qp.b.rows_mut(rows.equality, equalities).neg_mut();
        rows.qp.C.rows_mut(rows.inequality, inequalities).neg_mut();
        for i in 0..rows.qp.lower.len() {
            if (rows.qp.lower[i], rows.qp.upper[i]) != (before.0[i], before.1[i]) {
                let (lower, upper) = (rows.qp.lower[i], rows.qp.upper[i]);
                // A bound that is symmetric has the wrong sign on both sides: `limit ≤ x ≤ -limit`.
                (rows.qp.lower[i], rows.qp.upper[i]) = if lower == -upper { (upper, lower) } else { (-upper, -lower) };
            }
        }
    }

    fn names(&self) -> [Vec<String>; 2] {
        self.0.names()
    }
}

/// COMAN+ on its two soles in its posture, with references that need large forces.
struct Standing {
    model: Model,
    contacts: Vec<Contact>,
    q: Vec<f64>,
    qd: Vec<f64>,
    kin: Kinematics,
    at: Vec<ContactState>,
    M: DMatrix<f64>,
    h: DVector<f64>,
}

/// What was violated by a solution, or that there was none.
#[derive(Debug, Default)]
struct Found {
    unsolved: bool,
    /// Unbalanced force and moment on the base, N and N m.
    dynamics: f64,
    /// Largest violation of the corner pyramids by the rows, N.
    admissible: f64,
    bounds: f64,
    acceleration: f64,
    torque: f64,
    /// Acceleration of the soles, m/s² and rad/s².
    slip: f64,
    f_z: f64,
    vd_com_z: f64,
}

const FRICTION: f64 = 0.7;
const MOST_Z: f64 = 450.0;
const QDD_MAX: f64 = 40.0;

impl Standing {
    fn new(rng: &mut Rng) -> Self {
        let tree = UrdfTree::parse(COMAN.0, "coman_plus.urdf").unwrap();
        let description = RobotDescription::from_toml(COMAN.1, "coman_plus.toml", &tree).unwrap();
        let model = description.model(&tree).unwrap();
        let contacts: Vec<Contact> =
            Contact::all(&description, &model).unwrap().into_iter().filter(|contact| contact.size() == 6).collect();
        assert_eq!(contacts.len(), 2);
        let mut q = vec![0.0; model.nj()];
        for (joint, position) in description.posture("nominal").unwrap() {
            q[model.joint(joint).unwrap().index()] = *position;
        }
        q.iter_mut().for_each(|q| *q += 0.02 * rng.symmetric());
        let qd: Vec<f64> = q.iter().map(|_| 0.2 * rng.symmetric()).collect();
        let mut kin = Kinematics::new(&model);
        let base = BaseState { w_WB_W: rng.vec3(0.1), ..BaseState::identity() };
        kin.update(&model, &base, &q, &qd);
        let nv = model.nv();
        let (mut M, mut h) = (DMatrix::zeros(nv, nv), DVector::zeros(nv));
        mass_matrix(&model, &kin, &mut M);
        bias_force(&model, &kin, &mut h);
        let at = contacts
            .iter()
            .map(|contact| {
                let mut at = contact.state(&model);
                contact.update(&model, &kin, &Vector3::z(), &mut at);
                at
            })
            .collect();
        Standing { model, contacts, q, qd, kin, at, M, h }
    }

    fn solve(&self, wrong: Wrong, push: f64, rng: &mut Rng) -> Found {
        let Standing { model, contacts, q, qd, kin, at, M, h } = self;
        let (nv, nj) = (model.nv(), model.nj());
        let variables = Variables::new(nv, contacts.iter().map(Contact::size), true);
        assert_eq!((variables.len(), variables.slack()), (34 + 12 + 1, Some(46)));
        let of = Structure { model, contacts, variables: &variables };
        let sign = |which: Wrong, constraint: Box<dyn Constraint>| -> Box<dyn Constraint> {
            if which == wrong { Box::new(Negated(constraint)) } else { constraint }
        };
        let mut constraints = vec![
            sign(Wrong::Dynamics, Box::new(BaseDynamics::new(&of))),
            sign(Wrong::Friction, Box::new(Friction::new(&of, FRICTION))),
            sign(Wrong::Acceleration, Box::new(JointAcceleration::new(&of, QDD_MAX))),
            sign(Wrong::Bounds, Box::new(ForceBounds::new(&of))),
            sign(Wrong::Torque, Box::new(TorqueLimits::new(&of, 100.0))),
        ];
        let mut load = ContactLoad { least_normal: 10.0, ..ContactLoad::FREE };
        (load.lower, load.upper) = ([-1e3; 6], [1e3; 6]);
        (load.lower[2], load.upper[2]) = (0.0, MOST_Z);
        let loads = [load; 2];
        let state = ModelState { model, contacts, variables: &variables, q, qd, kin, M, h, at, loads: &loads };

        let (mut rest, mut trunk) = (ContactsAtRest::new(&of), BaseOrientation::new(&of));
        let mut posture = Posture::new(&of, vec![(0..nj).collect()]);
        let mut internal = InternalForces::new(&of);
        let mut tasks = [rest.rows(), trunk.rows(), posture.rows(), internal.rows()];
        rest.update(&state, &(), &mut tasks[0]);
        let upright = OrientationReference {
            R_WB: Rx(push * rng.symmetric()) * Ry(push * rng.symmetric()),
            w_WB_W: Vector3::zeros(),
            kp: [100.0; 3],
            kd: [20.0; 3],
            active: true,
        };
        trunk.update(&state, &upright, &mut tasks[1]);
        let mut reference = posture.reference();
        reference.q.iter_mut().zip(q).for_each(|(to, q)| *to = q + push * rng.symmetric());
        for (to, value) in
            [(&mut reference.qd, 0.0), (&mut reference.qdd, 0.0), (&mut reference.kp, 100.0), (&mut reference.kd, 20.0)]
        {
            to.fill(value);
        }
        posture.update(&state, &reference, &mut tasks[2]);
        internal.update(&state, &(), &mut tasks[3]);

        let columns = tasks.iter().map(|rows| rows.A.ncols()).max().unwrap();
        let pattern = pattern(&constraints, &variables, columns);
        let regularization =
            DVector::from_fn(variables.len(), |i, _| if Some(i) == variables.slack() { 1e6 } else { 1e-6 });
        let weights = [1e3, 10.0, 1.0, 1e-6];
        let terms = weights
            .into_iter()
            .enumerate()
            .map(|(task, weight)| Term { task, weight, takes: vec![true; tasks[task].len()] })
            .collect();
        let each = |of_level: &Qp| Backend::ActiveSet.build(of_level, 400, 1e-10);
        let mut stack =
            Cascade::new(vec![terms], &pattern, regularization, columns, variables.slack(), &Solver::Each(&each));
        update_all(&mut constraints, &state, stack.constraints());
        stack.build(&tasks);
        stack.solve(&tasks);
        let Some(level) = stack.solution() else { return Found { unsolved: true, ..Found::default() } };

        // From here on only equations of motion and the definition of what each constraint means.
        let vd = level.x.rows(0, nv);
        let slack = level.x[46] * 100.0;
        let mut left = M * vd + h;
        let none = f64::NEG_INFINITY;
        let mut found = Found { admissible: none, bounds: none, acceleration: none, torque: none, ..Found::default() };
        for (i, contact) in contacts.iter().enumerate() {
            let F = level.x.rows(34 + 6 * i, 6) * FORCE_UNIT;
            left -= at[i].J.transpose() * &F;
            let c = FRICTION * std::f64::consts::FRAC_1_SQRT_2;
            let R = at[i].R_WC.transpose();
            let (f, m) = (R * F.fixed_rows::<3>(0), R * F.fixed_rows::<3>(3));
            // Pressure inside the rectangle, and friction; the yaw moment is that of the corners at most.
            let (x, y) = (-m.y / f.z, m.x / f.z);
            let (xs, ys) = ([-0.1035, 0.107], [-0.055, 0.055]);
            let outside = (xs[0] - x).max(x - xs[1]).max(ys[0] - y).max(y - ys[1]) * f.z.abs();
            let over = (f.x.abs() - c * f.z).max(f.y.abs() - c * f.z).max(10.0 - f.z);
            let yaw = m.z.abs() - (c * (0.10525 + 0.055) + 0.01) * f.z;
            found.admissible = found.admissible.max(outside).max(over).max(yaw);
            found.bounds = found.bounds.max(F[2] - MOST_Z).max(-F[2]);
            found.f_z += F[2];
            let a = &at[i].J * vd + at[i].a_bias_W;
            found.slip = found.slip.max(a.norm());
            assert_eq!(contact.size(), 6);
        }
        found.dynamics = left.rows(0, 6).norm();
        for j in 0..nj {
            let (least, most) = model.joints[j].torque_range(qd[j]);
            found.torque = found.torque.max(left[6 + j] - most - slack).max(least - left[6 + j] - slack);
            found.acceleration = found.acceleration.max(vd[6 + j].abs() - QDD_MAX);
        }
        // Rate of the vertical momentum, from the first rows of M and its bias without gravity.
        let mass = model.total_mass();
        found.vd_com_z = (M.row(2) * vd)[0] + h[2] - mass * GRAVITY;
        found
    }
}

#[test]
fn a_humanoid_on_two_soles_satisfies_the_equations_of_motion_and_every_constraint() {
    let mut rng = Rng(17);
    let mut limited = 0;
    for trial in 0..12 {
        let standing = Standing::new(&mut rng);
        let push = if trial < 4 { 0.0 } else { 0.4 };
        let found = standing.solve(Wrong::None, push, &mut rng);
        assert!(!found.unsolved, "{trial}");
        let worst = found.admissible.max(found.bounds).max(found.acceleration).max(found.torque);
        assert!(found.dynamics < 1e-7 && worst < 1e-6, "{trial}: {found:?}");
        // Newton's law for the whole robot: the soles carry the weight and the acceleration.
        let weight = standing.model.total_mass() * GRAVITY;
        assert!((found.f_z - weight - found.vd_com_z).abs() < 1e-7, "{trial}: {found:?}");
        limited += usize::from(worst > -1e-6);
        if push == 0.0 {
            assert!(found.slip < 0.05, "{trial}: {found:?}");
            let center = com(&standing.kin);
            assert!(center.x.abs() < 0.2 && (found.f_z / weight - 1.0).abs() < 0.2, "{trial}: {found:?}");
        }
    }
    assert!(limited > 3, "{limited}");
}

/// A constraint with the wrong sign has no solution, or one that the checks above reject.
#[test]
fn every_constraint_with_the_wrong_sign_is_found() {
    for (wrong, seed) in
        [(Wrong::Dynamics, 1), (Wrong::Friction, 2), (Wrong::Bounds, 3), (Wrong::Acceleration, 4), (Wrong::Torque, 5)]
    {
        let mut caught = false;
        let mut rng = Rng(seed);
        for _ in 0..6 {
            let mut standing = Standing::new(&mut rng);
            // Weak drives, so that the torque limits decide.
            standing.model.joints.iter_mut().for_each(|joint| joint.effort = 30.0);
            let mut same = Rng(rng.0);
            let right = standing.solve(Wrong::None, 0.4, &mut same);
            assert!(right.unsolved || (right.torque < 1e-6 && right.dynamics < 1e-7), "{right:?}");
            let found = standing.solve(wrong, 0.4, &mut rng);
            let by_check = match wrong {
                Wrong::None => false,
                Wrong::Dynamics => found.dynamics > 1.0,
                Wrong::Friction => found.admissible > 1.0,
                Wrong::Bounds => found.bounds > 1.0,
                Wrong::Acceleration => found.acceleration > 1.0,
                Wrong::Torque => found.torque > 1.0,
            };
            caught |= found.unsolved || by_check;
        }
        assert!(caught, "{wrong:?}");
    }
}
