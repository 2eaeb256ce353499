//! Bad input leads to the safe state in the same tick with a fault code, and never to a panic or a non-finite command.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{
    GOOD, Puppet, assert_damps, command_of, finite, hyq, operator_at, set_base, standing, tick_of, walking, wbc_of,
};
use controller::math::{Rx, Ry};
use controller::quadruped::Quadruped;
use controller::{Controller, Outbox};
use lcmtypes::{ControllerTick as Tick, LegState, OperatorCommand, RobotCommand, TickInput, WbcSolution, channels};
use nalgebra::Vector3;

/// Asserts that, after `edit` of its input, the walking controller damps in the same tick, reports `code`, `index` and `value`, and stays in
/// damping with good input.
#[track_caller]
fn damps(edit: impl FnOnce(&mut TickInput), code: i32, index: i32, value: f64) {
    let (mut controller, mut puppet, mut out) = walking();
    edit(&mut puppet.input);
    let good_after = Puppet::new(5).input;
    controller.step(&puppet.input, &mut out);
    let t0 = puppet.input.t_ns;
    for later in 0..20 {
        let Tick { mode, fault, fault_index, fault_value, .. } = tick_of(&out);
        assert_eq!((mode, fault, fault_index), (Tick::MODE_DAMPING, code, index), "{later} ticks later");
        let same = fault_value.to_bits() == value.to_bits() || (fault_value - value).abs() < 1e-9;
        assert!(same, "fault value {fault_value}, expected {value}");
        assert_damps(&command_of(&out));
        assert_eq!(wbc_of(&out).status, WbcSolution::STATUS_NOT_RUN);
        let t_ns = t0.saturating_add(later + 1);
        let mut input = TickInput { t_ns, tick: GOOD + 1 + later, ..good_after.clone() };
        input.state.t_ns = t_ns;
        controller.step(&input, &mut out);
    }
}

/// Asserts that the walking controller continues after `edit` of its input. Returns controller, puppet and outputs of that tick.
#[track_caller]
fn goes_on(edit: impl FnOnce(&mut TickInput)) -> (Quadruped, Puppet, Outbox) {
    let (mut controller, mut puppet, mut out) = walking();
    edit(&mut puppet.input);
    controller.step(&puppet.input, &mut out);
    assert!(matches!(tick_of(&out).mode, Tick::MODE_WALK | Tick::MODE_STANCE));
    assert_eq!(command_of(&out).mode, RobotCommand::MODE_TORQUE);
    assert!(finite(&command_of(&out)));
    (controller, puppet, out)
}

#[test]
fn non_finite_values_are_reported_with_the_index_of_the_joint() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        damps(|i| i.state.q[4] = bad, Tick::FAULT_INPUT_NOT_FINITE, 4, bad);
        damps(|i| i.state.qd[0] = bad, Tick::FAULT_INPUT_NOT_FINITE, 0, bad);
        damps(|i| i.state.tau[11] = bad, Tick::FAULT_INPUT_NOT_FINITE, 11, bad);
        damps(|i| i.state.w_WI_I[0][1] = bad, Tick::FAULT_INPUT_NOT_FINITE, -1, bad);
    }
}

#[test]
fn implausible_values_count_as_non_finite() {
    for bad in [1.001e6, -1e150, f64::MAX] {
        damps(|i| i.state.q[4] = bad, Tick::FAULT_INPUT_NOT_FINITE, 4, bad);
        damps(|i| i.state.qd[5] = bad, Tick::FAULT_INPUT_NOT_FINITE, 5, bad);
        damps(|i| i.state.tau[6] = bad, Tick::FAULT_INPUT_NOT_FINITE, 6, bad);
        damps(|i| i.state.w_WI_I[0][2] = bad, Tick::FAULT_INPUT_NOT_FINITE, -1, bad);
    }
}

