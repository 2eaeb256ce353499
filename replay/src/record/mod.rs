//! Recording: everything that a network or a run says, in one log, with what is missing said there too.
//!
//! - [`Recorder`]: hears an LCM network without taking part in it. It counts loss, duplicates and late arrivals of each sender from the
//!   sequence numbers that LCM sends and no LCM library shows, and writes its findings into the log as ordinary EVENT messages.
//! - [`RingWriter`]: the way of a run in this process to its log: a lock-free ring and a thread.
//! - [`byte_ring`]: that ring.
//!
//! What it must never do: leave out a message in silence, leave out a replay input while anything else is recorded, make a control loop
//! wait, or leave behind a file that cannot be read.

mod account;
mod bytes;
mod disk;
mod drop_policy;
mod files;
mod fresh;
mod hearing;
mod intake;
mod pattern;
mod recorder;
mod ring;

pub use account::{Account, Run};
pub use bytes::{BytesIn, BytesOut, byte_ring};
pub use disk::{DiskState, PatientFile};
pub use drop_policy::Keep;
pub use files::{Create, Files, Names, Rotation};
pub use fresh::Fresh;
pub use hearing::{Hearing, Message, Tally};
pub use intake::{Heard, Intake, Status};
pub use pattern::{Filter, Pattern};
pub use recorder::{Progress, RecordOptions, Recorded, Recorder};
pub use ring::{EventSink, RingOptions, RingWriter, Target, WhenFull};
