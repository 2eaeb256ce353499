//! What can go wrong between a log and its report.

use std::path::PathBuf;

/// Why a log could not be turned into frames, figures or a report.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The log could not be opened or read.
    #[error("cannot read log {}", path.display())]
    Log {
        /// The log.
        path: PathBuf,
        /// What the reader said.
        #[source]
        source: replay::Error,
    },
    /// The log holds no message that any figure or metric is made of.
    #[error("log {} holds {messages} messages and none on a channel that a report is made of; expected at least one of {expected}", path.display())]
    NothingToReport {
        /// The log.
        path: PathBuf,
        /// Messages of any channel that it holds.
        messages: u64,
        /// Channels that would do.
        expected: String,
    },
    /// A channel that was asked for is not in the log.
    #[error("channel {channel} is not in the log; it holds {found}")]
    NoSuchChannel {
        /// The name asked for.
        channel: String,
        /// The names there are.
        found: String,
    },
    /// A data frame could not be built or written.
    #[error("data frame of channel {channel}")]
    Frame {
        /// Channel of the frame.
        channel: String,
        /// What polars said.
        #[source]
        source: polars::error::PolarsError,
    },
    /// The types that a log carries are no LCM types.
    #[error("log {}: the .lcm texts in its RUN_INFO", path.display())]
    Types {
        /// The log.
        path: PathBuf,
        /// What the parser said.
        #[source]
        source: lcm_idl::Error,
    },
    /// A figure could not be drawn.
    #[error("cannot draw figure {figure}: {reason}")]
    Figure {
        /// Name of the figure.
        figure: String,
        /// What the plotting back-end said.
        reason: String,
    },
    /// A report of no log was asked for.
    #[error("no log to report; expected at least one")]
    NoLog,
    /// A file could not be read.
    #[error("cannot read {}", path.display())]
    ReadFile {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
    /// A file of plots or limits has a mistake.
    #[error("{file}: {problem}")]
    Choices {
        /// The file, or what was read instead of one.
        file: String,
        /// Which key, what was found and what was expected.
        problem: String,
    },
    /// A file of the report could not be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        source: std::io::Error,
    },
}
