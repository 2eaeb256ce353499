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
use lcmtypes::ControllerInput;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// HyQ with a formula: the parts of a tick that the tasks read, at a random base orientation and random joint positions and velocities.
struct Bench {
    robot: Robot,
    params: Params,
    input: ControllerInput,
    estimate: Estimate,
    references: References,
    state: State,
    wbc: Wbc,
    R_WB: Matrix3<f64>,
    w_WB_W: Vector3<f64>,
}

impl Bench {
    fn new(overrides: &[(&str, &str)], rng: &mut Rng) -> Self {
        let params = Params::from_toml(&params_with(overrides), "hyq.toml").unwrap();
        let robot = Robot::new(URDF, &params.robot).unwrap();
        let (mut input, mut state, mut references) = (standing(&robot), State::new(robot.nj()), References::new(&robot));
        input.state.q.iter_mut().for_each(|q| *q += 0.1 * rng.symmetric());
        input.state.qd.iter_mut().for_each(|qd| *qd = rng.symmetric());
        let (R_WB, w_WB_W) = (Rz(rng.symmetric()) * Ry(0.1 * rng.symmetric()) * Rx(0.1 * rng.symmetric()), rng.vec3(0.5));
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
        let Bench { robot, params, input, estimate, references, state, wbc, R_WB, .. } = self;
        let trunk = TrunkReference { R_WB: *R_WB, w_WB_W: Vector3::zeros() };
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
    let formula = formula("1e6 contact + 1e3 trunk + swing + posture");
    for inertia in [false, true] {
        let set = [
            ("stack.formula", formula.as_str()),
            ("swing.kp", "[400, 500, 600]"),
            ("swing.kd", "[30, 40, 50]"),
            ("swing.inertia", if inertia { "true" } else { "false" }),
        ];
        let mut rng = Rng(31);
        for _ in 0..5 {
            let mut bench = Bench::new(&set, &mut rng);
            for leg in [Leg::LF, Leg::RH] {
                bench.state.leg_state[leg] = LegPhase::SwingDown;
                bench.references.p_BF_H[leg] += rng.vec3(0.01);
                bench.references.v_BF_H[leg] = rng.vec3(1.0);
                bench.references.a_BF_H[leg] = rng.vec3(5.0);
            }
            bench.solve();
            let vd = bench.wbc.vd.clone();
            let (velocity, acceleration) = bench.motion(&vd);
            let base = &bench.estimate.base;
            let spin = Vector3::z() * base.yaw_rate;
            for leg in [Leg::LF, Leg::RH] {
                let (i, of_robot) = (leg as usize, &bench.robot.legs[leg]);
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
                for joint in of_robot.joints {
                    assert!(!bench.rows("posture").is_on(joint));
                }
            }
            assert!(bench.robot.legs[Leg::RF].joints.iter().all(|joint| bench.rows("posture").is_on(*joint)));
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
        let mut bench = Bench::new(&[("stack.formula", &formula(tasks))], &mut Rng(32));
        for leg in [Leg::LF, Leg::RH] {
            bench.state.leg_state[leg] = LegPhase::SwingUp;
        }
        bench.build();
        let on = |leg: Leg| bench.robot.legs[leg].joints.map(|joint| bench.rows("posture").is_on(joint));
        assert_eq!([on(Leg::LF), on(Leg::RH), on(Leg::RF)], [[of_lf; 3], [of_rh; 3], [true; 3]], "{tasks}");
    }
}
