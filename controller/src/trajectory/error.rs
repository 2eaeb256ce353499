//! Rejected references and limits.

/// A pose or twist that is rejected.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ValueError {
    /// A non-finite number.
    #[error("{what}[{index}] is {found}, expected a finite number")]
    NotFinite {
        /// The vector: `position`, `orientation`, `velocity` or `goal`.
        what: &'static str,
        /// Index of the number in the vector.
        index: usize,
        /// The number.
        found: f64,
    },
    /// A quaternion that is not of unit length.
    #[error("quaternion has length {found}, expected 1 within {tolerance}")]
    NotUnit {
        /// Length.
        found: f64,
        /// Allowed difference from 1.
        tolerance: f64,
    },
}

/// A reference, way-point or limit that is rejected; nothing changes.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceError {
    /// An invalid pose, twist or goal.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// No way-point, or more than fit.
    #[error("{found} way-points, expected 1 to {max}")]
    Count {
        /// Number of way-points.
        found: usize,
        /// Largest number.
        max: usize,
    },
    /// An invalid pose of a way-point.
    #[error("way-point {index}: {error}")]
    Waypoint {
        /// Index of the way-point, from 0.
        index: usize,
        /// The error.
        error: ValueError,
    },
    /// A way-point that is not after the one before it.
    #[error("way-point {index}: time is {found} s, expected a finite time after {before} s")]
    Time {
        /// Index of the way-point, from 0.
        index: usize,
        /// Time of the way-point, s.
        found: f64,
        /// Time of the way-point before it, or 0 for the first one, s.
        before: f64,
    },
    /// An invalid limit.
    #[error("limit of {name} is {found}, expected a positive number")]
    Limit {
        /// Name of the limit.
        name: &'static str,
        /// The limit.
        found: f64,
    },
    /// A reference that does not belong to the mode of the task.
    #[error("task is in mode {found}, expected {expected}")]
    Mode {
        /// Present mode.
        found: &'static str,
        /// Mode that accepts the reference.
        expected: &'static str,
    },
    /// An array of another length than the reference has numbers.
    #[error("{found} numbers, expected {expected}")]
    Length {
        /// Length of the array.
        found: usize,
        /// Length that the reference has.
        expected: usize,
    },
}

/// Checks that numbers are finite.
///
/// - `what`: name of the vector in the error.
pub(super) fn check_finite(what: &'static str, numbers: &[f64]) -> Result<(), ValueError> {
    match numbers.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(ValueError::NotFinite { what, index, found: numbers[index] }),
        None => Ok(()),
    }
}

/// Checks the length of an array.
pub(super) fn check_length(found: usize, expected: usize) -> Result<(), ReferenceError> {
    if found == expected { Ok(()) } else { Err(ReferenceError::Length { found, expected }) }
}
