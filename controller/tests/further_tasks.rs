//! The tasks that a formula can name besides contact, trunk and posture: rows compared with numerical derivatives, solutions with what the task asks for.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{Rng, URDF, params_with, set_base, standing};
use controller::math::{Rx, Ry, Rz, norm, sin};
use controller::model::{BaseState, Kinematics, mass_matrix};
use controller::params::Params;
use controller::quadruped::estimation::Estimate;
use controller::quadruped::leg::{Leg, LegPhase};
use controller::quadruped::reference::References;
use controller::quadruped::robot::Robot;
use controller::quadruped::state::State;
use controller::quadruped::trunk::TrunkReference;
use controller::quadruped::wbc::Wbc;
use controller::stack::{Rows, S1};
use lcmtypes::TickInput;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// HyQ with a formula: the parts of a tick that the tasks read, at a random base orientation and random joint positions and velocities.
struct Bench {
    robot: Robot,
    params: Params,
    input: TickInput,
    estimate: Estimate,
    references: References,
    state: State,
    wbc: Wbc,
    R_WB: Matrix3<f64>,
    w_WB_W: Vector3<f64>,
}

impl Bench {
    /// - `speed`: largest joint velocity, rad/s, and twice the largest component of the base's angular velocity, rad/s.
    fn new(overrides: &[(&str, &str)], speed: f64, rng: &mut Rng) -> Self {
        let params = Params::from_toml(&params_with(overrides), "hyq.toml").unwrap();
        let robot = Robot::new(URDF, &params.robot).unwrap();
        let (mut input, mut state, mut references) =
            (standing(&robot), State::new(robot.nj()), References::new(&robot));
        input.state.q.iter_mut().for_each(|q| *q += 0.1 * rng.symmetric());
        input.state.qd.iter_mut().for_each(|qd| *qd = speed * rng.symmetric());
        let R_WB = Rz(rng.symmetric()) * Ry(0.1 * rng.symmetric()) * Rx(0.1 * rng.symmetric());
        let w_WB_W = rng.vec3(0.5 * speed);
        set_base(&robot, &mut input, &R_WB, &w_WB_W);
        let mut estimate = Estimate::new(&robot);
        estimate.update(&robot, &input.state);
        state.q_des.clone_from(&input.state.q);
        references.qd_des.clone_from(&input.state.qd);
        let R_HW = estimate.base.R_WH.transpose();
        for leg in Leg::ALL {
            references.p_BF_H[leg] = R_HW * estimate.legs[leg].p_BF_W;
            references.v_BF_H[leg] = Vector3::zeros();
            references.a_BF_H[leg] = Vector3::zeros();
        }
        let wbc = Wbc::new(&robot, &params).unwrap();
        Bench { robot, params, input, estimate, references, state, wbc, R_WB, w_WB_W }
    }

    fn build(&mut self) {
        let Bench { robot, params, input, estimate, references, state, wbc, R_WB, w_WB_W } = self;
        let trunk = TrunkReference { R_WB: *R_WB, w_WB_W: *w_WB_W };
        wbc.build(robot, params, &input.state, estimate, &trunk, references, state);
    }

    fn solve(&mut self) {
        self.build();
        self.wbc.solve(&self.estimate, &self.state);
        assert!(self.wbc.solved(), "{:?}", self.wbc.info);
    }

    fn rows(&self, task: &str) -> &Rows {
        &self.wbc.tasks.rows[self.wbc.tasks.names().position(|name| name == task).unwrap()]
    }

    /// Positions of the foot centres from the base origin in W axes, after the time `t` with the accelerations `vd`.
    fn feet_at(&self, t: f64, vd: &DVector<f64>) -> [Vector3<f64>; 4] {
        let turned = self.w_WB_W * t + vd.fixed_rows::<3>(3) * (0.5 * t * t);
        let moved = |j: usize| self.input.state.q[j] + self.input.state.qd[j] * t + 0.5 * vd[6 + j] * t * t;
        let q: Vec<f64> = (0..self.robot.nj()).map(moved).collect();
        let zero = Vector3::zeros();
        let base = BaseState { p_WB: zero, R_WB: turn(&turned) * self.R_WB, v_WB: zero, w_WB_W: zero };
        let mut kin = Kinematics::new(&self.robot.model);
        kin.update(&self.robot.model, &base, &q, &vec![0.0; q.len()]);
        Leg::ALL.map(|leg| kin.p_WF(&self.robot.model, self.robot.legs[leg].foot))
    }

