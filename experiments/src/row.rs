//! One measured quantity of an experiment, with its target.

use serde::Serialize;

/// [`Row::wanted`] of a row without a target.
pub const NOT_JUDGED: &str = "not judged";

/// One measured quantity of an experiment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Name of the quantity.
    pub name: String,
    /// Value that the source reports, if any.
    pub published: Option<f64>,
    /// Target, such as "<= 10"; [`NOT_JUDGED`] if there is none.
    pub wanted: String,
    /// Measured value; NaN (`null` in JSON) if there was nothing to measure, which misses every target.
    pub measured: f64,
    /// Unit of all values; empty for counts and ratios.
    pub unit: &'static str,
    /// Whether the measured value meets the target; `None` for a row that is not judged.
    pub pass: Option<bool>,
}

impl Row {
    /// A row that is not judged.
    pub fn info(name: impl Into<String>, measured: f64, unit: &'static str) -> Self {
        Row { name: name.into(), published: None, wanted: NOT_JUDGED.to_owned(), measured, unit, pass: None }
    }

    /// Adds the value that the source reports.
    pub fn published(self, published: f64) -> Self {
        Row { published: Some(published), ..self }
    }

    /// Judges the row: passes up to and including `limit`.
    pub fn at_most(self, limit: f64) -> Self {
        Row { wanted: format!("<= {}", number(limit)), pass: Some(self.measured <= limit), ..self }
    }

    /// Judges the row: passes from `limit` on, inclusive.
    pub fn at_least(self, limit: f64) -> Self {
        Row { wanted: format!(">= {}", number(limit)), pass: Some(self.measured >= limit), ..self }
    }

    /// Removes the target.
    pub fn not_judged(self) -> Self {
        Row { wanted: NOT_JUDGED.to_owned(), pass: None, ..self }
    }

    /// Judges the row: passes within 1e-9 of `value`.
    pub fn exactly(self, value: f64) -> Self {
        let close = (self.measured - value).abs() < 1e-9;
        Row { wanted: number(value), pass: Some(close), ..self }
    }
}

impl Row {
    /// Cells of the columns published, wanted, measured, pass.
    pub(crate) fn cells(&self) -> [String; 4] {
        let pass = self.pass.map_or("", |pass| if pass { "yes" } else { "NO" });
        [self.published.map_or(String::new(), number), self.wanted.clone(), number(self.measured), pass.to_owned()]
    }
}

/// A value for a table: four decimals below 10, one from there on, a power of ten below 5e-4, none for whole numbers; `-` for NaN.
fn number(x: f64) -> String {
    if x.is_nan() {
        "-".to_owned()
    } else if x == x.trunc() && x.abs() < 1e6 {
        format!("{x:.0}")
    } else if x.abs() < 5e-4 {
        format!("{x:.1e}")
    } else if x.abs() < 10.0 {
        format!("{x:.4}")
    } else {
        format!("{x:.1}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_inclusive_and_nan_never_passes() {
        let row = |measured| Row::info("delay", measured, "ms");
        assert_eq!([row(10.0).at_most(10.0).pass, row(10.1).at_most(10.0).pass], [Some(true), Some(false)]);
        assert_eq!([row(20.0).at_least(20.0).pass, row(19.9).at_least(20.0).pass], [Some(true), Some(false)]);
        let nothing = [row(f64::NAN).at_most(1.0), row(f64::NAN).at_least(1.0), row(f64::NAN).exactly(0.0)];
        assert!(nothing.iter().all(|row| row.pass == Some(false)));
        assert_eq!(row(f64::NAN).cells(), ["", NOT_JUDGED, "-", ""]);
        assert_eq!(row(1.0).exactly(2.0).not_judged(), row(1.0));
        assert_eq!(row(0.012_34).published(0.0101).at_most(0.0101).cells(), ["0.0101", "<= 0.0101", "0.0123", "NO"]);
    }

    #[test]
    fn values_are_printed_with_few_digits() {
        assert_eq!([3.0, 1.25, 1180.44, 3.2e-14].map(number), ["3", "1.2500", "1180.4", "3.2e-14"]);
    }
}
