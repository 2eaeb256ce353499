//! Key presses, gamepad states and lines, and the commands made from them.

use super::pad::{Button, PadState, stick};
use super::script::ScriptError;
use super::*;
use std::time::Duration;

type Op = OperatorCommand;
type Tick = ControllerTick;

const MS: i64 = 1_000_000;
/// A robot that also has a gait in which it stays in place.
fn limits() -> Limits {
    let gaits = [("trot", 0.6, 0.8), ("crawl", 0.1, 0.2), ("single_leg", 0.0, 0.0)];
    let gaits = gaits.map(|(name, speed, yaw_rate)| GaitLimits { name: name.to_owned(), speed, yaw_rate });
    Limits { gaits: gaits.into(), orientation: 0.35, height: 0.12 }
}
const FORWARD: Press = Press::Move(Axis::Forward, Sign::Plus);
const BACK: Press = Press::Move(Axis::Forward, Sign::Minus);
const TURN: Press = Press::Move(Axis::Turn, Sign::Plus);

/// Reasons why a press has no effect.
const STOPPED: &str = "emergency stop in force: r clears it";
const NOT_WALKING: &str = "not walking: press Space first";
const NOT_STANDING: &str = "not standing: press Enter first";
const NOT_STANDING_PAD: &str = "not standing: press Start first";

fn walking() -> OperatorInput {
    let mut input = OperatorInput::new(limits());
    input.set_robot_mode(Tick::MODE_STANCE);
    input.press(Press::Walk, 0).unwrap();
    input
}

/// Velocities and mode that are sent at a time, ms.
fn sent(input: &mut OperatorInput, ms: i64) -> ([f64; 2], f64, i8) {
    let command = input.command(ms * MS).unwrap();
    (command.v_H, command.yaw_rate, command.mode)
}

#[test]
fn a_new_operator_starts_with_the_mode_of_the_robot() {
    for (robot, first) in [
        (Tick::MODE_IDLE, Op::MODE_IDLE),
        (Tick::MODE_SIT, Op::MODE_SIT),
        (Tick::MODE_STAND_UP, Op::MODE_STAND),
        (Tick::MODE_STANCE, Op::MODE_STAND),
        (Tick::MODE_WALK, Op::MODE_STAND),
    ] {
        let mut input = OperatorInput::new(limits());
        assert_eq!(input.command(0), None, "the mode of the robot is unknown");
        input.set_robot_mode(robot);
        assert_eq!(input.command(0).map(|c| (c.mode, c.seq)), Some((first, 0)));
    }
}

#[test]
fn a_new_operator_of_a_damped_robot_sends_nothing() {
    let mut input = OperatorInput::new(limits());
    input.set_robot_mode(Tick::MODE_DAMPING);
    assert_eq!(input.command(0), None);
    assert_eq!(input.press(Press::Posture, 0), Err(STOPPED));
    let mut left = input.clone();
    left.leave();
    assert_eq!(left.command(0), None, "leaving sends nothing either");
    let mut cleared = input.clone();
    cleared.press(Press::Reset, 0).unwrap();
    assert_eq!(cleared.command(0).map(|c| (c.mode, c.seq)), Some((Op::MODE_IDLE, 0)));
    // Another operator clears the stop.
    input.set_robot_mode(Tick::MODE_IDLE);
    assert_eq!(input.command(0).map(|c| c.mode), Some(Op::MODE_IDLE));
}

#[test]
fn channels_of_other_types_are_refused() {
    for channel in [CHANNEL, "OPERATOR_COMMAND", "pad-2"] {
        assert_eq!(check_channel(channel), Ok(()));
    }
    for channel in ["", "A B", "hold/ROBOT_COMMAND", "OPERATOR_.*", &"A".repeat(64)] {
        assert_eq!(check_channel(channel), Err(ChannelError::Name), "{channel}");
    }
    let taken = ChannelError::Taken { type_name: "hoofprint.parameter_request_t" };
    assert_eq!(check_channel("PARAMETER_REQUEST"), Err(taken));
}

