//! A plot of points: one quantity over another, one line a series. For sweeps, where a figure is not of one run.

use std::path::Path;

use super::canvas::{Drawing, Stroke};
use super::panel::{Frame, Labels, Panel, Range};
use super::style::{
    BLACK, BLUE, BOTTOM_MARGIN, LEFT_MARGIN, LEG_COLORS, Mark, PAGE_WIDTH, REFERENCE_LINE, RIGHT_MARGIN, TOP_MARGIN,
    VERMILLION, legend,
};
use crate::Error;

const HEIGHT: f64 = 230.0;

/// What to plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Curves {
    /// Label of the horizontal axis, with its unit.
    pub x: String,
    /// Label of the vertical axis, with its unit.
    pub y: String,
    /// The vertical axis goes by the logarithm; all values are positive.
    pub logarithmic: bool,
    /// Names and points, in the order of their abscissae.
    pub series: Vec<(String, Vec<(f64, f64)>)>,
    /// A level to be marked, with its name.
    pub limit: Option<(String, f64)>,
}

impl Curves {
    /// Writes `NAME.svg` and `NAME.png` (288 dpi) into a directory. The same points give the same bytes.
    ///
    /// # Errors
    /// A folder that cannot be written to.
    pub fn write(&self, dir: &Path, name: &str) -> Result<(), Error> {
        let failed = |reason| Error::Figure { figure: name.to_owned(), reason };
        let drawing = self.draw();
        let path = dir.join(format!("{name}.svg"));
        std::fs::write(&path, drawing.svg().map_err(failed)?).map_err(|source| Error::Write { path, source })?;
        drawing.write_png(&dir.join(format!("{name}.png"))).map_err(failed)
    }

    fn draw(&self) -> Drawing {
        let mut drawing = Drawing::new(PAGE_WIDTH, TOP_MARGIN + HEIGHT + BOTTOM_MARGIN);
        let points = || self.series.iter().flat_map(|(_, points)| points);
        let xs: Vec<f64> = points().map(|p| p.0).collect();
        let ys: Vec<f64> = points().map(|p| p.1).chain(self.limit.iter().map(|(_, level)| *level)).collect();
        let width = drawing.width() - LEFT_MARGIN - RIGHT_MARGIN;
        let frame = Frame { left: LEFT_MARGIN, top: TOP_MARGIN, width, height: HEIGHT };
        let x = Range::covering(&xs, 1e-9);
        let panel = if self.logarithmic {
            let (low, high) = ys.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), y| (low.min(*y), high.max(*y)));
            Panel::new(frame, x, Range { min: low / 1.5, max: high * 1.5 }).logarithmic()
        } else {
            Panel::new(frame, x, Range::covering(ys.iter().chain([&0.0]), 1e-9))
        };
        panel.grid(&mut drawing);
        let mut entries = Vec::new();
        if let Some((name, level)) = &self.limit {
            panel.dashed(&mut drawing, &[x.min, x.max], &[*level, *level], REFERENCE_LINE);
            entries.push((name.as_str(), Mark::Dashed(REFERENCE_LINE)));
        }
        let colors = [BLUE, VERMILLION, LEG_COLORS[0], LEG_COLORS[2], BLACK];
        for ((name, points), color) in self.series.iter().zip(colors.into_iter().cycle()) {
            let stroke = Stroke { color, width: 1.3 };
            drawing.line(points.iter().map(|p| panel.at(p.0, p.1)).collect(), stroke);
            for p in points {
                drawing.dot(panel.at(p.0, p.1), 2.4, color);
            }
            entries.push((name.as_str(), Mark::Line(stroke)));
        }
        panel.axes(&mut drawing, Labels { x: Some(&self.x), y: Some(&self.y) });
        legend(&mut drawing, LEFT_MARGIN, 14.0, &entries);
        drawing
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
        let svg = curves.draw().svg().unwrap();
        for text in ["ratio", "distance", "first", "second", "limit"] {
            assert!(svg.contains(text), "{text}");
        }
        assert_eq!(svg.matches("<circle").count(), 3);
    }
}
