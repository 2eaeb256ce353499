//! What a check of the release rule finds.

use crate::printable;

/// What is wrong with a delivery.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ReleaseFault {
    /// It was delivered before it was due.
    Early,
    /// It was due, was not delivered, and is not listed as late.
    NotDelivered,
    /// Its component published no such message at this time, or one with other bytes.
    OtherBytes,
}

/// A delivery that violates the release rule.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct ReleaseViolation {
    /// Component that consumed the message, or should have.
    pub component: String,
    /// Channel of the message.
    pub channel: String,
    /// Tick of that component.
    pub tick: i64,
    /// What is wrong.
    pub what: ReleaseFault,
    /// Base tick in which the message is due; `None` if its component published none at this time.
    pub expected_base_tick: Option<i64>,
    /// Base tick of the input.
    pub found_base_tick: i64,
}

impl ReleaseViolation {
    /// One line for people.
    pub fn text(&self) -> String {
        let ReleaseViolation { component, channel, tick, what, expected_base_tick, found_base_tick } = self;
        let due = expected_base_tick.map_or("no base tick".to_owned(), |tick| format!("base tick {tick}"));
        let what = match what {
            ReleaseFault::Early => format!("delivered in base tick {found_base_tick}, due in {due}"),
            ReleaseFault::NotDelivered => {
                format!("due in {due}, not delivered in base tick {found_base_tick} and not listed as late")
            }
            ReleaseFault::OtherBytes => {
                format!("delivered in base tick {found_base_tick} with bytes that were not published")
            }
        };
        format!("component {}, tick {tick}: {}: {what}", printable(component), printable(channel))
    }
}

/// Violations of the release rule in a log.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct ReleaseViolations {
    /// Their number.
    pub count: u64,
    /// The first one.
    pub first: Option<ReleaseViolation>,
}
