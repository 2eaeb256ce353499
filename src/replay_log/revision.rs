//! `hoof replay LOG --revision`: the replay of the revision that wrote the log.

use crate::{Outcome, say, say_json};
use replay::Error;
use replay::bisect::{recorded_revision, replay_with_revision};
use std::path::Path;

/// - `revision`: empty is the revision that wrote the log.
pub fn run(log: &Path, revision: &str, repository: &Path, work: &Path, json: bool) -> anyhow::Result<Outcome> {
    let found = replay_with_revision(log, repository, Some(revision).filter(|name| !name.is_empty()), work)?;
    if json {
        say_json(&found)?;
    } else {
        let build = if found.built { "built" } else { "build from the cache" };
        say(format!("revision {} ({build}):\n{}", found.revision, found.said))?;
    }
    Ok(Outcome::failed_if(!found.identical))
}

/// Adds the revision that wrote the log to an error that it may not have, if it is not the revision of this build.
pub fn name(log: &Path, error: anyhow::Error) -> anyhow::Error {
    if !matches!(
        error.downcast_ref(),
        Some(Error::Load { .. } | Error::OtherTypeVersion { .. } | Error::Restore { .. })
    ) {
        return error;
    }
    match recorded_revision(log) {
        Ok(Some(revision)) if revision != crate::run_info::build().revision => error.context(format!(
            "revision {revision} wrote this log; in the source tree, `hoof replay {} --revision` replays it with that revision",
            log.display()
        )),
        _ => error,
    }
}
