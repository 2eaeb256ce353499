//! A drawing as a list of lines, areas, discs and texts, in units of 1/96 inch.
//!
//! Layout code needs no renderer and cannot fail. `svg`, `pdf` and `png` render the list; equal drawings give equal bytes.

pub use plotters::style::RGBAColor;

/// Position of a text relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// The text begins at the point.
    Left,
    /// The text is centered on the point.
    Middle,
    /// The text ends at the point.
    Right,
}

/// Color and width of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// Color with opacity.
    pub color: RGBAColor,
    /// Width, units of 1/96 inch.
    pub width: f64,
}

/// One shape or text. Points are `(x right, y down)` from the upper left corner.
#[derive(Clone, Debug)]
pub(super) enum Item {
    Line { points: Vec<(f64, f64)>, stroke: Stroke },
    Area { points: Vec<(f64, f64)>, color: RGBAColor },
    Rect { corner: (f64, f64), size: (f64, f64), color: RGBAColor },
    Dot { center: (f64, f64), radius: f64, color: RGBAColor },
    Text { baseline: (f64, f64), text: String, em: f64, align: Align, upward: bool, color: RGBAColor },
}

/// A drawing. Lengths are in units of 1/96 inch (one CSS pixel).
#[derive(Clone, Debug)]
pub struct Drawing {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) items: Vec<Item>,
}

impl Drawing {
    /// An empty white drawing.
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, items: Vec::new() }
    }

    /// Width, in units of 1/96 inch.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Adds a polyline; fewer than two points are ignored.
    pub fn line(&mut self, points: Vec<(f64, f64)>, stroke: Stroke) {
        if points.len() > 1 {
            self.items.push(Item::Line { points, stroke });
        }
    }

    /// Adds a filled polygon; fewer than three points are ignored.
    pub fn area(&mut self, points: Vec<(f64, f64)>, color: RGBAColor) {
        if points.len() > 2 {
            self.items.push(Item::Area { points, color });
        }
    }

    /// Adds a filled rectangle; `corner` is the upper left.
    pub fn rect(&mut self, corner: (f64, f64), size: (f64, f64), color: RGBAColor) {
        self.items.push(Item::Rect { corner, size, color });
    }

    /// Adds a filled disc.
    pub fn dot(&mut self, center: (f64, f64), radius: f64, color: RGBAColor) {
        self.items.push(Item::Dot { center, radius, color });
    }

    /// Adds a line of text with its baseline through the point; `em` is the font size.
    pub fn text(&mut self, baseline: (f64, f64), text: impl Into<String>, em: f64, align: Align, color: RGBAColor) {
        self.items.push(Item::Text { baseline, text: text.into(), em, align, upward: false, color });
    }

    /// Adds a line of text that reads upward, centered on the point.
    pub fn text_upward(&mut self, baseline: (f64, f64), text: impl Into<String>, em: f64, color: RGBAColor) {
        self.items.push(Item::Text { baseline, text: text.into(), em, align: Align::Middle, upward: true, color });
    }

    /// The drawing with every length multiplied by a factor.
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
