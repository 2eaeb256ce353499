//! Checks that all tables of a scenario share, and times in ns.

use std::ops::RangeInclusive;

/// An invalid key of a table.
#[derive(Debug)]
pub(crate) struct BadKey {
    /// The key.
    pub key: &'static str,
    /// Its value, or `missing`, or `given` for a key that must not be there.
    pub found: String,
    /// The allowed values.
    pub expected: String,
}

/// Checks that all values are within `range`, limits included. NaN is never within a range.
pub(crate) fn check_range(key: &'static str, values: &[f64], range: RangeInclusive<f64>) -> Result<(), BadKey> {
    match values.iter().find(|value| !range.contains(value)) {
        None => Ok(()),
        Some(found) => Err(BadKey {
            key,
            found: found.to_string(),
            expected: format!("at least {} and at most {}", range.start(), range.end()),
        }),
    }
}

/// A half-open time span, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First instant inside.
    pub start_ns: i64,
    /// First instant after it.
    pub end_ns: i64,
}

impl Window {
    /// Whether `t_ns` is inside.
    pub fn contains(&self, t_ns: i64) -> bool {
        (self.start_ns..self.end_ns).contains(&t_ns)
    }

    pub(crate) fn new(t_s: f64, duration_s: f64) -> Self {
        Window { start_ns: to_ns(t_s), end_ns: to_ns(t_s + duration_s) }
    }
}

/// Seconds as nanoseconds, rounded.
pub(crate) fn to_ns(t_s: f64) -> i64 {
    (t_s * 1e9).round() as i64
}
