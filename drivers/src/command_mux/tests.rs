//! Tests of the command multiplexer.

use super::*;

const MS: i64 = 1_000_000;
const PAD: usize = 0;
const KEYS: usize = 1;
const PLANNER: usize = 2;

/// Three sources with decreasing priority.
fn mux() -> CommandMux {
    let source = |channel: &str, priority, timeout_s| Source { channel: channel.to_owned(), priority, timeout_s };
    CommandMux::new(vec![source("PAD", 30, 0.1), source("KEYS", 20, 0.25), source("PLANNER", 10, 1.0)]).unwrap()
}

fn command(mode: i8, seq: i64) -> OperatorCommand {
    OperatorCommand { mode, seq, t_ns: seq * 20 * MS, ..OperatorCommand::default() }
}

fn walk(seq: i64) -> OperatorCommand {
    command(OperatorCommand::MODE_WALK, seq)
}

fn stop(seq: i64) -> OperatorCommand {
    command(OperatorCommand::MODE_DAMPING, seq)
}

fn stand(seq: i64) -> OperatorCommand {
    command(OperatorCommand::MODE_STAND, seq)
}

/// Source, seq and arrival in ms of the selected command.
fn selected(mux: &mut CommandMux, ms: i64) -> Option<(usize, i64, i64)> {
    mux.select(ms * MS).map(|found| (found.source, found.command.seq, found.arrival_ns / MS))
}

fn transitions(mux: &mut CommandMux) -> Vec<Transition> {
    std::iter::from_fn(|| mux.transition()).collect()
}

/// A command of another sender, whose mode was requested at `request_ms` of its own clock.
fn of(sender_id: i64, seq: i64, mode: i8, t_ms: i64, request_ms: i64) -> OperatorCommand {
    OperatorCommand { sender_id, t_ns: t_ms * MS, t_mode_ns: request_ms * MS, ..command(mode, seq) }
}

const STAND: i8 = OperatorCommand::MODE_STAND;
const WALK: i8 = OperatorCommand::MODE_WALK;
const STOP: i8 = OperatorCommand::MODE_DAMPING;
const IDLE: i8 = OperatorCommand::MODE_IDLE;

#[test]
fn the_highest_priority_is_active_until_it_times_out() {
    let mut a = mux();
    assert_eq!(selected(&mut a, 0), None);
    a.receive(PLANNER, 10 * MS, &walk(7));
    assert_eq!(selected(&mut a, 12), Some((PLANNER, 7, 10)));
    assert_eq!(transitions(&mut a), [Transition::Activated(PLANNER)]);
    a.receive(PAD, 20 * MS, &walk(1));
    a.receive(PLANNER, 30 * MS, &walk(8));
    assert_eq!(selected(&mut a, 120), Some((PAD, 1, 20)), "100 ms after its command, its time-out");
    let ignored = |why| Transition::Ignored(PLANNER, WALK, why);
    assert_eq!(transitions(&mut a), [ignored(Ignored::OtherActive(PAD)), Transition::Activated(PAD)]);
    assert_eq!(selected(&mut a, 121), Some((PAD, 1, 20)), "the planner requested WALK before");
    assert_eq!(a.ignored(PLANNER, 0), Some(Ignored::Overridden(PAD)));
    assert_eq!(transitions(&mut a), [Transition::TimedOut(PAD)]);
    a.receive(PLANNER, 130 * MS, &stand(9));
    assert_eq!(selected(&mut a, 131), Some((PLANNER, 9, 130)), "a new request");
    assert_eq!(transitions(&mut a), [Transition::Activated(PLANNER)]);
    assert_eq!(transitions(&mut a), [], "once");
}

