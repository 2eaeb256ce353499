//! A drawing as data.
//!
//! A figure is a list of lines, areas, dots and words in units of 1/96 inch, so that the code that lays a figure out has no back-end
//! and no error in it. `svg`, `pdf` and `png` render the list, each the same bytes for the same drawing.

pub use plotters::style::RGBAColor;

/// Where a text stands from its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// It begins there.
    Left,
    /// It is centred there.
    Middle,
    /// It ends there.
    Right,
}

/// Colour and width of a line, width in units of 1/96 inch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// Colour, with its opacity.
    pub color: RGBAColor,
    /// Width.
    pub width: f64,
}

/// One thing to draw; points are `(x right, y down)` from the upper left corner.
#[derive(Clone, Debug)]
pub(super) enum Item {
    Line { points: Vec<(f64, f64)>, stroke: Stroke },
    Area { points: Vec<(f64, f64)>, color: RGBAColor },
    Rect { corner: (f64, f64), size: (f64, f64), color: RGBAColor },
    Dot { center: (f64, f64), radius: f64, color: RGBAColor },
    Text { baseline: (f64, f64), text: String, em: f64, align: Align, upward: bool, color: RGBAColor },
}

/// A figure as data: lengths in units of 1/96 inch (one CSS pixel).
#[derive(Clone, Debug)]
pub struct Drawing {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) items: Vec<Item>,
}

impl Drawing {
    /// An empty, white drawing of this size.
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, items: Vec::new() }
    }

    /// A polyline; fewer than two points draw nothing.
    pub fn line(&mut self, points: Vec<(f64, f64)>, stroke: Stroke) {
        if points.len() > 1 {
            self.items.push(Item::Line { points, stroke });
        }
    }

    /// A filled polygon; fewer than three points draw nothing.
    pub fn area(&mut self, points: Vec<(f64, f64)>, color: RGBAColor) {
        if points.len() > 2 {
            self.items.push(Item::Area { points, color });
        }
    }

    /// A filled rectangle from its upper left corner.
    pub fn rect(&mut self, corner: (f64, f64), size: (f64, f64), color: RGBAColor) {
        self.items.push(Item::Rect { corner, size, color });
    }

    /// A filled disc.
    pub fn dot(&mut self, center: (f64, f64), radius: f64, color: RGBAColor) {
        self.items.push(Item::Dot { center, radius, color });
    }

    /// A line of text, its baseline through the point; `em` is the font size.
    pub fn text(&mut self, baseline: (f64, f64), text: impl Into<String>, em: f64, align: Align, color: RGBAColor) {
        self.items.push(Item::Text { baseline, text: text.into(), em, align, upward: false, color });
    }

    /// A line of text that reads upward, centred on the point.
    pub fn text_upward(&mut self, baseline: (f64, f64), text: impl Into<String>, em: f64, color: RGBAColor) {
        self.items.push(Item::Text { baseline, text: text.into(), em, align: Align::Middle, upward: true, color });
    }

    /// The same drawing with every length multiplied.
    #[must_use]
    pub fn scaled(mut self, by: f64) -> Self {
        let scale = |(x, y): (f64, f64)| (x * by, y * by);
        for item in &mut self.items {
            match item {
                Item::Line { points, stroke } => {
                    points.iter_mut().for_each(|p| *p = scale(*p));
                    stroke.width *= by;
                }
                Item::Area { points, .. } => points.iter_mut().for_each(|p| *p = scale(*p)),
                Item::Rect { corner, size, .. } => (*corner, *size) = (scale(*corner), scale(*size)),
                Item::Dot { center, radius, .. } => (*center, *radius) = (scale(*center), *radius * by),
                Item::Text { baseline, em, .. } => (*baseline, *em) = (scale(*baseline), *em * by),
            }
        }
        Self { width: self.width * by, height: self.height * by, items: self.items }
    }
}
