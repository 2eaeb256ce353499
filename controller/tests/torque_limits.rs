//! Torque limits as rows of the quadratic programs, and the speed-dependent limits of the drives.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{PARAMS, Rng, URDF, params_with, set_base, standing};
use controller::math::Rx;
use controller::model::DriveLimits;
use controller::params::Params;
use controller::quadruped::Quadruped;
use controller::quadruped::estimation::Estimate;
use controller::quadruped::leg::LegPhase;
use controller::quadruped::reference::References;
use controller::quadruped::robot::Robot;
use controller::quadruped::state::{Mode, State};
use controller::quadruped::trunk::TrunkReference;
use controller::quadruped::wbc::Wbc;
use controller::safety::limit_command;
use controller::stack::{S1, S3};
use lcmtypes::RobotCommand;
use nalgebra::{Matrix3, Vector3};

/// HyQ with the same effort at every joint, in trot and stance, with references that need large torques. Calls a function with each solution and the joint
/// velocities.
fn solve(formula: &str, solver: &str, effort: f64, drive: DriveLimits, mut check: impl FnMut(&Wbc, &[f64])) {
    let (formula, solver) = (format!("{formula:?}"), format!("{solver:?}"));
    let overrides = [("stack.formula", &*formula), ("qp.solver", &*solver), ("wbc.tolerance", "1e-10")];
    let params = Params::from_toml(&params_with(&overrides), "hyq.toml").unwrap();
    let mut robot = Robot::new(URDF, &params.robot).unwrap();
    for joint in &mut robot.model.joints {
        (joint.effort, joint.drive) = (effort, drive);
    }
    let (mut estimate, mut wbc) = (Estimate::new(&robot), Wbc::new(&robot, &params).unwrap());
    let mut references = References::new(&robot);
    let mut rng = Rng(7);
    for k in 0..12 {
        let mut input = standing(&robot);
        set_base(&robot, &mut input, &Matrix3::identity(), &rng.vec3(1.0));
        let mut state = State::new(robot.nj());
        state.mode = Mode::Walk;
        for j in 0..robot.nj() {
            input.state.qd[j] = 4.0 * rng.symmetric();
            state.q_des[j] = input.state.q[j] + 0.3 * rng.symmetric();
            references.qd_des[j] = rng.symmetric();
        }
        if k % 2 == 1 {
            for leg in [1, 2] {
                state.leg_state.0[leg] = LegPhase::SwingDown;
            }
        }
        let trunk = TrunkReference { R_WB: Rx(0.1 * rng.symmetric()), w_WB_W: Vector3::zeros() };
        estimate.update(&robot, &input.state);
        wbc.build(&robot, &params, &input.state, &estimate, &trunk, &references, &state);
        wbc.solve(&estimate, &state);
        assert!(wbc.stack.levels.iter().all(controller::stack::Level::solved), "{formula} {k}");
        check(&wbc, &input.state.qd);
    }
}

fn largest(tau: impl IntoIterator<Item = f64>) -> f64 {
    tau.into_iter().fold(0.0, |most, x| most.max(x.abs()))
}

#[test]
fn the_program_keeps_the_torque_limits_that_a_clamp_would_cut() {
    let mut over = 0;
    let without = S1.replace(" << torque_limits", "");
    solve(&without, "active_set", 120.0, DriveLimits::default(), |wbc, _| {
        over += usize::from(largest(wbc.tau.iter().copied()) > 121.0);
        assert_eq!((wbc.torque_slack, wbc.x.len()), (0.0, 30));
    });
    assert!(over > 6, "{over} of 12 programs are limited");
    for formula in [S1, S3] {
        solve(formula, "active_set", 120.0, DriveLimits::default(), |wbc, _| {
            let most = largest(wbc.tau.iter().copied());
            assert!(most < 120.0 * 1.005 && most <= 120.0 + wbc.torque_slack + 1e-6, "{formula}: {most} N m");
            assert!(wbc.torque_slack < 0.6, "{formula}: slack {}", wbc.torque_slack);
            assert!(wbc.base_residual() < 1e-6, "{formula}: {}", wbc.base_residual());
        });
    }
}

#[test]
fn limits_that_cannot_be_kept_leave_a_solution_with_slack() {
    for formula in [S1, S3] {
        let mut slack = 0.0_f64;
        solve(formula, "active_set", 2.0, DriveLimits::default(), |wbc, _| {
            let most = largest(wbc.tau.iter().copied());
            assert!(most <= 2.0 + wbc.torque_slack + 1e-6, "{formula}: {most} N m, slack {}", wbc.torque_slack);
            slack = slack.max(wbc.torque_slack);
        });
        assert!(slack > 0.01, "{formula}: slack {slack}");
    }
}

