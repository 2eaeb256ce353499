//! Timelines of synthetic runs with known events.

#![allow(clippy::unwrap_used, reason = "a test stops at the first error")]

mod common;

use analysis::Run;
use analysis::check::Limits;
use analysis::metrics::Metrics;
use analysis::timeline::{EntryKind, TimelineEntry, entries};
use common::{Plan, late_by_two_from, scratch, write};
use lcmtypes::Event;

fn run_of(name: &str, plan: &Plan) -> Run {
    let path = scratch(name).join("run.mcap");
    write(&path, plan);
    Run::read(&path, &mut |_| ()).unwrap()
}

/// Kind and tick of every entry, and the whole numbers in its text.
fn summary(run: &Run) -> Vec<(EntryKind, Option<i64>, Vec<i64>)> {
    let numbers = |text: &str| text.split([' ', ',', ';', '(']).filter_map(|part| part.parse().ok()).collect();
    entries(run).into_iter().map(|TimelineEntry { what, tick, text, .. }| (what, tick, numbers(&text))).collect()
}

#[test]
fn a_walk_starts_and_is_pushed() {
    let timeline = summary(&run_of("walk", &Plan::default()));
    let expected = [
        (EntryKind::Mode, Some(1000), vec![]),
        (EntryKind::Event, Some(1000), vec![]),
        (EntryKind::Push, Some(3000), vec![]),
    ];
    assert_eq!(timeline, expected);
}

#[test]
fn gaps_and_losses_have_tick_and_count() {
    let run = run_of("losses", &Plan { ticks: 900, gap: 300..310, stale: 500, ..Plan::default() });
    let timeline = summary(&run);
    let expected = [
        (EntryKind::Gap, Some(299), vec![10]),
        (EntryKind::Stale, Some(500), vec![1]),
        (EntryKind::Lost, Some(501), vec![1]),
    ];
    assert_eq!(timeline, expected);
}

/// A live run that is late skips ticks: the numbers of its ticks are consecutive, and no message is missing in the log.
#[test]
fn skipped_ticks_are_no_gap() {
    let mut run = run_of("skipped", &Plan { ticks: 900, live: true, ..Plan::default() });
    late_by_two_from(&mut run, 500);
    let timeline = summary(&run);
    let skipped = (EntryKind::Deadline, Some(499), vec![2]);
    assert!(timeline.contains(&skipped) && !timeline.iter().any(|(what, ..)| *what == EntryKind::Gap), "{timeline:?}");
}

#[test]
fn an_event_of_another_clock_gets_the_time_of_the_event_before_it() {
    let mut run = run_of("clocks", &Plan { ticks: 1200, ..Plan::default() });
    let event = Event { t_ns: 1_795_322_830_386_616_200, tick: -1, text: "lost 4".into(), ..Event::default() };
    run.events.push(Event { source: "recorder".into(), ..event });
    let last = entries(&run).pop().unwrap();
    assert_eq!((last.t_s, last.tick, &*last.text), (1.0, None, "recorder: lost 4"));
}

#[test]
fn fall_fault_and_missed_deadline_are_listed() {
    let run = run_of("fall", &Plan { ticks: 1600, fall: 1500, live: true, ..Plan::default() });
    let problems: Vec<_> = summary(&run).into_iter().filter(|(what, ..)| what.is_problem()).collect();
    let expected = [
        (EntryKind::Deadline, Some(777), vec![1, 510, 1500]),
        (EntryKind::Fall, Some(1500), vec![]),
        (EntryKind::Fault, Some(1510), vec![-1]),
    ];
    assert_eq!(problems, expected);
}

#[test]
fn limits_are_judged_and_unknown_keys_are_errors() {
    let metrics = Metrics::of(&run_of("limits", &Plan::default()));
    let limits = "[limits]\n\"tracking.pitch.mean\" = 0.0\n\"tracking.roll.rms\" = 0.003\n\"safety.fell\" = { equals = false }\n\
                  \"tracking.feet.RH.x.mean\" = { min = 0.0199, max = 0.0201 }\n\"timing.stages.QP.us.count\" = { equals = 4000 }\n\
                  \"run.robot\" = { equals = \"hyq\" }\n\"safety.fell_at_s\" = 9.0\n";
    let verdicts = Limits::parse(limits, "ci.toml").unwrap().check(&metrics).unwrap();
    let kept: Vec<bool> = verdicts.iter().map(|verdict| verdict.pass).collect();
    assert_eq!(verdicts.iter().map(|v| v.key.as_str()).collect::<Vec<_>>().len(), 7);
    for (verdict, pass) in verdicts.iter().zip(&kept) {
        // A fall that did not happen has no time; the roll error is 0.004 rad.
        let fails = ["tracking.roll.rms", "safety.fell_at_s"].contains(&verdict.key.as_str());
        assert_eq!(*pass, !fails, "{verdict:?}");
    }
    let error = Limits::parse("[limits]\n\"tracking.pich.std\" = 1", "ci.toml").unwrap().check(&metrics).unwrap_err();
    assert_eq!(error.to_string().split(';').next().unwrap(), "ci.toml: unknown key `tracking.pich.std`");
    assert!(error.to_string().contains("`tracking.pitch.std`"), "{error}");
}

/// A damaged or foreign message can hold any number.
#[test]
fn extreme_times_and_ticks_overflow_nothing() {
    let dir = scratch("extreme");
    let (whole, out) = (dir.join("ordinary.mcap"), dir.join("extreme.mcap"));
    write(&whole, &Plan { ticks: 1100, live: true, ..Plan::default() });
    let extremes = [i64::MIN, i64::MIN + 1, -1, 0, i64::MAX - 1, i64::MAX];
    for from in 0..extremes.len() {
        let mut log = replay::log::LogWriter::create(&out).unwrap();
        for (i, event) in replay::log::LogReader::open(&whole).unwrap().events().enumerate() {
            let mut event = event.unwrap();
            // Eight bytes each: time, tick or sequence number; of TIMING also the clock readings.
            let numbers = if *event.channel == *lcmtypes::channels::TIMING { 1..8 } else { 1..3 };
            if i % 5 == 0 && *event.channel != *lcmtypes::channels::RUN_INFO {
                for word in numbers {
                    let extreme = extremes[(from + i / 5 + word) % extremes.len()];
                    event.data[8 * word..8 * word + 8].copy_from_slice(&extreme.to_be_bytes());
                }
            }
            log.write(&event.channel, event.t_ns, &event.data).unwrap();
        }
        log.finish().unwrap();
        let run = Run::read(&out, &mut |_| {}).unwrap();
        assert!(run.ticks.len() > 1000);
        let _ = (entries(&run), Metrics::of(&run));
    }
}
