//! A plot of one quantity over another, with one line per series; for sweeps.

use super::Figure;
use super::canvas::Stroke;
use super::chart::{Chart, Layer, Plot, Section};
use super::panel::Range;
use super::style::{Mark, REFERENCE_LINE, RUN_COLORS};

const HEIGHT: f64 = 230.0;

/// Content of the plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Curves {
    /// Label of the horizontal axis, with its unit.
    pub x: String,
    /// Label of the vertical axis, with its unit.
    pub y: String,
    /// True: the vertical axis is logarithmic, and all values are positive.
    pub logarithmic: bool,
    /// Names and points of the series, points in order of x.
    pub series: Vec<(String, Vec<(f64, f64)>)>,
    /// Name and value of a dashed horizontal line.
    pub limit: Option<(String, f64)>,
}

impl Curves {
    /// The plot as a figure. Equal points give equal bytes.
    pub fn figure(&self, name: &str) -> Figure {
        let points = || self.series.iter().flat_map(|(_, points)| points);
        let xs: Vec<f64> = points().map(|p| p.0).collect();
        let ys: Vec<f64> = points().map(|p| p.1).chain(self.limit.iter().map(|(_, level)| *level)).collect();
        let y = if self.logarithmic {
            let (low, high) = ys.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), y| (low.min(*y), high.max(*y)));
            Range { min: low / 1.5, max: high * 1.5 }
        } else {
            Range::covering(ys.iter().chain([&0.0]), 1e-9)
        };
        let (mut layers, mut legend) = (Vec::new(), Vec::new());
        if let Some((name, level)) = &self.limit {
            layers.push(Layer::Level(*level, REFERENCE_LINE));
            legend.push((name.clone(), Mark::Dashed(REFERENCE_LINE)));
        }
        for ((name, points), color) in self.series.iter().zip(RUN_COLORS.into_iter().cycle()) {
            let stroke = Stroke { color, width: 1.3 };
            layers.push(Layer::Path(points.clone(), stroke));
            layers.push(Layer::Dots(points.clone(), 2.4, color));
            legend.push((name.clone(), Mark::Line(stroke)));
        }
        let plot = Plot {
            x_label: self.x.clone(),
            y_label: self.y.clone(),
            x: Range::covering(&xs, 1e-9),
            y,
            logarithmic: [false, self.logarithmic],
            height: HEIGHT,
            layers,
            ..Plot::default()
        };
        let caption = format!("{} over {}.", self.y, self.x);
        Figure::of_chart(name, name, &Chart { caption, sections: vec![Section::column(vec![plot])], legend })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_series_and_the_limit_are_in_the_legend() {
        let curves = Curves {
            x: "ratio".to_owned(),
            y: "distance".to_owned(),
            logarithmic: true,
            series: vec![("first".to_owned(), vec![(0.0, 1.0), (1.0, 0.1)]), ("second".to_owned(), vec![(0.0, 0.5)])],
            limit: Some(("limit".to_owned(), 0.05)),
        };
        let svg = curves.figure("sweep").svg();
        for text in ["ratio", "distance", "first", "second", "limit"] {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(svg.matches("<circle").count(), 3);
    }
}
