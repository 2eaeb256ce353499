//! The one error type of this crate.

use std::path::{Path, PathBuf};

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
        source: Box<mcap::McapError>,
    },
    /// `.lcm` texts that cannot be used.
    #[error("{path}: its types: {source}", path = path.display())]
    Types {
        /// File.
        path: PathBuf,
        /// Reason.
        source: Box<lcm_idl::Error>,
    },
    /// A folder that was to hold `.lcm` files.
    #[error("{path}: no .lcm file in this folder nor in the folders in it", path = path.display())]
    NoTypes {
        /// Folder.
        path: PathBuf,
    },
    /// What was to be a regular expression.
    #[error("{pattern:?} is no regular expression for channels: {why}")]
    Pattern {
        /// As given.
        pattern: String,
        /// Reason.
        why: String,
    },
    /// What was to be a condition on the traffic.
    #[error("alarm {alarm:?}: {why}")]
    Alarm {
        /// As given.
        alarm: String,
        /// What is wrong with it.
        why: String,
    },
    /// A moment behind the end of a log.
    #[error("{path}: nothing at {moment_s} s: the log ends {duration_s:.3} s after its first tick", path = path.display())]
    NothingThere {
        /// File.
        path: PathBuf,
        /// Time asked for, s since the first tick.
        moment_s: f64,
        /// Time of the last event, s since the first tick.
        duration_s: f64,
    },
    /// No state to start a replay from.
    #[error("{path}: no CONTROLLER_SNAPSHOT up to {before_s:.3} s, so nothing could be replayed from there", path = path.display())]
    NoSnapshot {
        /// File.
        path: PathBuf,
        /// Until when one was looked for, s since the first event.
        before_s: f64,
    },
    /// A log without RUN_INFO: nobody knows which controller ran.
    #[error("{path}: no RUN_INFO among its {events} events, so the controller and its parameters are unknown: a live run says it again every 5 s", path = path.display())]
    NoRunInfo {
        /// File.
        path: PathBuf,
        /// Events that were looked through.
        events: u64,
    },
    /// A log without CONTROLLER_INPUT: there is nothing to replay.
    #[error("{path}: no CONTROLLER_INPUT, so there is nothing to replay", path = path.display())]
    NoInput {
        /// File.
        path: PathBuf,
    },
    /// A time behind the end of the log.
    #[error("{path}: nothing to replay from {from_s} s on: its last tick is {last_s:.3} s after the first", path = path.display())]
    BeyondEnd {
        /// File.
        path: PathBuf,
        /// Time asked for, s since the first tick.
        from_s: f64,
        /// Time of the last tick, s since the first.
        last_s: f64,
    },
    /// A tick that the log does not hold.
    #[error("{path}: no input of tick {tick}: the log holds ticks {first} to {last}", path = path.display())]
    NoSuchTick {
        /// File.
        path: PathBuf,
        /// Tick asked for.
        tick: i64,
        /// First tick of the log.
        first: i64,
        /// Last tick of the log.
        last: i64,
    },
    /// A tick that can be computed from no state of the log.
    #[error("{path}: tick {tick} cannot be computed: inputs before it are missing, and the next recorded state comes later", path = path.display())]
    StateUnknown {
        /// File.
        path: PathBuf,
        /// Tick asked for.
        tick: i64,
    },
    /// Parameters that change on the way, and a log to write, which has one set of them.
    #[error("parameters that change on the way cannot be written into a log: RUN_INFO holds one set")]
    ChangesInLog,
    /// A second RUN_INFO that differs from the first.
    #[error("{path}: another run begins at byte {offset}: trim the log to one run", path = path.display())]
    SeveralRuns {
        /// File.
        path: PathBuf,
        /// Where the second RUN_INFO stands.
        offset: u64,
    },
    /// A type has changed since the log was written.
    #[error("{path}: log of another type version: channel {channel}, {type_name}: fingerprint {found:016x} in the log, {expected:016x} today", path = path.display())]
    OtherTypeVersion {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
        /// Its type.
        type_name: String,
        /// Fingerprint in the log; 0 if the message is too short to have one.
        found: u64,
        /// Fingerprint of the type as it is now.
        expected: u64,
    },
    /// A message that is not what its channel says.
    #[error("{path}: channel {channel}, byte {offset}: {source}", path = path.display())]
    Decode {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
        /// Where its event stands.
        offset: u64,
        /// Reason.
        source: Box<lcmtypes::DecodeError>,
    },
    /// A message that cannot be written.
    #[error("{path}: {source}", path = path.display())]
    Encode {
        /// File.
        path: PathBuf,
        /// Reason.
        source: Box<lcmtypes::EncodeError>,
    },
    /// The controller of a log cannot be built.
    #[error("{path}: {source}", path = path.display())]
    Load {
        /// Log.
        path: PathBuf,
        /// Reason.
        source: Box<controller::LoadError>,
    },
    /// A recorded state that the controller does not take.
    #[error("{path}: CONTROLLER_SNAPSHOT of tick {tick}: {source}", path = path.display())]
    Restore {
        /// Log.
        path: PathBuf,
        /// Tick of the snapshot.
        tick: i64,
        /// Reason.
        source: Box<controller::RestoreError>,
    },
    /// A manifest of golden logs that cannot be used.
    #[error("{path}: {why}", path = path.display())]
    Manifest {
        /// File.
        path: PathBuf,
        /// Reason.
        why: String,
    },
    /// A golden log that the manifest does not know.
    #[error("{path}: no golden log \"{name}\", known: {known}", path = path.display())]
    UnknownGolden {
        /// Manifest.
        path: PathBuf,
        /// Name asked for.
        name: String,
        /// Names in the manifest.
        known: String,
    },
    /// A program that was asked for help refused it.
    #[error("{command}: {said}")]
    Command {
        /// What was run.
        command: String,
        /// What it said.
        said: String,
    },
    /// Revisions among which there is nothing to find.
    #[error("{path}: {why}", path = path.display())]
    Bisect {
        /// Log.
        path: PathBuf,
        /// Reason.
        why: String,
    },
    /// A URL that names no LCM network over UDP multicast.
    #[error("LCM URL {url:?}: {problem}; expected udpm://239.255.76.67:7667?ttl=0&recv_buf_size=BYTES or part of it")]
    LcmUrl {
        /// What was given.
        url: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A network that cannot be heard.
    #[error("{url}: {at}: {source}{advice}", advice = socket_advice(source))]
    Socket {
        /// Network.
        url: String,
        /// System call or option.
        at: &'static str,
        /// Reason.
        source: std::io::Error,
    },
    /// A message longer than the whole ring between a run and the thread that writes its log.
    #[error("{path}: channel {channel}: a message of {bytes} bytes, the ring before the log takes at most {limit}", path = path.display())]
    RingTooSmall {
        /// File.
        path: PathBuf,
        /// Channel.
        channel: String,
        /// Length of the message.
        bytes: usize,
        /// Longest that it takes.
        limit: usize,
    },
    /// A log without two ticks: no even pace can be found in it.
    #[error("{path}: no two messages with t_ns and tick, so the control period is unknown; play it by receive or publish time", path = path.display())]
    NoTicks {
        /// File.
        path: PathBuf,
    },
    /// A log that would be written over itself while it is read.
    #[error("{path}: a log cannot be read and written at the same time", path = path.display())]
    SameFile {
        /// File.
        path: PathBuf,
    },
}

impl Error {
    /// [`Error::SameFile`] if `out` is there and is the file `log`.
    pub(crate) fn unless_apart(log: &Path, out: &Path) -> Result<(), Self> {
        match (log.canonicalize(), out.canonicalize()) {
            (Ok(log), Ok(out)) if log == out => Err(Error::SameFile { path: out }),
            _ => Ok(()),
        }
    }
}

/// What to do where the network has no way to multicast.
fn socket_advice(error: &std::io::Error) -> &'static str {
    match error.kind() {
        std::io::ErrorKind::NetworkUnreachable => {
            "; as root: ip route replace 224.0.0.0/4 dev lo (or the robot's interface)"
        }
        _ if error.raw_os_error() == Some(nix::libc::ENODEV) => {
            "; no interface has a route for multicast; as root: ip route replace 224.0.0.0/4 dev lo (or the robot's interface)"
        }
        _ => "",
    }
}