#[test]
fn the_robot_moves_while_a_key_is_held() {
    let mut input = walking();
    input.press(FORWARD, 0).unwrap();
    assert_eq!(sent(&mut input, 800), ([0.3, 0.0], 0.0, Op::MODE_WALK), "keyboards wait before they repeat");
    // Held: repeats from 500 ms on.
    for k in 0..50 {
        input.press(FORWARD, (500 + k * 33) * MS).unwrap();
        assert_eq!(sent(&mut input, 500 + k * 33).0, [0.3, 0.0]);
    }
    let last = 500 + 49 * 33;
    assert_eq!(sent(&mut input, last + 300).0, [0.3, 0.0]);
    assert_eq!(sent(&mut input, last + 301), ([0.0, 0.0], 0.0, Op::MODE_WALK));
    // A velocity that has expired stays zero when another key is pressed.
    input.press(TURN, 5000 * MS).unwrap();
    assert_eq!(sent(&mut input, 5000), ([0.0, 0.0], 0.4, Op::MODE_WALK));
}

#[test]
fn both_velocities_are_kept_while_the_last_key_repeats() {
    let mut input = walking();
    input.press(FORWARD, 0).unwrap();
    for ms in [400, 1150, 1183, 1200] {
        input.press(TURN, ms * MS).unwrap();
    }
    assert_eq!(sent(&mut input, 1500), ([0.3, 0.0], 0.4, Op::MODE_WALK));
    assert_eq!(sent(&mut input, 1501), ([0.0, 0.0], 0.0, Op::MODE_WALK));
    // A new key gets the long time-out, whatever was held before it.
    input.press(FORWARD, 2000 * MS).unwrap();
    input.press(TURN, 2700 * MS).unwrap();
    assert_eq!(sent(&mut input, 3500), ([0.3, 0.0], 0.4, Op::MODE_WALK));
    assert_eq!(sent(&mut input, 3501).1, 0.0);
}

#[test]
fn a_press_in_the_opposite_direction_stops_first() {
    let mut input = walking();
    input.press(FORWARD, 0).unwrap();
    input.press(BACK, 100 * MS).unwrap();
    assert_eq!(sent(&mut input, 100).0, [0.0, 0.0]);
    input.press(BACK, 200 * MS).unwrap();
    assert_eq!(sent(&mut input, 200).0, [-0.3, 0.0]);
}

#[test]
fn the_pace_scales_velocities_up_to_the_limit() {
    let mut input = walking();
    for _ in 0..20 {
        input.press(Press::Pace(Sign::Plus), 0).unwrap();
    }
    input.press(FORWARD, 0).unwrap();
    input.press(Press::Move(Axis::Left, Sign::Minus), 0).unwrap();
    let ([forward, left], ..) = sent(&mut input, 0);
    assert!((libm::hypot(forward, left) - 0.6).abs() < 1e-12 && forward == -left, "{forward} {left}");
    for _ in 0..20 {
        input.press(Press::Pace(Sign::Minus), 0).unwrap();
    }
    assert!((input.pace() - 0.1).abs() < 1e-12);
}

#[test]
fn poses_stay_within_their_limits_and_are_reset() {
    let mut input = walking();
    for _ in 0..30 {
        for press in [Press::Pose(Pose::Roll, Sign::Plus), Press::Pose(Pose::Pitch, Sign::Minus)] {
            input.press(press, 0).unwrap();
        }
    }
    input.press(Press::Pose(Pose::Height, Sign::Minus), 0).unwrap();
    let c = input.command(0).unwrap();
    assert_eq!((c.roll, c.pitch, c.height_offset), (0.35, -0.35, -0.012));
    input.press(Press::Reset, 0).unwrap();
    let c = input.command(0).unwrap();
    assert_eq!((c.roll, c.pitch, c.height_offset, c.mode), (0.0, 0.0, 0.0, Op::MODE_WALK));
}

