//! Logs, and the replay of a controller from its log, bit for bit.
//!
//! - [`log`]: one writer and one reader for two formats. The LCM event log is read by every LCM tool; MCAP is compressed, checksummed and
//!   indexed.
//! - [`record`]: writes the messages of an LCM network, or of a run in this process, into a log, with an account of what was lost.
//!   [`udpm`] implements LCM's UDP multicast protocol.
//! - [`traffic`]: rate, jitter, bandwidth and losses of each channel and sender.
//! - [`play`]: publishes the events of a log at their recorded times.
//! - [`engine`]: feeds the recorded inputs to the controller that the log describes and compares every bit of its outputs.
//! - [`corpus`]: the golden logs under `logs/golden`, and how a change of behaviour is accepted.
//! - [`bisect`](mod@bisect): finds the first revision of the source tree whose replay of a log differs.
//! - [`prove`](mod@prove): a run replays its own log before it completes it.
//! - [`text_file`]: reads files that a user names, with a bound on their size.
//! - [`printable`](mod@printable): escapes control characters in text from logs and networks.
//!
//! Invariants: no length that a file claims is trusted, reading never ends silently before the end of a log, and no comparison has a
//! tolerance. The reader returns every undamaged event and reports what is missing; the replay reports differing and missing outputs
//! separately.

pub mod bisect;
pub mod corpus;
pub mod engine;
pub mod log;
mod names;
pub mod play;
pub mod printable;
pub mod prove;
pub mod record;
pub mod text_file;
pub mod traffic;
pub mod udpm;

mod error;

pub use error::Error;
pub use printable::{printable, printable_lines, printable_path};
pub use text_file::{read_text, read_text_lossy};
