//! The error type of this crate.

use crate::printable::{printable, printable_path};
use lcmtypes::EXTERNAL;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// An error of a log, a network or a replay. Damage inside a log is not an error: see [`crate::log::Item`].
///
/// Messages contain names from logs and networks only with their control characters escaped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An operating system call failed.
    #[error("{path}: {source}", path = printable_path(path))]
    Io {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// A directory, device or pipe in place of a file.
    #[error("{path}: not a regular file", path = printable_path(path))]
    NotAFile {
        /// The path that was opened.
        path: PathBuf,
    },
    /// An empty file.
    #[error("{path}: the file is empty", path = printable_path(path))]
    EmptyFile {
        /// File.
        path: PathBuf,
    },
    /// A file that is neither an LCM event log nor MCAP.
    #[error("{path}: not an LCM event log and not MCAP: {bytes} bytes, first bytes {found}", path = printable_path(path))]
    NotALog {
        /// File.
        path: PathBuf,
        /// Its length.
        bytes: u64,
        /// Its first bytes in hexadecimal.
        found: String,
    },
    /// A file name whose extension is no log format.
    #[error("{path}: unknown log format: expected a file name that ends with .lcmlog or .mcap", path = printable_path(path))]
    UnknownExtension {
        /// File.
        path: PathBuf,
    },
    /// A channel name that LCM does not allow.
    #[error("{path}: channel {channel:?}: expected 1 to 63 bytes without NUL", path = printable_path(path))]
    ChannelName {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
    },
    /// An event with a negative time.
    #[error("{path}: channel {channel}: time {t_ns} ns is negative; a log holds times from 0", path = printable_path(path), channel = printable(channel))]
    NegativeTime {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
        /// Time of the event, ns.
        t_ns: i64,
    },
    /// A message longer than LCM allows.
    #[error("{path}: channel {channel}: message of {bytes} bytes, limit {limit}", path = printable_path(path), channel = printable(channel))]
    MessageTooLong {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
        /// Length of the message.
        bytes: usize,
        /// Greatest length.
        limit: usize,
    },
    /// An earlier write failed. Nothing more is written, so that the log has no hole.
    #[error("{path}: an earlier write failed; the log ends there", path = printable_path(path))]
    WriterFailed {
        /// File.
        path: PathBuf,
    },
    /// The MCAP library failed to write.
    #[error("{path}: {source}", path = printable_path(path))]
    Mcap {
        /// File.
        path: PathBuf,
        /// Cause.
        source: Box<mcap::McapError>,
    },
    /// Invalid `.lcm` text.
    #[error("{path}: invalid LCM types: {source}", path = printable_path(path))]
    Types {
        /// File.
        path: PathBuf,
        /// Cause.
        source: Box<lcm_idl::Error>,
    },
    /// A file or folder without a valid LCM type.
    #[error("{path}: no valid LCM type in this file, folder or its subfolders: expected .lcm files", path = printable_path(path))]
    NoTypes {
        /// File or folder.
        path: PathBuf,
    },
    /// An invalid regular expression.
    #[error("{pattern:?}: invalid regular expression for channel names: {why}")]
    Pattern {
        /// The expression.
        pattern: String,
        /// Cause.
        why: String,
    },
    /// An invalid alarm condition.
    #[error("alarm {alarm:?}: {why}")]
    Alarm {
        /// The condition.
        alarm: String,
        /// What is wrong, and what was expected.
        why: String,
    },
    /// No snapshot to start a replay from.
    #[error("{path}: no CONTROLLER_SNAPSHOT up to {before_s:.3} s: a replay cannot start before that time", path = printable_path(path))]
    NoSnapshot {
        /// File.
        path: PathBuf,
        /// End of the searched range, s since the first tick.
        before_s: f64,
    },
    /// A log without RUN_INFO: controller and parameters are unknown.
    #[error("{path}: no RUN_INFO in {events} events: controller and parameters are unknown (a live run repeats it every 5 s)", path = printable_path(path))]
    NoRunInfo {
        /// File.
        path: PathBuf,
        /// Events that were searched.
        events: u64,
    },
    /// A log without CONTROLLER_INPUT.
    #[error("{path}: no CONTROLLER_INPUT: the log cannot be replayed", path = printable_path(path))]
    NoInput {
        /// File.
        path: PathBuf,
    },
    /// A time after the end of the log.
    #[error("{path}: no data at {from_s} s: the log ends {last_s:.3} s after its first tick", path = printable_path(path))]
    BeyondEnd {
        /// File.
        path: PathBuf,
        /// Requested time, s since the first tick.
        from_s: f64,
        /// End of the log, s since the first tick.
        last_s: f64,
    },
    /// A tick that is not in the log.
    #[error("{path}: no input of tick {tick}: the log has ticks {first} to {last}", path = printable_path(path))]
    NoSuchTick {
        /// File.
        path: PathBuf,
        /// Requested tick.
        tick: i64,
        /// First tick of the log.
        first: i64,
        /// Last tick of the log.
        last: i64,
    },
    /// A tick that no recorded state of the log leads to.
    #[error("{path}: tick {tick} cannot be computed: inputs before it are missing and the next recorded state is later", path = printable_path(path))]
    StateUnknown {
        /// File.
        path: PathBuf,
        /// Requested tick.
        tick: i64,
    },
    /// A replay with timed parameter overrides cannot write a log, because RUN_INFO holds one set of parameters.
    #[error(
        "a replay with parameters that change during the run cannot write a log: RUN_INFO holds one set of parameters"
    )]
    ParameterChangesInLog,
    /// A RUN_INFO of another run.
    #[error("{path}: another run starts at byte {offset}; select one with --run N, `hoof log info` lists them", path = printable_path(path))]
    SeveralRuns {
        /// File.
        path: PathBuf,
        /// Offset of that RUN_INFO.
        offset: u64,
    },
    /// A run that the log does not contain.
    #[error("{path}: no run {number}, runs in the log: {runs}; `hoof log info` lists them", path = printable_path(path))]
    NoSuchRun {
        /// File.
        path: PathBuf,
        /// Number of the run, from 1.
        number: usize,
        /// Number of runs in the log.
        runs: usize,
    },
    /// A message type that changed after the log was written.
    #[error(
        "{path}: channel {channel}, {type_name}: log of another type version: fingerprint {found:016x} in the log, expected {expected:016x}",
        path = printable_path(path), channel = printable(channel), type_name = printable(type_name)
    )]
    OtherTypeVersion {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
        /// Its type.
        type_name: String,
        /// Fingerprint in the log; 0 if the message is too short to have one.
        found: u64,
        /// Fingerprint of the type in this build.
        expected: u64,
    },
    /// A message that is not of its channel's type.
    #[error("{path}: channel {channel}, byte {offset}: {source}", path = printable_path(path), channel = printable(channel))]
    Decode {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
        /// Offset of its event.
        offset: u64,
        /// Cause.
        source: Box<lcmtypes::DecodeError>,
    },
    /// A message that cannot be encoded.
    #[error("{path}: {source}", path = printable_path(path))]
    Encode {
        /// File.
        path: PathBuf,
        /// Cause.
        source: Box<lcmtypes::EncodeError>,
    },
    /// A component of a run that is not the first one cannot be replayed.
    #[error("component {}: {source}", printable(name))]
    Component {
        /// Its name.
        name: String,
        /// Cause.
        source: Box<Error>,
    },
    /// A component that RUN_INFO does not contain.
    #[error("{path}: the run has no component {name:?}; its components are {}", printable(&known.join(", ")), path = printable_path(path))]
    NoComponent {
        /// Log.
        path: PathBuf,
        /// The requested name.
        name: String,
        /// Names of the components of the run.
        known: Vec<String>,
    },
    /// A component of another program.
    #[error("{path}: component {name:?} is of kind {EXTERNAL}: it has no controller to replay", path = printable_path(path))]
    ExternalComponent {
        /// Log.
        path: PathBuf,
        /// Its name.
        name: String,
    },
    /// The controller of a log cannot be built.
    #[error("{path}: {source}", path = printable_path(path))]
    Load {
        /// Log.
        path: PathBuf,
        /// Cause.
        source: Box<controller::LoadError>,
    },
    /// A recorded state that the controller rejects.
    #[error("{path}: CONTROLLER_SNAPSHOT of tick {tick}: {source}", path = printable_path(path))]
    Restore {
        /// Log.
        path: PathBuf,
        /// Tick of the snapshot.
        tick: i64,
        /// Cause.
        source: Box<controller::RestoreError>,
    },
    /// An invalid manifest of golden logs.
    #[error("{path}: {why}", path = printable_path(path))]
    Manifest {
        /// File.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// A golden log that the manifest does not list.
    #[error("{path}: no golden log \"{name}\"; known: {known}", path = printable_path(path))]
    UnknownGolden {
        /// Manifest.
        path: PathBuf,
        /// Requested name.
        name: String,
        /// Names in the manifest.
        known: String,
    },
    /// An external program failed.
    #[error("{command}: {output}")]
    Command {
        /// Command line.
        command: String,
        /// Its error output, or why it could not be started.
        output: String,
    },
    /// Revisions that cannot be bisected.
    #[error("{path}: {why}", path = printable_path(path))]
    Bisect {
        /// Log.
        path: PathBuf,
        /// Cause.
        why: String,
    },
    /// An invalid LCM URL.
    #[error("LCM URL {url:?}: {problem}; expected udpm://239.255.76.67:7667?ttl=0&recv_buf_size=BYTES or part of it")]
    LcmUrl {
        /// The URL.
        url: String,
        /// What is wrong.
        problem: String,
    },
    /// The UDP socket of an LCM network cannot be opened.
    #[error("{url}: {at}: {source}{advice}", advice = socket_advice(source))]
    Socket {
        /// Network.
        url: String,
        /// System call or socket option that failed.
        at: &'static str,
        /// Cause.
        source: std::io::Error,
    },
    /// A message that does not fit into the ring buffer in front of the log writer.
    #[error(
        "{path}: channel {channel}: message of {bytes} bytes does not fit into the write buffer, limit {limit}",
        path = printable_path(path), channel = printable(channel)
    )]
    RingTooSmall {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
        /// Length of the message.
        bytes: usize,
        /// Greatest length that fits.
        limit: usize,
    },
    /// A log without two ticks: the control period is unknown.
    #[error("{path}: no two messages with t_ns and tick: the control period is unknown; play by receive or publish time", path = printable_path(path))]
    NoTicks {
        /// File.
        path: PathBuf,
    },
    /// The same file as input and output.
    #[error("{path}: input and output are the same file; a log cannot be read and written at the same time", path = printable_path(path))]
    SameFile {
        /// File.
        path: PathBuf,
    },
}

impl Error {
    /// Checks that `out` is not the input file `log`, also not by another name (a link of any kind).
    ///
    /// # Errors
    /// [`Error::SameFile`].
    pub fn check_distinct_files(log: &Path, out: &Path) -> Result<(), Self> {
        let (log, _) = crate::log::run_path::split_run(log);
        let identity = |path: &Path| std::fs::metadata(path).map(|file| (file.dev(), file.ino()));
        match (identity(&log), identity(out)) {
            (Ok(log), Ok(same)) if log == same => Err(Error::SameFile { path: out.into() }),
            _ => Ok(()),
        }
    }
}

/// The command that adds a multicast route, if the error shows that none exists.
fn socket_advice(error: &std::io::Error) -> String {
    let no_route =
        error.kind() == std::io::ErrorKind::NetworkUnreachable || error.raw_os_error() == Some(nix::libc::ENODEV);
    if no_route { format!("; {}", lcmtypes::bus::NO_ROUTE) } else { String::new() }
}
