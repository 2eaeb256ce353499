//! Playing a log: every event again, when its time has come.
//!
//! - [`Player`]: which event is next and when it is due. It reads no clock and publishes nothing: whoever drives it says what time it is,
//!   which is how pausing, stepping and seeking are tested.
//! - [`TimeBase`]: which of an event's times sets the pace.
//! - [`Lateness`]: how well the pace was kept.

mod lateness;
mod player;
mod times;

pub use lateness::{Lateness, LatenessSummary};
pub use player::{PlayOptions, Player};
pub use times::TimeBase;
