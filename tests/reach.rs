//! A foot over a hole deeper than its leg: the search for the ground ends at a stated depth after a stated time, and the run replays bit for bit.
//!
//! Source of the search: Raiola et al. 2020, section 4.3, which does not say where it ends.
#![allow(clippy::unwrap_used, missing_docs, non_snake_case)]

mod common;

use common::{folder, hoof, messages};
use lcmtypes::{ControllerTick, Event, GroundTruth, LegState, channels};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Depth of the hole, m. The legs of HyQ are 0.7 m long when stretched.
const HOLE: f64 = 1.0;
/// Time of the hole under LF, s: it opens when the foot is next in the air.
const OPENS_S: f64 = 4.0;

/// Walks forward at `v_x` until a hole opens under LF; returns the log and the JSON of the simulation. The log replays bit for bit.
fn walk_into_hole(folder: &Path, gait: &str, v_x: f64) -> (PathBuf, Value) {
    let scenario = folder.join(format!("{gait}.toml"));
    let text = format!(
        "name = \"hole\"\nduration_s = 10.0\nseed = 1\nfriction = 0.8\n[terrain]\nkind = \"flat\"\n\
         [[operator]]\nt_s = 0.0\nmode = \"stand\"\ngait = \"{gait}\"\n[[operator]]\nt_s = 1.0\nmode = \"walk\"\n\
         [[operator]]\nt_s = 2.0\nv_x = {v_x}\n[[floor]]\nt_s = {OPENS_S}\nleg = \"LF\"\nheight_m = -{HOLE}\n"
    );
    std::fs::write(&scenario, text).unwrap();
    let log = folder.join(format!("{gait}.mcap"));
    let run = hoof(&format!("sim --robot hyq --scenario {} --log {} --json", scenario.display(), log.display()));
    let replay = hoof(&format!("replay {} --jobs 2 --json", log.display())).exits(0).json();
    assert_eq!(replay["identical"], true);
    (log, run.json())
}

#[test]
fn a_crawling_robot_holds_the_foot_and_stands_on_the_other_three() {
    let folder = folder("crawl");
    let (log, run) = walk_into_hole(&folder, "crawl", 0.05);
    assert_eq!((&run["fell"], &run["safe_state"]), (&Value::Bool(false), &Value::Null), "{run}");
    let legs: Vec<LegState> = messages(&log, channels::LEG_STATE);
    let ticks: Vec<ControllerTick> = messages(&log, channels::CONTROLLER_TICK);
    let truth: Vec<GroundTruth> = messages(&log, channels::GROUND_TRUTH);

    let held = legs.iter().position(|legs| legs.state[0] == LegState::STATE_FAULT_HOLD).unwrap();
    // Half a swing time downward, half a swing time of waiting, at 3 swings a second.
    let searched = legs[..held].iter().rev().take_while(|legs| legs.state[0] == LegState::STATE_REACH).count();
    assert!((332..=334).contains(&searched), "{searched} ticks");
    // No leg steps from then on.
    let expected = [LegState::STATE_FAULT_HOLD, LegState::STATE_STANCE, LegState::STATE_STANCE, LegState::STATE_STANCE];
    assert!(legs[held..].iter().all(|legs| legs.state == expected));
    for (tick, legs) in ticks.iter().zip(&legs) {
        let is_held = legs.state[0] == LegState::STATE_FAULT_HOLD;
        assert_eq!(tick.fault == ControllerTick::FAULT_NO_GROUND, is_held, "tick {}", tick.tick);
    }
    let last = ticks.last().unwrap();
    assert_eq!((last.mode, last.fault_index), (ControllerTick::MODE_WALK, 0));
    // swing.height is 0.1 m, and the search lasts a quarter of the period of the sine.
    assert!((last.fault_value - 0.1).abs() < 1e-12, "{}", last.fault_value);
    let events: Vec<Event> = messages(&log, channels::EVENT);
    let warnings: Vec<&Event> = events.iter().filter(|event| event.level == Event::LEVEL_WARNING).collect();
    assert!(matches!(&warnings[..], [one] if one.text.contains("LF") && one.text.contains("0.100")), "{warnings:?}");

    // The base comes to rest, and the foot is held in the hole. Measured: see the limits.
    let (from, to) = (&truth[held + 1000], truth.last().unwrap());
    let moved = (0..3).map(|k| (to.p_WB[k] - from.p_WB[k]).powi(2)).sum::<f64>().sqrt();
    assert!(moved < 0.01, "the base moved by {moved} m");
    let depth = -to.p_WF[0][2];
    assert!((0.05..0.15).contains(&depth), "the foot is {depth} m below the ground");
}

#[test]
fn a_trotting_robot_that_cannot_stand_without_the_foot_is_damped() {
    let folder = folder("trot");
    let (log, run) = walk_into_hole(&folder, "trot", 0.2);
    assert_eq!(run["fell"], true, "{run}");
    let ticks: Vec<ControllerTick> = messages(&log, channels::CONTROLLER_TICK);
    let last = ticks.last().unwrap();
    let falls = [ControllerTick::FAULT_TILT, ControllerTick::FAULT_HEIGHT];
    assert!(last.mode == ControllerTick::MODE_DAMPING && falls.contains(&last.fault), "{last:?}");
}
