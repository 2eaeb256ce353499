//! Finds the first revision of the source tree that replays a log differently, and the kind of change that caused it.
//!
//! Each revision is checked out into a work tree; `replay_golden` (without simulator and analysis) is built there and run on the log. Its
//! output is the *outcome* of the revision; a revision with another outcome than the good one is bad. Parameters and inputs are those of
//! the log, so only the revision can change a bit.

mod commands;
mod recorded;

pub use recorded::{RevisionReplay, recorded_revision, replay_with_revision};

use crate::Error;
use crate::corpus::Corpus;
use commands::{build, git, locked, remove_tree, resolve, run};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Options of a search.
#[derive(Debug, Clone)]
pub struct Options {
    /// Log to replay.
    pub log: PathBuf,
    /// Root of the source tree, a git repository.
    pub repository: PathBuf,
    /// Revision that replays the log correctly.
    pub good: String,
    /// Later revision that replays it differently.
    pub bad: String,
    /// Directory for the work tree and the builds; existing builds are reused.
    pub work: PathBuf,
    /// Shell command to run in each work tree instead of build and replay, with the path of the log in `$LOG`. Exit codes: 0 good, 125 skip, any
    /// other bad.
    pub run: Option<String>,
}

/// Outcome of a revision.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Outcome {
    /// Commit.
    pub revision: String,
    /// First line of its message.
    pub subject: String,
    /// Verdict.
    pub verdict: Verdict,
    /// Output of the replay or command.
    pub said: String,
}

/// Verdict on a revision.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Same outcome as the good revision.
    Good,
    /// Another outcome.
    Bad,
    /// It cannot be tested.
    Skipped,
}

/// Kind of change in a revision that can change a bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Compiler, flags, dependencies: `Cargo.toml`, `Cargo.lock`, `rust-toolchain.toml`, `.cargo`, `build.rs`.
    Build,
    /// Parameters and their defaults: `robots`, `scenarios`, `controller/src/params`.
    Configuration,
    /// A message type that differs from the log's: `lcmtypes/*.lcm`, or a replay that reports missing inputs.
    MissingInput,
    /// Everything else.
    Code,
}

/// The result of a search.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Found {
    /// The first bad revision, after the skipped revisions directly before it, which may also be the first.
    pub first_bad: Vec<Outcome>,
    /// Kinds of its changes that each make the revision before it bad on their own; all kinds if only their combination does.
    pub causes: Vec<Cause>,
    /// Number of revisions after the good one up to the bad one.
    pub revisions: usize,
    /// Tested revisions, in order.
    pub tried: Vec<Outcome>,
}

/// Searches by bisection. `progress` receives each outcome and the number of remaining revisions.
///
/// # Errors
/// [`Error::Command`] if git fails, [`Error::Bisect`] if good and bad do not differ or bad is not after good, and errors of reading the log.
pub fn bisect(options: &Options, progress: &mut dyn FnMut(&Outcome, usize)) -> Result<Found, Error> {
    let resolved = |name: &str| resolve(&options.log, &options.repository, name);
    let (good, bad) = (resolved(&options.good)?, resolved(&options.bad)?);
    let tree = WorkTree::new(options)?;
    let found = search(options, &tree, &good, &bad, progress);
    remove_tree(&options.repository, &tree.dir);
    found
}

