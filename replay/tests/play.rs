//! Playing a log, with a clock that the test turns.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{Random, path};
use lcmtypes::{ControllerTick, Message, RobotState, channels};
use replay::Error;
use replay::log::LogWriter;
use replay::play::{PlayOptions, Player, TimeBase};
use replay::record::{Filter, Pattern};
use std::path::{Path, PathBuf};

const MS: i64 = 1_000_000;

/// `count` events 10 ms apart, beginning at 5 s; the channel is the event's number.
fn log(name: &str, count: i64) -> PathBuf {
    let path = path(name);
    let mut log = LogWriter::create(&path).unwrap();
    for i in 0..count {
        log.write(&format!("E{i}"), 5000 * MS + i * 10 * MS, b"12345678").unwrap();
    }
    log.finish().unwrap();
    path
}

fn number(channel: &str) -> i64 {
    channel[1..].parse().unwrap()
}

/// Plays to the end, each event exactly when it is due; (number, time) of each.
fn play(player: &mut Player, from_ns: i64) -> Vec<(i64, i64)> {
    let (mut now, mut all) = (from_ns, Vec::new());
    while let Some(due) = player.due_ns() {
        now = now.max(due);
        let event = player.take(now).unwrap().unwrap();
        all.push((number(&event.channel), now));
        if all.len() > 10_000 {
            break;
        }
    }
    all
}

fn open(path: &Path, options: PlayOptions) -> Player {
    Player::open(path, options, 0).unwrap()
}

#[test]
fn the_pace_is_that_of_the_log_times_the_speed() {
    let path = log("pace.mcap", 100);
    for (speed, period) in [(1.0, 10 * MS), (4.0, 2_500_000), (0.5, 20 * MS)] {
        let options = PlayOptions { speed: Some(speed), ..PlayOptions::default() };
        let expected: Vec<_> = (0..100).map(|i| (i, i * period)).collect();
        assert_eq!(play(&mut open(&path, options), 0), expected);
    }
    let flat_out = PlayOptions { speed: None, ..PlayOptions::default() };
    assert_eq!(play(&mut open(&path, flat_out), 0), (0..100).map(|i| (i, 0)).collect::<Vec<_>>());
}

#[test]
fn a_part_of_the_log_begins_at_once() {
    let path = log("part.mcap", 100);
    let options = PlayOptions { from_ns: Some(205 * MS), to_ns: Some(300 * MS), ..PlayOptions::default() };
    let expected: Vec<_> = (21..30).map(|i| (i, i * 10 * MS - 205 * MS)).collect();
    assert_eq!(play(&mut open(&path, options), 0), expected);
}

#[test]
fn repeating_keeps_the_pace() {
    let path = log("repeat.mcap", 3);
    let mut player = open(&path, PlayOptions { repeat: true, ..PlayOptions::default() });
    let mut all = Vec::new();
    for _ in 0..7 {
        // 3 ms late each time: the lateness must not add up.
        let now = player.due_ns().unwrap() + 3 * MS;
        all.push((number(&player.take(now).unwrap().unwrap().channel), now / MS));
    }
    assert_eq!(all, [(0, 3), (1, 13), (2, 23), (0, 23), (1, 33), (2, 43), (0, 43)]);
    player.seek(i64::MAX, 0).unwrap();
    assert_eq!(number(&player.take(0).unwrap().unwrap().channel), 0);
}

#[test]
fn channels_are_chosen_and_renamed() {
    let path = log("chosen.mcap", 30);
    let filter = Filter { include: Pattern::new("E1.*").ok(), exclude: Pattern::new("E1[0-7]").ok() };
    let rename = [("E18".to_owned(), "E99".to_owned())].into();
    let mut player = open(&path, PlayOptions { filter, rename, ..PlayOptions::default() });
    assert_eq!(play(&mut player, 0), [(1, 10 * MS), (99, 180 * MS), (19, 190 * MS)]);
}

#[test]
fn pausing_stops_the_time_and_a_step_is_one_event() {
    let path = log("pause.mcap", 100);
    let mut player = open(&path, PlayOptions::default());
    let take = |player: &mut Player, now| player.take(now).unwrap().map(|event| number(&event.channel));
    assert_eq!(take(&mut player, 0), Some(0));
    player.pause(4 * MS);
    assert_eq!((player.due_ns(), player.position_ns(900 * MS)), (None, 4 * MS));
    player.resume(1000 * MS);
    // 6 of 10 ms were left to wait.
    assert_eq!(player.due_ns(), Some(1006 * MS));
    player.pause(1001 * MS);
    assert_eq!([take(&mut player, 2000 * MS), take(&mut player, 2000 * MS)], [Some(1), Some(2)]);
    assert_eq!(player.position_ns(3000 * MS), 20 * MS);
    player.resume(5000 * MS);
    assert_eq!(player.due_ns(), Some(5010 * MS));
}

#[test]
fn seeking_goes_forward_and_back_and_to_the_ends() {
    let path = log("seek.mcap", 100);
    let mut player = open(&path, PlayOptions::default());
    let mut next_after = |to_ns| {
        player.seek(to_ns, 7 * MS).unwrap();
        let due = player.due_ns();
        (player.take(7 * MS).unwrap().map(|event| number(&event.channel)), due)
    };
    assert_eq!(next_after(501 * MS), (Some(51), Some(16 * MS)));
    assert_eq!(next_after(500 * MS), (Some(50), Some(7 * MS)));
    assert_eq!(next_after(-1), (Some(0), Some(7 * MS)));
    assert_eq!(next_after(i64::MAX), (None, None));
    assert_eq!(next_after(990 * MS), (Some(99), Some(7 * MS)));
}