#[test]
fn the_largest_accepted_values_give_finite_commands() {
    for size in [1e6, -1e6] {
        for array in 0..4 {
            let (mut controller, mut puppet, mut out) = walking();
            for _ in 0..20 {
                let state = &mut puppet.input.state;
                match array {
                    0 => state.q.fill(size),
                    1 => state.qd.fill(size),
                    2 => state.tau.fill(size),
                    _ => state.w_WI_I[0] = [size; 3],
                }
                controller.step(&puppet.input, &mut out);
                assert!(finite(&command_of(&out)), "array {array}, {size}");
                puppet.react(&out);
            }
        }
    }
}

#[test]
fn a_failed_accelerometer_changes_no_command() {
    let (_, _, broken) = goes_on(|i| i.state.a_I[0] = [f64::NAN; 3]);
    let (_, _, whole) = goes_on(|_| ());
    assert_eq!(command_of(&broken), command_of(&whole));
    assert_ne!(tick_of(&broken).digest[0], tick_of(&whole).digest[0]);
}

#[test]
fn arrays_of_wrong_length_are_faults() {
    damps(|i| i.state.q.truncate(11), Tick::FAULT_INPUT_SIZE, -1, 11.0);
    damps(|i| i.state.qd.push(0.0), Tick::FAULT_INPUT_SIZE, -1, 13.0);
    damps(|i| i.state.tau.clear(), Tick::FAULT_INPUT_SIZE, -1, 0.0);
    damps(|i| i.state.q_WI_wxyz.clear(), Tick::FAULT_INPUT_SIZE, -1, 0.0);
    damps(|i| i.state.w_WI_I.clear(), Tick::FAULT_INPUT_SIZE, -1, 0.0);
}

#[test]
fn orientations_that_are_not_unit_quaternions_are_faults() {
    damps(|i| i.state.q_WI_wxyz[0] = [0.0; 4], Tick::FAULT_ORIENTATION, -1, 0.0);
    damps(|i| i.state.q_WI_wxyz[0] = [1.1, 0.0, 0.0, 0.0], Tick::FAULT_ORIENTATION, -1, 1.1);
    damps(|i| i.state.q_WI_wxyz[0] = [1.0, f64::NAN, 0.0, 0.0], Tick::FAULT_ORIENTATION, -1, 1.0);
    damps(|i| i.state.q_WI_wxyz[0] = [f64::INFINITY, 0.0, 0.0, 0.0], Tick::FAULT_ORIENTATION, -1, f64::INFINITY);
    damps(|i| i.state.q_WI_wxyz[0] = [1e200; 4], Tick::FAULT_ORIENTATION, -1, 1e200);
    goes_on(|i| i.state.q_WI_wxyz[0] = i.state.q_WI_wxyz[0].map(|x| x * 1.005));
}

#[test]
fn old_states_and_clocks_that_do_not_advance_are_faults() {
    // Up to 10 ms is good: safety.max_state_age.
    goes_on(|i| i.state.t_ns = i.t_ns - 10_000_000);
    damps(|i| i.state.t_ns = i.t_ns - 10_000_001, Tick::FAULT_STATE_STALE, -1, 0.010_000_001);
    damps(|i| i.state.t_ns = i64::MIN, Tick::FAULT_STATE_STALE, -1, i64::MAX as f64 * 1e-9);
    damps(|i| i.state.t_ns = i.t_ns + 10_000_001, Tick::FAULT_CLOCK, -1, -0.010_000_001);
    damps(|i| i.state.t_ns = i64::MAX, Tick::FAULT_CLOCK, -1, (GOOD * 1_000_000 - i64::MAX) as f64 * 1e-9);
    // The clock of the tick itself: the last tick was one period before.
    damps(|i| i.t_ns -= 1_000_000, Tick::FAULT_CLOCK, -1, 0.0);
    damps(|i| i.t_ns -= 1_500_000, Tick::FAULT_CLOCK, -1, -0.0005);
    damps(|i| i.t_ns = i64::MIN, Tick::FAULT_CLOCK, -1, i64::MIN as f64 * 1e-9);
    damps(|i| i.t_ns = i64::MAX, Tick::FAULT_STATE_STALE, -1, (i64::MAX - GOOD * 1_000_000) as f64 * 1e-9);
}