    /// Velocities and accelerations of the foot centres relative to the base origin, by differences of the positions.
    fn motion(&self, vd: &DVector<f64>) -> ([Vector3<f64>; 4], [Vector3<f64>; 4]) {
        let h = 1e-4;
        let [before, now, after] = [-h, 0.0, h].map(|t| self.feet_at(t, vd));
        let per_foot = |of: &dyn Fn(usize) -> Vector3<f64>| [0, 1, 2, 3].map(of);
        let velocity = per_foot(&|i| (after[i] - before[i]) / (2.0 * h));
        (velocity, per_foot(&|i| (after[i] - now[i] * 2.0 + before[i]) / (h * h)))
    }
}

/// Rotation by a rotation vector.
fn turn(v: &Vector3<f64>) -> Matrix3<f64> {
    let angle = norm(v);
    if angle == 0.0 {
        return Matrix3::identity();
    }
    let K = (v / angle).cross_matrix();
    Matrix3::identity() + K * sin(angle) + K * K * (2.0 * sin(0.5 * angle) * sin(0.5 * angle))
}

/// S1 with other tasks.
fn formula(tasks: &str) -> String {
    format!("{tasks} <<{}", S1.split_once("<<").unwrap().1)
}

/// In the solution a swinging foot has the acceleration `r̈_d + K_P e + K_D ė`, relative to the base; with `swing.inertia`, the feedback times `Λ⁻¹`. The
/// acceleration, the error of the velocity and the leg's Jacobian are differences of positions.
#[test]
fn a_swinging_foot_has_the_acceleration_of_its_task() {
    let (kp, kd) = (Vector3::new(400.0, 500.0, 600.0), Vector3::new(30.0, 40.0, 50.0));
    // Without limits of torques and joint accelerations, which these motions exceed.
    let formula = "contact / trunk / swing / posture << base_dynamics << force_bounds";
    for inertia in [false, true] {
        let set = [
            ("stack.formula", formula),
            ("swing.kp", "[400, 500, 600]"),
            ("swing.kd", "[30, 40, 50]"),
            ("swing.inertia", if inertia { "true" } else { "false" }),
        ];
        let mut rng = Rng(31);
        for leg in [Leg::LF, Leg::RF, Leg::LH, Leg::RH] {
            let mut bench = Bench::new(&set, 1.0, &mut rng);
            bench.state.leg_state[leg] = LegPhase::SwingDown;
            bench.references.p_BF_H[leg] += rng.vec3(0.01);
            bench.references.v_BF_H[leg] = rng.vec3(1.0);
            bench.references.a_BF_H[leg] = rng.vec3(5.0);
            bench.solve();
            let (velocity, acceleration) = bench.motion(&bench.wbc.vd);
            let (base, i) = (&bench.estimate.base, leg as usize);
            let spin = Vector3::z() * base.yaw_rate;
            let r_des = base.R_WH * bench.references.p_BF_H[leg];
            let v_H = base.R_WH * bench.references.v_BF_H[leg];
            // The reference is fixed to H, which turns about the vertical: r = R r_H, so ṙ = ω × r + R ṙ_H, and its derivative.
            let v_des = spin.cross(&r_des) + v_H;
            let a_des = spin.cross(&v_des) + spin.cross(&v_H) + base.R_WH * bench.references.a_BF_H[leg];
            let e = r_des - bench.estimate.legs[leg].p_BF_W;
            let mut u = kp.component_mul(&e) + kd.component_mul(&(v_des - velocity[i]));
            if inertia {
                u = mobility(&bench, leg) * u;
            }
            let off = norm(&(acceleration[i] - a_des - u)) / norm(&(a_des + u));
            assert!(off < 1e-3, "{}, inertia {inertia}: off by {off:e}", leg.name());
            for other in Leg::ALL {
                for joint in bench.robot.legs[other].joints {
                    assert_eq!(bench.rows("posture").is_on(joint), other != leg);
                }
            }
        }
    }
}

