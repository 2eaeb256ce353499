//! A drawing as PDF 1.7: vector graphics, and text in the embedded font.
//!
//! The crate `pdf-writer` writes the objects, in a fixed order and without a date: equal drawings give equal bytes. Text is stored as glyph numbers of the
//! font (Identity-H) with a map to Unicode, so that a viewer can search and copy it.

use std::collections::BTreeMap;

use pdf_writer::types::{CidFontType, FontFlags, LineCapStyle, LineJoinStyle, SystemInfo, UnicodeCmap};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};

use super::canvas::{Align, Drawing, Item, RGBAColor};
use super::style::POINTS_PER_UNIT;
use super::text::{FONT, FontFacts, font_facts, placed};

/// Name of the font in the resources of the page.
const FONT_RESOURCE: Name = Name(b"F");
const SYSTEM_INFO: SystemInfo = SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };
/// Height of capitals and width of vertical stems of the embedded font, in thousandths of its size.
const CAP_HEIGHT: f32 = 716.0;
const STEM_V: f32 = 80.0;

/// The drawing as a PDF file. `metadata` becomes the document information dictionary.
pub fn pdf(drawing: &Drawing, metadata: &[(&str, String)]) -> Vec<u8> {
    let page = Page::of(drawing);
    let facts = font_facts();
    let mut ids = (1..).map(Ref::new);
    let mut next = || ids.next().expect("the range has no end");
    let (catalog, pages, page_id, content, info) = (next(), next(), next(), next(), next());
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([page_id]).count(1);

    let font = next();
    let mut writer = pdf.page(page_id);
    let size = (rounded(drawing.width * POINTS_PER_UNIT), rounded(drawing.height * POINTS_PER_UNIT));
    writer.parent(pages).media_box(Rect::new(0.0, 0.0, size.0, size.1)).contents(content);
    let mut resources = writer.resources();
    resources.fonts().pair(FONT_RESOURCE, font);
    let mut states = resources.ext_g_states();
    for (k, &opacity) in page.opacities.iter().enumerate() {
        let mut state = states.insert(Name(state_name(k).as_bytes())).start::<pdf_writer::writers::ExtGraphicsState>();
        state.stroking_alpha(rounded(opacity)).non_stroking_alpha(rounded(opacity));
    }
    states.finish();
    resources.finish();
    writer.finish();

    let data = compressed(&page.content.finish());
    pdf.stream(content, &data).filter(Filter::FlateDecode);
    write_font(&mut pdf, &facts, &page.glyphs, font, &mut next);
    let mut entries = pdf.document_info(info);
    for (key, value) in metadata {
        entries.pair(Name(name_of(key).as_bytes()), TextStr(value));
    }
    entries.finish();
    pdf.finish()
}

/// The embedded font, with widths and Unicode characters of the glyphs in use.
fn write_font(
    pdf: &mut Pdf,
    facts: &FontFacts,
    glyphs: &BTreeMap<u16, char>,
    font: Ref,
    next: &mut impl FnMut() -> Ref,
) {
    let (descendant, descriptor, file, to_unicode) = (next(), next(), next(), next());
    let name = Name(facts.name.as_bytes());
    pdf.type0_font(font)
        .base_font(name)
        .encoding_predefined(Name(b"Identity-H"))
        .descendant_font(descendant)
        .to_unicode(to_unicode);
    let mut cid_font = pdf.cid_font(descendant);
    cid_font.subtype(CidFontType::Type2).base_font(name).system_info(SYSTEM_INFO).font_descriptor(descriptor);
    cid_font.cid_to_gid_map_predefined(Name(b"Identity"));
    let mut widths = cid_font.widths();
    for &glyph in glyphs.keys() {
        widths.consecutive(glyph, [rounded(facts.advance(glyph))]);
    }
    widths.finish();
    cid_font.finish();
    let (ascent, descent) = (rounded(facts.ascent), rounded(facts.descent));
    pdf.font_descriptor(descriptor)
        .name(name)
        .flags(FontFlags::NON_SYMBOLIC)
        .bbox(Rect::new(-200.0, descent, 1200.0, ascent))
        .italic_angle(0.0)
        .ascent(ascent)
        .descent(descent)
        .cap_height(CAP_HEIGHT)
        .stem_v(STEM_V)
        .font_file2(file);
    let data = compressed(FONT);
    let length = i32::try_from(FONT.len()).expect("the embedded font is smaller than 2 GiB");
    pdf.stream(file, &data).filter(Filter::FlateDecode).pair(Name(b"Length1"), length);
    let mut map = UnicodeCmap::<u16>::new(Name(b"Hoofprint"), SYSTEM_INFO);
    for (&glyph, &c) in glyphs {
        map.pair(glyph, c);
    }
    let data = compressed(&map.finish());
    pdf.cmap(to_unicode, &data).filter(Filter::FlateDecode);
}

/// The operators of the page, and the resources they use.
struct Page {
    content: Content,
    /// Opacities in use; the graphics state of each has its index as name.
    opacities: Vec<f64>,
    /// Glyphs in use, each with its character.
    glyphs: BTreeMap<u16, char>,
}

