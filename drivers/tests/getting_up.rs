//! The robots get up from the ground, sit down on it, and give up where they cannot.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{ROBOTS, assert_torques_bounded, run, scenario};
use lcmtypes::ControllerTick as Tick;
use test_support::replace_once;

const FLAT: &str = "kind = \"flat\"";
/// Stones under the robot itself too.
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
                // Up at its nominal height by the time it is asked to sit.
                let info = common::description(robot, &[]);
                let nominal =
                    controller::quadruped::Quadruped::new(&info.urdf, &info.params).unwrap().robot().nominal_height;
                let height = seen.truth[7400].p_WB[2];
                assert!((height - nominal).abs() < 0.05, "{what}: at {height} m of {nominal}");
                // Down again, as low as it lay before, and without a bump: what leaves the ground of 0.13 m falls at 1.6 m/s.
                let (lay, lies) = (seen.truth[999].p_WB[2], seen.truth.last().unwrap().p_WB[2]);
                assert!(lies < lay + 0.04, "{what}: lay at {lay} m, lies at {lies} m");
                let fastest = seen.truth.iter().fold(0.0_f64, |most, truth| most.min(truth.v_WB[2]));
                assert!(fastest > -0.6, "{what}: comes down at {fastest} m/s");
                assert!(seen.fastest(Tick::MODE_SIT) < 4.5, "{what}: {} rad/s", seen.fastest(Tick::MODE_SIT));
            }
        }
    }
}

#[test]
fn a_leg_that_is_stuck_or_limp_is_named_and_the_robot_damped() {
    for (robot, joint, index) in [("hyq", "rf_kfe_joint", 5), ("anymal_b", "RF_KFE", 5)] {
        let fault = format!("[[fault]]\nt_s = 1.5\nduration_s = 60.0\nkind = \"stuck_encoder\"\njoint = \"{joint}\"\n");
        let (seen, _) = run(robot, &scenario(14.0, FLAT, LYING, &UP_AND_DOWN[..2], &fault), &[]);
        let given_up = seen.first(Tick::MODE_DAMPING).unwrap_or_else(|| panic!("{robot}: {:?}", seen.modes()));
        assert_eq!((given_up.fault, given_up.fault_index), (Tick::FAULT_POSTURE, index), "{robot}");
        assert!(!seen.modes().contains(&Tick::MODE_STANCE), "{robot}");
        let why = &seen.said.iter().find(|event| event.tick == given_up.tick).unwrap().text;
        assert!(why.starts_with("controller is in DAMPING: joint does not follow"), "{why}");
        assert_torques_bounded(robot, &seen);
    }
}

#[test]
fn a_robot_that_lies_crooked_is_not_moved() {
    for robot in ROBOTS {
        let start = "[start]\nposture = \"lying\"\nroll = 2.8";
        let (seen, _) = run(robot, &scenario(5.0, FLAT, start, &UP_AND_DOWN[..2], ""), &[]);
        let given_up = seen.first(Tick::MODE_DAMPING).unwrap();
        assert_eq!((given_up.fault, given_up.t_ns >= 1_000_000_000), (Tick::FAULT_TILT, true), "{robot}");
        assert!(!seen.modes().contains(&Tick::MODE_STAND_UP), "{robot}");
    }
}

/// Peak joint speeds, measured: HyQ 2.5 rad/s from standing and 3.5 from a trot, ANYmal B 1.9 and 2.5. Limits in the URDF: 12 and 15.
#[test]
fn a_stop_brings_the_robot_down_softly_and_it_gets_up_again() {
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
