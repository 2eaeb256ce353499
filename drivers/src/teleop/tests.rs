//! Hands on keys and sticks, and what comes of it.

use super::pad::{Button, PadState, stick};
use super::*;
use std::time::Duration;

type Op = OperatorCommand;
type Tick = ControllerTick;

const MS: i64 = 1_000_000;
const LIMITS: Limits = Limits { speed: 0.6, yaw_rate: 0.8, orientation: 0.35, height: 0.12 };
const FORWARD: Press = Press::Move(Axis::Forward, Sign::Plus);
const BACK: Press = Press::Move(Axis::Forward, Sign::Minus);
const TURN: Press = Press::Move(Axis::Turn, Sign::Plus);

fn walking() -> Desk {
    let mut desk = Desk::new(LIMITS);
    desk.hear(Tick::MODE_STANCE);
    desk.press(Press::Walk, 0).unwrap();
    desk
}

/// Velocities and mode that are sent at a time, ms.
fn sent(desk: &mut Desk, ms: i64) -> ([f64; 2], f64, i8) {
    let command = desk.command(ms * MS).unwrap();
    (command.v_H, command.yaw_rate, command.mode)
}

#[test]
fn who_begins_takes_over_what_the_robot_does() {
    for (robot, begins) in [
        (Tick::MODE_IDLE, Op::MODE_IDLE),
        (Tick::MODE_SIT, Op::MODE_SIT),
        (Tick::MODE_STAND_UP, Op::MODE_STAND),
        (Tick::MODE_STANCE, Op::MODE_STAND),
        (Tick::MODE_WALK, Op::MODE_STAND),
    ] {
        let mut desk = Desk::new(LIMITS);
        assert_eq!(desk.command(0), None, "nothing is known yet");
        desk.hear(robot);
        assert_eq!(desk.command(0).map(|c| (c.mode, c.seq)), Some((begins, 0)));
    }
}

#[test]
fn who_begins_at_a_damped_robot_says_nothing() {
    let mut desk = Desk::new(LIMITS);
    desk.hear(Tick::MODE_DAMPING);
    assert_eq!(desk.command(0), None);
    assert_eq!(desk.press(Press::Posture, 0), Err("emergency stop: r takes it back"));
    let mut left = desk.clone();
    left.leave();
    assert_eq!(left.command(0), None, "nor when leaving");
    let mut taken_back = desk.clone();
    taken_back.press(Press::Reset, 0).unwrap();
    assert_eq!(taken_back.command(0).map(|c| (c.mode, c.seq)), Some((Op::MODE_IDLE, 0)));
    // Somebody else takes it back.
    desk.hear(Tick::MODE_IDLE);
    assert_eq!(desk.command(0).map(|c| c.mode), Some(Op::MODE_IDLE));
}

#[test]
fn an_operator_has_a_channel_of_its_own() {
    for channel in [CHANNEL, "OPERATOR_COMMAND", "pad-2"] {
        assert_eq!(check_channel(channel), Ok(()));
    }
    for channel in ["", "A B", "hold/ROBOT_COMMAND", "OPERATOR_.*", &"A".repeat(64)] {
        assert_eq!(check_channel(channel), Err(ChannelError::Name), "{channel}");
    }
    let text = check_channel("PARAMETER_REQUEST").unwrap_err().to_string();
    assert_eq!(text, "hoofprint.parameter_request_t is sent there, no operator's command");
}

#[test]
fn a_key_that_is_held_moves_the_robot_and_one_that_is_let_go_stops_it() {
    let mut desk = walking();
    desk.press(FORWARD, 0).unwrap();
    assert_eq!(sent(&mut desk, 800), ([0.3, 0.0], 0.0, Op::MODE_WALK), "keyboards wait before they repeat");
    // Held: repeats from 500 ms on.
    for k in 0..50 {
        desk.press(FORWARD, (500 + k * 33) * MS).unwrap();
        assert_eq!(sent(&mut desk, 500 + k * 33).0, [0.3, 0.0]);
    }
    let last = 500 + 49 * 33;
    assert_eq!(sent(&mut desk, last + 300).0, [0.3, 0.0]);
    assert_eq!(sent(&mut desk, last + 301), ([0.0, 0.0], 0.0, Op::MODE_WALK));
    // What was let go does not come back with another key.
    desk.press(TURN, 5000 * MS).unwrap();
    assert_eq!(sent(&mut desk, 5000), ([0.0, 0.0], 0.4, Op::MODE_WALK));
}