#[test]
fn keys_lead_from_lying_to_walking_and_back() {
    let mut input = OperatorInput::new(limits());
    input.set_robot_mode(Tick::MODE_IDLE);
    assert_eq!(input.press(Press::Walk, 0), Err(NOT_STANDING));
    let mut modes = Vec::new();
    for press in [Press::Posture, Press::Walk, Press::Walk, Press::Walk, Press::Posture, Press::Posture, Press::Posture]
    {
        input.press(press, 0).unwrap();
        modes.push(input.mode().unwrap());
    }
    use OperatorCommand as O;
    assert_eq!(
        modes,
        [O::MODE_STAND, O::MODE_WALK, O::MODE_STAND, O::MODE_WALK, O::MODE_STAND, O::MODE_SIT, O::MODE_STAND]
    );
    assert_eq!(input.press(FORWARD, 0), Err(NOT_WALKING));
    input.press(Press::Gait, 0).unwrap();
    assert_eq!(input.command(0).unwrap().gait, O::GAIT_CRAWL);
}

#[test]
fn reset_requests_idle_while_sitting() {
    let mut input = OperatorInput::new(limits());
    input.set_robot_mode(Tick::MODE_STANCE);
    input.press(Press::Posture, 0).unwrap();
    assert_eq!(input.mode(), Some(Op::MODE_SIT));
    input.press(Press::Reset, 0).unwrap();
    assert_eq!(input.mode(), Some(Op::MODE_IDLE));
    input.press(Press::Posture, 0).unwrap();
    assert_eq!(input.mode(), Some(Op::MODE_STAND));
}

#[test]
fn an_emergency_stop_stays_until_it_is_cleared() {
    let mut input = walking();
    input.press(FORWARD, 0).unwrap();
    input.press(Press::Stop, MS).unwrap();
    assert_eq!(sent(&mut input, 1), ([0.0; 2], 0.0, Op::MODE_DAMPING));
    for press in [Press::Walk, Press::Posture, FORWARD] {
        assert_eq!(input.press(press, 2 * MS), Err(STOPPED));
    }
    assert_eq!(sent(&mut input, 3).2, Op::MODE_DAMPING);
    input.press(Press::Reset, 4 * MS).unwrap();
    assert_eq!(sent(&mut input, 4).2, Op::MODE_IDLE);
    input.press(Press::Posture, 5 * MS).unwrap();
    assert_eq!(sent(&mut input, 5).2, Op::MODE_STAND);
    let untouched = OperatorInput::new(limits()).press(Press::Stop, 0);
    assert_eq!(untouched, Ok(()), "while the mode of the robot is unknown");
}

#[test]
fn after_the_safe_state_the_request_to_walk_is_gone() {
    let mut input = walking();
    input.press(FORWARD, 0).unwrap();
    input.set_robot_mode(Tick::MODE_WALK);
    input.set_robot_mode(Tick::MODE_DAMPING);
    assert_eq!(sent(&mut input, 1), ([0.0; 2], 0.0, Op::MODE_STAND));
    assert_eq!(input.press(Press::Walk, 0), Err(STOPPED));
    input.press(Press::Reset, 0).unwrap();
    input.set_robot_mode(Tick::MODE_DAMPING);
    assert_eq!(input.mode(), Some(Op::MODE_IDLE));
}

#[test]
fn leaving_stands_a_walking_robot_and_clears_no_stop() {
    for (mode, left) in
        [("walk", Op::MODE_STAND), ("sit", Op::MODE_SIT), ("idle", Op::MODE_IDLE), ("estop", Op::MODE_DAMPING)]
    {
        let mut input = OperatorInput::new(limits());
        input.apply_line(mode).unwrap();
        input.leave();
        assert_eq!(sent(&mut input, 0), ([0.0; 2], 0.0, left));
    }
}

#[test]
fn messages_are_numbered() {
    let mut input = walking();
    let numbers: Vec<(i64, i64)> = (0..3).filter_map(|k| input.command(k * 20 * MS)).map(|c| (c.seq, c.t_ns)).collect();
    assert_eq!(numbers, [(0, 0), (1, 20 * MS), (2, 40 * MS)]);
}

