//! A drawing as PDF 1.7: vectors, and words as text in the embedded font.
//!
//! Seven objects in a fixed order and no date, so that the same drawing gives the same bytes. Words are glyph numbers of the font (Identity-H) with a map
//! back to Unicode, so that they can be searched and copied.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::canvas::{Align, Drawing, Item, RGBAColor};
use super::style::POINTS_PER_UNIT;
use super::svg::number;
use super::text::{FONT, FontFacts, font_facts, placed};

/// The drawing as a PDF file; metadata goes into the document's information dictionary.
pub fn pdf(drawing: &Drawing, metadata: &[(&str, String)]) -> Vec<u8> {
    let facts = font_facts();
    let (page_width, page_height) = (drawing.width * POINTS_PER_UNIT, drawing.height * POINTS_PER_UNIT);
    let mut content = Content { text: String::new(), opacities: Vec::new(), glyphs: BTreeMap::new() };
    let flip = -POINTS_PER_UNIT;
    let _ = writeln!(content.text, "{POINTS_PER_UNIT} 0 0 {flip} 0 {} cm 1 j", number(page_height));
    drawing.items.iter().for_each(|item| content.item(item));

    let states = content.opacities.iter().enumerate().map(|(k, opacity)| {
        let opacity = number(*opacity);
        format!("/G{k} << /CA {opacity} /ca {opacity} >> ")
    });
    let states: String = states.collect();
    let mut file = File::default();
    file.object("<< /Type /Catalog /Pages 2 0 R >>");
    file.object("<< /Type /Pages /Kids [3 0 R] /Count 1 >>");
    file.object(&format!(
        "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {} {}] /Contents 4 0 R /Resources << /Font << /F 5 0 R >> /ExtGState << {states}>> >> >>",
        number(page_width),
        number(page_height)
    ));
    file.stream("", content.text.as_bytes());
    file.object(&format!(
        "<< /Type /Font /Subtype /Type0 /BaseFont /{0} /Encoding /Identity-H /DescendantFonts [6 0 R] /ToUnicode 9 0 R >>",
        facts.name
    ));
    let widths = content.glyphs.keys().fold(String::new(), |mut text, &glyph| {
        let _ = write!(text, "{glyph} [{}] ", number(facts.advance(glyph)));
        text
    });
    file.object(&format!(
        "<< /Type /Font /Subtype /CIDFontType2 /BaseFont /{} /CIDSystemInfo << /Registry (Adobe) /Ordering (Identity) /Supplement 0 >> \
         /FontDescriptor 7 0 R /CIDToGIDMap /Identity /W [{widths}] >>",
        facts.name
    ));
    let FontFacts { name, ascent, descent, .. } = &facts;
    let (ascent, descent) = (number(*ascent), number(*descent));
    file.object(&format!(
        "<< /Type /FontDescriptor /FontName /{name} /Flags 32 /FontBBox [-200 {descent} 1200 {ascent}] /ItalicAngle 0 /Ascent {ascent} \
         /Descent {descent} /CapHeight 716 /StemV 80 /FontFile2 8 0 R >>"
    ));
    file.stream(&format!("/Length1 {}", FONT.len()), FONT);
    file.stream("", to_unicode(&content.glyphs).as_bytes());
    let entries = metadata.iter().map(|(key, value)| format!("/{} {} ", name_of(key), text_string(value)));
    file.object(&format!("<< {}>>", entries.collect::<String>()));
    file.finish()
}

/// The page's operators, and what they refer to.
struct Content {
    text: String,
    opacities: Vec<f64>,
    /// Glyphs used, with the character of each.
    glyphs: BTreeMap<u16, char>,
}

impl Content {
    fn item(&mut self, item: &Item) {
        match item {
            Item::Line { points, stroke } => {
                self.color(stroke.color);
                let _ = writeln!(self.text, "{} w {}S", number(stroke.width), path(points));
            }
            Item::Area { points, color } => {
                self.color(*color);
                let _ = writeln!(self.text, "{}h f", path(points));
            }
            Item::Rect { corner, size, color } => {
                self.color(*color);
                let (x, y) = (number(corner.0), number(corner.1));
                let _ = writeln!(self.text, "{x} {y} {} {} re f", number(size.0), number(size.1));
            }
            // A line of no length with round ends is a disc.
            Item::Dot { center, radius, color } => {
                self.color(*color);
                let (x, y) = (number(center.0), number(center.1));
                let _ = writeln!(self.text, "q 1 J {} w {x} {y} m {x} {y} l S Q", number(2.0 * radius));
            }
            Item::Text { baseline: (x, y), text, em, align, upward, color } => {
                self.color(*color);
                let (glyphs, width) = placed(text, *em);
                let back = match align {
                    Align::Left => 0.0,
                    Align::Middle => 0.5 * width,
                    Align::Right => width,
                };
                let _ = write!(self.text, "BT /F {} Tf ", number(*em));
                for (c, glyph, along) in glyphs {
                    self.glyphs.entry(glyph).or_insert(c);
                    let along = along - back;
                    // The page is upside down, so letters are turned back.
                    let _ = if *upward {
                        write!(self.text, "0 -1 -1 0 {} {} Tm <{glyph:04x}> Tj ", number(*x), number(y - along))
                    } else {
                        write!(self.text, "1 0 0 -1 {} {} Tm <{glyph:04x}> Tj ", number(x + along), number(*y))
                    };
                }
                self.text.push_str("ET\n");
            }
        }
    }

