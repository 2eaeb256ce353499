//! A foot over a hole deeper than its leg: the search for the ground ends at a stated depth after a stated time, and the run replays bit for bit.
//!
//! Source of the search: Raiola et al. 2020, section 4.3, which does not say where it ends.
#![allow(clippy::unwrap_used, missing_docs, non_snake_case)]

mod common;

use common::{folder, hoof, messages};
use lcmtypes::{ControllerTick, Event, LegState, RobotState, channels};
use std::path::{Path, PathBuf};

/// Depth of the hole, m. The legs of HyQ are 0.7 m long when stretched.
const HOLE: f64 = 1.0;
/// Time of the hole under LF, s: it opens when the foot is next in the air.
const OPENS_S: f64 = 4.0;

/// Walks forward at `v_x` until a hole opens under LF; returns the log, which replays bit for bit.
fn walk_into_hole(folder: &Path, gait: &str, v_x: f64) -> PathBuf {
    let scenario = folder.join(format!("{gait}.toml"));
    let text = format!(
        "name = \"hole\"\nduration_s = 10.0\nseed = 1\nfriction = 0.8\n[terrain]\nkind = \"flat\"\n\
         [[operator]]\nt_s = 0.0\nmode = \"stand\"\ngait = \"{gait}\"\n[[operator]]\nt_s = 1.0\nmode = \"walk\"\n\
         [[operator]]\nt_s = 2.0\nv_x = {v_x}\n[[floor]]\nt_s = {OPENS_S}\nleg = \"LF\"\nheight_m = -{HOLE}\n"
    );
    std::fs::write(&scenario, text).unwrap();
    let log = folder.join(format!("{gait}.mcap"));
    hoof(&format!("sim --robot hyq --scenario {} --log {}", scenario.display(), log.display()));
    let replay = hoof(&format!("replay {} --jobs 2 --json", log.display())).exits(0).json();
    assert_eq!(replay["identical"], true);
    log
}

#[test]
fn a_crawling_robot_holds_the_foot_and_is_damped_when_it_sinks() {
    let folder = folder("crawl");
    let log = walk_into_hole(&folder, "crawl", 0.05);
    let legs: Vec<LegState> = messages(&log, channels::LEG_STATE);
    let ticks: Vec<ControllerTick> = messages(&log, channels::CONTROLLER_TICK);
    let states: Vec<RobotState> = messages(&log, channels::ROBOT_STATE);

    let held = legs.iter().position(|legs| legs.state[0] == LegState::STATE_FAULT_HOLD).unwrap();
    // Half a swing time downward, half a swing time of waiting, at 3 swings a second.
    let searched = legs[..held].iter().rev().take_while(|legs| legs.state[0] == LegState::STATE_REACH).count();
    assert!((332..=334).contains(&searched), "{searched} ticks");
    let damped = ticks.iter().position(|tick| tick.mode == ControllerTick::MODE_DAMPING).unwrap();
    assert!(held < damped, "held in tick {held}, damped in tick {damped}");
    // No leg steps from the hold on, and every tick names the leg and the depth: swing.height is 0.1 m, and the search lasts a quarter of the sine's period.
    let expected = [LegState::STATE_FAULT_HOLD, LegState::STATE_STANCE, LegState::STATE_STANCE, LegState::STATE_STANCE];
    assert!(legs[held..damped].iter().all(|legs| legs.state == expected));
    assert!(ticks[..held].iter().all(|tick| tick.fault == ControllerTick::FAULT_NONE));
    for ControllerTick { mode, fault, fault_index, fault_value, .. } in &ticks[held..damped] {
        assert_eq!((*mode, *fault, *fault_index), (ControllerTick::MODE_WALK, ControllerTick::FAULT_NO_GROUND, 0));
        assert!((fault_value - 0.1).abs() < 1e-12, "{fault_value}");
    }
    // The safe state begins 0.15 m deeper. A foot sinks by less than 1 cm in a tick.
    assert_damped_over_hole(&ticks, 0.25..0.26);
    assert_eq!(event_levels(&log), [Event::LEVEL_WARNING, Event::LEVEL_ERROR]);
    // Without the safe state a joint reaches 39 rad/s.
    let fastest = states.iter().flat_map(|state| &state.qd).fold(0.0_f64, |most, qd| most.max(qd.abs()));
    assert!(fastest < 6.0, "{fastest} rad/s");
}

#[test]
fn a_trotting_robot_is_damped_as_soon_as_the_search_has_ended() {
    let folder = folder("trot");
    let log = walk_into_hole(&folder, "trot", 0.2);
    let ticks: Vec<ControllerTick> = messages(&log, channels::CONTROLLER_TICK);
    // On two feet it has fallen farther by then; the hole is deeper still.
    assert_damped_over_hole(&ticks, 0.25..HOLE);
    assert!(event_levels(&log).contains(&Event::LEVEL_ERROR));
}

/// Without a search the foot of a swing that ends a little above the ground is held, and that is no hole.
#[test]
fn a_foot_held_near_the_ground_damps_nothing() {
    let folder = folder("no_search");
    for scenario in ["short_crawl", "short_rough"] {
        let log = folder.join(format!("{scenario}.mcap"));
        let run = hoof(&format!(
            "sim --robot hyq --scenario scenarios/{scenario}.toml --set swing.reach_time=0 --log {} --json",
            log.display()
        ));
        assert_eq!(run.json()["safe_state"], serde_json::Value::Null, "{scenario}");
    }
}

/// Asserts that the run ends in the safe state because LF found no ground, at a depth in m.
#[track_caller]
fn assert_damped_over_hole(ticks: &[ControllerTick], depth: std::ops::Range<f64>) {
    let ControllerTick { mode, fault, fault_index, fault_value, .. } = ticks.last().unwrap();
    assert_eq!((*mode, *fault, *fault_index), (ControllerTick::MODE_DAMPING, ControllerTick::FAULT_NO_GROUND, 0));
    assert!(depth.contains(fault_value), "{fault_value} m");
}

/// Levels of the controller's EVENTs that name LF.
fn event_levels(log: &Path) -> Vec<i8> {
    let events: Vec<Event> = messages(log, channels::EVENT);
    events
        .iter()
        .filter(|event| event.source == "controller" && event.text.contains("LF"))
        .map(|event| event.level)
        .collect()
}
