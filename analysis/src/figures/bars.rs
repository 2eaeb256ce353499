//! Horizontal bars: one group per row, one bar per series; for comparisons of variants.

use super::canvas::{Align, Drawing};
use super::style::{FRAME, GRID, LABEL_EM, Mark, RIGHT_MARGIN, RUN_COLORS, TEXT, TICK_EM, UNITS_PER_MM, legend};
use super::text::text_width;
use super::{Figure, PAGE_MM};

const BAR: f64 = 7.0;
const GAP: f64 = 7.0;
const TOP: f64 = 26.0;
const BOTTOM: f64 = 36.0;

/// Content of the figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars {
    /// Label of the axis, with its unit.
    pub label: String,
    /// Right end of the axis; its left end is 0.
    pub end: f64,
    /// Names of the series.
    pub series: Vec<String>,
    /// Name and values of each row, one value for each series, 0 to `end`; NaN has no bar.
    pub rows: Vec<(String, Vec<f64>)>,
}

impl Bars {
    /// The bars as a figure. Equal values give equal bytes.
    pub fn figure(&self, name: &str, title: &str) -> Figure {
        let width = PAGE_MM * UNITS_PER_MM;
        let left = 10.0 + self.rows.iter().map(|(name, _)| text_width(name, LABEL_EM)).fold(0.0, f64::max);
        #[expect(clippy::cast_precision_loss, reason = "a few rows and series")]
        let (n_rows, n_series) = (self.rows.len() as f64, self.series.len() as f64);
        let group = n_series * BAR + GAP;
        let bottom = TOP + n_rows * group;
        let mut drawing = Drawing::new(width, bottom + BOTTOM);
        let right = width - RIGHT_MARGIN;
        let at = |value: f64| left + (right - left) * (value / self.end).clamp(0.0, 1.0);
        for part in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let x = at(part * self.end);
            drawing.line(vec![(x, TOP), (x, bottom)], GRID);
            drawing.text((x, bottom + 12.0), format!("{}", part * self.end), TICK_EM, Align::Middle, TEXT);
        }
        let mut y = TOP + 0.5 * GAP;
        for (name, values) in &self.rows {
            let middle = y + 0.5 * n_series * BAR + 0.35 * LABEL_EM;
            drawing.text((left - 5.0, middle), name.as_str(), LABEL_EM, Align::Right, TEXT);
            for (value, color) in values.iter().zip(RUN_COLORS.into_iter().cycle()) {
                if value.is_finite() {
                    drawing.rect((left, y + 0.5), ((at(*value) - left).max(1.0), BAR - 1.0), color);
                }
                y += BAR;
            }
            y += GAP;
        }
        drawing.line(vec![(left, TOP), (left, bottom), (right, bottom)], FRAME);
        drawing.text((0.5 * (left + right), bottom + 28.0), self.label.as_str(), LABEL_EM, Align::Middle, TEXT);
        let marks = RUN_COLORS.into_iter().cycle().map(Mark::Fill);
        let entries: Vec<(&str, Mark)> = self.series.iter().map(String::as_str).zip(marks).collect();
        legend(&mut drawing, left, 16.0, &entries);
        let caption = format!("{}: {}.", self.label, self.series.join(", "));
        Figure::of_drawing(name, title, caption, drawing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_finite_value_has_a_bar_of_its_length() {
        let bars = Bars {
            label: "falls (%)".to_owned(),
            end: 100.0,
            series: vec!["added".to_owned(), "removed".to_owned()],
            rows: vec![("sway".to_owned(), vec![50.0, 100.0]), ("trim".to_owned(), vec![f64::NAN, 0.0])],
        };
        let svg = bars.figure("ablation", "Ablation").svg();
        for text in ["falls (%)", "added", "removed", "sway", "trim"] {
            assert!(svg.contains(text), "{text}");
        }
        let widths: Vec<f64> = svg
            .split("<rect")
            .skip(1)
            .filter(|rect| rect.contains("height=\"6\""))
            .map(|rect| rect.split("width=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap())
            .collect();
        assert_eq!(widths.len(), 3, "{svg}");
        assert!((widths[0] / widths[1] - 0.5).abs() < 0.01 && widths[2] == 1.0, "{widths:?}");
    }
}