fn search(
    options: &Options,
    tree: &WorkTree,
    good: &str,
    bad: &str,
    progress: &mut dyn FnMut(&Outcome, usize),
) -> Result<Found, Error> {
    let failed = |why: String| Error::Bisect { path: options.log.clone(), why };
    let line = git(&options.repository, &["rev-list", "--reverse", "--first-parent", &format!("{good}..{bad}")])?;
    let revisions: Vec<&str> = line.lines().collect();
    if revisions.is_empty() {
        return Err(failed(format!("{} is not after {}: no revision between them", options.bad, options.good)));
    }
    let mut tried = Vec::new();
    let reference = tree.outcome(good, None)?;
    progress(&reference, revisions.len());
    if reference.verdict == Verdict::Skipped {
        return Err(failed(format!("the good revision {} cannot be tested: {}", options.good, reference.said)));
    }
    if options.run.is_some() && reference.verdict == Verdict::Bad {
        return Err(failed(format!("the good revision {} is bad: {}", options.good, reference.said)));
    }
    let reference = Outcome { verdict: Verdict::Good, ..reference };
    tried.push(reference.clone());
    let mut judge = |i: usize, left: usize| {
        let outcome = tree.outcome(revisions[i], Some(&reference))?;
        progress(&outcome, left);
        tried.push(outcome.clone());
        Ok::<_, Error>(outcome)
    };
    let last = judge(revisions.len() - 1, revisions.len())?;
    if last.verdict != Verdict::Bad {
        return Err(failed(format!("{} has the same outcome as {}: {}", options.bad, options.good, last.said)));
    }
    let (before, first_bad) = halve(revisions.len(), last, &mut judge)?;
    let causes = match &first_bad[..] {
        [only] => {
            let before = before.map_or(good, |i| revisions[i]);
            tree.causes(before, only, &reference)?
        }
        _ => Vec::new(),
    };
    Ok(Found { first_bad, causes, revisions: revisions.len(), tried })
}

/// Bisects between the last good revision (`None`: before the first) and the first bad one, around skipped revisions. Returns the last good
/// one, and the skipped revisions directly before the first bad one, followed by it.
fn halve<E>(
    count: usize,
    last: Outcome,
    judge: &mut dyn FnMut(usize, usize) -> Result<Outcome, E>,
) -> Result<(Option<usize>, Vec<Outcome>), E> {
    let mut good: Option<usize> = None;
    let (mut bad, mut bad_outcome) = (count - 1, last);
    let mut skipped: Vec<(usize, Outcome)> = Vec::new();
    loop {
        let first = good.map_or(0, |good| good + 1);
        let middle = first + (bad - first) / 2;
        let open = (first..bad).filter(|i| skipped.iter().all(|(skipped, _)| skipped != i));
        // The untested revision nearest to the middle.
        let Some(next) = open.min_by_key(|i| i.abs_diff(middle)) else { break };
        let outcome = judge(next, bad - first)?;
        match outcome.verdict {
            Verdict::Good => good = Some(next),
            Verdict::Bad => (bad, bad_outcome) = (next, outcome),
            Verdict::Skipped => skipped.push((next, outcome)),
        }
    }
    let first = good.map_or(0, |good| good + 1);
    skipped.retain(|(i, _)| (first..bad).contains(i));
    skipped.sort_by_key(|(i, _)| *i);
    Ok((good, skipped.into_iter().map(|(_, outcome)| outcome).chain([bad_outcome]).collect()))
}

/// The work tree, and a corpus that contains only the log.
struct WorkTree<'o> {
    options: &'o Options,
    dir: PathBuf,
    corpus: PathBuf,
    /// Shared target directory, so that each revision compiles only its changes.
    target: PathBuf,
    /// Keeps other processes out of the directory.
    _lock: File,
}

