//! Standing up and sitting down; damping where that is not possible.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{ROBOTS, assert_torques_bounded, run, scenario};
use lcmtypes::{ControllerTick as Tick, GroundTruth};
use test_support::replace_once;

const FLAT: &str = "kind = \"flat\"";
/// Stones also under the robot.
const SLIGHTLY_ROUGH: &str = "kind = \"rough\"\nheight_m = [0.01, 0.02]\nflat_radius_m = 0.0";
const LYING: &str = "[start]\nposture = \"lying\"";
const UP_AND_DOWN: [(f64, &str); 4] =
    [(0.0, "mode = \"idle\""), (1.0, "mode = \"stand\""), (7.5, "mode = \"sit\""), (14.0, "mode = \"idle\"")];

#[test]
fn both_robots_get_up_and_sit_down_on_flat_and_slightly_rough_ground() {
    for robot in ROBOTS {
        for (ground, seeds) in [(FLAT, 1..2), (SLIGHTLY_ROUGH, 1..5)] {
            for seed in seeds {
                let text = replace_once(
                    &scenario(15.0, ground, LYING, &UP_AND_DOWN, ""),
                    "seed = 1",
                    &format!("seed = {seed}"),
                );
                let (seen, outcome) = run(robot, &text, &[]);
                let what = format!("{robot} on {ground}, seed {seed}");
                let expected =
                    [Tick::MODE_IDLE, Tick::MODE_STAND_UP, Tick::MODE_STANCE, Tick::MODE_SIT, Tick::MODE_IDLE];
                assert_eq!(seen.modes(), expected, "{what}");
                assert_eq!((outcome.fell_at_s, outcome.safe_state), (None, None), "{what}");
                assert_torques_bounded(robot, &seen);
                // At nominal height before the sit command.
                let info = common::description(robot, &[]);
                let nominal =
                    controller::quadruped::Quadruped::new(&info.urdf, info.params()).unwrap().robot().nominal_height;
                let height = seen.truth[7400].p_WB[2];
                assert!((height - nominal).abs() < 0.05, "{what}: at {height} m of {nominal}");
                // Down again at the initial height without a fall: a free fall of 0.13 m ends at 1.6 m/s.
                let (before, after) = (seen.truth[999].p_WB[2], seen.truth.last().unwrap().p_WB[2]);
                assert!(after < before + 0.04, "{what}: base at {before} m before and {after} m after");
                // The base stays where it is, along the ground, while the feet move out to where they lie.
                let at = |truth: &GroundTruth| [truth.p_WB[0], truth.p_WB[1]];
                let ([x, y], [x_end, y_end]) = (at(&seen.truth[7400]), at(seen.truth.last().unwrap()));
                let slid = (x_end - x).hypot(y_end - y);
                let most = if ground == FLAT { 0.05 } else { 0.12 };
                assert!(slid < most, "{what}: the base slid {slid} m");
                let fastest = seen.truth.iter().fold(0.0_f64, |most, truth| most.min(truth.v_WB[2]));
                assert!(fastest > -0.6, "{what}: base velocity {fastest} m/s");
                assert!(seen.fastest(Tick::MODE_SIT) < 4.5, "{what}: {} rad/s", seen.fastest(Tick::MODE_SIT));
            }
        }
    }
}

#[test]
fn a_stuck_joint_causes_damping_and_is_named() {
    for (robot, joint, index) in [("hyq", "rf_kfe_joint", 5), ("anymal_b", "RF_KFE", 5)] {
        let fault = format!("[[fault]]\nt_s = 1.5\nduration_s = 60.0\nkind = \"stuck_encoder\"\njoint = \"{joint}\"\n");
        let (seen, _) = run(robot, &scenario(14.0, FLAT, LYING, &UP_AND_DOWN[..2], &fault), &[]);
        let damped = seen.first(Tick::MODE_DAMPING).unwrap_or_else(|| panic!("{robot}: {:?}", seen.modes()));
        assert_eq!((damped.fault, damped.fault_index), (Tick::FAULT_POSTURE, index), "{robot}");
        assert!(!seen.modes().contains(&Tick::MODE_STANCE), "{robot}");
        let text = &seen.messages.iter().find(|event| event.tick == damped.tick).unwrap().text;
        assert!(text.contains(joint), "{text}");
        assert_torques_bounded(robot, &seen);
    }
}

#[test]
fn a_robot_that_lies_tilted_is_not_moved() {
    for robot in ROBOTS {
        let start = "[start]\nposture = \"lying\"\nroll = 2.8";
        let (seen, _) = run(robot, &scenario(5.0, FLAT, start, &UP_AND_DOWN[..2], ""), &[]);
        let damped = seen.first(Tick::MODE_DAMPING).unwrap();
        assert_eq!((damped.fault, damped.t_ns >= 1_000_000_000), (Tick::FAULT_TILT, true), "{robot}");
        assert!(!seen.modes().contains(&Tick::MODE_STAND_UP), "{robot}");
    }
}

/// Measured peak joint speeds: HyQ 2.5 rad/s from standing and 3.5 from a trot, ANYmal B 1.9 and 2.5. Limits in the URDF: 12 and 15.
#[test]
fn after_an_emergency_stop_the_robot_comes_down_slowly_and_can_stand_up_again() {
    for robot in ROBOTS {
        let again = [(7.0, "mode = \"idle\""), (9.5, "mode = \"stand\""), (18.0, "mode = \"walk\"\nv_x = 0.2")];
        for before in ["mode = \"stand\"", "mode = \"walk\"\nv_x = 0.3"] {
            let asked = [&[(0.0, "mode = \"stand\""), (1.0, before), (3.1, "mode = \"damping\"")], &again[..]].concat();
            let (seen, outcome) = run(robot, &scenario(20.0, FLAT, "", &asked, ""), &[]);
            let modes = seen.modes();
            let expected =
                [Tick::MODE_DAMPING, Tick::MODE_IDLE, Tick::MODE_STAND_UP, Tick::MODE_STANCE, Tick::MODE_WALK];
            assert_eq!(modes[modes.len() - 5..], expected, "{robot}, {before}: {modes:?}");
            assert_eq!(outcome.fell_at_s, None, "{robot}, {before}");
            assert!(seen.fastest(Tick::MODE_DAMPING) < 4.0, "{robot}: {} rad/s", seen.fastest(Tick::MODE_DAMPING));
            assert_torques_bounded(robot, &seen);
        }
    }
}
