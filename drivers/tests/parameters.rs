//! Parameter changes during a walk: replies, their ticks in the log, and replays.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{Seen, run, scenario};
use lcmtypes::{Event, Message, ParameterChange, ParameterRequest, RequestReply, channels};
use replay::engine::{Cursor, Options, OtherParameters, Replay};
use replay::log::{EventFilter, Excerpt, LogReader, LogWriter, Types, copy_excerpt};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use test_support::replace_once;

/// Two changes during a trot, one of them a new stack of tasks, and three rejected requests.
static CHANGES: &str = r#"
[[parameter]]
t_s = 1.2005
key = "trunk.kp"
value = [700.0, 700.0, 700.0]
[[parameter]]
t_s = 1.5
key = "robot.posture.lf_haa_joint"
value = 0.0
[[parameter]]
t_s = 1.6
key = "stack.tasks.hand.kpp"
value = 3
[[parameter]]
t_s = 1.7
key = "wbc.friction"
value = -1
[[parameter]]
t_s = 2.3
key = "stack.formula"
value = "contact + 0.5 * trunk + 0.1 * posture << base_dynamics << friction << force_bounds"
"#;

/// A run of 3.3 s with changes, snapshots at ticks 0, 1000, 2000, 3000.
static RUN: LazyLock<Seen> = LazyLock::new(|| {
    let formula = controller::stack::S3;
    let changes = replace_once(
        CHANGES,
        "contact + 0.5 * trunk + 0.1 * posture << base_dynamics << friction << force_bounds",
        formula.trim_matches('"'),
    );
    let asked = [(0.0, "mode = \"stand\""), (0.3, "mode = \"walk\"\nv_x = 0.2")];
    let (seen, outcome) = run("hyq", &scenario(3.3, "kind = \"flat\"", "", &asked, &changes), &[]);
    assert_eq!((outcome.fell_at_s, outcome.safe_state), (None, None));
    seen
});

