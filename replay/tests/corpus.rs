//! Golden logs: checked, found changed, accepted.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::toy::{self, Toy};
use lcmtypes::channels::{self, Stage};
use replay::Error;
use replay::corpus::{self, Corpus, Part};
use replay::log::{EventFilter, LogSummary, Types};
use std::path::{Path, PathBuf};

/// A folder with two golden logs of the toy.
fn folder(name: &str) -> PathBuf {
    let dir = common::path(name);
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir(&dir).unwrap();
    let run = common::path(&format!("{name}.mcap"));
    toy::write(&run, &toy::events(500));
    let mut corpus = open(&dir, |toy| toy);
    corpus.add(&run, "trot", "a first run", &[]).unwrap();
    corpus.add(&run, "crawl", "the same with forces", &[channels::CONTACT_ESTIMATE]).unwrap();
    dir
}

fn open<'a>(dir: &Path, change: impl Fn(Toy) -> Toy + Sync + 'a) -> Corpus<'a> {
    Corpus::open_with(dir, move |info| Ok(toy::component(change(toy::toy(info)?)))).unwrap()
}

fn mutant(toy: Toy) -> Toy {
    Toy { mutant: Some((Stage::Estimation, 123)), ..toy }
}

#[test]
fn a_golden_log_keeps_what_a_replay_needs() {
    let dir = folder("keeps");
    let counts = |file: &str| -> Vec<_> {
        let channels = LogSummary::read(dir.join(file)).unwrap().channels;
        channels.into_iter().map(|channel| (channel.name, channel.count)).collect()
    };
    let kept = |contacts: u64| {
        let rest = [("CONTROLLER_SNAPSHOT", 5), ("CONTROLLER_TICK", 500), ("ROBOT_COMMAND", 25), ("RUN_INFO", 1)];
        let all = [("CONTACT_ESTIMATE", contacts), ("CONTROLLER_INPUT", 500)].into_iter().chain(rest);
        all.chain([("WBC_SOLUTION", 25)]).map(|(name, count)| (name.to_owned(), count)).collect::<Vec<_>>()
    };
    assert_eq!(counts("trot.mcap"), kept(25));
    // Requested channels are stored for every tick, also when the log is recorded again.
    assert_eq!(counts("crawl.mcap"), kept(500));
    for name in ["trot", "crawl"] {
        let bytes = || std::fs::read(dir.join(format!("{name}.mcap"))).unwrap();
        let before = bytes();
        open(&dir, |toy| toy).accept(name, "no reason").unwrap();
        assert!(bytes() == before, "{name}");
    }
    let readme = std::fs::read_to_string(dir.join("README.md")).unwrap();
    assert!(readme.contains("| trot |") && readme.contains("| no reason |"), "{readme}");
}

#[test]
fn an_unchanged_controller_passes_and_a_changed_one_does_not() {
    let dir = folder("check");
    let results = open(&dir, |toy| toy).check(2);
    assert_eq!(
        results.iter().map(|r| (&*r.name, r.identical, r.ticks)).collect::<Vec<_>>(),
        [("crawl", true, 500), ("trot", true, 500),]
    );
    let places: Vec<_> = open(&dir, mutant)
        .check(1)
        .into_iter()
        .map(|result| {
            assert!(!result.identical);
            let first = result.first_divergence.unwrap();
            (first.tick, first.stage, first.channel, first.field)
        })
        .collect();
    let at = |channel: &str, field: &str| (123, "estimation".to_owned(), channel.to_owned(), field.to_owned());
    assert_eq!(places, [at("CONTACT_ESTIMATE", "f_F_W"), at("CONTROLLER_TICK", "digest_estimation")]);
}

/// What was kept of the outputs, and the same of today's.
#[test]
fn a_changed_log_can_be_laid_beside_what_it_was() {
    let dir = folder("sides");
    let [before, after] = ["before", "after"].map(|side| dir.join(format!("{side}.mcap")));
    open(&dir, mutant).sides("trot", &before, &after).unwrap();
    let none = EventFilter::default();
    let diff = replay::log::diff(&before, &after, &none, Types::default(), &mut |_| {}).unwrap();
    let found: Vec<_> =
        diff.channels.iter().map(|c| (&*c.name, c.left, c.right, c.first.as_ref().map(|f| f.number))).collect();
    let (same, changed) = (None, Some(140));
    let expected = [
        ("CONTACT_ESTIMATE", 25, 25, changed),
        ("CONTROLLER_INPUT", 25, 25, same),
        ("CONTROLLER_TICK", 25, 25, changed),
        ("ROBOT_COMMAND", 25, 25, changed),
        ("RUN_INFO", 1, 1, same),
        ("WBC_SOLUTION", 25, 25, changed),
    ];
    assert_eq!(found, expected);
    // Two logs, manifest and page, and the two sides.
    assert_eq!(std::fs::read_dir(&dir).unwrap().count(), 6);
}

