//! Logs, and the replay of a controller from its log, bit for bit.
//!
//! - [`log`]: two formats, one writer, one reader. The LCM event log is read by every LCM tool; MCAP is compressed, checked and indexed.
//! - [`record`]: hears an LCM network, or takes what a run in this process says, and leaves a log that says what is missing in it.
//!   [`udpm`] is the network's format, byte by byte.
//! - [`traffic`]: who says what, how often, how evenly, and what of it is lost.
//! - [`play`]: a log's events again, when their time has come.
//! - [`engine`]: feeds the recorded inputs to the controller that the log describes and compares every bit that comes out.
//! - [`corpus`]: the golden logs under `logs/golden` and the flow by which a change of behaviour is accepted.
//! - [`bisect`](mod@bisect): the first revision of the source tree that replays a log otherwise.
//! - [`prove`](mod@prove): a run replays its own log before it completes it.
//!
//! What it must never do: trust a length that a file claims, stop quietly before the end of a log, or compare with a tolerance.
//! The reader keeps every undamaged event and says what is missing; the replay keeps what differs apart from what is absent.

pub mod bisect;
pub mod corpus;
pub mod engine;
pub mod log;
pub mod play;
pub mod prove;
pub mod record;
pub mod traffic;
pub mod udpm;

mod error;

pub use error::Error;
