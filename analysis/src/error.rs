//! Errors of this crate.

use std::path::PathBuf;

/// An error while reading a log or writing frames, figures or reports.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A log could not be opened or read.
    #[error("cannot read log {}", path.display())]
    Log {
        /// The log.
        path: PathBuf,
        /// Error of the reader.
        #[source]
        source: replay::Error,
    },
    /// The log has no message on a channel that reports use.
    #[error("log {} has {messages} messages, but none on a channel that a report uses; expected at least one of {expected}", path.display())]
    NothingToReport {
        /// The log.
        path: PathBuf,
        /// Number of messages in the log.
        messages: u64,
        /// Channels that reports use.
        expected: String,
    },
    /// A requested channel is not in the log.
    #[error("channel {channel} is not in the log; channels of the log: {found}")]
    NoSuchChannel {
        /// Name of the requested channel.
        channel: String,
        /// Names of the channels of the log.
        found: String,
    },
    /// A data frame could not be built or written.
    #[error("cannot build or write the data frame of channel {channel}")]
    Frame {
        /// Channel of the frame.
        channel: String,
        /// Error of polars.
        #[source]
        source: polars::error::PolarsError,
    },
    /// A matrix is too large for a MATLAB file of Level 5.
    #[error("channel {channel} does not fit into {}: a variable in a MATLAB file of Level 5 has at most 4 GiB; select fewer channels or a shorter part of the log, or use Parquet", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Channel.
        channel: String,
    },
    /// A figure could not be drawn.
    #[error("cannot draw figure {figure}: {reason}")]
    Figure {
        /// Name of the figure.
        figure: String,
        /// Error of the renderer.
        reason: String,
    },
    /// No log was given.
    #[error("no log given; expected at least one")]
    NoLog,
    /// A file could not be read.
    #[error("cannot read {}", path.display())]
    ReadFile {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        source: std::io::Error,
    },
    /// A file of plots or limits is invalid.
    #[error("{file}: {problem}")]
    Choices {
        /// Name of the file, or of the text.
        file: String,
        /// The key, the value found and the values expected.
        problem: String,
    },
    /// A file of the report could not be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        #[source]
        source: std::io::Error,
    },
}