#[test]
fn the_last_command_is_kept_when_all_have_timed_out() {
    let mut a = mux();
    a.receive(KEYS, 10 * MS, &walk(3));
    assert_eq!(selected(&mut a, 11), Some((KEYS, 3, 10)));
    assert_eq!(transitions(&mut a), [Transition::Activated(KEYS)]);
    assert_eq!(selected(&mut a, 5001), Some((KEYS, 3, 10)));
    assert_eq!(transitions(&mut a), [Transition::TimedOut(KEYS)]);
    a.receive(KEYS, 5020 * MS, &walk(4));
    assert_eq!(selected(&mut a, 5020), Some((KEYS, 4, 5020)));
    assert_eq!(transitions(&mut a), [Transition::Activated(KEYS)]);
}

#[test]
fn an_emergency_stop_overrides_priorities_and_only_its_sender_clears_it() {
    let mut a = mux();
    a.receive(PAD, 0, &walk(1));
    assert_eq!(selected(&mut a, 1), Some((PAD, 1, 0)));
    a.receive(PLANNER, 5 * MS, &stop(2));
    assert_eq!(selected(&mut a, 6), Some((PLANNER, 2, 6)));
    for ms in 1..500 {
        a.receive(PAD, ms * 20 * MS, &stand(ms + 1));
        assert_eq!(selected(&mut a, ms * 20 + 1), Some((PLANNER, 2, ms * 20 + 1)), "timed out, but in force");
    }
    let stops = |t: &Transition| matches!(t, Transition::StopTriggered(_) | Transition::StopCleared(_));
    let changes = |mux: &mut CommandMux| transitions(mux).into_iter().filter(stops).collect::<Vec<_>>();
    assert_eq!(changes(&mut a), [Transition::StopTriggered(PLANNER)]);
    a.receive(PLANNER, 10_000 * MS, &command(IDLE, 3));
    assert_eq!(changes(&mut a), [Transition::StopCleared(PLANNER)]);
    assert_eq!(selected(&mut a, 10_001), Some((PLANNER, 3, 10_000)), "STAND was requested during the stop");
    a.receive(PAD, 10_010 * MS, &walk(600));
    assert_eq!(selected(&mut a, 10_011), Some((PAD, 600, 10_010)));
}

/// Two teleoperations on one channel: the second one's stop is not taken back by the first, which repeats WALK all the time.
#[test]
fn senders_on_one_channel_are_distinguished() {
    let mut a = mux();
    a.receive(KEYS, 0, &of(1, 0, WALK, 0, 0));
    a.receive(KEYS, 100 * MS, &of(2, 0, STAND, 100, 100));
    a.receive(KEYS, 101 * MS, &of(1, 1, WALK, 101, 0));
    assert_eq!(selected(&mut a, 102), Some((KEYS, 1, 101)), "the first one is active");
    assert_eq!(a.ignored(KEYS, 2), Some(Ignored::OtherActive(KEYS)));
    a.receive(KEYS, 200 * MS, &of(2, 1, STOP, 200, 200));
    for k in 1..100 {
        a.receive(KEYS, (200 + 20 * k) * MS, &of(1, 1 + k, WALK, 200 + 20 * k, 0));
        assert_eq!(a.select(200 * MS + k * 20 * MS).map(|found| found.command.sender_id), Some(2));
    }
    assert!(transitions(&mut a).len() < 6, "no flood of reports");
    // While the sender of the stop is alive, not even a new request for IDLE of the other one clears it.
    a.receive(KEYS, 2200 * MS, &of(2, 2, STOP, 2200, 200));
    a.receive(KEYS, 2210 * MS, &of(1, 200, IDLE, 2210, 2210));
    assert_eq!(a.select(2211 * MS).map(|found| found.command.mode), Some(STOP));
    // Its process has ended: a new request for IDLE clears it, another one does not.
    a.receive(KEYS, 3000 * MS, &of(1, 201, STAND, 3000, 3000));
    assert_eq!(a.select(3001 * MS).map(|found| found.command.mode), Some(STOP));
    a.receive(KEYS, 3010 * MS, &of(1, 202, IDLE, 3010, 3010));
    assert_eq!(a.select(3011 * MS).map(|found| (found.command.sender_id, found.command.mode)), Some((1, IDLE)));
}

