//! What happened, of synthetic runs whose every event is chosen.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod common;

use analysis::Run;
use analysis::check::Limits;
use analysis::metrics::Metrics;
use analysis::timeline::{TimelineEntry, What, happenings};
use common::{Plan, late_by_two_from, scratch, write};
use lcmtypes::Event;

fn run_of(name: &str, plan: &Plan) -> Run {
    let path = scratch(name).join("run.mcap");
    write(&path, plan);
    Run::read(&path, &mut |_| ()).unwrap()
}

/// Kind, tick and words of everything that happened.
fn told(run: &Run) -> Vec<(What, Option<i64>, String)> {
    happenings(run).into_iter().map(|TimelineEntry { what, tick, text, .. }| (what, tick, text)).collect()
}

#[test]
fn a_walk_starts_and_is_pushed() {
    let told = told(&run_of("walk", &Plan::default()));
    let expected = [
        (What::Mode, Some(1000), "the controller walks"),
        (What::Event, Some(1000), "scenario: walk <forward>"),
        (What::Push, Some(3000), "the base is pushed for 0.30 s"),
    ];
    assert_eq!(told, expected.map(|(what, tick, text)| (what, tick, text.to_owned())));
}

#[test]
fn losses_are_dated_and_counted() {
    let run = run_of("losses", &Plan { ticks: 900, gap: 300..310, stale: 500, ..Plan::default() });
    let told = told(&run);
    let expected = [
        (What::Gap, Some(299), "10 ticks are missing from the log after this one: 0.011 s"),
        (What::Stale, Some(500), "1 ticks were computed from a state used before"),
        (What::Lost, Some(501), "1 states of the robot did not reach the controller"),
    ];
    assert_eq!(told, expected.map(|(what, tick, text)| (what, tick, text.to_owned())));
}

/// A live run that comes too late for ticks leaves them out: their numbers go on, and nothing is missing from the log.
#[test]
fn ticks_that_were_left_out_are_not_missing() {
    let mut run = run_of("left_out", &Plan { ticks: 900, live: true, ..Plan::default() });
    late_by_two_from(&mut run, 500);
    let told = told(&run);
    let out = (What::Deadline, Some(499), "2 ticks were left out: the controller came too late for them".to_owned());
    assert!(told.contains(&out) && !told.iter().any(|(what, ..)| *what == What::Gap), "{told:?}");
}

#[test]
fn an_event_by_another_clock_is_where_it_stands_in_the_log() {
    let mut run = run_of("clocks", &Plan { ticks: 1200, ..Plan::default() });
    let event = Event { t_ns: 1_795_322_830_386_616_200, tick: -1, text: "lost 4".into(), ..Event::default() };
    run.events.push(Event { source: "recorder".into(), ..event });
    let last = happenings(&run).pop().unwrap();
    assert_eq!((last.t_s, last.tick, &*last.text), (1.0, None, "recorder: lost 4"));
}

#[test]
fn a_fall_its_fault_and_a_missed_deadline_are_told() {
    let run = run_of("fall", &Plan { ticks: 1600, fall: 1500, live: true, ..Plan::default() });
    let bad: Vec<_> = told(&run).into_iter().filter(|(what, ..)| what.is_bad()).collect();
    let expected = [
        (What::Deadline, Some(777), "1 deadlines missed by up to 510 µs, ticks of up to 1500 µs"),
        (What::Fall, Some(1500), "the robot fell"),
        (What::Fault, Some(1510), "tilt, index -1, value 0.7"),
    ];
    assert_eq!(bad, expected.map(|(what, tick, text)| (what, tick, text.to_owned())));
}

#[test]
fn limits_are_kept_or_not_and_unknown_keys_are_errors() {
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
    assert_eq!(error.to_string().split("; near").next().unwrap(), "ci.toml: unknown key `tracking.pich.std`");
    assert!(error.to_string().contains("near: `tracking.pitch.std`"), "{error}");
}
