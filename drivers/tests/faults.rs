//! Every fault that causes the safe state, injected into a simulated walk: damping starts in the same tick, the log contains the reason,
//! and torques stay within the effort limits.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{ROBOTS, Seen, assert_torques_bounded, run, scenario};
use lcmtypes::{ControllerTick as Tick, Event, RobotCommand};

/// Time of the fault, ms; the robot trots at that time.
const AT: i64 = 2000;

/// A trot with a fault or push.
fn walk(robot: &str, disturbance: &str, set: &[(&str, &str)]) -> Seen {
    let operator = [(0.0, "mode = \"stand\""), (0.3, "mode = \"walk\"\nv_x = 0.2")];
    let (seen, _) = run(robot, &scenario(4.0, "kind = \"flat\"", "", &operator, disturbance), set);
    assert_torques_bounded(robot, &seen);
    seen
}

/// Name of a joint by its index.
fn joint(robot: &str, index: usize) -> String {
    let leg = lcmtypes::enum_names::LEGS[index / 3];
    let joint = ["HAA", "HFE", "KFE"][index % 3];
    if robot == "hyq" { format!("{leg}_{joint}_joint").to_lowercase() } else { format!("{leg}_{joint}") }
}

/// A fault of 2 ms at [`AT`].
fn fault(kind: &str, rest: &str) -> String {
    fault_for(0.002, kind, rest)
}

/// A fault of `duration_s` at [`AT`].
fn fault_for(duration_s: f64, kind: &str, rest: &str) -> String {
    format!("[[fault]]\nt_s = {}\nduration_s = {duration_s:?}\nkind = \"{kind}\"\n{rest}\n", AT as f64 * 1e-3)
}

/// Asserts that the robot is damped from tick `at` on, for the given reason, and that an EVENT of that tick names fault and joint.
#[track_caller]
fn assert_damped(robot: &str, seen: &Seen, at: i64, code: i32, index: i32) {
    let first = seen.first(Tick::MODE_DAMPING).unwrap_or_else(|| panic!("{robot} is never damped: {:?}", seen.modes()));
    assert_eq!((first.tick, first.fault, first.fault_index), (at, code, index), "{robot}: {first:?}");
    let after = usize::try_from(at).unwrap();
    assert!(seen.ticks[after..].iter().all(|tick| (tick.mode, tick.fault) == (Tick::MODE_DAMPING, code)));
    assert!(seen.commands[after..].iter().all(|command| command.mode == RobotCommand::MODE_DAMPING));
    assert!(seen.commands[..after].iter().all(|command| command.mode == RobotCommand::MODE_TORQUE));
    let is_error = |event: &&Event| event.level == Event::LEVEL_ERROR && event.source == "controller";
    let event = seen.messages.iter().find(is_error).unwrap();
    let reason = lcmtypes::enum_names::fault(code);
    let named = usize::try_from(index).map_or_else(|_| String::new(), |index| joint(robot, index));
    assert!(event.tick == at && event.text.contains(reason) && event.text.contains(&named), "{robot}: {event:?}");
}

#[test]
fn implausible_sensor_values_cause_damping() {
    for robot in ROBOTS {
        let of = |index: usize, rest: &str| format!("joint = \"{}\"\n{rest}", joint(robot, index));
        let reading = |index, quantity: &str, offset: f64| {
            fault("false_reading", &of(index, &format!("quantity = \"{quantity}\"\noffset = {offset:?}")))
        };
        for (what, code, index) in [
            (fault("nan_sensor", &of(10, "")), Tick::FAULT_INPUT_NOT_FINITE, 10),
            (reading(4, "position", 20.0), Tick::FAULT_JOINT_POSITION, 4),
            (reading(7, "velocity", -80.0), Tick::FAULT_JOINT_VELOCITY, 7),
            (reading(11, "torque", 500.0), Tick::FAULT_JOINT_TORQUE, 11),
            (reading(2, "velocity", 1e6), Tick::FAULT_JOINT_VELOCITY, 2),
            (fault("imu_bias", "orientation_rad = [0.9, 0.0, 0.0]"), Tick::FAULT_TILT, -1),
            (fault("clock_jump", "jump_s = 0.5"), Tick::FAULT_CLOCK, -1),
            (fault("clock_jump", "jump_s = -0.5"), Tick::FAULT_STATE_STALE, -1),
        ] {
            assert_damped(robot, &walk(robot, &what, &[]), AT, code, index);
        }
    }
}