#[test]
fn requests_from_before_the_run_are_ignored_until_they_are_made_again() {
    let mut a = mux();
    a.start(1000 * MS);
    a.receive(PAD, 1010 * MS, &of(1, 90, STAND, 5010, 3000));
    assert_eq!(selected(&mut a, 1011), None, "requested two seconds before, on its own clock");
    let ignored = Transition::Ignored(PAD, STAND, Ignored::BeforeRun);
    assert_eq!(transitions(&mut a), [ignored], "reported although no operator is active");
    a.receive(KEYS, 1020 * MS, &of(2, 0, WALK, 1020, 1015));
    assert_eq!(selected(&mut a, 1021), Some((KEYS, 0, 1020)));
    assert_eq!(a.ignored(PAD, 1), Some(Ignored::BeforeRun));
    // A sender that gives no time of its request, and whose first message this is not.
    a.receive(PLANNER, 1030 * MS, &OperatorCommand { sender_id: 3, ..walk(40) });
    assert_eq!(selected(&mut a, 1031), Some((KEYS, 0, 1020)));
    assert_eq!(a.ignored(PLANNER, 3), Some(Ignored::BeforeRun));
    a.receive(PAD, 1040 * MS, &of(1, 91, STAND, 5040, 5035));
    assert_eq!(selected(&mut a, 1041), Some((PAD, 91, 1040)), "requested again");
    a.receive(PLANNER, 1050 * MS, &of(3, 41, STOP, 1050, 0));
    assert_eq!(a.select(1051 * MS).map(|found| found.command.mode), Some(STOP), "a stop is never ignored");
}

#[test]
fn a_new_selection_is_another_command_than_before() {
    let mut a = mux();
    let new =
        |a: &mut CommandMux, ms: i64| a.new_selection(ms * MS).map(|c| (c.source, c.command.seq, c.arrival_ns / MS));
    assert_eq!(new(&mut a, 0), None);
    a.receive(KEYS, MS, &walk(1));
    assert_eq!(new(&mut a, 2), Some((KEYS, 1, 1)));
    assert_eq!(new(&mut a, 2000), None, "a time-out is no new command");
    a.receive(KEYS, 2001 * MS, &walk(1));
    assert_eq!(new(&mut a, 2001), Some((KEYS, 1, 2001)), "the same command, received again");
    a.receive(PLANNER, 2002 * MS, &stop(1));
    assert_eq!(new(&mut a, 2002), Some((PLANNER, 1, 2002)));
    assert_eq!(new(&mut a, 2021), None);
    assert_eq!(new(&mut a, 2022), Some((PLANNER, 1, 2022)), "in force");
}

#[test]
fn each_emergency_stop_is_cleared_by_its_own_source() {
    let mut a = mux();
    a.receive(PAD, 0, &stop(1));
    a.receive(KEYS, 0, &stop(1));
    assert_eq!(selected(&mut a, 1), Some((PAD, 1, 1)));
    a.receive(PAD, 2 * MS, &stand(2));
    assert_eq!(selected(&mut a, 3), Some((KEYS, 1, 3)));
}

#[test]
fn an_older_command_does_not_clear_an_emergency_stop() {
    let mut a = mux();
    a.receive(KEYS, 0, &stop(9));
    a.receive(KEYS, MS, &walk(8));
    assert_eq!(selected(&mut a, 2), Some((KEYS, 9, 2)));
    a.receive(KEYS, 2 * MS, &walk(10));
    assert_eq!(selected(&mut a, 3), Some((KEYS, 10, 2)));
    a.receive(KEYS, 4 * MS, &stop(9));
    assert_eq!(selected(&mut a, 5), Some((KEYS, 9, 5)), "an older command, but an emergency stop");
}