/// `J M⁻¹ Jᵀ` of a leg with the base held, by differences of the foot's position.
fn mobility(bench: &Bench, leg: Leg) -> Matrix3<f64> {
    let (model, of_robot) = (&bench.robot.model, &bench.robot.legs[leg]);
    let (zero, h) = (Vector3::zeros(), 1e-6);
    let base = BaseState { p_WB: zero, R_WB: bench.R_WB, v_WB: zero, w_WB_W: zero };
    let mut kin = Kinematics::new(model);
    let mut foot = |joint: usize, by: f64| {
        let mut q = bench.input.state.q.clone();
        q[joint] += by;
        kin.update(model, &base, &q, &vec![0.0; q.len()]);
        kin.p_WF(model, of_robot.foot)
    };
    let columns = of_robot.joints.map(|joint| (foot(joint, h) - foot(joint, -h)) / (2.0 * h));
    let J = Matrix3::from_columns(&columns);
    let mut M = DMatrix::zeros(model.nv(), model.nv());
    kin.update(model, &base, &bench.input.state.q, &vec![0.0; bench.robot.nj()]);
    mass_matrix(model, &kin, &mut M);
    let M_leg = Matrix3::from_fn(|r, c| M[(6 + of_robot.joints[r], 6 + of_robot.joints[c])]);
    J * M_leg.try_inverse().unwrap() * J.transpose()
}

/// A leg of which the formula has not all rows stays in the posture task; so does every leg without the task.
#[test]
fn the_posture_moves_the_legs_that_the_swing_task_does_not() {
    for (tasks, of_lf, of_rh) in [
        ("1e6 contact + 1e3 trunk + posture", true, true),
        ("1e6 contact + 1e3 trunk + swing[0,1,2] + posture", false, true),
        ("1e6 contact + 1e3 trunk + swing[0,1,2,9,10] + posture", false, true),
        ("1e6 contact + 1e3 trunk + swing[0,1,2] + posture + swing[9,10,11]", false, false),
    ] {
        let mut bench = Bench::new(&[("stack.formula", &formula(tasks))], 1.0, &mut Rng(32));
        for leg in [Leg::LF, Leg::RH] {
            bench.state.leg_state[leg] = LegPhase::SwingUp;
        }
        bench.build();
        let on = |leg: Leg| bench.robot.legs[leg].joints.map(|joint| bench.rows("posture").is_on(joint));
        assert_eq!([on(Leg::LF), on(Leg::RH), on(Leg::RF)], [[of_lf; 3], [of_rh; 3], [true; 3]], "{tasks}");
    }
}

/// Net force and moment about the base origin of the contact forces, 6 x 12; zero columns for feet that do not stand.
fn net(bench: &Bench, stands: [bool; 4]) -> DMatrix<f64> {
    let mut G = DMatrix::zeros(6, 12);
    for leg in Leg::ALL.into_iter().filter(|leg| stands[*leg as usize]) {
        let at = 3 * leg as usize;
        G.view_mut((0, at), (3, 3)).copy_from(&Matrix3::identity());
        G.view_mut((3, at), (3, 3)).copy_from(&bench.estimate.legs[leg].p_BF_W.cross_matrix());
    }
    G
}

/// The force columns of a task, per N.
fn per_newton(bench: &Bench, task: &str) -> DMatrix<f64> {
    let A = &bench.rows(task).A;
    assert!(A.columns(0, A.ncols() - 12).iter().all(|a| *a == 0.0), "{task} has entries at accelerations");
    A.columns(A.ncols() - 12, 12) / controller::contact::FORCE_UNIT
}

