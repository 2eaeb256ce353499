//! Recording: writes all messages of a network or a run to a log, and reports losses in the log.
//!
//! - [`Recorder`]: records an LCM network passively. It counts lost, duplicate and late messages of each sender from the sequence numbers
//!   of LCM's datagrams, which no LCM library exposes, and writes its findings to the log as EVENT messages.
//! - [`RingWriter`]: writes the log of a run in this process through a lock-free ring and a thread.
//! - [`byte_ring`]: that ring.
//!
//! It must never drop a message without reporting it, drop a replay input while any other channel is recorded, block a control loop, or
//! leave an unreadable file.

/// Source of the recorder's EVENTs. Its warnings are losses, and nothing else is a warning.
pub const SOURCE: &str = "recorder";

mod bytes;
mod disk;
mod drop_policy;
mod files;
mod intake;
mod message_decoder;
mod new_file;
mod pattern;
mod recorder;
mod ring;
mod sender_counts;

pub use bytes::{BytesIn, BytesOut, byte_ring};
pub use disk::{DiskState, RetryingFile};
pub use drop_policy::RecordLevel;
pub use files::{Create, Files, Names, Rotation};
pub use intake::{Intake, IntakeSummary, Status};
pub use message_decoder::{Message, MessageDecoder, ReceiveCounts};
pub use new_file::NewFile;
pub use pattern::{Filter, Pattern};
pub use recorder::{Progress, RecordOptions, RecordSummary, Recorder};
pub use ring::{EventSink, RingOptions, RingWriter, Target, WhenFull};
pub use sender_counts::{SenderCounts, SequenceRange};