#[test]
fn a_sender_may_be_restarted() {
    let mut a = mux();
    a.receive(KEYS, 1000 * MS, &walk(50));
    // Before its time-out with a clock that continues, and after it with a clock that was reset.
    a.receive(KEYS, 1020 * MS, &OperatorCommand { t_ns: 1020 * MS, ..walk(0) });
    assert_eq!(selected(&mut a, 1020), Some((KEYS, 0, 1020)));
    a.receive(KEYS, 1300 * MS, &OperatorCommand { t_ns: 1, ..walk(0) });
    assert_eq!(selected(&mut a, 1300), Some((KEYS, 0, 1300)));
}

#[test]
fn many_senders_use_bounded_memory_and_a_stop_always_has_room() {
    let mut a = mux();
    for sender_id in 0..1000 {
        a.receive(KEYS, MS, &of(sender_id, 0, WALK, 1, 1));
        assert_eq!(a.select(2 * MS).map(|found| found.command.sender_id), Some(0));
    }
    assert_eq!(a.senders.len(), MAX_SENDERS);
    a.receive(KEYS, 3 * MS, &of(5000, 0, STOP, 3, 3));
    assert_eq!(a.select(4 * MS).map(|found| found.command.sender_id), Some(5000));
}

#[test]
fn of_equal_priorities_the_first_listed_is_active() {
    let source = |channel: &str| Source { channel: channel.to_owned(), priority: 1, timeout_s: 0.1 };
    let mut a = CommandMux::new(vec![source("A"), source("B")]).unwrap();
    a.receive(1, 0, &walk(1));
    a.receive(0, 0, &walk(1));
    assert_eq!(selected(&mut a, 1), Some((0, 1, 0)));
    assert_eq!((a.source_of("B"), a.source_of("C")), (Some(1), None));
}

#[test]
fn transitions_are_reported_with_the_channel() {
    let a = mux();
    for transition in [
        Transition::Activated(PLANNER),
        Transition::TimedOut(PLANNER),
        Transition::StopTriggered(PLANNER),
        Transition::StopCleared(PLANNER),
        Transition::Ignored(PLANNER, WALK, Ignored::OtherActive(PAD)),
        Transition::Ignored(PLANNER, WALK, Ignored::OtherActive(PLANNER)),
        Transition::Ignored(PLANNER, WALK, Ignored::BeforeRun),
        Transition::Ignored(PLANNER, WALK, Ignored::Overridden(PAD)),
    ] {
        assert!(a.text(transition).contains("PLANNER"));
    }
}

#[test]
fn invalid_sources_are_refused_by_name() {
    let read = |text: &str| -> Result<CommandMux, String> {
        #[derive(Deserialize)]
        struct File {
            #[serde(default)]
            operator: Vec<Source>,
        }
        let file: File = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        CommandMux::new(file.operator).map_err(|error| error.to_string())
    };
    let pad = "[[operator]]\nchannel = \"PAD\"\npriority = 3\n";
    assert_eq!(read(pad).unwrap().sources()[0].timeout_s, 0.25);
    for (text, names) in [
        (String::new(), vec!["[[operator]]"]),
        (format!("{pad}{pad}"), vec!["[[operator]] PAD"]),
        (format!("{pad}timeout_s = 0.0\n"), vec!["[[operator]] PAD", "timeout_s is 0", "0.02 to 60"]),
        (format!("{pad}timeout_s = nan\n"), vec!["[[operator]] PAD", "timeout_s is NaN", "0.02 to 60"]),
        (pad.replace("PAD", ""), vec!["[[operator]] \"\""]),
        (pad.replace("PAD", "P.*"), vec!["[[operator]] \"P.*\""]),
        (format!("{pad}timeout = 1\n"), vec!["`timeout`", "`channel`, `priority`, `timeout_s`"]),
    ] {
        let error = read(&text).unwrap_err();
        assert!(names.iter().all(|name| error.contains(name)), "{names:?}: {error}");
    }
}