#[test]
fn the_tick_number_changes_no_command() {
    let (_, _, expected) = goes_on(|_| ());
    for tick in [i64::MIN, -1, i64::MAX] {
        let (_, _, out) = goes_on(|i| i.tick = tick);
        assert_eq!(command_of(&out).tau, command_of(&expected).tau);
        assert_eq!(tick_of(&out).tick, tick);
    }
}

#[test]
fn too_much_tilt_is_a_fault() {
    let (_, puppet, _) = walking();
    let robot = hyq();
    for (R_WB, lean) in [(Rx(0.65), 0.65), (Rx(-0.65), -0.65), (Ry(0.7), 0.7), (Rx(3.0), 3.0)] {
        let mut input = puppet.input.clone();
        set_base(robot.robot(), &mut input, &R_WB, &Vector3::zeros());
        damps(|i| *i = input, Tick::FAULT_TILT, -1, lean);
    }
    let mut input = puppet.input;
    set_base(robot.robot(), &mut input, &Rx(0.59), &Vector3::zeros());
    goes_on(|i| *i = input);
}

#[test]
fn joints_outside_their_limits_are_faults() {
    // Limits of lf_hfe_joint: -0.8727 to 1.2217 rad plus 0.2 rad; three times 12 rad/s; 1.5 times 150 N m.
    damps(|i| i.state.q[1] = 1.43, Tick::FAULT_JOINT_POSITION, 1, 1.43);
    damps(|i| i.state.q[1] = -1.08, Tick::FAULT_JOINT_POSITION, 1, -1.08);
    damps(|i| i.state.tau[11] = 225.1, Tick::FAULT_JOINT_TORQUE, 11, 225.1);
    goes_on(|i| (i.state.q[1], i.state.qd[7], i.state.tau[11]) = (1.42, -35.9, 224.9));
    let (mut controller, mut puppet, mut out) = walking();
    puppet.input.state.qd[7] = -36.1;
    controller.step(&puppet.input, &mut out);
    let Tick { mode, fault, fault_index, fault_value, .. } = tick_of(&out);
    assert_eq!((mode, fault, fault_index, fault_value), (Tick::MODE_DAMPING, Tick::FAULT_JOINT_VELOCITY, 7, -36.1));
    assert_eq!(command_of(&out).mode, RobotCommand::MODE_DAMPING);
}

#[test]
fn a_base_that_is_too_low_is_a_fault() {
    // Folded legs while walking. The limit is half of the nominal height: 0.29 m.
    let fold = |input: &mut TickInput, part: f64| {
        let q = hyq().robot().q_nominal.clone();
        for leg in 0..4 {
            input.state.q[3 * leg] = q[3 * leg] - part;
            input.state.q[3 * leg + 1] = q[3 * leg + 1].signum() * 1.2;
            input.state.q[3 * leg + 2] = q[3 * leg + 2].signum() * 2.4;
        }
    };
    let (mut controller, mut puppet, mut out) = walking();
    fold(&mut puppet.input, 0.7);
    controller.step(&puppet.input, &mut out);
    let Tick { mode, fault, fault_index, fault_value, .. } = tick_of(&out);
    assert_eq!((mode, fault, fault_index), (Tick::MODE_DAMPING, Tick::FAULT_HEIGHT, -1));
    assert!(fault_value > 0.15 && fault_value < 0.29, "{fault_value}");
    assert_damps(&command_of(&out));
    goes_on(|i| fold(i, 0.0));
}

