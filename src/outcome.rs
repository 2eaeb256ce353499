//! How a command ends, and how it prints.

use anyhow::Context;
use replay::printable::{printable_json, printable_lines};
use std::fmt::Display;
use std::io::Write;

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

/// Writes text to standard output. Text from logs, messages and files may be anywhere in it: what could control a terminal is escaped. A closed pipe
/// is an error, not a panic.
pub fn say(text: impl Display) -> anyhow::Result<()> {
    writeln!(std::io::stdout().lock(), "{}", printable_lines(&text.to_string())).context("standard output")
}

/// Writes text to standard error, escaped as by [`say`]. A failure is ignored: a terminal that was closed must not end a run.
pub fn note(text: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{}", printable_lines(&text.to_string()));
}

/// Prints a value as JSON, in which every character that could control a terminal is a `\uXXXX`.
pub fn say_json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    let json = serde_json::to_string_pretty(value)?;
    writeln!(std::io::stdout().lock(), "{}", printable_json(&json)).context("standard output")
}
