//! A chart: panels with layers, laid out for any width.
//!
//! Panels are arranged in sections, column by column. On a narrow sheet the columns are stacked, so the same chart fits the width of a page and of a column.

use std::rc::Rc;

use super::canvas::{Align, Drawing, RGBAColor, Stroke};
use super::panel::{Frame, Labels, Panel, Range};
use super::style::{
    BOTTOM_MARGIN, LABEL_EM, LEFT_MARGIN, LEGEND_ROW, Mark, RIGHT_MARGIN, TEXT, TICK_EM, TOP_MARGIN, legend,
    legend_rows,
};

/// Sheets narrower than this use one column.
const ONE_COLUMN: f64 = 450.0;
/// Vertical space between panels.
const GAP: f64 = 12.0;
/// Space between columns, including the numbers of the right column.
const COLUMN_GAP: f64 = 62.0;
/// Height of the text above a panel.
const HEADING: f64 = 16.0;
/// Height of a strip above a panel.
const STRIP: f64 = 4.0;

/// Begin and end of intervals.
pub type Spans = Vec<(f64, f64)>;

/// A figure before its layout.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// One or two sentences about the content.
    pub caption: String,
    /// Groups of panels, from the top.
    pub sections: Vec<Section>,
    /// Legend entries: text and mark.
    pub legend: Vec<(String, Mark)>,
}

/// Columns of panels.
#[derive(Clone, Debug)]
pub struct Section {
    /// Relative width of each column.
    pub columns: Vec<f64>,
    /// Panels column by column, from the top.
    pub plots: Vec<Plot>,
    /// True: the panels of a column share their horizontal axis, with numbers below the last panel only.
    pub shared_x: bool,
}

/// One panel.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Text above the panel.
    pub heading: Option<String>,
    /// Label of the horizontal axis.
    pub x_label: String,
    /// Label of the vertical axis.
    pub y_label: String,
    /// Horizontal axis.
    pub x: Range,
    /// Vertical axis.
    pub y: Range,
    /// Logarithmic axes: horizontal, vertical.
    pub logarithmic: [bool; 2],
    /// Height.
    pub height: f64,
    /// Names of rows of equal height from the top, instead of numbers at the vertical axis.
    pub rows: Vec<String>,
    /// Names of two columns of equal width, instead of numbers at the horizontal axis.
    pub categories: Option<[String; 2]>,
    /// Layers in drawing order.
    pub layers: Vec<Layer>,
    /// Lines of text in the upper left corner.
    pub notes: Vec<String>,
}

impl Default for Plot {
    fn default() -> Self {
        let unit = Range { min: 0.0, max: 1.0 };
        Self {
            heading: None,
            x_label: "time [s]".to_owned(),
            y_label: String::new(),
            x: unit,
            y: unit,
            logarithmic: [false; 2],
            height: 92.0,
            rows: Vec::new(),
            categories: None,
            layers: Vec::new(),
            notes: Vec::new(),
        }
    }
}

/// Content of a panel, in units of its axes.
#[derive(Clone, Debug)]
pub enum Layer {
    /// Shaded background of intervals.
    Shade(Spans, RGBAColor),
    /// Bars above the panel; each layer has its own strip.
    Strip(Spans, RGBAColor),
    /// Bars inside the panel; top and height are fractions of the height of the panel.
    Bars(Spans, (f64, f64), RGBAColor),
    /// A line, thinned to the resolution of the layout.
    Line { xs: Rc<[f64]>, ys: Vec<f64>, stroke: Stroke, dashed: bool },
    /// Filled area between two lines, thinned in the same way.
    Band { xs: Rc<[f64]>, low: Vec<f64>, high: Vec<f64>, color: RGBAColor },
    /// Median, and maximum in a paler color, of short intervals.
    Spread { xs: Rc<[f64]>, ys: Vec<f64>, stroke: Stroke },
    /// A polyline, not thinned.
    Path(Vec<(f64, f64)>, Stroke),
    /// A filled rectangle between two corners.
    Box((f64, f64), (f64, f64), RGBAColor),
    /// Discs.
    Dots(Vec<(f64, f64)>, f64, RGBAColor),
    /// Text centered on a point.
    Text((f64, f64), String, RGBAColor),
    /// A dashed horizontal line at a value.
    Level(f64, Stroke),
    /// A dashed vertical line at a value.
    Upright(f64, Stroke),
}

