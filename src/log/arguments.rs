//! Arguments and output that several log commands share.

use crate::{Outcome, note, say, say_json};
use replay::log::{CopyReport, EventFilter, ItemRef, LogReader, Types, path_of_run};
use replay::{printable, printable_path};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Message types from `.lcm` files.
#[derive(clap::Args)]
pub struct LogTypes {
    /// File or folder with `.lcm` type definitions that the log itself does not contain; may be repeated
    #[arg(long, value_name = "DIR|FILE")]
    lcm_types: Vec<PathBuf>,
}

impl LogTypes {
    /// Fails if an output is one of the files.
    pub fn check_output(&self, out: &Path) -> anyhow::Result<()> {
        Ok(self.lcm_types.iter().try_for_each(|input| replay::Error::check_distinct_files(input, out))?)
    }

    /// Reads the files. Prints a warning for each type and file that cannot be used.
    pub fn read(&self) -> anyhow::Result<Types> {
        let types = Types::from_files(&self.lcm_types)?;
        for warning in types.warnings() {
            note(format!("warning: --lcm-types: {warning}"));
        }
        Ok(types)
    }
}

/// One run of a log that contains several.
#[derive(clap::Args)]
pub struct OneRun {
    /// Select the N-th run of a log with several, from 1; `hoof log info` lists them. LOG#N does the same
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub run: Option<u16>,
}

impl OneRun {
    /// The log, or the selected run of it.
    pub fn of(&self, log: &Path) -> PathBuf {
        self.run.map_or_else(|| log.to_owned(), |number| path_of_run(log, number.into()))
    }
}

/// Channels to select.
#[derive(clap::Args)]
pub struct Channels {
    /// Select only channels whose whole name matches this regular expression
    #[arg(long, value_name = "REGEX")]
    pub channels: Option<String>,
    /// Omit channels whose whole name matches this regular expression
    #[arg(long, value_name = "REGEX")]
    pub exclude: Option<String>,
}

/// Channels of which an error gives the names.
const NAMED: usize = 40;

impl Channels {
    /// Fails if a selection is given and no channel of the logs is selected. Reads up to the first event of a selected channel.
    pub fn check(&self, logs: &[&Path]) -> anyhow::Result<()> {
        let filter = EventFilter::new(self.channels.as_deref(), self.exclude.as_deref(), None, None)?;
        if self.channels.is_none() && self.exclude.is_none() {
            return Ok(());
        }
        let mut is_selected = false;
        let names = search(logs, |name| {
            is_selected = filter.matches(name);
            is_selected
        })?;
        let given = [("--channels", &self.channels), ("--exclude", &self.exclude)];
        let given: Vec<_> = given.iter().filter_map(|(o, text)| Some(format!("{o} {:?}", text.as_ref()?))).collect();
        anyhow::ensure!(is_selected, "{} selects no channel: {}", given.join(" "), listed(logs, &names));
        Ok(())
    }
}

/// Fails if a log does not have each of these channels.
pub fn check_names(option: &str, log: &Path, wanted: impl IntoIterator<Item = String>) -> anyhow::Result<()> {
    let mut missing: BTreeSet<String> = wanted.into_iter().collect();
    if missing.is_empty() {
        return Ok(());
    }
    let names = search(&[log], |name| {
        missing.remove(name);
        missing.is_empty()
    })?;
    let Some(name) = missing.first() else { return Ok(()) };
    anyhow::bail!("{option} {name}: no channel of this name: {}", listed(&[log], &names))
}

/// Calls `found` with the channel of each event until it returns true. Returns the names, at most [`NAMED`].
fn search(logs: &[&Path], mut found: impl FnMut(&str) -> bool) -> anyhow::Result<BTreeSet<String>> {
    let (mut names, mut last) = (BTreeSet::new(), None);
    for log in logs {
        let mut reader = LogReader::open(log)?;
        while let Some(item) = reader.read()? {
            let ItemRef::Event(event) = item else { continue };
            if last.as_ref().is_some_and(|last| Arc::ptr_eq(last, event.channel)) {
                continue;
            }
            last = Some(Arc::clone(event.channel));
            if found(event.channel) {
                return Ok(names);
            }
            if names.len() < NAMED && !names.contains(&**event.channel) {
                names.insert(event.channel.to_string());
            }
        }
    }
    Ok(names)
}

fn listed(logs: &[&Path], names: &BTreeSet<String>) -> String {
    let logs: Vec<_> = logs.iter().map(|log| log.display().to_string()).collect();
    let names: Vec<_> = names.iter().map(|name| printable(name)).collect();
    let more = if names.len() == NAMED { ", ..." } else { "" };
    format!(
        "{} has {}{more}",
        logs.join(" and "),
        if names.is_empty() { "no events".to_owned() } else { names.join(", ") }
    )
}

/// Channels and time range to select.
#[derive(clap::Args)]
pub struct Part {
    #[command(flatten)]
    pub channels: Channels,
    /// Start time, s since the run's first tick, or since the first event of a log without a run
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub from: Option<f64>,
    /// End time, inclusive, s since the run's first tick, or since the first event of a log without a run
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub to: Option<f64>,
}

impl Part {
    pub fn filter(&self) -> anyhow::Result<EventFilter> {
        if let (Some(from), Some(to)) = (self.from, self.to) {
            anyhow::ensure!(from <= to, "--from {from} is later than --to {to}");
        }
        let Channels { channels, exclude } = &self.channels;
        Ok(EventFilter::new(channels.as_deref(), exclude.as_deref(), self.from, self.to)?)
    }
}

/// Parses a time such as `41.2` or `41.2s`.
pub fn seconds(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix('s').unwrap_or(text).trim();
    let parsed = number.parse().ok().filter(|s| (0.0..1e9).contains(s));
    parsed.ok_or_else(|| "expected a time in s from 0 to 1e9, such as 41.2 or 41.2s".to_owned())
}

/// `DataLoss` if something was lost.
pub fn loss(loss: bool) -> Outcome {
    if loss { Outcome::DataLoss } else { Outcome::Good }
}

/// Prints the result of a copy.
pub fn print_copy_report(copied: &CopyReport, json: bool) -> anyhow::Result<Outcome> {
    if json {
        say_json(copied)?;
    } else {
        say(copy_report_text(copied))?;
    }
    Ok(loss(!copied.is_lossless()))
}

fn copy_report_text(c: &CopyReport) -> String {
    let mut text = format!("{} events in {}", c.events, printable_path(&c.out));
    let mut add = |n: u64, what: &str| {
        if n > 0 {
            text += &format!("\n{n} {what}");
        }
    };
    add(c.left_out, "events not selected");
    add(c.damaged, "damaged ranges");
    add(u64::from(c.cut), "cut: the log ends inside a record");
    add(c.bytes_skipped, "bytes skipped");
    add(
        c.refused,
        "events not written: negative time (MCAP), or channel name that is empty, longer than 999 bytes or contains NUL (.lcmlog)",
    );
    add(c.times_rounded, "times rounded down to whole microseconds, the resolution of an LCM event log");
    for (what, n) in &c.not_kept {
        add(*n, &format!("{what} of the input not kept"));
    }
    text
}