#[test]
fn two_keys_live_as_long_as_the_last_one_repeats() {
    let mut desk = walking();
    desk.press(FORWARD, 0).unwrap();
    for ms in [400, 1150, 1183, 1200] {
        desk.press(TURN, ms * MS).unwrap();
    }
    assert_eq!(sent(&mut desk, 1500), ([0.3, 0.0], 0.4, Op::MODE_WALK));
    assert_eq!(sent(&mut desk, 1501), ([0.0, 0.0], 0.0, Op::MODE_WALK));
    // A key that is new has to wait for its repeats, whatever was held before it.
    desk.press(FORWARD, 2000 * MS).unwrap();
    desk.press(TURN, 2700 * MS).unwrap();
    assert_eq!(sent(&mut desk, 3500), ([0.3, 0.0], 0.4, Op::MODE_WALK));
    assert_eq!(sent(&mut desk, 3501).1, 0.0);
}

#[test]
fn the_other_way_is_a_stop_first() {
    let mut desk = walking();
    desk.press(FORWARD, 0).unwrap();
    desk.press(BACK, 100 * MS).unwrap();
    assert_eq!(sent(&mut desk, 100).0, [0.0, 0.0]);
    desk.press(BACK, 200 * MS).unwrap();
    assert_eq!(sent(&mut desk, 200).0, [-0.3, 0.0]);
}

#[test]
fn the_pace_scales_and_the_speed_keeps_its_limit() {
    let mut desk = walking();
    for _ in 0..20 {
        desk.press(Press::Pace(Sign::Plus), 0).unwrap();
    }
    desk.press(FORWARD, 0).unwrap();
    desk.press(Press::Move(Axis::Left, Sign::Minus), 0).unwrap();
    let ([forward, left], ..) = sent(&mut desk, 0);
    assert!((libm::hypot(forward, left) - 0.6).abs() < 1e-12 && forward == -left, "{forward} {left}");
    for _ in 0..20 {
        desk.press(Press::Pace(Sign::Minus), 0).unwrap();
    }
    assert!((desk.pace() - 0.1).abs() < 1e-12);
}

#[test]
fn poses_stay_within_their_limits_and_are_reset() {
    let mut desk = walking();
    for _ in 0..30 {
        for press in [Press::Pose(Pose::Roll, Sign::Plus), Press::Pose(Pose::Pitch, Sign::Minus)] {
            desk.press(press, 0).unwrap();
        }
    }
    desk.press(Press::Pose(Pose::Height, Sign::Minus), 0).unwrap();
    let c = desk.command(0).unwrap();
    assert_eq!((c.roll, c.pitch, c.height_offset), (0.35, -0.35, -0.012));
    desk.press(Press::Reset, 0).unwrap();
    let c = desk.command(0).unwrap();
    assert_eq!((c.roll, c.pitch, c.height_offset, c.mode), (0.0, 0.0, 0.0, Op::MODE_WALK));
}

#[test]
fn keys_go_from_lying_to_walking_and_back() {
    let mut desk = Desk::new(LIMITS);
    desk.hear(Tick::MODE_IDLE);
    assert_eq!(desk.press(Press::Walk, 0), Err("the robot has to stand first: Enter"));
    let mut modes = Vec::new();
    for press in [Press::Posture, Press::Walk, Press::Walk, Press::Walk, Press::Posture, Press::Posture, Press::Posture]
    {
        desk.press(press, 0).unwrap();
        modes.push(desk.mode().unwrap());
    }
    use OperatorCommand as O;
    assert_eq!(
        modes,
        [O::MODE_STAND, O::MODE_WALK, O::MODE_STAND, O::MODE_WALK, O::MODE_STAND, O::MODE_SIT, O::MODE_STAND]
    );
    assert_eq!(desk.press(FORWARD, 0), Err("Space begins to walk"));
    desk.press(Press::Gait, 0).unwrap();
    assert_eq!(desk.command(0).unwrap().gait, O::GAIT_CRAWL);
}

#[test]
fn a_robot_that_sits_is_let_go() {
    let mut desk = Desk::new(LIMITS);
    desk.hear(Tick::MODE_STANCE);
    desk.press(Press::Posture, 0).unwrap();
    assert_eq!(desk.mode(), Some(Op::MODE_SIT));
    desk.press(Press::Reset, 0).unwrap();
    assert_eq!(desk.mode(), Some(Op::MODE_IDLE));
    desk.press(Press::Posture, 0).unwrap();
    assert_eq!(desk.mode(), Some(Op::MODE_STAND));
}