impl<'o> WorkTree<'o> {
    fn new(options: &'o Options) -> Result<Self, Error> {
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| Error::Io { path, source }
        };
        std::fs::create_dir_all(&options.work).map_err(io(&options.work))?;
        let work = options.work.canonicalize().map_err(io(&options.work))?;
        let lock = locked(&work)?;
        lock.try_lock().map_err(|_| Error::Bisect {
            path: options.log.clone(),
            why: format!(
                "another process works in {}: wait for its end, or give another directory with --work",
                work.display()
            ),
        })?;
        let [dir, corpus, target] = ["tree", "corpus", "target"].map(|name| work.join(name));
        if options.run.is_none() {
            if corpus.exists() {
                std::fs::remove_dir_all(&corpus).map_err(io(&corpus))?;
            }
            std::fs::create_dir(&corpus).map_err(io(&corpus))?;
            let bytes =
                Corpus::open_with(&corpus, controller::load)?.add(&options.log, "log", "bisect", &ALL_OUTPUTS)?;
            // Only keys that the manifest has had in all revisions.
            let manifest = format!("[[log]]\nname = \"log\"\nfile = \"log.mcap\"\nbytes = {bytes}\nwhy = \"bisect\"\n");
            let path = corpus.join("corpus.toml");
            std::fs::write(&path, manifest).map_err(io(&path))?;
        }
        let tree = WorkTree { options, dir, corpus, target, _lock: lock };
        remove_tree(&options.repository, &tree.dir);
        let dir = tree.dir.display().to_string();
        git(&options.repository, &["worktree", "add", "--force", "--detach", &dir, &options.good])?;
        Ok(tree)
    }

    /// Checks out a revision and compares its outcome with the good one's.
    fn outcome(&self, revision: &str, good: Option<&Outcome>) -> Result<Outcome, Error> {
        git(&self.dir, &["checkout", "--quiet", "--force", "--detach", revision])?;
        git(&self.dir, &["clean", "--quiet", "--force", "-d"])?;
        let subject = git(&self.dir, &["show", "--no-patch", "--format=%s", revision])?;
        let (verdict, said) = self.judge(good)?;
        Ok(Outcome { revision: revision.to_owned(), subject, verdict, said })
    }

    /// Tests the contents of the work tree.
    fn judge(&self, good: Option<&Outcome>) -> Result<(Verdict, String), Error> {
        if let Some(command) = &self.options.run {
            let log = self.options.log.canonicalize().unwrap_or_else(|_| self.options.log.clone());
            let mut shell = Command::new("sh");
            let (code, said) = run(shell.args(["-c", command]).env("LOG", log).current_dir(&self.dir))?;
            let verdict = match code {
                Some(0) => Verdict::Good,
                Some(125) | None => Verdict::Skipped,
                Some(_) => Verdict::Bad,
            };
            return Ok((verdict, said));
        }
        let program = match build(&self.dir, &self.target)? {
            Ok(program) => program,
            Err(said) => return Ok((Verdict::Skipped, format!("does not build: {said}"))),
        };
        let (code, said) = run(Command::new(program).arg(&self.corpus).current_dir(&self.dir))?;
        let verdict = match (code, good) {
            (Some(0 | 1), None) => Verdict::Good,
            (Some(0 | 1), Some(good)) if first_place(&good.said) == first_place(&said) => Verdict::Good,
            (Some(0 | 1), Some(_)) => Verdict::Bad,
            _ => Verdict::Skipped,
        };
        Ok((verdict, said))
    }

    /// Kinds of changes of a revision that make the revision before it bad on their own.
    fn causes(&self, before: &str, bad: &Outcome, good: &Outcome) -> Result<Vec<Cause>, Error> {
        let names = git(&self.dir, &["diff", "--name-only", before, &bad.revision])?;
        let mut kinds: Vec<Cause> = names.lines().map(cause_of).collect();
        kinds.sort_unstable();
        kinds.dedup();
        if reports_missing_input(&bad.said) {
            return Ok(vec![Cause::MissingInput]);
        }
        if kinds.len() < 2 {
            return Ok(kinds);
        }
        let mut causes = Vec::new();
        for kind in &kinds {
            let files = names.lines().filter(|name| cause_of(name) == *kind);
            git(&self.dir, &["checkout", "--quiet", "--force", "--detach", before])?;
            git(&self.dir, &["clean", "--quiet", "--force", "-d"])?;
            for file in files {
                // The revision may delete the file.
                if git(&self.dir, &["checkout", "--quiet", &bad.revision, "--", file]).is_err() {
                    git(&self.dir, &["rm", "--quiet", "--force", "--", file])?;
                }
            }
            if self.judge(Some(good))?.0 == Verdict::Bad {
                causes.push(*kind);
            }
        }
        Ok(if causes.is_empty() { kinds } else { causes })
    }
}

