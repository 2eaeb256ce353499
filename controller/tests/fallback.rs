//! Fallbacks: torques without a solution of the quadratic program, effort limits, invalid snapshots.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{Puppet, assert_damps, command_of, finite, hyq, hyq_with, tick_of, walking, wbc_of};
use controller::quadruped::Quadruped;
use controller::quadruped::state::Mode;
use controller::{Controller, Outbox, RestoreError};
use lcmtypes::{ControllerTick as Tick, Message, QuadrupedState, RobotCommand, WbcSolution};

/// A walking controller with an iteration limit of 1, which cannot solve its programs but has the torques of the last solution. It uses
/// Clarabel, which then fails on every program; the active-set solver would need a program with violated rows.
fn starved() -> (Quadruped, Puppet, Outbox, Vec<f64>) {
    let (controller, puppet, out) = walking();
    let mut snapshot = Vec::new();
    controller.snapshot(&mut snapshot);
    let mut starved = hyq_with(&[("qp.solver", "\"clarabel\""), ("wbc.max_iterations", "1")]);
    starved.restore(&snapshot).unwrap();
    let tau = command_of(&out).tau;
    assert!(tau.iter().all(|t| *t != 0.0));
    (starved, puppet, out, tau)
}

#[test]
fn without_a_solution_the_last_torques_are_repeated_five_times() {
    let (mut controller, mut puppet, mut out, tau) = starved();
    for failures in 1..=5 {
        controller.step(&puppet.input, &mut out);
        assert_eq!((tick_of(&out).mode, tick_of(&out).fault), (Tick::MODE_WALK, Tick::FAULT_NONE));
        assert_eq!((command_of(&out).mode, &command_of(&out).tau), (RobotCommand::MODE_TORQUE, &tau));
        assert!(finite(&command_of(&out)));
        assert_eq!(controller.state().qp_failures, failures);
        let wbc = wbc_of(&out);
        assert_eq!(wbc.status, WbcSolution::STATUS_FAILED);
        assert_eq!(
            (wbc.vd, wbc.f_F_W, wbc.residual, wbc.base_residual),
            (vec![0.0; 18], vec![[0.0; 3]; 4], [0.0; 3], 0.0)
        );
        puppet.react(&out);
    }
    for tick in 0..20 {
        controller.step(&puppet.input, &mut out);
        // The tick of the fault reports the failure; later ticks do not solve.
        let status = if tick == 0 { WbcSolution::STATUS_FAILED } else { WbcSolution::STATUS_NOT_RUN };
        assert_eq!((wbc_of(&out).status, wbc_of(&out).level), (status, -1));
        let Tick { mode, fault, fault_index, fault_value, .. } = tick_of(&out);
        assert_eq!((mode, fault, fault_index, fault_value), (Tick::MODE_DAMPING, Tick::FAULT_QP, -1, 6.0));
        assert_damps(&command_of(&out));
        puppet.react(&out);
    }
}

#[test]
fn a_solution_resets_the_count_of_failures() {
    let (mut controller, mut puppet, mut out, _) = starved();
    for _ in 0..5 {
        controller.step(&puppet.input, &mut out);
        puppet.react(&out);
    }
    let mut snapshot = Vec::new();
    controller.snapshot(&mut snapshot);
    let mut fed = hyq();
    fed.restore(&snapshot).unwrap();
    fed.step(&puppet.input, &mut out);
    assert_eq!((fed.state().qp_failures, tick_of(&out).mode), (0, Tick::MODE_WALK));
    assert_eq!(wbc_of(&out).status, WbcSolution::STATUS_SOLVED);
}

#[test]
fn torques_are_limited_to_the_effort_of_the_urdf_and_clamps_are_counted() {
    let (mut controller, mut puppet, mut out) = walking();
    let mut clamped = 0;
    for tick in 0..60 {
        // Large disturbances: the tasks require more than the effort limits.
        puppet.input.state.w_WI_I[0] = [if tick % 20 < 10 { 6.0 } else { -6.0 }, 4.0, 0.0];
        controller.step(&puppet.input, &mut out);
        let command = command_of(&out);
        for (joint, tau) in controller.robot().model.joints.iter().zip(&command.tau) {
            assert!(tau.abs() <= joint.effort, "{}: {tau} of {}", joint.name, joint.effort);
        }
        let at_limit = command.tau.iter().filter(|tau| tau.abs() == 150.0).count();
        let wbc = wbc_of(&out);
        if wbc.status == WbcSolution::STATUS_SOLVED {
            assert_eq!(usize::try_from(wbc.n_clamped).unwrap(), at_limit);
            clamped += at_limit;
        }
        puppet.react(&out);
    }
    assert!(clamped > 0, "no torque was limited: the disturbances are too small");
}