fn forces(bench: &Bench) -> DVector<f64> {
    DVector::from_iterator(12, bench.wbc.f_F_W.0.iter().flat_map(|f| f.iter().copied().collect::<Vec<_>>()))
}

#[test]
fn the_rows_of_the_internal_forces_project_onto_the_forces_without_net_wrench() {
    let formula = formula("1e6 contact + 1e3 trunk + posture + internal_forces");
    let mut rng = Rng(33);
    // The dimension of the internal forces of four, three and two feet; one foot has none.
    for (swings, expected) in [(0, 6.0), (1, 3.0), (2, 1.0), (3, 0.0)] {
        let mut bench = Bench::new(&[("stack.formula", &formula)], 1.0, &mut rng);
        let mut stands = [true; 4];
        for leg in [Leg::LF, Leg::RH, Leg::RF].into_iter().take(swings) {
            (bench.state.leg_state[leg], stands[leg as usize]) = (LegPhase::SwingUp, false);
        }
        bench.build();
        assert_eq!(bench.rows("internal_forces").is_on(0), swings < 3);
        let P = per_newton(&bench, "internal_forces");
        assert!((&P * &P - &P).norm() < 1e-12 && (&P - P.transpose()).norm() < 1e-12);
        assert!((net(&bench, stands) * &P).norm() < 1e-12);
        assert!((P.trace() - expected).abs() < 1e-12, "{swings} feet swing: {} internal forces", P.trace());
        assert!(bench.rows("internal_forces").b.iter().all(|b| *b == 0.0));
    }
}

/// Below the other tasks, a task of forces changes the forces and neither their net wrench nor an acceleration.
#[test]
fn the_tasks_of_forces_move_forces_in_the_null_space_of_the_net_wrench() {
    let under = S1.split_once("<<").unwrap().1;
    let mut rng = Rng(34);
    for _ in 0..5 {
        let seed = rng.word();
        let solved = |tasks: &str| {
            let formula = format!("contact / trunk / posture{tasks} <<{under}");
            let mut bench = Bench::new(&[("stack.formula", &formula)], 0.02, &mut Rng(seed));
            bench.solve();
            bench
        };
        let (plain, cone, both) =
            (solved(""), solved(" / cone_center"), solved(" / cone_center + 1e6 internal_forces"));
        let G = net(&plain, [true; 4]);
        let [of_plain, of_cone, of_both] = [&plain, &cone, &both].map(forces);
        for (bench, F) in [(&cone, &of_cone), (&both, &of_both)] {
            let off = (&G * (F - &of_plain)).norm() / (&G * &of_plain).norm();
            assert!(off < 1e-6, "net wrench off by {off:e}");
            assert!((&bench.wbc.vd - &plain.wbc.vd).norm() < 1e-4 * (1.0 + plain.wbc.vd.norm()));
        }
        assert!((&of_cone - &of_plain).norm() > 1e-3 * of_plain.norm());

        // Expected: the least tangential forces of all forces with this net wrench, by the KKT matrix.
        let T = per_newton(&cone, "cone_center");
        let mut kkt = DMatrix::zeros(18, 18);
        kkt.view_mut((0, 0), (12, 12)).copy_from(&(T.transpose() * &T + DMatrix::identity(12, 12) * 1e-9));
        kkt.view_mut((0, 12), (12, 6)).copy_from(&G.transpose());
        kkt.view_mut((12, 0), (6, 12)).copy_from(&G);
        let mut right = DVector::zeros(18);
        right.rows_mut(12, 6).copy_from(&(&G * &of_plain));
        let least = (&T * (kkt.try_inverse().unwrap() * right).rows(0, 12)).norm();
        let [before, after] = [&of_plain, &of_cone].map(|F| (&T * F).norm());
        assert!((after - least).abs() < 1e-3 * before.max(1.0), "{after} N, least {least} N");
        assert!(after < before, "{after} N instead of {before} N");

        let P = per_newton(&both, "internal_forces");
        let [squeezed, released] = [&of_cone, &of_both].map(|F| (&P * F).norm());
        assert!(squeezed > 1.0 && released < 1e-2 * squeezed, "{released} N instead of {squeezed} N");
    }
}