#[test]
fn damping_torques_are_limited_to_the_effort() {
    let (mut controller, mut puppet, mut out) = walking();
    puppet.input.op.mode = OperatorCommand::MODE_DAMPING;
    puppet.input.state.qd[2] = 20.0;
    puppet.input.state.qd[5] = -15.0;
    controller.step(&puppet.input, &mut out);
    // With 20 N m s/rad the torques would be 400 and 300 N m; the limit is 150 N m.
    let expected: Vec<f64> =
        (0..12).map(|j| [20.0, 7.5, 10.0][usize::from(j == 2) + 2 * usize::from(j == 5)]).collect();
    assert_eq!((command_of(&out).mode, command_of(&out).kd), (RobotCommand::MODE_DAMPING, expected));
}

#[test]
fn the_operator_can_request_damping() {
    damps(|i| i.op.mode = OperatorCommand::MODE_DAMPING, Tick::FAULT_OPERATOR, -1, 0.0);
}

#[test]
fn a_non_finite_operator_command_stops_the_walk() {
    let edits: [fn(&mut OperatorCommand); 6] = [
        |op| op.v_H[0] = f64::NAN,
        |op| op.v_H[1] = f64::INFINITY,
        |op| op.yaw_rate = f64::NAN,
        |op| op.roll = f64::NEG_INFINITY,
        |op| op.pitch = f64::NAN,
        |op| op.height_offset = f64::NAN,
    ];
    for edit in edits {
        let (mut controller, mut puppet, mut out) = goes_on(|i| edit(&mut i.op));
        assert_eq!(tick_of(&out).fault, Tick::FAULT_OPERATOR_NOT_FINITE);
        // The robot finishes its steps and stands.
        for _ in 0..400 {
            puppet.react(&out);
            edit(&mut puppet.input.op);
            controller.step(&puppet.input, &mut out);
            assert!(finite(&command_of(&out)));
        }
        assert_eq!((tick_of(&out).mode, tick_of(&out).fault), (Tick::MODE_STANCE, Tick::FAULT_OPERATOR_NOT_FINITE));
        // A good command continues the walk.
        puppet.react(&out);
        puppet.input.op = operator_at(200);
        controller.step(&puppet.input, &mut out);
        assert_eq!((tick_of(&out).mode, tick_of(&out).fault), (Tick::MODE_WALK, Tick::FAULT_NONE));
    }
}

#[test]
fn unknown_modes_stop_the_walk_and_unknown_gaits_are_ignored() {
    for unknown in [5, i8::MAX, -1, i8::MIN] {
        let (mut controller, mut puppet, mut out) = goes_on(|i| i.op.mode = unknown);
        for _ in 0..400 {
            puppet.react(&out);
            puppet.input.op.mode = unknown;
            controller.step(&puppet.input, &mut out);
        }
        let Tick { mode, fault, fault_index, .. } = tick_of(&out);
        assert_eq!((mode, fault, fault_index), (Tick::MODE_STANCE, Tick::FAULT_OPERATOR_REFUSED, unknown.into()));
    }
    for (gait, unknown) in [(OperatorCommand::GAIT_TROT, 2), (OperatorCommand::GAIT_CRAWL, -1)] {
        let (mut controller, mut puppet, mut out) = walking();
        let mut after = |n: i64, gait: i8| {
            for _ in 0..n {
                puppet.react(&out);
                puppet.input.op.gait = gait;
                controller.step(&puppet.input, &mut out);
            }
            common::get::<LegState>(&out, channels::LEG_STATE).gait
        };
        assert_eq!(after(400, gait), gait);
        assert_eq!(after(1300, unknown), gait);
    }
}

