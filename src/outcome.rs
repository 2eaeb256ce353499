//! How a command ends, and how it prints.

use anyhow::Context;

/// Result of a command that could do its work; its exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Exit code 0.
    Good,
    /// The check failed: not identical, fell, out of limits. Exit code 1.
    Failed,
    /// Done, but part of the input was damaged or missing. Exit code 3.
    DataLoss,
}

impl Outcome {
    /// `Failed` if the check failed, else `Good`.
    pub fn failed_if(failed: bool) -> Self {
        if failed { Outcome::Failed } else { Outcome::Good }
    }
}

/// Writes a line to standard output. A closed pipe is an error, not a panic.
pub fn say(text: impl std::fmt::Display) -> anyhow::Result<()> {
    use std::io::Write;
    writeln!(std::io::stdout().lock(), "{text}").context("standard output")
}

/// Prints a value as JSON.
pub fn say_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    say(serde_json::to_string_pretty(value)?)
}