fn path(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("parameters");
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// Writes a log of the events of the run for which `keep` returns true.
fn log(name: &str, mut keep: impl FnMut(&str, &[u8]) -> bool) -> PathBuf {
    let path = path(name);
    let mut log = LogWriter::create(&path).unwrap();
    for (channel, t_ns, data) in &RUN.events {
        if keep(channel, data) {
            log.write(channel, *t_ns, data).unwrap();
        }
    }
    log.finish().unwrap();
    path
}

fn changes() -> Vec<ParameterChange> {
    let messages = RUN.events.iter().filter(|(channel, ..)| channel == channels::PARAMETER_CHANGE);
    messages.map(|(.., data)| ParameterChange::decode(data).unwrap()).collect()
}

fn messages<M: Message>(channel: &str) -> Vec<M> {
    let messages = RUN.events.iter().filter(|(name, ..)| name == channel);
    messages.map(|(.., data)| M::decode(data).unwrap()).collect()
}

#[test]
fn every_request_has_a_reply_and_an_event_and_changes_have_their_tick() {
    let found: Vec<_> = changes().into_iter().map(|change| (change.tick, change.seq, change.key)).collect();
    assert_eq!(found, [(1201, 0, "trunk.kp".to_owned()), (2300, 4, "stack.formula".to_owned())]);
    let requests: Vec<ParameterRequest> = messages(channels::PARAMETER_REQUEST);
    assert_eq!(requests.iter().map(|request| request.seq).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
    let replies: Vec<RequestReply> = messages(channels::REQUEST_REPLY);
    let outcomes: Vec<_> = replies.iter().map(|reply| (reply.request_id, reply.tick, reply.code)).collect();
    let done = RequestReply::CODE_DONE;
    assert_eq!(
        outcomes,
        [
            (0, 1201, done),
            (1, -1, RequestReply::CODE_REJECTED),
            (2, -1, RequestReply::CODE_UNKNOWN_NAME),
            (3, -1, RequestReply::CODE_OUT_OF_RANGE),
            (4, 2300, done),
        ]
    );
    let events: Vec<_> = RUN.messages.iter().filter(|event| event.source == "parameters").collect();
    assert_eq!(events.len(), 5);
    for ((reply, event), request) in replies.iter().zip(events).zip(&requests) {
        let is_done = reply.code == done;
        assert_eq!(event.level, if is_done { Event::LEVEL_INFO } else { Event::LEVEL_WARNING });
        assert!(event.text.contains(&request.key), "{}", event.text);
        assert!(is_done || reply.reason == event.text, "{}", reply.reason);
    }
    // The reason names the keys of the section.
    assert!(replies[2].reason.contains("[stack.tasks]"), "{}", replies[2].reason);
}

#[test]
fn all_forms_of_replay_follow_the_changes_bit_for_bit() {
    for ending in ["lcmlog", "mcap"] {
        let path = log(&format!("run.{ending}"), |_, _| true);
        let replay = Replay::open(&path).unwrap();
        for (from_s, jobs, ticks) in [(None, 1, 3300), (None, 3, 3300), (Some(1.1), 1, 2299), (Some(2.9), 2, 1299)] {
            let options = Options { from_s, jobs, ..Options::default() };
            let report = replay.run(&options, &mut |_| {}).unwrap();
            assert!(report.identical && report.ticks == ticks, "{ending}, {options:?}: {:?}", report.first_divergence);
        }
        let out = self::path(&format!("again.{ending}"));
        replay.run(&Options { out: Some(out.clone()), ..Options::default() }, &mut |_| {}).unwrap();
        let report = Replay::open(&out).unwrap().run(&Options::default(), &mut |_| {}).unwrap();
        assert!(report.identical && report.ticks == 3300, "{ending}: {:?}", report.first_divergence);
    }
}

#[test]
fn a_cursor_has_the_parameters_of_its_tick() {
    let path = log("cursor.mcap", |_, _| true);
    let replay = Replay::open(&path).unwrap();
    let mut cursor = Cursor::open(&replay, &Options::default(), &mut |_| {}).unwrap();
    // In both directions over both changes, within a page and between pages.
    for tick in [3100, 1200, 1201, 2299, 2300, 900, 2500, 1500] {
        let moment = cursor.go_to(tick).unwrap();
        assert_eq!(moment.divergence, None, "tick {tick}");
    }
}

#[test]
fn mutant_without_a_change_the_ticks_from_it_on_are_skipped() {
    for (name, first_tick) in [("trunk.kp", 1201_i64), ("stack.formula", 2300)] {
        let path = log(&format!("without_{name}.mcap"), |channel, data| {
            channel != channels::PARAMETER_CHANGE || ParameterChange::decode(data).unwrap().key != name
        });
        for jobs in [1, 2] {
            let options = Options { jobs, ..Options::default() };
            let report = Replay::open(&path).unwrap().run(&options, &mut |_| {}).unwrap();
            let ticks = 3300 - first_tick.unsigned_abs();
            assert_eq!(report.other_parameters, Some(OtherParameters { first_tick, ticks }), "{name}, {jobs} jobs");
            assert!(report.identical && !report.complete, "{name}, {jobs} jobs: {:?}", report.first_divergence);
            assert_eq!((report.ticks, report.skipped_ticks), (3300 - ticks, ticks), "{name}, {jobs} jobs");
        }
    }
}

#[test]
fn mutant_a_change_one_tick_late_is_detected() {
    let path = path("late.mcap");
    let mut late = LogWriter::create(&path).unwrap();
    for (channel, t_ns, data) in &RUN.events {
        let mut data = data.clone();
        if channel == channels::PARAMETER_CHANGE {
            let mut change = ParameterChange::decode(&data).unwrap();
            change.tick += 1;
            data.clear();
            change.encode(&mut data).unwrap();
        }
        late.write(channel, *t_ns, &data).unwrap();
    }
    late.finish().unwrap();
    let report = Replay::open(&path).unwrap().run(&Options::default(), &mut |_| {}).unwrap();
    // Ticks 1201 and 2300 themselves; the state is unknown from each of them to the next snapshot, at 2000 and 3000.
    assert_eq!(report.other_parameters, Some(OtherParameters { first_tick: 1201, ticks: 2 }));
    assert!(report.identical && !report.complete, "{:?}", report.first_divergence);
    assert_eq!((report.ticks, report.skipped_ticks), (3300 - 1501, 1501));
}

/// A live run publishes changes again for logs that begin later; in other logs the copies have no effect.
#[test]
fn repeated_changes_are_followed_once() {
    let again = |name: &str, from: i64| {
        let path = path(name);
        let mut log = LogWriter::create(&path).unwrap();
        let is_change = |channel: &str| channel == channels::PARAMETER_CHANGE;
        for (channel, t_ns, data) in &RUN.events {
            let is_recorded =
                *t_ns > from * 1_000_000 || channel == channels::CONTROLLER_SNAPSHOT && *t_ns == from * 1_000_000;
            if is_recorded || from == 0 || channel == channels::RUN_INFO {
                log.write(channel, *t_ns, data).unwrap();
            }
        }
        for (channel, _, data) in RUN.events.iter().filter(|(channel, ..)| is_change(channel)) {
            log.write(channel, 3_300_000_000, data).unwrap();
        }
        log.finish().unwrap();
        path
    };
    for (name, from, ticks) in [("again_whole.mcap", 0, 3300), ("again_late.mcap", 2000, 1299)] {
        let replay = Replay::open(again(name, from)).unwrap();
        for jobs in [1, 2] {
            let report = replay.run(&Options { jobs, ..Options::default() }, &mut |_| {}).unwrap();
            assert!(report.identical, "{name}: {:?}", report.first_divergence.map(|first| first.tick));
            assert_eq!((report.ticks, report.account.late_messages), (ticks, 0), "{name}");
        }
    }
}

/// A live run publishes each change several times within 140 ms, so a lost copy has no effect.
#[test]
fn a_change_whose_first_message_is_lost_is_followed_at_its_tick() {
    let path = path("first_lost.mcap");
    let mut log = LogWriter::create(&path).unwrap();
    let mut held = Vec::new();
    for (channel, t_ns, data) in &RUN.events {
        if channel == channels::PARAMETER_CHANGE {
            held.push((*t_ns + 140_000_000, data));
            continue;
        }
        while let Some((due, data)) = held.pop_if(|(due, _)| *due <= *t_ns) {
            log.write(channels::PARAMETER_CHANGE, due, data).unwrap();
        }
        log.write(channel, *t_ns, data).unwrap();
    }
    log.finish().unwrap();
    let report = Replay::open(&path).unwrap().run(&Options::default(), &mut |_| {}).unwrap();
    assert!(
        report.identical && report.account.late_messages == 0,
        "{:?}",
        report.first_divergence.map(|first| first.tick)
    );
}

#[test]
fn overrides_of_a_replay_stay_in_force_over_the_changes_of_the_log() {
    let path = log("held.mcap", |_, _| true);
    let replay = Replay::open(&path).unwrap();
    // With the initial value held, the replay diverges where the log changes it; with the later value, from the beginning.
    let set = vec![("trunk.kp".to_owned(), "[1000, 1000, 1000]".to_owned())];
    let report = replay.run(&Options { set, bound: Some(1e9), ..Options::default() }, &mut |_| {}).unwrap();
    assert_eq!(report.first_divergence.unwrap().tick, 1201, "the log changes it there");
    let set = vec![("trunk.kp".to_owned(), "[700, 700, 700]".to_owned())];
    let report = replay.run(&Options { set, bound: Some(1e9), ..Options::default() }, &mut |_| {}).unwrap();
    assert_eq!(report.first_divergence.unwrap().tick, 0, "changed from the beginning");
}

#[test]
fn a_part_of_a_log_includes_the_changes_before_it() {
    let whole = log("whole.mcap", |_, _| true);
    let folder = path("corpus");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let mut corpus = replay::corpus::Corpus::open_with(&folder, controller::load).unwrap();
    let part = replay::corpus::Part { around_s: 2.8, span_s: 0.4 };
    corpus.add_part(&whole, Some(part), "part", "test", &[]).unwrap();
    corpus.add(&whole, "whole", "test", &[]).unwrap();
    for result in corpus.check(2) {
        assert!(result.identical && result.ticks > 0, "{result:?}");
    }
}

#[test]
fn an_excerpt_includes_the_changes_before_it() {
    let whole = log("to_trim.mcap", |_, _| true);
    // From the state of tick 1000, with a change on either side of the state of tick 2000; and from that one on.
    for (around_s, ticks, keys) in [(1.8, 1100, &["trunk.kp"][..]), (2.5, 800, &["trunk.kp", "stack.formula"])] {
        let out = path("trimmed.mcap");
        let window = Excerpt::Around { around_s, before_s: 0.3, after_s: 0.3 };
        copy_excerpt(&whole, &out, window, EventFilter::default(), Types::default(), &mut |_| {}).unwrap();
        let kept = LogReader::open(&out).unwrap().events().map(Result::unwrap);
        let kept = kept.filter(|event| *event.channel == *channels::PARAMETER_CHANGE);
        let kept: Vec<String> = kept.map(|event| ParameterChange::decode(&event.data).unwrap().key).collect();
        assert_eq!(kept, keys);
        let report = Replay::open(&out).unwrap().run(&Options::default(), &mut |_| {}).unwrap();
        assert!(report.identical && report.ticks == ticks, "{} ticks: {:?}", report.ticks, report.first_divergence);
    }
}