impl Page {
    fn of(drawing: &Drawing) -> Self {
        let mut page = Self { content: Content::new(), opacities: Vec::new(), glyphs: BTreeMap::new() };
        let scale = POINTS_PER_UNIT as f32;
        // y points down in a drawing and up in a PDF.
        page.content.transform([scale, 0.0, 0.0, -scale, 0.0, rounded(drawing.height * POINTS_PER_UNIT)]);
        page.content.set_line_join(LineJoinStyle::RoundJoin);
        drawing.items.iter().for_each(|item| page.item(item));
        page
    }

    fn item(&mut self, item: &Item) {
        match item {
            Item::Line { points, stroke } => {
                self.color(stroke.color);
                self.content.set_line_width(rounded(stroke.width));
                self.path(points);
                self.content.stroke();
            }
            Item::Area { points, color } => {
                self.color(*color);
                self.path(points);
                self.content.close_path().fill_nonzero();
            }
            Item::Rect { corner, size, color } => {
                self.color(*color);
                let [x, y, width, height] = [corner.0, corner.1, size.0, size.1].map(rounded);
                self.content.rect(x, y, width, height).fill_nonzero();
            }
            // A line of length zero with round caps is a disc.
            Item::Dot { center, radius, color } => {
                self.color(*color);
                let (x, y) = (rounded(center.0), rounded(center.1));
                self.content.save_state().set_line_cap(LineCapStyle::RoundCap).set_line_width(rounded(2.0 * radius));
                self.content.move_to(x, y).line_to(x, y).stroke().restore_state();
            }
            Item::Text { baseline: (x, y), text, em, align, upward, color } => {
                self.color(*color);
                let (glyphs, width) = placed(text, *em);
                let back = match align {
                    Align::Left => 0.0,
                    Align::Middle => 0.5 * width,
                    Align::Right => width,
                };
                self.content.begin_text().set_font(FONT_RESOURCE, rounded(*em));
                for (c, glyph, along) in glyphs {
                    self.glyphs.entry(glyph).or_insert(c);
                    let along = along - back;
                    // The page is mirrored; the text matrix mirrors letters back.
                    self.content.set_text_matrix(if *upward {
                        [0.0, -1.0, -1.0, 0.0, rounded(*x), rounded(y - along)]
                    } else {
                        [1.0, 0.0, 0.0, -1.0, rounded(x + along), rounded(*y)]
                    });
                    self.content.show(Str(&glyph.to_be_bytes()));
                }
                self.content.end_text();
            }
        }
    }

    /// Sets color and opacity of strokes and fills.
    fn color(&mut self, RGBAColor(r, g, b, opacity): RGBAColor) {
        let known = self.opacities.iter().position(|&o| o == opacity);
        let state = known.unwrap_or_else(|| {
            self.opacities.push(opacity);
            self.opacities.len() - 1
        });
        // Three decimals: 8 bits per channel need no more.
        let [r, g, b] = [r, g, b].map(|v| ((f64::from(v) / 255.0 * 1e3).round() / 1e3) as f32);
        self.content.set_parameters(Name(state_name(state).as_bytes()));
        self.content.set_stroke_rgb(r, g, b).set_fill_rgb(r, g, b);
    }

    fn path(&mut self, points: &[(f64, f64)]) {
        for (k, &(x, y)) in points.iter().enumerate() {
            let (x, y) = (rounded(x), rounded(y));
            if k == 0 {
                self.content.move_to(x, y)
            } else {
                self.content.line_to(x, y)
            };
        }
    }
}

/// Rounded to two decimals: 1/100 unit is 1/9600 inch.
fn rounded(value: f64) -> f32 {
    ((value * 100.0).round() / 100.0) as f32
}

fn state_name(k: usize) -> String {
    format!("G{k}")
}

/// A key of a dictionary: letters and digits only.
fn name_of(key: &str) -> String {
    key.chars().filter(char::is_ascii_alphanumeric).collect()
}

fn compressed(data: &[u8]) -> Vec<u8> {
    miniz_oxide::deflate::compress_to_vec_zlib(data, 9)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::style::TEXT;

    #[test]
    fn the_cross_reference_table_gives_the_offset_of_every_object() {
        let mut drawing = Drawing::new(100.0, 50.0);
        drawing.text((10.0, 20.0), "\u{2212}0.5 µs", 10.0, Align::Left, TEXT);
        drawing.dot((5.0, 5.0), 2.0, RGBAColor(0, 0, 0, 0.5));
        let bytes = pdf(&drawing, &[("Title", "größe".to_owned())]);
        assert_eq!(bytes, pdf(&drawing, &[("Title", "größe".to_owned())]));
        let text = String::from_utf8_lossy(&bytes);
        let table: usize = text.rsplit_once("startxref\n").unwrap().1.lines().next().unwrap().parse().unwrap();
        let lines = std::str::from_utf8(&bytes[table..]).unwrap().lines().skip(3);
        let mut number = 0;
        for line in lines.take_while(|line| line.trim_end().ends_with('n')) {
            number += 1;
            let offset: usize = line[..10].parse().unwrap();
            assert!(bytes[offset..].starts_with(format!("{number} 0 obj").as_bytes()), "object {number}");
        }
        assert_eq!(number, 10);
    }
}
