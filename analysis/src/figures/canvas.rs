//! A drawing as data, and its two renderings: SVG and PNG.
//!
//! A figure is a list of lines, rectangles, dots and words in units of 1/96 inch, so that the code that lays a figure out has no back-end
//! and no error in it. plotters draws the list: its coordinates are whole pixels, so both renderings draw on a finer grid
//! than they show. The SVG is given a view box of 1/10 unit, the PNG is averaged down from twice its size.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::FontTransform;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::text::{FONT_FAMILY, rasterize};

pub use plotters::style::RGBAColor;

/// Drawing grid of the SVG, steps per unit.
const SVG_GRID: f64 = 10.0;
/// Pixels of the PNG per unit: 3 × 96 = 288 dpi.
const PNG_DENSITY: u32 = 3;
/// Pixels drawn per pixel of the PNG, in each direction.
const PNG_OVERSAMPLING: u32 = 2;

/// The size that plotters takes, per em that it writes into an SVG.
const SVG_SIZE_PER_EM: f64 = 1.24;

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
enum Item {
    Line { points: Vec<(f64, f64)>, stroke: Stroke },
    Rect { corner: (f64, f64), size: (f64, f64), color: RGBAColor },
    Dot { center: (f64, f64), radius: f64, color: RGBAColor },
    Text { baseline: (f64, f64), text: String, em: f64, align: Align, upward: bool, color: RGBAColor },
}

/// A figure as data: lengths in units of 1/96 inch (one CSS pixel).
#[derive(Clone, Debug)]
pub struct Drawing {
    width: f64,
    height: f64,
    items: Vec<Item>,
}

impl Drawing {
    /// An empty, white drawing of this size.
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, items: Vec::new() }
    }

    /// Width, in units of 1/96 inch.
    pub fn width(&self) -> f64 {
        self.width
    }

    /// A polyline; fewer than two points draw nothing.
    pub fn line(&mut self, points: Vec<(f64, f64)>, stroke: Stroke) {
        if points.len() > 1 {
            self.items.push(Item::Line { points, stroke });
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

    /// The drawing as an SVG document, the same bytes for the same drawing.
    pub fn svg(&self) -> Result<String, String> {
        let size = self.pixels(SVG_GRID);
        let mut text = String::new();
        {
            let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
            self.draw(&root, SVG_GRID, Target::Svg)?;
            root.present().map_err(|e| e.to_string())?;
        }
        // plotters sizes the image in grid steps and cannot say how lines are joined: rewrite its first tag.
        let body = text.split_once('>').map_or("", |(_, body)| body);
        Ok(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" viewBox=\"0 0 {} {}\" \
             stroke-linejoin=\"round\" stroke-linecap=\"butt\">{}",
            self.width,
            self.height,
            size.0,
            size.1,
            body.replace(" opacity=\"1\"", "")
        ))
    }

    /// Writes the drawing as a PNG of 288 dpi, the same bytes for the same drawing.
    pub fn write_png(&self, path: &std::path::Path) -> Result<(), String> {
        let scale = PNG_DENSITY * PNG_OVERSAMPLING;
        let (width, height) = self.pixels(f64::from(PNG_DENSITY));
        let fine_size = (width * PNG_OVERSAMPLING, height * PNG_OVERSAMPLING);
        let mut fine = vec![255_u8; 3 * fine_size.0 as usize * fine_size.1 as usize];
        {
            let root = BitMapBackend::with_buffer(&mut fine, fine_size).into_drawing_area();
            self.draw(&root, f64::from(scale), Target::Bitmap)?;
            root.present().map_err(|e| e.to_string())?;
        }
        let mut image = BitMapBackend::new(path, (width, height));
        image
            .blit_bitmap((0, 0), (width, height), &average(&fine, fine_size, PNG_OVERSAMPLING))
            .map_err(|e| e.to_string())?;
        image.present().map_err(|e| e.to_string())
    }

    fn pixels(&self, scale: f64) -> (u32, u32) {
        ((self.width * scale).ceil() as u32, (self.height * scale).ceil() as u32)
    }

    fn draw<DB: DrawingBackend>(
        &self,
        root: &DrawingArea<DB, Shift>,
        scale: f64,
        target: Target,
    ) -> Result<(), String> {
        root.fill(&WHITE).map_err(|e| e.to_string())?;
        for item in &self.items {
            draw_item(root, item, scale, target).map_err(|e| e.to_string())?;
        }
        Ok(())
    }
}

