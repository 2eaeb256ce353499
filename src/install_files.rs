//! `hoof install-files` (hidden): writes shell completions and manual pages. `make install` calls it.

use crate::{Outcome, say};
use anyhow::Context;
use clap_complete::{Shell, generate};
use std::fs::{File, create_dir_all};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "Example: hoof install-files --prefix /usr/local")]
pub struct Args {
    /// Folder below which `share/man` and the completions of bash, zsh and fish are written
    #[arg(long, value_name = "DIR")]
    prefix: PathBuf,
}

/// Folder and file name of the completions of each shell, below the prefix.
const COMPLETIONS: [(Shell, &str, &str); 3] = [
    (Shell::Bash, "share/bash-completion/completions", "hoof"),
    (Shell::Zsh, "share/zsh/site-functions", "_hoof"),
    (Shell::Fish, "share/fish/vendor_completions.d", "hoof.fish"),
];

/// Writes the files for `command`, the definition of the whole command line.
pub fn run(args: &Args, mut command: clap::Command) -> anyhow::Result<Outcome> {
    for (shell, folder, name) in COMPLETIONS {
        let path = made(&args.prefix.join(folder))?.join(name);
        let mut file = File::create(&path).with_context(|| path.display().to_string())?;
        generate(shell, &mut command, "hoof", &mut file);
        say(path.display())?;
    }
    let manual = made(&args.prefix.join("share/man/man1"))?;
    clap_mangen::generate_to(without_help(command), &manual).with_context(|| manual.display().to_string())?;
    say(manual.display())?;
    Ok(Outcome::Good)
}

/// Without the generated `help` subcommands: each would be a page that repeats another one.
fn without_help(command: clap::Command) -> clap::Command {
    command.disable_help_subcommand(true).mut_subcommands(without_help)
}

/// The folder, created if missing.
fn made(folder: &Path) -> anyhow::Result<PathBuf> {
    create_dir_all(folder).with_context(|| folder.display().to_string())?;
    Ok(folder.to_path_buf())
}
