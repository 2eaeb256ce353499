//! `hoof replay bisect`: finds the first revision that replays a log differently.

use crate::{Outcome, note, say, say_json};
use replay::bisect::{self, Cause, Found, Options, Verdict};
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(after_help = "Example: hoof replay bisect field.mcap --good v0.1 --bad HEAD\n         \
    hoof replay bisect field.mcap --good 1a2b3c --bad HEAD --run 'make -s && ./check.sh \"$LOG\"'\n\n\
    Each revision is checked out into a work tree; builds are reused. Exit codes of the --run command: 0 good, 125 skip this revision, any other bad.")]
pub struct Args {
    /// Log to replay; LOG#N selects the N-th run of a log with several
    log: PathBuf,
    /// Revision that replays the log correctly
    #[arg(long, value_name = "REV")]
    good: String,
    /// Later revision that replays it differently
    #[arg(long, value_name = "REV")]
    bad: String,
    /// Root of the source tree
    #[arg(long, value_name = "DIR", default_value = ".")]
    repo: PathBuf,
    /// Directory for the work tree and the builds
    #[arg(long, value_name = "DIR", default_value = "target/bisect")]
    work: PathBuf,
    /// Shell command that tests a revision, instead of build and replay; it runs in the work tree with LOG set
    #[arg(long, value_name = "CMD")]
    run: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let options = Options {
        log: args.log.clone(),
        repository: args.repo.clone(),
        good: args.good.clone(),
        bad: args.bad.clone(),
        work: args.work.clone(),
        run: args.run.clone(),
    };
    let found = bisect::bisect(&options, &mut |outcome, left| {
        let verdict = match outcome.verdict {
            Verdict::Good => "good",
            Verdict::Bad => "bad",
            Verdict::Skipped => "skipped",
        };
        note(format!("{left:>4} left: {} {verdict:<7} {}", short(&outcome.revision), outcome.subject));
    })?;
    if args.json {
        say_json(&found)?
    } else {
        say(text(&found))?
    }
    Ok(Outcome::Good)
}

fn text(found: &Found) -> String {
    let Some((bad, skipped)) = found.first_bad.split_last() else { return "nothing found".to_owned() };
    let mut text = format!("first revision with a difference: {} {}", short(&bad.revision), bad.subject);
    for outcome in skipped {
        text += &format!("\n  or this one, which was skipped: {} {}", short(&outcome.revision), outcome.subject);
    }
    let names = found.causes.iter().map(|cause| match cause {
        Cause::Build => "build",
        Cause::Configuration => "configuration",
        Cause::MissingInput => "missing input",
        Cause::Code => "code",
    });
    if !found.causes.is_empty() {
        text += &format!("\ncause: {}", names.collect::<Vec<_>>().join(" and "));
    }
    text + &format!("\n{}\n{} of {} revisions tried", bad.said, found.tried.len() - 1, found.revisions)
}

fn short(revision: &str) -> &str {
    revision.get(..10).unwrap_or(revision)
}