#[test]
fn operator_commands_of_any_size_are_limited() {
    for size in [1e3, 1e200, f64::MAX, -f64::MAX] {
        let (mut controller, mut puppet, mut out) = walking();
        for _ in 0..100 {
            puppet.react(&out);
            let op = &mut puppet.input.op;
            (op.v_H, op.yaw_rate, op.roll, op.pitch, op.height_offset) = ([size; 2], size, size, size, size);
            controller.step(&puppet.input, &mut out);
            assert!(finite(&command_of(&out)));
        }
        let state = controller.state();
        let [vx, vy] = state.v_H_des;
        assert!(vx * vx + vy * vy <= 0.36 + 1e-12, "speed {vx} {vy}, foothold.max_speed is 0.6");
        assert!(state.yaw_rate_des.abs() <= 0.8 && state.height_offset.abs() <= 0.12);
        assert!(state.rp_des.iter().all(|x| x.abs() <= 0.35));
    }
}

#[test]
fn before_the_first_good_input_the_controller_is_idle_and_reports_the_fault() {
    let (mut controller, mut out) = (hyq(), Outbox::new());
    let good = standing(hyq().robot());
    type Edit = fn(&mut TickInput);
    let edits: [(Edit, i32); 5] = [
        (|i| i.state = Default::default(), Tick::FAULT_INPUT_SIZE),
        (|i| i.state.q[1] = f64::NAN, Tick::FAULT_INPUT_NOT_FINITE),
        (|i| i.state.q_WI_wxyz[0] = [0.0; 4], Tick::FAULT_ORIENTATION),
        (|i| i.state.t_ns -= 1_000_000_000, Tick::FAULT_STATE_STALE),
        (|i| i.op.mode = OperatorCommand::MODE_DAMPING, Tick::FAULT_OPERATOR),
    ];
    for (tick, (edit, code)) in (0..).zip(edits) {
        let mut input = TickInput { t_ns: tick * 1_000_000, tick, ..good.clone() };
        input.state.t_ns = input.t_ns;
        edit(&mut input);
        controller.step(&input, &mut out);
        assert_eq!((tick_of(&out).mode, tick_of(&out).fault), (Tick::MODE_IDLE, code));
        let command = command_of(&out);
        assert_eq!(command.mode, RobotCommand::MODE_IDLE);
        assert!(finite(&command));
        assert_eq!((&command.tau, &command.kp, &command.kd), (&vec![0.0; 12], &vec![0.0; 12], &vec![0.0; 12]));
    }
    // The clock starts with the first good input, even if its time is before that of the bad inputs.
    let mut input = TickInput { t_ns: -5_000_000, tick: 5, ..good };
    input.state.t_ns = input.t_ns;
    controller.step(&input, &mut out);
    assert_eq!((tick_of(&out).mode, tick_of(&out).fault), (Tick::MODE_STANCE, Tick::FAULT_NONE));
    assert_eq!(command_of(&out).mode, RobotCommand::MODE_TORQUE);
    assert_eq!(command_of(&out).q_des, input.state.q);
}

#[test]
fn a_robot_without_ground_contact_reaches_for_the_ground_then_damps() {
    let (mut controller, mut puppet, mut out) = walking();
    let mut lasts = 0;
    while tick_of(&out).mode != Tick::MODE_DAMPING {
        let legs: LegState = common::get(&out, channels::LEG_STATE);
        assert!(lasts < 495 || legs.state.contains(&LegState::STATE_FAULT_HOLD), "{lasts} ms without ground");
        puppet.input.state.tau.fill(0.0);
        controller.step(&puppet.input, &mut out);
        assert!(finite(&command_of(&out)));
        puppet.react(&out);
        lasts += 1;
    }
    let Tick { mode, fault, fault_index, fault_value, .. } = tick_of(&out);
    assert_eq!((mode, fault, fault_index), (Tick::MODE_DAMPING, Tick::FAULT_NO_CONTACT, -1));
    // safety.max_flight_time is 0.5 s.
    assert!(
        (500..=501).contains(&lasts) && (fault_value - 0.5).abs() < 1.1e-3,
        "after {lasts} ticks, value {fault_value}"
    );
    assert_damps(&command_of(&out));
}