/// Whatever is pressed, what comes between two seeks is the log without a gap, and every event comes no earlier than it is due.
#[test]
fn any_pauses_steps_and_speeds_play_every_event_once() {
    let path = log("any.lcmlog", 300);
    let mut random = Random(11);
    for _ in 0..50 {
        let mut player = open(&path, PlayOptions::default());
        let (mut now, mut expected, mut taken) = (0, 0, 0);
        while !player.is_at_end() {
            now += (random.next() % 20) as i64 * MS;
            match random.next() % 10 {
                0 => player.pause(now),
                1 | 2 => player.resume(now),
                3 => player.set_speed([0.25, 1.0, 3.0][(random.next() % 3) as usize], now),
                4 if random.next().is_multiple_of(20) => {
                    let to = (random.next() % 300) as i64;
                    player.seek(to * 10 * MS, now).unwrap();
                    expected = to;
                }
                5 if player.is_paused() => {
                    assert_eq!(number(&player.take(now).unwrap().unwrap().channel), expected);
                    expected += 1;
                }
                _ => {
                    while let Some(due) = player.due_ns().filter(|due| *due <= now) {
                        assert!(player.position_ns(now) >= expected * 10 * MS, "event {expected}, due {due}, at {now}");
                        assert_eq!(number(&player.take(now).unwrap().unwrap().channel), expected);
                        expected += 1;
                        taken += 1;
                    }
                }
            }
        }
        assert_eq!(expected, 300);
        assert!(taken > 0);
    }
}

/// Received with jitter, sent evenly: each time base has its own pace.
#[test]
fn each_time_base_has_its_own_pace() {
    let path = path("bases.mcap");
    let mut log = LogWriter::create(&path).unwrap();
    let mut bytes = Vec::new();
    for (tick, received_ms, sent_us) in [(100, 50, 1000), (101, 58, 5050), (102, 59, 8950), (104, 70, 17_000)] {
        let t = received_ms * MS;
        log.write("OTHER", t, b"no type of ours").unwrap();
        bytes.clear();
        ControllerTick { t_ns: sent_us * 1000, tick, ..Default::default() }.encode(&mut bytes).unwrap();
        log.write(channels::CONTROLLER_TICK, t, &bytes).unwrap();
        // A message for people, by another clock than the robot's, must not stop the player for years.
        bytes.clear();
        lcmtypes::Event { t_ns: 1_700_000_000_000_000_000, ..Default::default() }.encode(&mut bytes).unwrap();
        log.write(channels::EVENT, t, &bytes).unwrap();
    }
    log.finish().unwrap();
    let paced = |base| {
        let mut player = open(&path, PlayOptions { base, ..PlayOptions::default() });
        let mut all = Vec::new();
        while let Some(due) = player.due_ns() {
            all.push((player.take(due).unwrap().unwrap().channel.to_string(), due / 1000));
        }
        assert_eq!(all.len(), 12);
        let of = |name: &str| all.iter().filter(|(channel, _)| channel == name).map(|(_, at)| *at).collect::<Vec<_>>();
        (of("OTHER"), of(channels::CONTROLLER_TICK), of(channels::EVENT))
    };
    let received = vec![0, 8000, 9000, 20_000];
    assert_eq!(paced(TimeBase::Receive), (received.clone(), received.clone(), received));
    let sent = vec![0, 4050, 7950, 16_000];
    assert_eq!(paced(TimeBase::Publish), (vec![0, 0, 4050, 7950], sent.clone(), sent));
    // The period is that of the first two ticks, 4.05 ms.
    let even = vec![0, 4050, 8100, 16_200];
    assert_eq!(paced(TimeBase::Tick), (vec![0, 0, 4050, 8100], even.clone(), even));
}

#[test]
fn a_log_without_ticks_says_so() {
    let path = path("no_ticks.mcap");
    let mut log = LogWriter::create(&path).unwrap();
    let mut bytes = Vec::new();
    RobotState::default().encode(&mut bytes).unwrap();
    log.write(channels::ROBOT_STATE, 0, &bytes).unwrap();
    log.finish().unwrap();
    let options = PlayOptions { base: TimeBase::Tick, ..PlayOptions::default() };
    assert!(matches!(Player::open(&path, options, 0), Err(Error::NoTicks { .. })));
}

/// Events whose times go back in the file are played in the order of their times.
#[test]
fn times_that_go_back_do_not_stop_the_player() {
    let path = path("back.lcmlog");
    let mut log = LogWriter::create(&path).unwrap();
    for (i, t) in [100, 110, 50, 60, 120].into_iter().enumerate() {
        log.write(&format!("E{i}"), t * MS, b"").unwrap();
    }
    log.finish().unwrap();
    let mut player = open(&path, PlayOptions::default());
    assert_eq!(play(&mut player, 0), [(2, 0), (3, 10 * MS), (0, 50 * MS), (1, 60 * MS), (4, 70 * MS)]);
}
