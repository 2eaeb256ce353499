//! Plays a log: returns each event when it is due.
//!
//! - [`Player`]: the next event and its due time. It reads no clock and publishes nothing; the caller passes the time, so that pausing,
//!   stepping and seeking can be tested.
//! - [`TimeOrder`]: whether the log is in the order of time, and what to do if it is not.
//! - [`TimeBase`]: the clock that sets the pace.
//! - [`Lateness`]: statistics of the lateness of events.

mod lateness;
mod player;
mod time_order;
mod times;

pub use lateness::{Lateness, LatenessSummary};
pub use player::{PlayOptions, Player};
pub use time_order::{OrderKind, TimeOrder};
pub use times::TimeBase;
