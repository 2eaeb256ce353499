//! Words: the embedded font, how wide it sets a text, and its pixels.
//!
//! plotters leaves out the room that a glyph keeps on its left, so that letters touch; bitmaps are set here instead. An SVG
//! carries its words as text, in a family whose widths are those of the embedded font.

use ab_glyph::{Font, FontRef, Glyph, PxScale, ScaleFont, point};

use super::canvas::Align;

/// Families that an SVG asks for: the embedded font, which a report carries, and others of its widths.
pub const FONT_FAMILY: &str = "Hoofprint Sans, Arial, Helvetica, Liberation Sans, sans-serif";

/// The embedded font, a TrueType file.
pub static FONT: &[u8] = include_bytes!("../../fonts/HoofprintSans-Regular.ttf");

/// Width of a text whose font size is `em`, in the same unit.
pub fn text_width(text: &str, em: f64) -> f64 {
    set(text, em).1
}

/// Calls `pixel` with place and coverage (0 to 1) of every pixel that a text touches. Place: `(x right, y down)` from its point on the baseline, or
/// turned so that the text reads upward.
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
    FontRef::try_from_slice(FONT).expect("the embedded file is a font: every figure of the tests is set in it")
}

/// The glyphs of a text from the origin along the baseline, and its width.
fn set(text: &str, em: f64) -> (Vec<Glyph>, f64) {
    let font = font();
    // A scale is a height from descent to ascent, not an em.
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

    /// Advance widths of Arial are public: digits 1139, space 569 of 2048 units.
    #[test]
    fn digits_are_as_wide_as_those_of_arial() {
        assert!((text_width("0000000000", 2048.0) - 11390.0).abs() < 1.0);
        assert!((text_width("0 0", 2048.0) - (2.0 * 1139.0 + 569.0)).abs() < 1.0);
    }

    #[test]
    fn a_text_that_reads_upward_is_the_same_turned() {
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
