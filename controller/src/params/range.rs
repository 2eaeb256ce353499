//! Range checks of parameters. A value that passes can be used in a `clamp`, as a count, or in a quadratic program.

use super::error::ParamsError;

/// The allowed range of a number, for parameters and for operator commands.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    /// Whether a number is in the range; false for NaN.
    pub contains: fn(f64) -> bool,
    /// Text of the range, for an error.
    pub expected: &'static str,
}

/// Upper limit of every gain, time and limit, so that products of them stay far from infinity.
const MAX: Range = Range { contains: |x| x <= 1e9, expected: "at most 1e9" };

/// Checks that `found` is above 0 and at most 1e9.
pub(crate) fn positive(key: &'static str, found: f64) -> Result<(), ParamsError> {
    within(key, &[found], "a positive number", |x| x > 0.0 && x.is_finite())?;
    in_range(key, &[found], MAX)
}

/// Checks that each of `found` is at least 0 and at most 1e9.
pub(crate) fn not_negative(key: &'static str, found: &[f64]) -> Result<(), ParamsError> {
    within(key, found, "a number that is not negative", |x| x >= 0.0 && x.is_finite())?;
    in_range(key, found, MAX)
}

/// Checks that each of `found` is in `range`.
pub(crate) fn in_range(key: &'static str, found: &[f64], range: Range) -> Result<(), ParamsError> {
    within(key, found, range.expected, range.contains)
}

/// Checks that `fits` holds for each of `found`; the error contains the first one for which it does not.
pub(crate) fn within(
    key: &'static str,
    found: &[f64],
    expected: &'static str,
    fits: impl Fn(f64) -> bool,
) -> Result<(), ParamsError> {
    match found.iter().find(|x| !fits(**x)) {
        Some(&found) => Err(ParamsError::OutOfRange { key, found, expected }),
        None => Ok(()),
    }
}

/// Checks that `found`, a force divided by the robot's weight, is above 0 and at most 1.
pub(crate) fn weight_fraction(key: &'static str, found: f64) -> Result<(), ParamsError> {
    within(key, &[found], "above 0 and at most 1, a fraction of the weight", |x| x > 0.0 && x <= 1.0)
}
