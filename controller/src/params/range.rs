//! Ranges of numbers. A parameter in its range can be used in a `clamp`, as a count, or in a quadratic program.

/// The allowed range of a number, for parameters and for operator commands.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    /// Whether a number is in the range; false for NaN.
    pub contains: fn(f64) -> bool,
    /// Text of the range, for an error.
    pub expected: &'static str,
}

/// The [`Range`] from one number to another, both included.
macro_rules! range {
    ($min:literal, $max:literal) => {
        $crate::params::range::Range {
            contains: |x| {
                #[allow(clippy::cast_lossless, reason = "some literals are integers")]
                let (min, max) = ($min as f64, $max as f64);
                (min..=max).contains(&x)
            },
            expected: concat!(stringify!($min), " to ", stringify!($max)),
        }
    };
}
pub(crate) use range;

/// A parameter and its allowed range. Each number of a table has a line in the table's `BOUNDS`; a test of [`super::bounds`] fails otherwise.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// Dotted key of a number, of an array of numbers, or of a table of numbers.
    pub key: &'static str,
    /// Range of each number.
    pub range: Range,
    /// Unit; empty = none, or it depends on another parameter.
    pub unit: &'static str,
}

impl Bound {
    pub(crate) const fn new(key: &'static str, range: Range, unit: &'static str) -> Self {
        Bound { key, range, unit }
    }

    /// The range with its unit.
    pub fn text(&self) -> String {
        format!("{} {}", self.range.expected, self.unit).trim_end().to_owned()
    }
}
