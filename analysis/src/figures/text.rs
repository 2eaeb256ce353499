//! The embedded font: width and pixels of a text.
//!
//! Bitmaps are typeset here because plotters ignores the left side bearing of glyphs, so that letters touch. An SVG contains text in a font family with the
//! widths of the embedded font.

use ab_glyph::{Font, FontRef, Glyph, PxScale, ScaleFont, point};

use super::canvas::Align;

/// Font families in an SVG: the embedded font, which reports contain, and fonts of the same widths.
pub const FONT_FAMILY: &str = "Hoofprint Sans, Arial, Helvetica, Liberation Sans, sans-serif";

/// The embedded font, a TrueType file.
pub static FONT: &[u8] = include_bytes!("../../fonts/HoofprintSans-Regular.ttf");

/// Width of a text whose font size is `em`, in the same unit.
pub fn text_width(text: &str, em: f64) -> f64 {
    set(text, em).1
}

/// Metrics of the embedded font, in 1/1000 of its size.
pub struct FontFacts {
    /// PostScript name.
    pub name: &'static str,
    /// Height above the baseline.
    pub ascent: f64,
    /// Depth below the baseline, negative.
    pub descent: f64,
    font: FontRef<'static>,
    per_em: f64,
}

impl FontFacts {
    /// Advance width of a glyph.
    pub fn advance(&self, glyph: u16) -> f64 {
        f64::from(self.font.h_advance_unscaled(ab_glyph::GlyphId(glyph))) * self.per_em
    }
}

/// Metrics of the font for a PDF.
pub fn font_facts() -> FontFacts {
    let font = font();
    let per_em = 1000.0 / f64::from(font.units_per_em().unwrap_or(1000.0));
    let (ascent, descent) = (f64::from(font.ascent_unscaled()) * per_em, f64::from(font.descent_unscaled()) * per_em);
    FontFacts { name: "HoofprintSans-Regular", ascent, descent, font, per_em }
}

/// Each character of a text with its glyph and its position along the baseline, and the width of the text.
pub fn placed(text: &str, em: f64) -> (Vec<(char, u16, f64)>, f64) {
    let (glyphs, width) = set(text, em);
    (text.chars().zip(glyphs).map(|(c, g)| (c, g.id.0, f64::from(g.position.x))).collect(), width)
}

/// Calls `pixel` with position and coverage (0 to 1) of every pixel of a text. Positions are `(x right, y down)` from the point on the baseline; with `upward`
/// they are rotated so that the text reads upward.
pub fn rasterize<E>(
    text: &str,
    em: f64,
    align: Align,
    upward: bool,
    mut pixel: impl FnMut((i32, i32), f64) -> Result<(), E>,
) -> Result<(), E> {
    let (glyphs, width) = set(text, em);
    let shift = match align {
        Align::Left => 0.0,
        Align::Middle => -0.5 * width,
        Align::Right => -width,
    };
    let mut covered = Vec::new();
    for mut glyph in glyphs {
        glyph.position.x += shift as f32;
        if let Some(outline) = font().outline_glyph(glyph) {
            let corner = outline.px_bounds().min;
            outline.draw(|x, y, coverage| {
                covered.push((corner.x as i32 + x as i32, corner.y as i32 + y as i32, f64::from(coverage)));
            });
        }
    }
    covered.into_iter().try_for_each(|(x, y, coverage)| pixel(if upward { (y, -x) } else { (x, y) }, coverage.min(1.0)))
}

fn font() -> FontRef<'static> {
    FontRef::try_from_slice(FONT).expect("the embedded file is a font: the tests use it")
}

/// The glyphs of a text along the baseline, and its width.
fn set(text: &str, em: f64) -> (Vec<Glyph>, f64) {
    let font = font();
    // The scale of ab_glyph is the height from descent to ascent, not the em.
    let height_per_em = font.height_unscaled() / font.units_per_em().unwrap_or(font.height_unscaled());
    let scale = PxScale::from(em as f32 * height_per_em);
    let scaled = font.as_scaled(scale);
    let (mut glyphs, mut x, mut last) = (Vec::new(), 0.0, None);
    for id in text.chars().map(|c| scaled.glyph_id(c)) {
        x += last.map_or(0.0, |last| scaled.kern(last, id));
        glyphs.push(id.with_scale_and_position(scale, point(x, 0.0)));
        x += scaled.h_advance(id);
        last = Some(id);
    }
    (glyphs, f64::from(x))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Advance widths of Arial: digits 1139, space 569 of 2048 units.
    #[test]
    fn digits_have_the_widths_of_arial() {
        assert!((text_width("0000000000", 2048.0) - 11390.0).abs() < 1.0);
        assert!((text_width("0 0", 2048.0) - (2.0 * 1139.0 + 569.0)).abs() < 1.0);
    }

    #[test]
    fn an_upward_text_is_the_rotated_text() {
        let pixels = |upward| {
            let mut out = Vec::new();
            rasterize("Fy", 20.0, Align::Left, upward, |p, c| -> Result<(), ()> {
                out.push((p, c));
                Ok(())
            })
            .unwrap();
            out
        };
        let turned: Vec<_> = pixels(false).into_iter().map(|((x, y), c)| ((y, -x), c)).collect();
        assert!(!turned.is_empty() && turned == pixels(true));
    }
}