#[test]
fn both_back_ends_agree_on_limited_torques() {
    for formula in [S1, S3] {
        let mut expected = Vec::new();
        solve(formula, "clarabel", 120.0, DriveLimits::default(), |wbc, _| expected.push(wbc.tau.clone()));
        let mut expected = expected.iter();
        solve(formula, "active_set", 120.0, DriveLimits::default(), |wbc, _| {
            let off = largest((&wbc.tau - expected.next().unwrap()).iter().copied());
            assert!(off < 0.5, "{formula}: off by {off} N m");
        });
    }
}

#[test]
fn without_an_active_limit_the_rows_change_no_torque() {
    let mut expected = Vec::new();
    let without = S1.replace(" << torque_limits", "");
    solve(&without, "active_set", 1e4, DriveLimits::default(), |wbc, _| expected.push(wbc.tau.clone()));
    let mut expected = expected.iter();
    solve(S1, "active_set", 1e4, DriveLimits::default(), |wbc, _| {
        let off = largest((&wbc.tau - expected.next().unwrap()).iter().copied());
        assert!(off < 1e-6 && wbc.torque_slack == 0.0, "off by {off} N m");
    });
}

#[test]
fn the_power_of_a_drive_limits_program_and_command() {
    let drive = DriveLimits { power: 150.0, no_load_velocity: 20.0, ..DriveLimits::default() };
    let mut near = 0;
    solve(S1, "active_set", 150.0, drive, |wbc, qd| {
        for (tau, qd) in wbc.tau.iter().zip(qd) {
            let allowed = 150.0 + (wbc.torque_slack + 1e-6) * qd.abs();
            assert!(tau * qd <= allowed, "{tau} N m at {qd} rad/s, slack {}", wbc.torque_slack);
            near += usize::from(tau * qd > 149.0);
        }
    });
    assert!(near > 3, "{near} drives at their power");

    let text = format!(
        "{PARAMS}\n[robot.drives]\nlf_kfe_joint = {{ power = 100.0, rated_velocity = 5.0, no_load_velocity = 10.0 }}\n"
    );
    let controller = Quadruped::new(URDF, &text).unwrap();
    let joints = &controller.robot().model.joints;
    let j = joints.iter().position(|joint| joint.name == "lf_kfe_joint").unwrap();
    assert_eq!((joints[j].torque_range(-4.0), joints[j].torque_range(12.0).1), ((-25.0, joints[j].effort), 0.0));
    let mut command = RobotCommand::zeros(12);
    command.mode = RobotCommand::MODE_TORQUE;
    command.tau.fill(-100.0);
    let mut measured = standing(controller.robot()).state;
    measured.qd[j] = -4.0;
    limit_command(joints, &mut command, &measured);
    assert_eq!((command.tau[j], command.tau[j - 1]), (-25.0, -100.0));
}

#[test]
fn the_power_of_a_drive_limits_both_directions_without_an_effort_limit() {
    let drive = DriveLimits { power: 150.0, ..DriveLimits::default() };
    for solver in ["active_set", "clarabel"] {
        let mut near = [0, 0];
        solve(S1, solver, f64::INFINITY, drive, |wbc, qd| {
            assert!(wbc.tau.iter().all(|tau| tau.is_finite()), "{solver}");
            for (tau, qd) in wbc.tau.iter().zip(qd) {
                let allowed = 150.0 + (wbc.torque_slack + 1e-3) * qd.abs();
                assert!(tau * qd <= allowed, "{solver}: {tau} N m at {qd} rad/s, slack {}", wbc.torque_slack);
                near[usize::from(*qd > 0.0)] += usize::from(tau * qd > 149.0);
            }
        });
        assert!(near[0] > 0 && near[1] > 0, "{solver}: {near:?} drives at their power, by direction");
    }
}

#[test]
fn a_drive_of_an_unknown_joint_or_without_torque_is_an_error() {
    for (drive, named) in [
        ("knee = { power = 100.0 }", "knee"),
        ("lf_kfe_joint = { power = 0.0 }", "robot.drives"),
        ("lf_kfe_joint = { rated_velocity = 5.0, no_load_velocity = 5.0 }", "no_load_velocity"),
        ("lf_kfe_joint = { speed = 5.0 }", "speed"),
    ] {
        let error = Quadruped::new(URDF, &format!("{PARAMS}\n[robot.drives]\n{drive}\n")).err().unwrap();
        assert!(error.to_string().contains(named), "{error}");
    }
}