impl Chart {
    /// The drawing for a sheet of this width.
    pub fn draw(&self, width: f64) -> Drawing {
        let entries: Vec<(&str, Mark)> = self.legend.iter().map(|(text, mark)| (text.as_str(), *mark)).collect();
        let rows = legend_rows(&entries, width - LEFT_MARGIN);
        let head = if entries.is_empty() { 10.0 } else { TOP_MARGIN + LEGEND_ROW * (rows.len().max(1) - 1) as f64 };
        let mut places = Vec::new();
        let mut top = head;
        for section in &self.sections {
            top = section.lay_out(width, top, &mut places);
        }
        let mut drawing = Drawing::new(width, top);
        for (plot, frame, numbered) in places {
            plot.draw(&mut drawing, frame, numbered);
        }
        for (k, row) in rows.iter().enumerate() {
            legend(&mut drawing, LEFT_MARGIN, 14.0 + LEGEND_ROW * k as f64, row);
        }
        drawing
    }
}

impl Section {
    /// A section of one column with a shared horizontal axis.
    pub fn column(plots: Vec<Plot>) -> Self {
        Self { columns: vec![1.0], plots, shared_x: true }
    }

    /// Adds the frame of each panel and whether its horizontal axis has numbers; returns the lower end.
    fn lay_out<'a>(&'a self, width: f64, top: f64, places: &mut Vec<(&'a Plot, Frame, bool)>) -> f64 {
        let columns: &[f64] = if width < ONE_COLUMN { &[1.0] } else { &self.columns };
        let per_column = self.plots.len().div_ceil(columns.len()).max(1);
        let room = width - LEFT_MARGIN - RIGHT_MARGIN - COLUMN_GAP * (columns.len() - 1) as f64;
        let whole: f64 = columns.iter().sum();
        let (mut left, mut lowest) = (LEFT_MARGIN, top);
        for (plots, share) in self.plots.chunks(per_column).zip(columns) {
            let mut y = top;
            for (k, plot) in plots.iter().enumerate() {
                let last = k + 1 == plots.len();
                let numbered = last || !self.shared_x;
                let strips = plot.layers.iter().filter(|layer| matches!(layer, Layer::Strip(..))).count() as f64;
                y += if plot.heading.is_some() { HEADING } else { 0.0 } + STRIP * strips;
                let frame = Frame { left, top: y, width: room * share / whole, height: plot.height };
                places.push((plot, frame, numbered));
                y += plot.height + if numbered { BOTTOM_MARGIN } else { GAP };
            }
            left += room * share / whole + COLUMN_GAP;
            lowest = lowest.max(y);
        }
        lowest
    }
}

