//! A pair of axes: ranges, ticks, lines and shading.

use super::canvas::{Align, Drawing, RGBAColor, Stroke};
use super::style::{FRAME, GRID, LABEL_EM, TEXT, TICK_EM};
use super::text::text_width;

/// A closed interval of values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
}

impl Range {
    /// Range of the finite values with a margin of 6 %, at least `least_span` wide; `0 ± least_span / 2` without finite values.
    pub fn covering<'a>(values: impl IntoIterator<Item = &'a f64>, least_span: f64) -> Self {
        let finite = values.into_iter().copied().filter(|v| v.is_finite());
        let (min, max) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        let (middle, span) = if min <= max { (0.5 * (min + max), max - min) } else { (0.0, 0.0) };
        let half = 0.5 * (span * 1.12).max(least_span);
        Self { min: middle - half, max: middle + half }
    }

    fn span(self) -> f64 {
        self.max - self.min
    }
}

/// Position and size of a panel in its drawing, units of 1/96 inch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

/// A pair of axes in a frame.
#[derive(Clone, Copy, Debug)]
pub struct Panel {
    frame: Frame,
    x: Range,
    y: Range,
    /// Logarithmic axes: horizontal, vertical. Their values are positive.
    logarithmic: [bool; 2],
}

/// Labels and ticks of the axes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Labels<'a> {
    /// Label of the horizontal axis; `None`: ticks without numbers.
    pub x: Option<&'a str>,
    /// Label of the vertical axis; `None`: ticks without numbers.
    pub y: Option<&'a str>,
    /// Whether axes have ticks: horizontal, vertical.
    pub ticks: [bool; 2],
}

impl Panel {
    /// Axes with these ranges.
    pub fn new(frame: Frame, x: Range, y: Range, logarithmic: [bool; 2]) -> Self {
        Self { frame, x, y, logarithmic }
    }

    /// Range of the horizontal axis.
    pub fn x(&self) -> Range {
        self.x
    }

    /// Range of the vertical axis.
    pub fn y(&self) -> Range {
        self.y
    }