#[test]
fn the_robot_walks_while_the_bumper_is_held() {
    let mut input = OperatorInput::new(limits());
    input.set_robot_mode(Tick::MODE_STANCE);
    let mut pad = PadState { forward: 1.0, left: 1.0, turn: -0.5, pitch: 1.0, ..PadState::default() };
    input.apply_pad(&pad, 0).unwrap();
    assert_eq!(sent(&mut input, 0), ([0.0; 2], 0.0, Op::MODE_STAND), "sticks alone do nothing");
    pad.bumper = true;
    input.apply_pad(&pad, 0).unwrap();
    let c = input.command(0).unwrap();
    assert_eq!((c.mode, c.yaw_rate, c.pitch), (Op::MODE_WALK, -0.4, 0.35));
    assert!((libm::hypot(c.v_H[0], c.v_H[1]) - 0.6).abs() < 1e-12, "{:?}", c.v_H);
    // No time-out while it is held.
    assert_eq!(sent(&mut input, 60_000).1, -0.4);
    pad.bumper = false;
    input.apply_pad(&pad, 0).unwrap();
    let c = input.command(0).unwrap();
    assert_eq!((c.mode, c.v_H, c.yaw_rate, c.pitch), (Op::MODE_STAND, [0.0; 2], 0.0, 0.0));
}

#[test]
fn the_bumper_does_not_make_a_lying_robot_stand() {
    for robot in [Tick::MODE_IDLE, Tick::MODE_SIT, Tick::MODE_DAMPING] {
        let mut input = OperatorInput::new(limits());
        input.set_robot_mode(robot);
        let before = input.mode();
        let pad = PadState { bumper: true, forward: 1.0, ..PadState::default() };
        assert_eq!(input.apply_pad(&pad, 0), Err(NOT_STANDING_PAD));
        assert_eq!(input.mode(), before);
        assert!(input.command(0).is_none_or(|command| command.v_H == [0.0; 2]));
    }
}

#[test]
fn buttons_act_when_pressed_and_the_stop_overrides_all() {
    let mut input = OperatorInput::new(limits());
    input.set_robot_mode(Tick::MODE_IDLE);
    let mut pad = PadState::default();
    pad.set(Button::Start, true);
    for _ in 0..5 {
        input.apply_pad(&pad, 0).unwrap();
        assert_eq!(input.mode(), Some(Op::MODE_STAND), "once, however long it is down");
    }
    for button in [Button::Up, Button::Left, Button::South] {
        pad.set(button, true);
    }
    input.apply_pad(&pad, 0).unwrap();
    let c = input.command(0).unwrap();
    assert_eq!((c.height_offset, c.roll, c.gait), (0.1 * 0.12, -0.1 * 0.35, Op::GAIT_CRAWL));

    let mut all = PadState { bumper: true, ..PadState::default() };
    for (button, _) in pad::BUTTONS {
        all.set(button, true);
    }
    let _ = input.apply_pad(&all, 0);
    assert_eq!(input.mode(), Some(Op::MODE_DAMPING));
}

#[test]
fn sticks_have_a_dead_zone_and_full_range() {
    assert_eq!([0.0, 0.1, -0.1, 1.0, -1.0, 7.0, f64::NAN].map(stick), [0.0, 0.0, 0.0, 1.0, -1.0, 1.0, 0.0]);
    assert!((stick(-0.55) + 0.5).abs() < 1e-12);
}