#[test]
fn missing_states_cause_damping() {
    for robot in ROBOTS {
        for (kind, rest) in [("drop_state", ""), ("late_process", ""), ("delay_state", "delay_s = 0.05")] {
            let lost = fault_for(5.0, kind, rest);
            // The last state is from tick AT - 1; a state is valid for up to 10 ms.
            let operator = [(0.0, "mode = \"stand\""), (0.3, "mode = \"walk\"\nv_x = 0.2")];
            let (seen, _) = run(robot, &scenario(3.0, "kind = \"flat\"", "", &operator, &lost), &[]);
            let damped = seen.first(Tick::MODE_DAMPING).unwrap();
            assert_eq!((damped.tick, damped.fault), (AT + 10, Tick::FAULT_STATE_STALE), "{robot}, {kind}");
        }
    }
}

#[test]
fn a_lost_operator_stops_the_walk_without_damping() {
    for robot in ROBOTS {
        let lost = fault_for(1.2, "drop_operator", "");
        let seen = walk(robot, &lost, &[]);
        assert!(!seen.modes().contains(&Tick::MODE_DAMPING));
        // The last command is at most 20 ms older than the fault, and valid for 0.5 s.
        let stale = seen.ticks.iter().find(|tick| tick.fault == Tick::FAULT_OPERATOR_STALE).unwrap();
        assert!((AT + 480..=AT + 501).contains(&stale.tick), "{robot}: {stale:?}");
        let stands = seen.ticks.iter().find(|tick| tick.tick > AT && tick.mode == Tick::MODE_STANCE).unwrap();
        assert!(stands.tick < AT + 1100, "{robot} stands at {}", stands.tick);
        // After the fault the robot walks again.
        assert_eq!(seen.ticks.last().unwrap().mode, Tick::MODE_WALK);
        let reason = lcmtypes::enum_names::fault(Tick::FAULT_OPERATOR_STALE);
        let warnings: Vec<_> = seen.messages.iter().filter(|event| event.text.contains(reason)).collect();
        assert!(warnings.len() == 1 && warnings[0].level == Event::LEVEL_WARNING, "{warnings:?}");
    }
}

#[test]
fn a_robot_lifted_off_the_ground_or_pressed_to_it_is_damped() {
    for (robot, up, down) in [("hyq", 900.0, -6000.0), ("anymal_b", 320.0, -2000.0)] {
        let push = |force: f64| format!("[[push]]\nt_s = 2.0\nduration_s = 1.5\nforce_W = [0.0, 0.0, {force:?}]\n");
        let operator = [(0.0, "mode = \"stand\"")];
        let (lifted, _) = run(robot, &scenario(4.0, "kind = \"flat\"", "", &operator, &push(up)), &[]);
        assert_torques_bounded(robot, &lifted);
        let first = lifted.first(Tick::MODE_DAMPING).unwrap();
        assert_eq!(first.fault, Tick::FAULT_NO_CONTACT, "{robot}: {first:?}");
        assert!((AT + 500..AT + 600).contains(&first.tick), "{robot}: {first:?}");
        // Joint speeds of the hanging legs stay low.
        let in_the_air = lifted.states.iter().filter(|state| (AT..first.tick).contains(&state.seq));
        let fastest = in_the_air.flat_map(|state| &state.qd).fold(0.0_f64, |most, qd| most.max(qd.abs()));
        assert!(fastest < 8.0, "{robot}: {fastest} rad/s");
        let pressed = walk(robot, &push(down), &[]);
        let first = pressed.first(Tick::MODE_DAMPING).unwrap();
        assert_eq!(first.fault, Tick::FAULT_HEIGHT, "{robot}: {first:?}");
    }
}

#[test]
fn failed_quadratic_programs_cause_damping() {
    for robot in ROBOTS {
        let starved = [("qp.solver", "\"clarabel\""), ("wbc.max_iterations", "1"), ("safety.max_qp_failures", "3")];
        let operator = [(0.0, "mode = \"stand\"")];
        let (seen, _) = run(robot, &scenario(0.1, "kind = \"flat\"", "", &operator, ""), &starved);
        let damped = seen.first(Tick::MODE_DAMPING).unwrap();
        assert_eq!((damped.tick, damped.fault, damped.fault_value), (3, Tick::FAULT_QP, 4.0), "{robot}");
        assert_torques_bounded(robot, &seen);
    }
}