#[test]
fn both_solvers_agree_on_a_stack_with_all_tasks() {
    let tasks = "1e6 relative_feet + 1e3 trunk + swing + posture + 0.1 cone_center + 0.01 internal_forces";
    for swings in [false, true] {
        let [active_set, clarabel] = ["\"active_set\"", "\"clarabel\""].map(|solver| {
            let set = [("stack.formula", &*formula(tasks)), ("qp.solver", solver), ("wbc.tolerance", "1e-12")];
            let mut bench = Bench::new(&set, 0.02, &mut Rng(35));
            if swings {
                (bench.state.leg_state[Leg::LF], bench.state.leg_state[Leg::RH]) =
                    (LegPhase::SwingUp, LegPhase::SwingUp);
            }
            bench.solve();
            forces(&bench)
        });
        let off = (&active_set - &clarabel).norm() / active_set.norm();
        assert!(off < 1e-5, "swing {swings}: forces {off:e} apart");
    }
}

/// Section 6: with feet at their reference distances, the stance task with feedback is the one without, whatever the base does.
#[test]
fn with_consistent_feet_the_relative_form_is_the_contact_task() {
    let formula = formula("1e6 relative_feet + 1e6 contact + 1e3 trunk + posture");
    let mut rng = Rng(36);
    let mut bench = Bench::new(&[("stack.formula", &formula)], 0.0, &mut rng);
    bench.build();
    let same = |bench: &Bench| {
        let (a, b) = (bench.rows("relative_feet"), bench.rows("contact"));
        assert_eq!(a.A, b.A);
        (&a.b - &b.b).norm()
    };
    // References and feet agree up to rounding.
    let off = same(&bench);
    assert!(off < 1e-12, "at rest off by {off:e} m/s²");

    // The base moves over feet that rest, and it is elsewhere than its reference.
    let (v, by) = (rng.vec3(0.5), rng.vec3(0.05));
    for leg in Leg::ALL {
        let qd = bench.estimate.legs[leg].J_leg.try_inverse().unwrap() * -v;
        for (k, joint) in bench.robot.legs[leg].joints.into_iter().enumerate() {
            bench.input.state.qd[joint] = qd[k];
        }
        bench.references.p_BF_H[leg] += by;
    }
    bench.estimate.update(&bench.robot, &bench.input.state);
    bench.build();
    let off = same(&bench);
    assert!(off < 1e-11, "off by {off:e} m/s²");
    let size = bench.rows("contact").b.norm();
    assert!(size > 0.1, "the legs move: {size} m/s²");

    // One foot moves away from the others: the feedback pulls it back, and has no mean.
    bench.references.p_BF_H[Leg::RF] += bench.estimate.base.R_WH.transpose() * Vector3::new(-0.01, 0.0, 0.0);
    bench.build();
    let feedback = &bench.rows("relative_feet").b - &bench.rows("contact").b;
    let of = |leg: Leg| feedback.fixed_rows::<3>(3 * leg as usize).into_owned();
    let mean = Leg::ALL.iter().fold(Vector3::zeros(), |sum, leg| sum + of(*leg));
    assert!(mean.norm() < 1e-11, "{mean}");
    // kp = 100: 1 m/s² between RF and the others.
    for leg in [Leg::LF, Leg::LH, Leg::RH] {
        assert!((of(Leg::RF) - of(leg) - Vector3::new(-1.0, 0.0, 0.0)).norm() < 1e-10);
    }
    // Two feet that swing are not in the task.
    (bench.state.leg_state[Leg::LF], bench.state.leg_state[Leg::RH]) = (LegPhase::SwingUp, LegPhase::SwingUp);
    bench.build();
    let rows = bench.rows("relative_feet");
    assert_eq!([0, 1, 2, 3].map(|leg| rows.is_on(leg)), [false, true, true, false]);
}
