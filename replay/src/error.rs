//! The one error type of this crate.

use std::path::PathBuf;

/// What can go wrong with a log or its replay. Damage inside a log is not an error: see [`crate::log::Item`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// Reason.
        source: std::io::Error,
    },
    /// A directory, device or pipe where a file was expected.
    #[error("{path}: not a regular file", path = path.display())]
    NotAFile {
        /// What was opened.
        path: PathBuf,
    },
    /// A file without a byte.
    #[error("{path}: the file is empty", path = path.display())]
    EmptyFile {
        /// File.
        path: PathBuf,
    },
    /// A file that is neither an LCM event log nor MCAP.
    #[error("{path}: neither an LCM event log nor MCAP: {bytes} bytes, beginning with {found}", path = path.display())]
    NotALog {
        /// File.
        path: PathBuf,
        /// Its length.
        bytes: u64,
        /// Its first bytes in hexadecimal.
        found: String,
    },
    /// A name whose ending names no log format.
    #[error("{path}: the name of a log ends with .lcmlog or .mcap", path = path.display())]
    UnknownExtension {
        /// File.
        path: PathBuf,
    },
    /// A channel name that LCM cannot carry.
    #[error("{path}: channel {channel:?}: an LCM channel has 1 to 63 bytes and no NUL", path = path.display())]
    ChannelName {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
    },
    /// A time before the epoch of its clock.
    #[error("{path}: channel {channel}: time {t_ns} ns is negative, which no log format can hold", path = path.display())]
    NegativeTime {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
        /// Time of the event, ns.
        t_ns: i64,
    },
    /// A message longer than LCM can carry.
    #[error("{path}: channel {channel}: {bytes} bytes, an LCM message has at most {limit}", path = path.display())]
    MessageTooLong {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
        /// Length of the message.
        bytes: usize,
        /// Largest length.
        limit: usize,
    },
    /// A write failed before, so the log has a hole: nothing more is written to it.
    #[error("{path}: an earlier write failed, the log ends there", path = path.display())]
    WriterFailed {
        /// File.
        path: PathBuf,
    },
    /// The MCAP library refused to write.
    #[error("{path}: {source}", path = path.display())]
    Mcap {
        /// File.
        path: PathBuf,
        /// Reason.
        source: mcap::McapError,
    },
    /// `.lcm` texts that cannot be used.
    #[error("{path}: its types: {source}", path = path.display())]
    Types {
        /// File.
        path: PathBuf,
        /// Reason.
        source: lcm_idl::Error,
    },
}
