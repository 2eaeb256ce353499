//! Replays a log with the revision that wrote it, in its own build.

use super::commands::{build, git, locked, remove_tree, resolve, run};
use crate::Error;
use crate::log::{CopyOptions, LogReader, copy, split_run};
use lcmtypes::channels::RUN_INFO;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Length of a git commit in hexadecimal.
const COMMIT: usize = 40;

/// What the replay of a revision found.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct RevisionReplay {
    /// Commit.
    pub revision: String,
    /// Its build was not in the cache.
    pub built: bool,
    /// The replay of this revision gives the outputs in the log, bit for bit.
    pub identical: bool,
    /// Output of its replay.
    pub said: String,
}

/// The commit that wrote a log, from its RUN_INFO of any type version; `None` if there is none.
///
/// # Errors
/// Those of reading the log.
pub fn recorded_revision(log: &Path) -> Result<Option<String>, Error> {
    for event in LogReader::open(log)?.events() {
        let event = event?;
        if *event.channel == *RUN_INFO
            && let Some(revision) = commit_in(&event.data)
        {
            return Ok(Some(revision));
        }
    }
    Ok(None)
}

/// The first string of a message that is a commit. The place of the field differs between versions of the type, the form of a string does not: a length
/// with the final NUL, the text, NUL.
fn commit_in(message: &[u8]) -> Option<String> {
    let length = (COMMIT as u32 + 1).to_be_bytes();
    message.windows(length.len() + COMMIT + 1).find_map(|bytes| {
        let text = bytes.strip_prefix(&length)?.strip_suffix(&[0])?;
        let is_hexadecimal = text.iter().all(|c| c.is_ascii_digit() || (b'a'..=b'f').contains(c));
        is_hexadecimal.then(|| String::from_utf8_lossy(text).into_owned())
    })
}

/// Replays a log with the replay of another revision. Its build is made in a work tree and kept.
///
/// - `revision`: `None` is the revision that wrote the log.
/// - `work`: directory for the work tree and the builds.
///
/// # Errors
/// [`Error::Bisect`] if the log names no revision, the repository lacks it, or it does not build or cannot replay the log; [`Error::Command`] if git fails.
pub fn replay_with_revision(
    log: &Path,
    repository: &Path,
    revision: Option<&str>,
    work: &Path,
) -> Result<RevisionReplay, Error> {
    let failed = |why: String| Error::Bisect { path: log.into(), why };
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| Error::Io { path, source }
    };
    let name = match revision {
        Some(revision) => revision.to_owned(),
        None => recorded_revision(log)?
            .ok_or_else(|| failed("RUN_INFO names no git commit: give the revision with --revision REV".to_owned()))?,
    };
    let revision = resolve(log, repository, &name)?;
    let builds = work.join("revisions");
    std::fs::create_dir_all(&builds).map_err(io(&builds))?;
    let work = work.canonicalize().map_err(io(work))?;
    // Until the end: work tree, builds and corpus have fixed names.
    let lock = locked(&work)?;
    lock.lock().map_err(io(&work))?;
    let program = work.join("revisions").join(&revision);
    let built = !program.exists();
    if built {
        let tree = work.join("tree");
        remove_tree(repository, &tree);
        git(repository, &["worktree", "add", "--force", "--detach", &tree.display().to_string(), &revision])?;
        let done = build(&tree, &work.join("target"));
        remove_tree(repository, &tree);
        let made = done?.map_err(|said| failed(format!("revision {revision} does not build: {said}")))?;
        // Only a complete copy has the final name.
        let partial = program.with_extension("partial");
        std::fs::copy(&made, &partial).map_err(io(&made))?;
        std::fs::rename(&partial, &program).map_err(io(&program))?;
    }
    let corpus = corpus_of(log, &work.join("recorded"))?;
    let (code, said) = run(Command::new(&program).arg(&corpus))?;
    match code {
        Some(code @ (0 | 1)) => Ok(RevisionReplay { revision, built, identical: code == 0, said }),
        _ => Err(failed(format!("revision {revision} cannot replay it: {said}"))),
    }
}

/// A corpus that contains only the log. Its manifest has the keys that the manifest had in all revisions.
fn corpus_of(log: &Path, corpus: &Path) -> Result<PathBuf, Error> {
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| Error::Io { path, source }
    };
    if corpus.exists() {
        std::fs::remove_dir_all(corpus).map_err(io(corpus))?;
    }
    std::fs::create_dir(corpus).map_err(io(corpus))?;
    let file = corpus.join("log.mcap");
    if let (_, Some(_)) = split_run(log) {
        // Earlier revisions cannot select a run.
        copy(log, &file, CopyOptions::default(), &mut |_| {})?;
    } else {
        let whole = log.canonicalize().map_err(io(log))?;
        std::os::unix::fs::symlink(&whole, &file).map_err(io(&file))?;
    }
    let bytes = std::fs::metadata(&file).map_err(io(&file))?.len();
    let manifest = corpus.join("corpus.toml");
    let text = format!("[[log]]\nname = \"log\"\nfile = \"log.mcap\"\nbytes = {bytes}\nwhy = \"recorded\"\n");
    std::fs::write(&manifest, text).map_err(io(&manifest))?;
    Ok(corpus.into())
}