#[test]
fn a_change_that_is_meant_is_accepted() {
    let dir = folder("accept");
    let before = std::fs::read(dir.join("trot.mcap")).unwrap();
    let mut corpus = open(&dir, mutant);
    let accepted = corpus.accept("trot", "a better estimator").unwrap();
    assert_eq!(accepted.before.first_divergence.unwrap().tick, 123);
    assert_eq!(accepted.bytes_before, before.len() as u64);
    let identical = |corpus: Corpus| corpus.check(1).into_iter().map(|result| result.identical).collect::<Vec<_>>();
    assert_eq!(identical(open(&dir, mutant)), [false, true]);
    assert_eq!(identical(open(&dir, |toy| toy)), [true, false]);
    assert!(std::fs::read_to_string(dir.join("corpus.toml")).unwrap().contains("a better estimator"));
    // Nothing but the logs, the manifest and the page is left.
    assert_eq!(std::fs::read_dir(&dir).unwrap().count(), 4);
    // Accepted back, the file has the bytes that it had.
    open(&dir, |toy| toy).accept("trot", "not better after all").unwrap();
    assert!(std::fs::read(dir.join("trot.mcap")).unwrap() == before);
}

/// A type of an output has changed since: nothing can be compared, but the inputs still stand for themselves.
#[test]
fn a_log_of_another_version_can_be_recorded_again() {
    let dir = folder("version");
    let mut events = toy::events(500);
    events.iter_mut().filter(|(c, ..)| c == channels::CONTROLLER_TICK).for_each(|(.., data)| data[7] ^= 1);
    toy::write(&dir.join("trot.mcap"), &events);
    let mut corpus = open(&dir, |toy| toy);
    let accepted = corpus.accept("trot", "a field more").unwrap();
    assert!(accepted.before.error.unwrap().contains("another type version"));
    assert!(corpus.check(1).iter().all(|result| result.identical));
}

#[test]
fn a_golden_log_with_a_hole_does_not_pass() {
    let dir = folder("hole");
    let path = dir.join("trot.mcap");
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 40]).unwrap();
    std::fs::remove_file(dir.join("crawl.mcap")).unwrap();
    let [crawl, trot] = &open(&dir, |toy| toy).check(1)[..] else { panic!("two logs") };
    assert!(!trot.identical && trot.error.is_some(), "{trot:?}");
    assert!(crawl.error.as_ref().unwrap().contains("crawl.mcap"), "{crawl:?}");
}

#[test]
fn what_the_manifest_does_not_know_is_refused() {
    let dir = folder("names");
    let error = open(&dir, |toy| toy).accept("gallop", "").unwrap_err();
    assert!(matches!(error, Error::UnknownGolden { .. }) && error.to_string().contains("crawl, trot"), "{error}");
    let error = open(&dir, |toy| toy).add(&dir.join("trot.mcap"), "trot", "", &[]).unwrap_err();
    assert!(matches!(error, Error::Manifest { .. }), "{error}");
    std::fs::write(dir.join("corpus.toml"), "[[log]]\nname = 3").unwrap();
    assert!(matches!(corpus::check(&dir, 1), Err(Error::Manifest { .. })));
    assert!(matches!(corpus::check(dir.join("nowhere"), 1), Err(Error::Io { .. })));
}

/// A part from the middle: the recorded state before it, then its ticks; it is checked and accepted as any other.
#[test]
fn a_part_of_a_field_log_becomes_a_golden_log() {
    let dir = folder("part");
    let run = common::path("part.mcap");
    let part = Part { around_s: 0.36, span_s: 0.04 };
    let mut corpus = open(&dir, |toy| toy);
    corpus.add_part(&run, Some(part), "stumble", "the field bug", &[]).unwrap();
    let of = |corpus: &Corpus| corpus.check(2).into_iter().find(|result| result.name == "stumble").unwrap();
    // From behind the state of tick 299 to tick 380.
    let result = of(&corpus);
    assert_eq!((result.identical, result.ticks, result.error), (true, 81, None));
    let late = |toy: Toy| Toy { mutant: Some((Stage::Gait, 350)), ..toy };
    let mut changed = open(&dir, late);
    let first = of(&changed).first_divergence.unwrap();
    assert_eq!((first.tick, &*first.stage, first.last_agreed_tick), (350, "gait", Some(349)));
    changed.accept("stumble", "meant").unwrap();
    assert!(of(&changed).identical);
    assert_eq!(of(&open(&dir, |toy| toy)).first_divergence.unwrap().tick, 350);

    let beyond = Part { around_s: 3.0, span_s: 1.0 };
    let error = corpus.add_part(&run, Some(beyond), "late", "", &[]).unwrap_err();
    assert!(matches!(error, Error::BeyondEnd { .. }), "{error}");
}

#[test]
fn a_golden_log_that_was_exchanged_is_noticed() {
    let dir = folder("exchanged");
    std::fs::copy(dir.join("crawl.mcap"), dir.join("trot.mcap")).unwrap();
    let [crawl, trot] = &open(&dir, |toy| toy).check(1)[..] else { panic!("two logs") };
    assert!(crawl.identical && !crawl.altered);
    assert_eq!((trot.identical, trot.altered), (false, true));
    assert_eq!(trot.error.as_deref(), Some("not the file that was accepted"));
}
