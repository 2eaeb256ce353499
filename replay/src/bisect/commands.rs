//! Git, cargo and the working directory of a search.

use crate::Error;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The file whose lock a process holds while it works in a directory.
pub(super) fn locked(work: &Path) -> Result<File, Error> {
    let path = work.join("lock");
    File::create(&path).map_err(|source| Error::Io { path, source })
}

/// Builds the replay of a work tree. The inner error is the output of a build that fails.
pub(super) fn build(dir: &Path, target: &Path) -> Result<Result<PathBuf, String>, Error> {
    let mut build = Command::new("cargo");
    build.args(["build", "--quiet", "--release", "--package", "replay", "--example", "replay_golden"]);
    build.arg("--target-dir").arg(target).current_dir(dir);
    // Build with the revision's own settings, not those of the environment.
    for variable in ["CARGO_TARGET_DIR", "RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "CARGO_BUILD_RUSTFLAGS"] {
        build.env_remove(variable);
    }
    let (code, said) = run(&mut build)?;
    Ok(if code == Some(0) { Ok(target.join("release/examples/replay_golden")) } else { Err(said) })
}

/// The commit of a revision.
///
/// # Errors
/// [`Error::Bisect`] if the repository has no such revision.
pub(super) fn resolve(log: &Path, repository: &Path, name: &str) -> Result<String, Error> {
    git(repository, &["rev-parse", "--verify", "--quiet", "--end-of-options", &format!("{name}^{{commit}}")]).map_err(
        |error| match error {
            Error::Command { output, .. } if output.is_empty() => Error::Bisect {
                path: log.into(),
                why: format!("revision \"{}\" does not exist in {}", crate::printable(name), repository.display()),
            },
            other => other,
        },
    )
}

/// Runs git in a directory. Returns its output.
pub(super) fn git(dir: &Path, args: &[&str]) -> Result<String, Error> {
    let mut command = Command::new("git");
    // Ignore the git environment of a calling hook or alias.
    command
        .arg("-C")
        .arg(dir)
        .args(args)
        .env_remove("GIT_DIR")
        .env_remove("GIT_WORK_TREE")
        .env_remove("GIT_INDEX_FILE");
    match run(&mut command)? {
        (Some(0), said) => Ok(said),
        (_, output) => Err(Error::Command { command: format!("git {}", args.join(" ")), output }),
    }
}

/// Runs a command. Returns its exit code and output.
pub(super) fn run(command: &mut Command) -> Result<(Option<i32>, String), Error> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command
        .stdin(std::process::Stdio::null())
        .output()
        .map_err(|source| Error::Command { command: name, output: source.to_string() })?;
    let text = if output.stdout.is_empty() { &output.stderr } else { &output.stdout };
    Ok((output.status.code(), String::from_utf8_lossy(text).trim().to_owned()))
}

/// Removes a work tree; errors are ignored because it may not exist.
pub(super) fn remove_tree(repository: &Path, tree: &Path) {
    let _ = git(repository, &["worktree", "remove", "--force", &tree.display().to_string()]);
    let _ = git(repository, &["worktree", "prune"]);
}
