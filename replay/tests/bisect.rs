//! Bisection in a repository of 20 revisions, with a shell command as test.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use replay::Error;
use replay::bisect::{Cause, Found, Options, Verdict, bisect, recorded_revision, replay_with_revision};
use std::path::{Path, PathBuf};
use std::process::Command;

fn git(dir: &Path, args: &[&str]) -> String {
    let mut command = Command::new("git");
    command
        .arg("-C")
        .arg(dir)
        .args(["-c", "user.name=t", "-c", "user.email=t@t", "-c", "commit.gpgsign=false"])
        .args(args);
    let output = command.env_remove("GIT_DIR").env_remove("GIT_INDEX_FILE").output().unwrap();
    assert!(output.status.success(), "git {args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

/// Revisions 0 to 20. In revision 13 the code changes a bit; parameters and flags change too but have no effect.
fn repository(name: &str) -> (PathBuf, Vec<String>) {
    let dir = common::path(name);
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(dir.join("controller")).unwrap();
    std::fs::create_dir_all(dir.join("robots")).unwrap();
    git(&dir, &["init", "--quiet"]);
    let revisions = (0..=20).map(|i| {
        std::fs::write(dir.join("controller/step.rs"), if i < 13 { "tau = 1.0" } else { "tau = 1.0000000000000002" })
            .unwrap();
        std::fs::write(dir.join("notes.md"), format!("revision {i}")).unwrap();
        if i == 13 {
            std::fs::write(dir.join("robots/a.toml"), "friction = 0.8").unwrap();
            std::fs::write(dir.join("Cargo.toml"), "opt-level = 3").unwrap();
        }
        if i == 8 {
            std::fs::write(dir.join("broken"), "").unwrap();
        } else if i == 9 {
            std::fs::remove_file(dir.join("broken")).unwrap();
        }
        git(&dir, &["add", "--all"]);
        git(&dir, &["commit", "--quiet", "--message", &format!("revision {i}")]);
        git(&dir, &["rev-parse", "HEAD"])
    });
    let revisions = revisions.collect();
    (dir, revisions)
}

fn search(name: &str, repository: &Path, good: &str, bad: &str, run: &str) -> Result<Found, Error> {
    let options = Options {
        log: common::path("any.mcap"),
        repository: repository.into(),
        good: good.into(),
        bad: bad.into(),
        work: common::path(&format!("{name}_work")),
        run: Some(run.into()),
    };
    bisect(&options, &mut |_, _| {})
}

#[test]
fn a_seeded_change_is_found_among_twenty_revisions() {
    let (dir, revisions) = repository("twenty");
    let run = "test -e broken && exit 125; grep -q 'tau = 1.0$' controller/step.rs";
    let found = search("twenty", &dir, &revisions[0], "HEAD", run).unwrap();
    let [bad] = &found.first_bad[..] else { panic!("{found:?}") };
    assert_eq!((&bad.revision, &*bad.subject), (&revisions[13], "revision 13"));
    assert_eq!(found.revisions, 20);
    assert_eq!(found.causes, [Cause::Code]);
    // Both ends, and bisection of 20 revisions.
    assert!(found.tried.len() <= 2 + 5, "{:?}", found.tried);
    // The repository is unchanged.
    assert_eq!(git(&dir, &["worktree", "list"]).lines().count(), 1);
}

#[test]
fn the_kind_of_change_that_caused_it_is_found() {
    let (dir, revisions) = repository("causes");
    let causes = |run: &str| search("causes", &dir, &revisions[12], &revisions[13], run).unwrap().causes;
    assert_eq!(causes("! test -e Cargo.toml"), [Cause::Build]);
    assert_eq!(causes("! test -e robots/a.toml"), [Cause::Configuration]);
    assert_eq!(causes("grep -q 'tau = 1.0$' controller/step.rs"), [Cause::Code]);
    // Only the combination causes it.
    assert_eq!(
        causes("! test -e Cargo.toml || ! test -e robots/a.toml"),
        [Cause::Build, Cause::Configuration, Cause::Code]
    );
    assert_eq!(causes("test -e Cargo.toml || exit 0; echo no CONTROLLER_INPUT; exit 1"), [Cause::MissingInput]);
}

#[test]
fn skipped_revisions_are_reported_with_the_first_bad_one() {
    let (dir, revisions) = repository("skipped");
    let run = "test -e broken && exit 125; ! grep -q -E ' (9|1[0-9]|20)$' notes.md";
    let found = search("skipped", &dir, &revisions[0], &revisions[20], run).unwrap();
    let verdicts: Vec<(&str, Verdict)> = found.first_bad.iter().map(|o| (&*o.subject, o.verdict)).collect();
    assert_eq!(verdicts, [("revision 8", Verdict::Skipped), ("revision 9", Verdict::Bad)]);
}

#[test]
fn an_impossible_search_is_an_error() {
    let (dir, revisions) = repository("nothing");
    let error = |good: &str, bad: &str, run: &str| search("nothing", &dir, good, bad, run).unwrap_err();
    let why = |good: &str, bad: &str, run: &str| match error(good, bad, run) {
        Error::Bisect { why, .. } => why,
        other => panic!("{other}"),
    };
    // Both revisions have the same outcome, the good one is bad, the bad one is before the good one.
    assert!(why(&revisions[0], &revisions[5], "true").contains(&revisions[5]));
    assert!(why(&revisions[0], &revisions[5], "echo sorry; false").ends_with("sorry"));
    assert!(why(&revisions[5], &revisions[0], "true").contains(&revisions[0]));
    assert!(why("nowhere", &revisions[0], "true").contains("\"nowhere\""));
    assert!(why(&revisions[0], "--all", "true").contains("\"--all\""));
}

/// A repository whose package `replay` has an example that prints `text` and exits with `code`.
fn buildable(dir: &Path, text: &str, code: i32) -> String {
    let package = dir.join("replay");
    std::fs::create_dir_all(package.join("examples")).unwrap();
    std::fs::create_dir_all(package.join("src")).unwrap();
    std::fs::write(dir.join("Cargo.toml"), "[workspace]\nmembers = [\"replay\"]\nresolver = \"2\"\n").unwrap();
    std::fs::write(
        package.join("Cargo.toml"),
        "[package]\nname = \"replay\"\nversion = \"0.1.0\"\nedition = \"2021\"\n",
    )
    .unwrap();
    std::fs::write(package.join("src/lib.rs"), "").unwrap();
    // The corpus holds the log under the name that its manifest gives.
    let main = format!(
        "fn main() {{\n    let dir = std::env::args().nth(1).unwrap();\n    std::fs::read(format!(\"{{dir}}/log.mcap\")).unwrap();\n    \
         assert!(std::fs::read_to_string(format!(\"{{dir}}/corpus.toml\")).unwrap().contains(\"log.mcap\"));\n    \
         println!(\"{text}\");\n    std::process::exit({code});\n}}\n"
    );
    std::fs::write(package.join("examples/replay_golden.rs"), main).unwrap();
    if !dir.join(".git").exists() {
        git(dir, &["init", "--quiet"]);
    }
    git(dir, &["add", "--all"]);
    git(dir, &["commit", "--quiet", "--message", text]);
    git(dir, &["rev-parse", "HEAD"])
}

#[test]
fn a_log_is_replayed_by_the_revision_that_wrote_it() {
    use common::toy;
    use lcmtypes::{Message, RunInfo};
    let (dir, work, log) = (common::path("recorded"), common::path("recorded_work"), common::path("recorded.mcap"));
    [&dir, &work].iter().for_each(|dir| drop(std::fs::remove_dir_all(dir)));
    let wrote = buildable(&dir, "log: identical: 3 ticks", 0);
    let later = buildable(&dir, "log: differs from tick 2", 1);
    let mut events = toy::events(10);
    let info = RunInfo { revision: wrote.clone(), ..RunInfo::decode(&events[0].2).unwrap() };
    events[0].2 = toy::encoded(&info);
    // RUN_INFO of another type version names it too.
    events[0].2[7] ^= 1;
    toy::write(&log, &events);
    assert_eq!(recorded_revision(&log).unwrap(), Some(wrote.clone()));
    let ask = |revision: Option<&str>| replay_with_revision(&log, &dir, revision, &work);
    for built in [true, false] {
        let found = ask(None).unwrap();
        assert_eq!((&found.revision, found.built, found.identical), (&wrote, built, true), "{found:?}");
        assert_eq!(found.said, "log: identical: 3 ticks");
    }
    // One run of a log is copied for a revision that cannot select it.
    let one = replay_with_revision(&replay::log::path_of_run(&log, 1), &dir, None, &work).unwrap();
    assert_eq!((&one.revision, one.identical), (&wrote, true), "{one:?}");
    let found = ask(Some("HEAD")).unwrap();
    assert_eq!((&found.revision, found.built, found.identical), (&later, true, false), "{found:?}");
    assert!(matches!(ask(Some("nowhere")), Err(Error::Bisect { .. })));
    assert_eq!(git(&dir, &["worktree", "list"]).lines().count(), 1);
}