    /// Position of a data point in the drawing. Values outside the vertical range are moved to the edge.
    pub fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let Frame { left, top, width, height } = self.frame;
        let share = |value: f64, range: Range, logarithmic: bool| {
            if logarithmic {
                (value / range.min).ln() / (range.max / range.min).ln()
            } else {
                (value - range.min) / range.span()
            }
        };
        let up = share(y, self.y, self.logarithmic[1]).clamp(0.0, 1.0);
        (left + share(x, self.x, self.logarithmic[0]) * width, top + (1.0 - up) * height)
    }

    /// Fills the interval between two values of x, clipped to the panel, at `(top, height)` in the drawing.
    pub fn strip(&self, drawing: &mut Drawing, (from, to): (f64, f64), (top, height): (f64, f64), color: RGBAColor) {
        let (from, to) = (from.max(self.x.min), to.min(self.x.max));
        if from < to {
            let (left, right) = (self.at(from, self.y.max).0, self.at(to, self.y.max).0);
            drawing.rect((left, top), (right - left, height), color);
        }
    }

    /// Draws a line through the samples, interrupted at NaN and thinned to the extremes of each unit of width. It looks like a line through all samples.
    pub fn line(&self, drawing: &mut Drawing, xs: &[f64], ys: &[f64], stroke: Stroke) {
        for points in self.thinned(xs, ys) {
            drawing.line(points, stroke);
        }
    }

    /// As [`Panel::line`], dashed.
    pub fn dashed(&self, drawing: &mut Drawing, xs: &[f64], ys: &[f64], stroke: Stroke) {
        for points in self.thinned(xs, ys) {
            for dash in dashes(&points, 4.0, 2.5) {
                drawing.line(dash, stroke);
            }
        }
    }

    /// The area between two lines, each thinned to its extremes, broken at NaN.
    pub fn band(&self, drawing: &mut Drawing, xs: &[f64], low: &[f64], high: &[f64], color: RGBAColor) {
        let columns = |ys: &[f64], upper: bool| {
            let mut out: Vec<(f64, f64)> = Vec::new();
            for (&x, &y) in xs.iter().zip(ys) {
                let inside = x >= self.x.min && x <= self.x.max;
                let (px, py) = self.at(x, y);
                match out.last_mut() {
                    Some(last) if inside && last.0.floor() == px.floor() && last.1.is_nan() == y.is_nan() => {
                        last.1 = if upper { last.1.min(py) } else { last.1.max(py) };
                    }
                    _ if inside => out.push((px, if y.is_nan() { f64::NAN } else { py })),
                    _ => {}
                }
            }
            out
        };
        let (low, high) = (columns(low, false), columns(high, true));
        for (low, high) in low.split(|p| p.1.is_nan()).zip(high.split(|p| p.1.is_nan())) {
            drawing.area(high.iter().chain(low.iter().rev()).copied().collect(), color);
        }
    }

    /// Draws a dashed line across the panel, from a point on its left or upper edge.
    pub fn rule(&self, drawing: &mut Drawing, (x, y): (f64, f64), stroke: &Stroke) {
        let Frame { left, top, width, height } = self.frame;
        let end = if x <= left && y > top { (left + width, y) } else { (x, top + height) };
        for dash in dashes(&[(x, y), end], 4.0, 2.5) {
            drawing.line(dash, *stroke);
        }
    }

    /// Median and maximum of the samples in each interval of `width` units, as two series of points. NaN is ignored.
    pub fn median_and_max(&self, xs: &[f64], ys: &[f64], width: f64) -> [Vec<(f64, f64)>; 2] {
        let finite: Vec<(f64, f64)> = xs.iter().copied().zip(ys.iter().copied()).filter(|p| p.1.is_finite()).collect();
        let stretch = |p: &(f64, f64)| ((self.at(p.0, self.y.max).0 - self.frame.left) / width).floor();
        let mut out = [Vec::new(), Vec::new()];
        for samples in finite.chunk_by(|a, b| stretch(a) == stretch(b)) {
            let x = self.frame.left + (stretch(&samples[0]) + 0.5) * width;
            let mut sorted: Vec<f64> = samples.iter().map(|p| p.1).collect();
            sorted.sort_by(f64::total_cmp);
            for (points, y) in out.iter_mut().zip([sorted[sorted.len() / 2], sorted[sorted.len() - 1]]) {
                points.push((x.min(self.frame.left + self.frame.width), self.at(self.x.min, y).1));
            }
        }
        out
    }

    fn thinned(&self, xs: &[f64], ys: &[f64]) -> Vec<Vec<(f64, f64)>> {
        let inside = |x: f64| x >= self.x.min && x <= self.x.max;
        let samples = xs.iter().zip(ys).filter(|(x, _)| inside(**x));
        let points: Vec<(f64, f64)> =
            samples.map(|(&x, &y)| if y.is_finite() { self.at(x, y) } else { (x, f64::NAN) }).collect();
        points.split(|p| p.1.is_nan()).filter(|piece| piece.len() > 1).map(thin).collect()
    }

    /// Draws frame, ticks, numbers and labels. Call it last, so that the frame is on top of the data.
    pub fn axes(&self, drawing: &mut Drawing, labels: Labels) {
        let Frame { left, top, width, height } = self.frame;
        let (right, bottom) = (left + width, top + height);
        for (value, text) in self.x_ticks().into_iter().filter(|_| labels.ticks[0]) {
            let x = self.at(value, self.y.min).0;
            drawing.line(vec![(x, bottom), (x, bottom + 3.0)], FRAME);
            if labels.x.is_some() {
                let rightmost = drawing.width() - 0.5 * text_width(&text, TICK_EM) - 1.0;
                drawing.text((x.min(rightmost), bottom + 13.0), text, TICK_EM, Align::Middle, TEXT);
            }
        }
        for (value, text) in self.y_ticks().into_iter().filter(|_| labels.ticks[1]) {
            let y = self.at(self.x.min, value).1;
            drawing.line(vec![(left - 3.0, y), (left, y)], FRAME);
            if labels.y.is_some() {
                drawing.text((left - 5.0, y + 0.36 * TICK_EM), text, TICK_EM, Align::Right, TEXT);
            }
        }
        drawing.line(vec![(left, top), (left, bottom), (right, bottom)], FRAME);
        if let Some(label) = labels.x {
            drawing.text((left + 0.5 * width, bottom + 27.0), label, LABEL_EM, Align::Middle, TEXT);
        }
        if let Some(label) = labels.y {
            drawing.text_upward((left - 40.0, top + 0.5 * height), label, LABEL_EM, TEXT);
        }
    }

    fn x_ticks(&self) -> Vec<(f64, String)> {
        let count = (self.frame.width / 45.0).clamp(2.0, 9.0) as usize;
        if self.logarithmic[0] { decades(self.x, self.frame.width / 30.0) } else { ticks(self.x, count) }
    }

    fn y_ticks(&self) -> Vec<(f64, String)> {
        let count = (self.frame.height / 16.0).clamp(3.0, 6.0) as usize;
        if self.logarithmic[1] { decades(self.y, self.frame.height / 13.0) } else { ticks(self.y, count) }
    }

    /// Draws grid lines at the numbers of the vertical axis. Call it first.
    pub fn grid(&self, drawing: &mut Drawing) {
        for (value, _) in self.y_ticks() {
            drawing.line(vec![self.at(self.x.min, value), self.at(self.x.max, value)], GRID);
        }
    }
}

/// First point, extremes and last point of each unit of width, in their order.
fn thin(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut out = Vec::new();
    for column in points.chunk_by(|a, b| a.0.floor() == b.0.floor()) {
        let by_height = |a: &usize, b: &usize| column[*a].1.total_cmp(&column[*b].1);
        let low = (0..column.len()).min_by(by_height).unwrap_or(0);
        let high = (0..column.len()).max_by(by_height).unwrap_or(0);
        let mut kept = [0, low.min(high), low.max(high), column.len() - 1];
        kept.sort_unstable();
        out.extend(kept.iter().enumerate().filter(|&(i, k)| i == 0 || kept[i - 1] != *k).map(|(_, &k)| column[k]));
    }
    out
}