    /// Colour and opacity of what follows, for strokes and fills.
    fn color(&mut self, RGBAColor(r, g, b, opacity): RGBAColor) {
        let known = self.opacities.iter().position(|&o| o == opacity);
        let state = known.unwrap_or_else(|| {
            self.opacities.push(opacity);
            self.opacities.len() - 1
        });
        let [r, g, b] = [r, g, b].map(|v| format!("{:.3}", f64::from(v) / 255.0));
        let _ = write!(self.text, "/G{state} gs {r} {g} {b} RG {r} {g} {b} rg ");
    }
}

fn path(points: &[(f64, f64)]) -> String {
    let mut out = String::new();
    for (k, &(x, y)) in points.iter().enumerate() {
        let _ = write!(out, "{} {} {} ", number(x), number(y), if k == 0 { "m" } else { "l" });
    }
    out
}

/// From glyph numbers to characters.
fn to_unicode(glyphs: &BTreeMap<u16, char>) -> String {
    let mut out =
        "/CIDInit /ProcSet findresource begin 12 dict begin begincmap /CMapName /Hoofprint def /CMapType 2 def\n\
                   1 begincodespacerange <0000> <ffff> endcodespacerange\n"
            .to_owned();
    // A section holds at most 100 lines.
    for section in glyphs.iter().collect::<Vec<_>>().chunks(100) {
        let _ = writeln!(out, "{} beginbfchar", section.len());
        for (glyph, c) in section {
            let units: String = c.encode_utf16(&mut [0; 2]).iter().map(|unit| format!("{unit:04x}")).collect();
            let _ = writeln!(out, "<{glyph:04x}> <{units}>");
        }
        out.push_str("endbfchar\n");
    }
    out.push_str("endcmap end end\n");
    out
}

/// A key of a dictionary: letters and digits only.
fn name_of(key: &str) -> String {
    key.chars().filter(char::is_ascii_alphanumeric).collect()
}

/// A text of any characters: UTF-16 with its mark, in hexadecimal digits.
fn text_string(text: &str) -> String {
    let units = text.encode_utf16().map(|unit| format!("{unit:04x}"));
    format!("<feff{}>", units.collect::<String>())
}

/// A file under construction: objects numbered from 1 in the order in which they come; the last is the information dictionary.
struct File {
    bytes: Vec<u8>,
    offsets: Vec<usize>,
}

impl Default for File {
    fn default() -> Self {
        // Bytes above 127 in the second line tell transfer programs that this is no text.
        Self { bytes: b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n".to_vec(), offsets: Vec::new() }
    }
}

impl File {
    fn object(&mut self, body: &str) {
        self.begin();
        self.bytes.extend_from_slice(body.as_bytes());
        self.bytes.extend_from_slice(b"\nendobj\n");
    }

    fn stream(&mut self, entries: &str, data: &[u8]) {
        let packed = miniz_oxide::deflate::compress_to_vec_zlib(data, 9);
        self.begin();
        let length = packed.len();
        let head = format!("<< /Filter /FlateDecode /Length {length} {entries} >>\nstream\n");
        self.bytes.extend_from_slice(head.as_bytes());
        self.bytes.extend_from_slice(&packed);
        self.bytes.extend_from_slice(b"\nendstream\nendobj\n");
    }

    fn begin(&mut self) {
        self.offsets.push(self.bytes.len());
        let number = self.offsets.len();
        self.bytes.extend_from_slice(format!("{number} 0 obj\n").as_bytes());
    }

    fn finish(mut self) -> Vec<u8> {
        let (table, size, last) = (self.bytes.len(), self.offsets.len() + 1, self.offsets.len());
        let mut tail = format!("xref\n0 {size}\n0000000000 65535 f \n");
        for offset in &self.offsets {
            let _ = writeln!(tail, "{offset:010} 00000 n ");
        }
        let _ = write!(tail, "trailer\n<< /Size {size} /Root 1 0 R /Info {last} 0 R >>\nstartxref\n{table}\n%%EOF\n");
        self.bytes.extend_from_slice(tail.as_bytes());
        self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::style::TEXT;

    #[test]
    fn every_object_stands_where_the_table_says() {
        let mut drawing = Drawing::new(100.0, 50.0);
        drawing.text((10.0, 20.0), "\u{2212}0.5 µs", 10.0, Align::Left, TEXT);
        drawing.dot((5.0, 5.0), 2.0, RGBAColor(0, 0, 0, 0.5));
        let bytes = pdf(&drawing, &[("Title", "größe".to_owned())]);
        let text = String::from_utf8_lossy(&bytes);
        let table: usize = text.rsplit_once("startxref\n").unwrap().1.lines().next().unwrap().parse().unwrap();
        let lines = std::str::from_utf8(&bytes[table..]).unwrap().lines().skip(3);
        let mut number = 0;
        for line in lines.take_while(|line| line.ends_with("n ")) {
            number += 1;
            let offset: usize = line[..10].parse().unwrap();
            assert!(bytes[offset..].starts_with(format!("{number} 0 obj").as_bytes()), "object {number}");
        }
        assert_eq!(number, 10);
        assert!(text.contains("/Info 10 0 R") && text.contains("/Title <feff006700720"));
    }
}