#[test]
fn lines_are_commands() {
    let mut input = OperatorInput::new(limits());
    assert_eq!(input.apply_line("vx=0.2 walk gait=crawl  # slowly"), Ok(Duration::ZERO));
    assert_eq!(sent(&mut input, 1_000_000), ([0.1, 0.0], 0.0, Op::MODE_WALK), "until another value is set");
    assert_eq!(input.apply_line("wait 2.5"), Ok(Duration::from_millis(2500)));
    assert_eq!(input.apply_line(""), Ok(Duration::ZERO));
    input.apply_line("yaw=-0.8 height=0.05 swing_frequency=3 duty=0.7 step_height=0.1").unwrap();
    let c = input.command(0).unwrap();
    assert_eq!((c.v_H, c.yaw_rate, c.height_offset), ([0.1, 0.0], -0.2, 0.05), "as a crawl allows");
    assert_eq!((c.swing_frequency, c.duty, c.step_height, c.gait), (3.0, 0.7, 0.1, Op::GAIT_CRAWL));
    input.apply_line("stand").unwrap();
    input.apply_line("walk").unwrap();
    assert_eq!(sent(&mut input, 0).0, [0.0; 2], "a new mode resets the velocities");
}

#[test]
fn an_invalid_line_changes_nothing_and_the_error_names_the_word() {
    let mut input = walking();
    let limit = |found: &str| ScriptError::Value {
        key: "vx".to_owned(),
        found: found.to_owned(),
        expected: "-0.6 to 0.6".to_owned(),
    };
    assert_eq!(input.apply_line("walk vx=0.7"), Err(limit("0.7")));
    assert_eq!(input.apply_line("walk vx=nan"), Err(limit("nan")));
    let word = |found: &str| ScriptError::Word { found: found.to_owned() };
    assert_eq!(input.apply_line("fly"), Err(word("fly")));
    assert_eq!(input.apply_line("wait"), Err(word("wait")));
    assert_eq!(input.apply_line("speed=1"), Err(ScriptError::Key { key: "speed".to_owned() }));
    for line in ["gait=gallop estop", "duty=0.2", "wait -1"] {
        assert!(matches!(input.apply_line(line), Err(ScriptError::Value { .. })), "{line}");
    }
    assert_eq!(sent(&mut input, 0), ([0.0; 2], 0.0, Op::MODE_WALK));
}

#[test]
fn in_a_crawl_a_key_press_asks_for_a_part_of_what_a_crawl_allows() {
    let mut input = walking();
    input.press(FORWARD, 0).unwrap();
    assert_eq!(sent(&mut input, 0).0, [0.3, 0.0]);
    input.press(Press::Gait, 0).unwrap();
    // The velocity of the trot is cut to the limit; the next press asks for the pace of the crawl.
    assert_eq!(sent(&mut input, 10).0, [0.1, 0.0]);
    input.press(FORWARD, 20 * MS).unwrap();
    assert_eq!(sent(&mut input, 20).0, [0.05, 0.0]);
    input.press(TURN, 20 * MS).unwrap();
    assert_eq!(sent(&mut input, 20).1, 0.1);
    input.press(Press::Gait, 30 * MS).unwrap();
    input.press(FORWARD, 30 * MS).unwrap();
    assert_eq!(sent(&mut input, 30).0, [0.0; 2], "a gait that stays in place");
}

#[test]
fn the_gait_key_goes_through_all_gaits_and_lines_name_them() {
    let mut input = walking();
    let gaits = [(); 4].map(|()| {
        input.press(Press::Gait, 0).unwrap();
        input.command(0).unwrap().gait
    });
    assert_eq!(gaits, [1, 2, 0, 1]);
    input.apply_line("gait=single_leg").unwrap();
    assert_eq!((input.command(0).unwrap().gait, &*input.gait().name), (2, "single_leg"));
    // The gaits of another run: the same name has another number.
    let mut other = limits();
    other.gaits.insert(2, GaitLimits { name: "pace".to_owned(), speed: 0.5, yaw_rate: 0.5 });
    input.set_limits(&other);
    assert_eq!(input.command(0).unwrap().gait, 3);
    input.set_limits(&Limits::default());
    assert_eq!(input.command(0).unwrap().gait, Op::GAIT_TROT, "a gait that the run does not have");
    let unknown = |found: &str, expected: &str| ScriptError::Value {
        key: "gait".to_owned(),
        found: found.to_owned(),
        expected: expected.to_owned(),
    };
    assert_eq!(input.apply_line("gait=pace"), Err(unknown("pace", "trot, crawl")));
}