/// All outputs, so that a difference is reported by field and not only by digest.
const ALL_OUTPUTS: [&str; 5] = {
    use lcmtypes::channels::{BASE_TRACKING, CONTACT_ESTIMATE, LEG_STATE, ROBOT_COMMAND, WBC_SOLUTION};
    [CONTACT_ESTIMATE, BASE_TRACKING, LEG_STATE, WBC_SOLUTION, ROBOT_COMMAND]
};

/// Kind of change of a file.
fn cause_of(file: &str) -> Cause {
    let name = file.rsplit('/').next().unwrap_or(file);
    let starts = |prefixes: &[&str]| prefixes.iter().any(|prefix| file.starts_with(prefix));
    match name {
        "Cargo.toml" | "Cargo.lock" | "rust-toolchain.toml" | "build.rs" => Cause::Build,
        _ if file.starts_with(".cargo/") => Cause::Build,
        _ if name.ends_with(".lcm") => Cause::MissingInput,
        _ if starts(&["robots/", "scenarios/", "controller/src/params"]) => Cause::Configuration,
        _ => Cause::Code,
    }
}

/// The first difference in the output; only newer revisions print further ones.
fn first_place(said: &str) -> &str {
    said.split_once("; also ").map_or(said, |(place, _)| place)
}

/// Whether the output reports missing or outdated inputs. The texts are those of all revisions, old and new.
fn reports_missing_input(said: &str) -> bool {
    ["another type version", "no RUN_INFO", "no CONTROLLER_INPUT", "lacks inputs"]
        .iter()
        .any(|text| said.contains(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(i: usize, verdict: Verdict) -> Outcome {
        Outcome { revision: i.to_string(), subject: String::new(), verdict, said: String::new() }
    }

    /// Every place of the first bad revision among 20, with every one of the others skipped once.
    #[test]
    fn the_first_bad_revision_is_found_around_skipped_ones() {
        let count = 20;
        for first_bad in 0..count {
            for broken in (0..count - 1).map(Some).chain([None]) {
                let mut tested = 0;
                let judge = &mut |i: usize, _: usize| {
                    tested += 1;
                    let verdict = match i {
                        i if Some(i) == broken => Verdict::Skipped,
                        i if i >= first_bad => Verdict::Bad,
                        _ => Verdict::Good,
                    };
                    Ok::<_, ()>(outcome(i, verdict))
                };
                let (good, found) = halve(count, outcome(count - 1, Verdict::Bad), judge).unwrap();
                let found: Vec<usize> = found.iter().map(|outcome| outcome.revision.parse().unwrap()).collect();
                // A skipped revision directly before the first bad one, or in its place, may be the first bad one.
                let expected: Vec<usize> = match broken {
                    Some(broken) if broken + 1 == first_bad => vec![broken, first_bad],
                    Some(broken) if broken == first_bad => vec![broken, broken + 1],
                    _ => vec![first_bad],
                };
                assert_eq!(found, expected, "bad from {first_bad} on, broken {broken:?}");
                assert_eq!(good, expected[0].checked_sub(1));
                assert!(tested <= 7, "{tested} tested");
            }
        }
    }

    #[test]
    fn files_are_assigned_to_causes() {
        let causes = [
            "replay/Cargo.toml",
            ".cargo/config.toml",
            "robots/hyq/hyq.toml",
            "lcmtypes/event_t.lcm",
            "controller/src/quadruped/gait.rs",
        ];
        let expected = [Cause::Build, Cause::Build, Cause::Configuration, Cause::MissingInput, Cause::Code];
        assert_eq!(causes.map(cause_of), expected);
    }
}