impl Plot {
    fn draw(&self, drawing: &mut Drawing, frame: Frame, numbered: bool) {
        let panel = Panel::new(frame, self.x, self.y, self.logarithmic);
        let is_back = |layer: &&Layer| matches!(layer, Layer::Shade(..));
        self.layers.iter().filter(is_back).for_each(|layer| layer.draw(drawing, &panel, frame, 0));
        if self.rows.is_empty() {
            panel.grid(drawing);
        }
        let mut strips = 0;
        for layer in self.layers.iter().filter(|layer| !is_back(layer)) {
            layer.draw(drawing, &panel, frame, strips);
            strips += usize::from(matches!(layer, Layer::Strip(..)));
        }
        let y = if self.rows.is_empty() { Some(&*self.y_label) } else { None };
        let ticks = [self.categories.is_none(), self.rows.is_empty()];
        panel.axes(drawing, Labels { x: numbered.then_some(&*self.x_label), y, ticks });
        for (k, name) in self.categories.iter().flatten().enumerate() {
            let x = frame.left + (k as f64 + 0.5) / 2.0 * frame.width;
            drawing.text((x, frame.top + frame.height + 13.0), name, TICK_EM, Align::Middle, TEXT);
        }
        for (k, name) in self.rows.iter().enumerate() {
            let middle = frame.top + (k as f64 + 0.5) / self.rows.len() as f64 * frame.height;
            drawing.text((frame.left - 8.0, middle + 0.36 * LABEL_EM), name, LABEL_EM, Align::Right, TEXT);
        }
        if let Some(heading) = &self.heading {
            let strip_room = STRIP * strips as f64;
            let place = (frame.left + 0.5 * frame.width, frame.top - 5.0 - strip_room);
            drawing.text(place, heading, LABEL_EM, Align::Middle, TEXT);
        }
        for (k, note) in self.notes.iter().enumerate() {
            let place = (frame.left + 5.0, frame.top + 9.0 + 11.0 * k as f64);
            drawing.text(place, note, TICK_EM, Align::Left, TEXT);
        }
    }
}

impl Layer {
    fn draw(&self, drawing: &mut Drawing, panel: &Panel, frame: Frame, strips_before: usize) {
        match self {
            Self::Shade(spans, color) => {
                for &span in spans {
                    panel.strip(drawing, span, (frame.top, frame.height), *color);
                }
            }
            Self::Strip(spans, color) => {
                let top = frame.top - STRIP * (strips_before as f64 + 1.0);
                for &span in spans {
                    panel.strip(drawing, span, (top, STRIP - 1.0), *color);
                }
            }
            Self::Bars(spans, (top, height), color) => {
                for &span in spans {
                    let place = (frame.top + top * frame.height, height * frame.height);
                    panel.strip(drawing, span, place, *color);
                }
            }
            Self::Line { xs, ys, stroke, dashed: false } => panel.line(drawing, xs, ys, *stroke),
            Self::Line { xs, ys, stroke, dashed: true } => panel.dashed(drawing, xs, ys, *stroke),
            Self::Band { xs, low, high, color } => panel.band(drawing, xs, low, high, *color),
            Self::Spread { xs, ys, stroke } => {
                let [median, largest] = panel.median_and_max(xs, ys, 2.0);
                let color = RGBAColor(stroke.color.0, stroke.color.1, stroke.color.2, 0.35);
                drawing.line(largest, Stroke { color, width: 0.6 });
                drawing.line(median, *stroke);
            }
            Self::Path(points, stroke) => {
                drawing.line(points.iter().map(|&(x, y)| panel.at(x, y)).collect(), *stroke);
            }
            Self::Box(a, b, color) => {
                let ((x0, y0), (x1, y1)) = (panel.at(a.0, a.1), panel.at(b.0, b.1));
                drawing.rect((x0.min(x1), y0.min(y1)), ((x1 - x0).abs(), (y1 - y0).abs()), *color);
            }
            Self::Dots(points, radius, color) => {
                points.iter().for_each(|&(x, y)| drawing.dot(panel.at(x, y), *radius, *color));
            }
            Self::Text((x, y), text, color) => {
                let (x, y) = panel.at(*x, *y);
                drawing.text((x, y + 0.36 * TICK_EM), text, TICK_EM, Align::Middle, *color);
            }
            Self::Level(value, stroke) => panel.rule(drawing, (frame.left, panel.at(panel.x().min, *value).1), stroke),
            Self::Upright(value, stroke) => panel.rule(drawing, (panel.at(*value, panel.y().min).0, frame.top), stroke),
        }
    }
}
