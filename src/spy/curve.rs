//! Values over time, reduced to the width of a screen.

/// Bars of a sparkline, lowest first.
const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// The values of one field over the visible time span.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Curve {
    /// Channel.
    pub channel: String,
    /// Field.
    pub path: String,
    /// Time since now, s (negative), and value; oldest first.
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    /// Finite values of the last `span_s`.
    fn shown(&self, span_s: f64) -> impl Iterator<Item = (f64, f64)> {
        self.points.iter().copied().filter(move |(t, value)| *t >= -span_s && value.is_finite())
    }

    /// Smallest and largest value of the last `span_s`.
    pub fn range(&self, span_s: f64) -> Option<(f64, f64)> {
        range(self.shown(span_s).map(|(_, value)| value))
    }

    /// The last value.
    pub fn last(&self) -> Option<f64> {
        self.points.last().map(|(_, value)| *value)
    }

    /// One bar per column, from `span_s` ago to now: the last value in the column's interval, blank if it has none.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "limited to the columns and bars there are"
    )]
    pub fn bars(&self, span_s: f64, width: usize) -> String {
        let Some((low, high)) = self.range(span_s) else { return " ".repeat(width) };
        let mut bars = vec![' '; width];
        for (t, value) in self.shown(span_s) {
            let column = ((t / span_s + 1.0) * width as f64) as usize;
            let part = if high > low { (value - low) / (high - low) } else { 0.5 };
            let bar = BARS[((part * BARS.len() as f64) as usize).min(BARS.len() - 1)];
            if width > 0 {
                bars[column.min(width - 1)] = bar;
            }
        }
        bars.into_iter().collect()
    }

    /// Reduces the points to the resolution of a plot: the smallest and the largest value per column, in the order of time.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited to the columns there are")]
    pub fn thinned(&self, span_s: f64, columns: usize) -> Vec<(f64, f64)> {
        let column = |point: &(f64, f64)| ((point.0 / span_s + 1.0) * columns as f64) as usize;
        let shown: Vec<_> = self.shown(span_s).collect();
        shown.chunk_by(|a, b| column(a) == column(b)).flat_map(extremes).collect()
    }
}

/// The smallest and the largest value, in the order of time; one point if both are the same.
fn extremes(points: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> {
    let places = || 0..points.len();
    let low = places().min_by(|a, b| points[*a].1.total_cmp(&points[*b].1)).unwrap_or(0);
    let high = places().max_by(|a, b| points[*a].1.total_cmp(&points[*b].1)).unwrap_or(0);
    let second = Some(low.max(high)).filter(|_| low != high);
    std::iter::once(low.min(high)).chain(second).map(|place| points[place])
}

/// Smallest and largest value.
pub fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |range, x| {
        let (low, high) = range.unwrap_or((x, x));
        Some((x.min(low), x.max(high)))
    })
}

/// Bounds of an axis: the range plus a margin of 5 %, never of zero length.
pub fn bounds(range: Option<(f64, f64)>) -> [f64; 2] {
    let Some((low, high)) = range else { return [-1.0, 1.0] };
    let room = if high > low { 0.05 * (high - low) } else { 0.05 * high.abs().max(1e-3) };
    [low - room, high + room]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(points: &[(f64, f64)]) -> Curve {
        Curve { points: points.to_vec(), ..Curve::default() }
    }

    #[test]
    fn bars_are_placed_by_time() {
        let curve = curve(&[(-4.0, 0.0), (-3.0, 7.0), (-1.0, 3.6), (0.0, f64::NAN)]);
        assert_eq!(curve.bars(4.0, 4), "▁█ ▅");
        assert_eq!(curve.bars(2.0, 4), "  ▅ ");
        assert_eq!(Curve::default().bars(4.0, 3), "   ");
        assert_eq!((curve.range(4.0), curve.range(2.0)), (Some((0.0, 7.0)), Some((3.6, 3.6))));
    }

    #[test]
    fn thinning_keeps_peaks() {
        let mut points: Vec<(f64, f64)> = (0..1000).map(|n| (f64::from(n) * 0.001 - 1.0, 0.0)).collect();
        points[437].1 = 5.0;
        points[441].1 = -2.0;
        let thinned = curve(&points).thinned(1.0, 10);
        assert!(thinned.len() <= 20);
        let peak = thinned.iter().position(|point| *point == points[437]);
        assert_eq!(peak.map(|at| thinned[at + 1]), Some(points[441]));
        assert!(thinned.is_sorted_by(|a, b| a.0 <= b.0));
    }

    #[test]
    fn axis_bounds_are_never_equal() {
        assert_eq!(bounds(Some((0.0, 10.0))), [-0.5, 10.5]);
        assert_eq!(bounds(Some((2.0, 2.0))), [1.9, 2.1]);
        assert_eq!(bounds(None), [-1.0, 1.0]);
    }
}