/// What is drawn on.
#[derive(Clone, Copy, PartialEq)]
enum Target {
    Svg,
    Bitmap,
}

fn draw_item<DB: DrawingBackend>(
    root: &DrawingArea<DB, Shift>,
    item: &Item,
    scale: f64,
    target: Target,
) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    let grid = |v: f64| (v * scale).round() as i32;
    let at = |(x, y): (f64, f64)| (grid(x), grid(y));
    match item {
        Item::Line { points, stroke } => {
            let points: Vec<_> = points.iter().map(|&p| at(p)).collect();
            let width = grid(stroke.width).max(1) as u32;
            let style = ShapeStyle { color: stroke.color, filled: false, stroke_width: width };
            if target == Target::Svg {
                return root.draw(&PathElement::new(points, style));
            }
            // plotters fills a wide polyline as one even-odd polygon, with holes where it crosses itself: draw it piece by piece.
            for pair in points.windows(2) {
                root.draw(&PathElement::new(pair.to_vec(), style))?;
            }
            for &joint in points.get(1..points.len() - 1).unwrap_or_default() {
                root.draw(&Circle::new(joint, width / 2, stroke.color.filled()))?;
            }
            Ok(())
        }
        Item::Rect { corner, size, color } => {
            let opposite = (corner.0 + size.0, corner.1 + size.1);
            root.draw(&Rectangle::new([at(*corner), at(opposite)], color.filled()))
        }
        Item::Dot { center, radius, color } => {
            root.draw(&Circle::new(at(*center), grid(*radius).max(1), color.filled()))
        }
        Item::Text { baseline, text, em, align, upward, color } => {
            let (x, y) = at(*baseline);
            if target == Target::Bitmap {
                return rasterize(text, em * scale, *align, *upward, |(dx, dy), coverage| {
                    root.draw_pixel((x + dx, y + dy), &color.mix(coverage))
                });
            }
            // plotters hangs a text from its top, which it takes to be 0.76 em above the baseline.
            let rise = (0.76 * em * scale).round() as i32;
            let (point, transform) =
                if *upward { ((x - rise, y), FontTransform::Rotate270) } else { ((x, y - rise), FontTransform::None) };
            let h_pos = match align {
                Align::Left => HPos::Left,
                Align::Middle => HPos::Center,
                Align::Right => HPos::Right,
            };
            let font = (FONT_FAMILY, em * scale * SVG_SIZE_PER_EM).into_font().transform(transform);
            root.draw(&Text::new(
                text.as_str(),
                point,
                TextStyle::from(font).color(color).pos(Pos::new(h_pos, VPos::Top)),
            ))
        }
    }
}

/// Mean over blocks of `n × n` pixels of an RGB image.
fn average(fine: &[u8], (fine_width, fine_height): (u32, u32), n: u32) -> Vec<u8> {
    let (n, stride) = (n as usize, 3 * fine_width as usize);
    let (width, height) = (fine_width as usize / n, fine_height as usize / n);
    let mut out = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        for x in 0..width {
            for channel in 0..3 {
                let block =
                    (0..n * n).map(|k| u32::from(fine[(y * n + k / n) * stride + 3 * (x * n + k % n) + channel]));
                out.push(((block.sum::<u32>() as usize + n * n / 2) / (n * n)) as u8);
            }
        }
    }
    out
}