#[test]
fn invalid_snapshots_are_rejected_or_handled() {
    let mut bytes = Vec::new();
    walking().0.snapshot(&mut bytes);
    let good = QuadrupedState::decode(&bytes).unwrap();
    let restored = |edit: &dyn Fn(&mut QuadrupedState)| {
        let mut state = good.clone();
        edit(&mut state);
        let mut bytes = Vec::new();
        state.encode(&mut bytes).unwrap();
        let mut controller = hyq();
        controller.restore(&bytes).map(|()| controller)
    };
    let refused = |edit: &dyn Fn(&mut QuadrupedState)| restored(edit).err().unwrap();
    assert!(matches!(refused(&|s| s.mode = 6), RestoreError::Value { field: "mode", found: 6, .. }));
    for unknown in [-1, 2] {
        let error = refused(&|s| s.gait = unknown);
        let expected = (i64::from(unknown), 1);
        assert!(matches!(error, RestoreError::Value { field: "gait", found, last } if (found, last) == expected));
    }
    assert!(matches!(refused(&|s| s.leg_state[3] = 5), RestoreError::Value { field: "leg_state", found: 5, .. }));
    assert!(matches!(refused(&|s| s.move_phase = 7), RestoreError::Value { field: "move_phase", found: 7, .. }));
    let fewer = |s: &mut QuadrupedState| {
        s.nj = 3;
        s.q_des.truncate(3);
        s.tau_last.truncate(3);
        s.qd_des.truncate(3);
        s.qdd_des.truncate(3);
        s.move_q.truncate(3);
    };
    assert!(matches!(refused(&fewer), RestoreError::Joints { found: 3, expected: 12 }));
    assert!(matches!(hyq().restore(&bytes[..40]).unwrap_err(), RestoreError::Decode(_)));

    type Edit = fn(&mut QuadrupedState);
    let not_finite: [(Edit, &str); 4] = [
        (|s| s.q_des[4] = f64::NAN, "q_des"),
        (|s| s.tau_last[0] = f64::INFINITY, "tau_last"),
        (|s| s.zeta = f64::NAN, "zeta"),
        (|s| s.t_leg[1] = f64::NEG_INFINITY, "t_leg"),
    ];
    for (edit, name) in not_finite {
        assert!(matches!(refused(&edit), RestoreError::NotFinite { field } if field == name), "{name}");
    }

    let odd: [&dyn Fn(&mut QuadrupedState); 4] = [
        &|s| (s.qp_failures, s.contact_count) = (i32::MAX, [i32::MAX; 4]),
        &|s| (s.qp_failures, s.contact_count) = (i32::MIN, [i32::MIN; 4]),
        &|s| (s.gait_clock, s.t_leg) = (-1e300, [-1e300; 4]),
        &|s| (s.t_ns, s.tick) = (i64::MIN, i64::MIN),
    ];
    for edit in odd {
        let (_, mut puppet, mut out) = walking();
        let mut controller = restored(edit).unwrap();
        for _ in 0..10 {
            controller.step(&puppet.input, &mut out);
            assert!(finite(&command_of(&out)));
            puppet.react(&out);
        }
        assert!(matches!(controller.state().mode, Mode::Walk | Mode::Stance | Mode::Damping));
    }
}

/// A state whose numbers overflow in the tick: the tick damps, and neither the command nor the next state contains a non-finite number.
#[test]
fn a_non_finite_command_is_never_published() {
    for edit in [
        (|m| m.p_stance_H = [[f64::MAX; 2]; 4]) as fn(&mut QuadrupedState),
        |m| m.zeta = f64::MAX,
        |m| m.gradient_W = [f64::MAX; 2],
    ] {
        let (mut controller, mut puppet, mut out) = walking();
        let mut bytes = Vec::new();
        controller.snapshot(&mut bytes);
        let mut state = QuadrupedState::decode(&bytes).unwrap();
        edit(&mut state);
        bytes.clear();
        state.encode(&mut bytes).unwrap();
        controller.restore(&bytes).unwrap();
        for _ in 0..20 {
            controller.step(&puppet.input, &mut out);
            assert!(finite(&command_of(&out)), "{:?}", command_of(&out));
            assert_eq!((tick_of(&out).mode, tick_of(&out).fault), (Tick::MODE_DAMPING, Tick::FAULT_COMMAND));
            assert_damps(&command_of(&out));
            puppet.react(&out);
        }
        bytes.clear();
        controller.snapshot(&mut bytes);
        controller.restore(&bytes).unwrap();
    }
}