#[test]
fn an_emergency_stop_holds_until_it_is_taken_back() {
    let mut desk = walking();
    desk.press(FORWARD, 0).unwrap();
    desk.press(Press::Stop, MS).unwrap();
    assert_eq!(sent(&mut desk, 1), ([0.0; 2], 0.0, Op::MODE_DAMPING));
    for press in [Press::Walk, Press::Posture, FORWARD] {
        assert_eq!(desk.press(press, 2 * MS), Err("emergency stop: r takes it back"));
    }
    assert_eq!(sent(&mut desk, 3).2, Op::MODE_DAMPING);
    desk.press(Press::Reset, 4 * MS).unwrap();
    assert_eq!(sent(&mut desk, 4).2, Op::MODE_IDLE);
    desk.press(Press::Posture, 5 * MS).unwrap();
    assert_eq!(sent(&mut desk, 5).2, Op::MODE_STAND);
    let untouched = Desk::new(LIMITS).press(Press::Stop, 0);
    assert_eq!(untouched, Ok(()), "before anything is known of the robot");
}

#[test]
fn a_robot_that_saved_itself_does_not_walk_on() {
    let mut desk = walking();
    desk.press(FORWARD, 0).unwrap();
    desk.hear(Tick::MODE_WALK);
    desk.hear(Tick::MODE_DAMPING);
    assert_eq!(sent(&mut desk, 1), ([0.0; 2], 0.0, Op::MODE_STAND));
    assert_eq!(desk.press(Press::Walk, 0), Err("emergency stop: r takes it back"));
    desk.press(Press::Reset, 0).unwrap();
    desk.hear(Tick::MODE_DAMPING);
    assert_eq!(desk.mode(), Some(Op::MODE_IDLE));
}

#[test]
fn who_leaves_stands_a_walking_robot_and_releases_no_stop() {
    for (mode, left) in
        [("walk", Op::MODE_STAND), ("sit", Op::MODE_SIT), ("idle", Op::MODE_IDLE), ("estop", Op::MODE_DAMPING)]
    {
        let mut desk = Desk::new(LIMITS);
        desk.line(mode).unwrap();
        desk.leave();
        assert_eq!(sent(&mut desk, 0), ([0.0; 2], 0.0, left));
    }
}

#[test]
fn messages_are_numbered() {
    let mut desk = walking();
    let numbers: Vec<(i64, i64)> = (0..3).filter_map(|k| desk.command(k * 20 * MS)).map(|c| (c.seq, c.t_ns)).collect();
    assert_eq!(numbers, [(0, 0), (1, 20 * MS), (2, 40 * MS)]);
}

#[test]
fn the_bumper_has_to_be_held() {
    let mut desk = Desk::new(LIMITS);
    desk.hear(Tick::MODE_STANCE);
    let mut pad = PadState { forward: 1.0, left: 1.0, turn: -0.5, pitch: 1.0, ..PadState::default() };
    desk.hold(&pad, 0).unwrap();
    assert_eq!(sent(&mut desk, 0), ([0.0; 2], 0.0, Op::MODE_STAND), "sticks alone do nothing");
    pad.bumper = true;
    desk.hold(&pad, 0).unwrap();
    let c = desk.command(0).unwrap();
    assert_eq!((c.mode, c.yaw_rate, c.pitch), (Op::MODE_WALK, -0.4, 0.35));
    assert!((libm::hypot(c.v_H[0], c.v_H[1]) - 0.6).abs() < 1e-12, "{:?}", c.v_H);
    // Nothing repeats and nothing runs out while it is held.
    assert_eq!(sent(&mut desk, 60_000).1, -0.4);
    pad.bumper = false;
    desk.hold(&pad, 0).unwrap();
    let c = desk.command(0).unwrap();
    assert_eq!((c.mode, c.v_H, c.yaw_rate, c.pitch), (Op::MODE_STAND, [0.0; 2], 0.0, 0.0));
}