/// Dashes of a polyline, `on` long with gaps of `off`, by arc length.
fn dashes(points: &[(f64, f64)], on: f64, off: f64) -> Vec<Vec<(f64, f64)>> {
    let mut out = Vec::new();
    let mut dash = vec![points[0]];
    let (mut drawing, mut left) = (true, on);
    for pair in points.windows(2) {
        let (mut from, to) = (pair[0], pair[1]);
        let mut length = (to.0 - from.0).hypot(to.1 - from.1);
        while length > left {
            let share = left / length;
            from = (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1));
            length -= left;
            if drawing {
                dash.push(from);
                out.push(std::mem::take(&mut dash));
            } else {
                dash = vec![from];
            }
            drawing = !drawing;
            left = if drawing { on } else { off };
        }
        left -= length;
        if drawing {
            dash.push(to);
        }
    }
    if dash.len() > 1 {
        out.push(dash);
    }
    out
}

/// About `count` or fewer round values in the range (steps of 1, 2 or 5 times a power of ten), with their texts.
fn ticks(range: Range, count: usize) -> Vec<(f64, String)> {
    let raw = range.span() / count as f64;
    let power = 10_f64.powf(raw.log10().floor());
    let step = power * [1.0, 2.0, 5.0, 10.0].into_iter().find(|m| m * power >= raw * 0.999).unwrap_or(10.0);
    let decimals = (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    let (first, last) = ((range.min / step).ceil() as i64, (range.max / step).floor() as i64);
    (first..=last).map(|k| (k as f64 * step, number(k as f64 * step, decimals))).collect()
}

/// The multiples 1, 2 and 5 of each power of ten in the range, or the powers alone if there are too many.
fn decades(range: Range, room: f64) -> Vec<(f64, String)> {
    let (first, last) = (range.min.log10().floor() as i32, range.max.log10().ceil() as i32);
    let of_each = |multiples: &[f64], powers: usize| -> Vec<(f64, String)> {
        (first..=last)
            .step_by(powers)
            .flat_map(|power| multiples.iter().map(move |m| (m * 10_f64.powi(power), power)))
            .filter(|(value, _)| (range.min..=range.max).contains(value))
            .map(|(value, power)| (value, number(value, usize::try_from(-power).unwrap_or(0))))
            .collect()
    };
    let choices = [of_each(&[1.0, 2.0, 5.0], 1), of_each(&[1.0], 1), of_each(&[1.0], 2)];
    let fits = choices.iter().position(|numbers| numbers.len() as f64 <= room && numbers.len() > 1);
    choices.into_iter().nth(fits.unwrap_or(2)).unwrap_or_default()
}

/// A number with the sign U+2212 for minus, and no sign for zero.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.abs());
    if value < 0.0 && text.bytes().any(|b| (b'1'..=b'9').contains(&b)) { format!("\u{2212}{text}") } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let texts = |min, max, n| ticks(Range { min, max }, n).into_iter().map(|t| t.1).collect::<Vec<_>>();
        assert_eq!(texts(-0.051, 0.103, 4), ["\u{2212}0.05", "0.00", "0.05", "0.10"]);
        assert_eq!(texts(0.0, 60.0, 6), ["0", "10", "20", "30", "40", "50", "60"]);
        assert_eq!(decades(Range { min: 90.0, max: 1100.0 }, 10.0).len(), 4);
    }

    #[test]
    fn thinning_keeps_a_spike() {
        let panel = Panel::new(
            Frame { left: 0.0, top: 0.0, width: 10.0, height: 100.0 },
            Range { min: 0.0, max: 1.0 },
            Range { min: 0.0, max: 1.0 },
            [false; 2],
        );
        let xs: Vec<f64> = (0..10_000).map(|i| f64::from(i) / 10_000.0).collect();
        let mut ys = vec![0.5; 10_000];
        ys[5001] = 1.0;
        let pieces = panel.thinned(&xs, &ys);
        assert_eq!(pieces.len(), 1);
        assert!(pieces[0].len() <= 40 && pieces[0].iter().any(|p| p.1 == 0.0), "the spike is drawn up to the top");
        ys[3000] = f64::NAN;
        assert_eq!(panel.thinned(&xs, &ys).len(), 2, "NaN interrupts the line");
    }

    #[test]
    fn dashes_cover_their_share() {
        let pieces = dashes(&[(0.0, 0.0), (13.0, 0.0)], 4.0, 2.5);
        let lengths: Vec<f64> = pieces.iter().map(|p| p[p.len() - 1].0 - p[0].0).collect();
        assert_eq!(lengths, [4.0, 4.0]);
    }
}
