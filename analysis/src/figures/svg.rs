//! A drawing as SVG.

use std::fmt::Write as _;

use super::canvas::{Align, Drawing, Item, RGBAColor};
use super::text::FONT_FAMILY;

/// The drawing as an SVG document. `metadata`: pairs of key and value.
pub fn svg(drawing: &Drawing, metadata: &[(&str, String)]) -> String {
    let (width, height) = (number(drawing.width), number(drawing.height));
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         stroke-linejoin=\"round\" fill=\"none\" font-family=\"{FONT_FAMILY}\">\n"
    );
    if !metadata.is_empty() {
        out.push_str("<metadata>\n");
        for (key, value) in metadata {
            let _ = writeln!(out, "{}: {}", escape(key), escape(value));
        }
        out.push_str("</metadata>\n");
    }
    let _ = writeln!(out, "<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>");
    for item in &drawing.items {
        write_item(&mut out, item);
    }
    out.push_str("</svg>\n");
    out
}

fn write_item(out: &mut String, item: &Item) {
    let _ = match item {
        Item::Line { points, stroke } => writeln!(
            out,
            "<path d=\"{}\"{} stroke-width=\"{}\"/>",
            path(points),
            paint("stroke", stroke.color),
            number(stroke.width)
        ),
        Item::Area { points, color } => writeln!(out, "<path d=\"{}Z\"{}/>", path(points), paint("fill", *color)),
        Item::Rect { corner, size, color } => writeln!(
            out,
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"{}/>",
            number(corner.0),
            number(corner.1),
            number(size.0),
            number(size.1),
            paint("fill", *color)
        ),
        Item::Dot { center, radius, color } => writeln!(
            out,
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\"{}/>",
            number(center.0),
            number(center.1),
            number(*radius),
            paint("fill", *color)
        ),
        Item::Text { baseline: (x, y), text, em, align, upward, color } => {
            let anchor = match align {
                Align::Left => "",
                Align::Middle => " text-anchor=\"middle\"",
                Align::Right => " text-anchor=\"end\"",
            };
            let (x, y) = (number(*x), number(*y));
            let turn = if *upward { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
            let (size, paint) = (number(*em), paint("fill", *color));
            writeln!(out, "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\"{anchor}{turn}{paint}>{}</text>", escape(text))
        }
    };
}

/// Path data: first point absolute, then differences of points rounded to 0.01, so that rounding errors do not accumulate.
fn path(points: &[(f64, f64)]) -> String {
    let grid = |v: f64| (v * 100.0).round() as i64;
    let mut out = String::new();
    let mut last = (0, 0);
    for (k, &(x, y)) in points.iter().enumerate() {
        let now = (grid(x), grid(y));
        let letter = ["M", "l", " "][k.min(2)];
        let hundredths = |v: i64| number(v as f64 / 100.0);
        let _ = write!(out, "{letter}{} {}", hundredths(now.0 - last.0), hundredths(now.1 - last.1));
        last = now;
    }
    out
}

fn paint(what: &str, RGBAColor(r, g, b, opacity): RGBAColor) -> String {
    let opacity_attribute =
        if opacity < 1.0 { format!(" {what}-opacity=\"{}\"", number(opacity)) } else { String::new() };
    format!(" {what}=\"#{r:02x}{g:02x}{b:02x}\"{opacity_attribute}")
}

/// A number with at most two decimals and no trailing zeros.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Text for XML: markup escaped, invalid characters removed.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() && !matches!(c, '\n' | '\t') => {}
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_errors_of_a_path_do_not_accumulate() {
        let points: Vec<(f64, f64)> = (0..1000).map(|k| (f64::from(k) * 0.333_333, 1.0)).collect();
        let d = path(&points);
        let steps = d.replace(['M', 'l'], " ");
        let xs: f64 = steps.split_whitespace().step_by(2).map(|v| v.parse::<f64>().unwrap()).sum();
        assert!((xs - 333.0).abs() < 0.01, "{xs}");
    }

    #[test]
    fn markup_is_escaped_and_control_characters_are_removed() {
        assert_eq!(escape("a<b & \"c\"\u{1}"), "a&lt;b &amp; &quot;c&quot;");
    }
}