#[test]
fn the_bumper_gets_no_robot_up_from_the_ground() {
    for robot in [Tick::MODE_IDLE, Tick::MODE_SIT, Tick::MODE_DAMPING] {
        let mut desk = Desk::new(LIMITS);
        desk.hear(robot);
        let before = desk.mode();
        let pad = PadState { bumper: true, forward: 1.0, ..PadState::default() };
        assert_eq!(desk.hold(&pad, 0), Err("the robot has to stand first: Start"));
        assert_eq!(desk.mode(), before);
        assert!(desk.command(0).is_none_or(|command| command.v_H == [0.0; 2]));
    }
}

#[test]
fn buttons_act_when_they_go_down_and_the_stop_has_the_last_word() {
    let mut desk = Desk::new(LIMITS);
    desk.hear(Tick::MODE_IDLE);
    let mut pad = PadState::default();
    pad.set(Button::Start, true);
    for _ in 0..5 {
        desk.hold(&pad, 0).unwrap();
        assert_eq!(desk.mode(), Some(Op::MODE_STAND), "once, however long it is down");
    }
    for button in [Button::Up, Button::Left, Button::South] {
        pad.set(button, true);
    }
    desk.hold(&pad, 0).unwrap();
    let c = desk.command(0).unwrap();
    assert_eq!((c.height_offset, c.roll, c.gait), (0.1 * 0.12, -0.1 * 0.35, Op::GAIT_CRAWL));

    let mut all = PadState { bumper: true, ..PadState::default() };
    for (button, _) in pad::BUTTONS {
        all.set(button, true);
    }
    let _ = desk.hold(&all, 0);
    assert_eq!(desk.mode(), Some(Op::MODE_DAMPING));
}

#[test]
fn sticks_have_a_dead_middle_and_reach_the_end() {
    assert_eq!([0.0, 0.1, -0.1, 1.0, -1.0, 7.0, f64::NAN].map(stick), [0.0, 0.0, 0.0, 1.0, -1.0, 1.0, 0.0]);
    assert!((stick(-0.55) + 0.5).abs() < 1e-12);
}

#[test]
fn lines_are_commands() {
    let mut desk = Desk::new(LIMITS);
    assert_eq!(desk.line("vx=0.2 walk gait=crawl  # slowly"), Ok(Duration::ZERO));
    assert_eq!(sent(&mut desk, 1_000_000), ([0.2, 0.0], 0.0, Op::MODE_WALK), "as long as nothing else is said");
    assert_eq!(desk.line("wait 2.5"), Ok(Duration::from_millis(2500)));
    assert_eq!(desk.line(""), Ok(Duration::ZERO));
    desk.line("yaw=-0.8 height=0.05 swing_frequency=3 duty=0.7 step_height=0.1").unwrap();
    let c = desk.command(0).unwrap();
    assert_eq!((c.v_H, c.yaw_rate, c.height_offset), ([0.2, 0.0], -0.8, 0.05));
    assert_eq!((c.swing_frequency, c.duty, c.step_height, c.gait), (3.0, 0.7, 0.1, Op::GAIT_CRAWL));
    desk.line("stand").unwrap();
    desk.line("walk").unwrap();
    assert_eq!(sent(&mut desk, 0).0, [0.0; 2], "a new mode begins with velocities of zero");
}

#[test]
fn a_line_that_is_wrong_anywhere_changes_nothing_and_says_where() {
    let mut desk = walking();
    for (line, wanted) in [
        ("walk vx=0.7", "vx=0.7: expected -0.6 to 0.6"),
        ("walk vx=nan", "vx=nan: expected -0.6 to 0.6"),
        ("gait=gallop estop", "gait=gallop: expected trot or crawl"),
        ("duty=0.2", "duty=0.2: expected at least 0.5 and below 1, or 0 for the parameters' own"),
        ("fly", "\"fly\" is neither stand, walk, sit, idle, estop nor KEY=VALUE, nor wait SECONDS"),
        ("wait", "\"wait\" is neither stand, walk, sit, idle, estop nor KEY=VALUE, nor wait SECONDS"),
        ("wait -1", "wait=-1: expected 0 to 86400 s"),
        (
            "speed=1",
            "unknown key \"speed\", known: vx, vy, yaw, roll, pitch, height, gait, swing_frequency, duty, step_height",
        ),
    ] {
        assert_eq!(desk.line(line).unwrap_err().to_string(), wanted);
        assert_eq!(sent(&mut desk, 0), ([0.0; 2], 0.0, Op::MODE_WALK));
    }
}
