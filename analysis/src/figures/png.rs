//! A drawing as PNG, rendered by plotters.
//!
//! plotters uses integer pixels, so the drawing is rendered at a higher resolution and averaged. The image has a palette of the 256 most frequent colors,
//! which is enough for line art and reduces the file to a third.

use std::collections::BTreeMap;

use plotters::coord::Shift;
use plotters::prelude::*;

use super::canvas::{Drawing, Item};
use super::text::rasterize;

/// Rendered pixels per pixel of the image, in each direction.
const OVERSAMPLING: u32 = 2;

/// The drawing as a PNG file, with metadata as `tEXt` (or `iTXt` outside Latin-1). The error is that of the renderer.
pub fn png(drawing: &Drawing, dpi: f64, metadata: &[(&str, String)]) -> Result<Vec<u8>, String> {
    let scale = dpi / 96.0;
    let size = ((drawing.width * scale).ceil() as u32, (drawing.height * scale).ceil() as u32);
    let fine_size = (size.0 * OVERSAMPLING, size.1 * OVERSAMPLING);
    let mut fine = vec![255_u8; 3 * fine_size.0 as usize * fine_size.1 as usize];
    {
        let root = BitMapBackend::with_buffer(&mut fine, fine_size).into_drawing_area();
        for item in &drawing.items {
            draw_item(&root, item, scale * f64::from(OVERSAMPLING)).map_err(|e| e.to_string())?;
        }
        root.present().map_err(|e| e.to_string())?;
    }
    let (palette, indices) = indexed(&average(&fine, fine_size, OVERSAMPLING));
    encode(size, dpi, palette, &indices, metadata).map_err(|e| e.to_string())
}

fn encode(
    (width, height): (u32, u32),
    dpi: f64,
    palette: Vec<u8>,
    indices: &[u8],
    metadata: &[(&str, String)],
) -> Result<Vec<u8>, png::EncodingError> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette);
    encoder.set_compression(png::Compression::Best);
    encoder.set_filter(png::FilterType::NoFilter);
    let per_metre = (dpi / 0.0254).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: per_metre, yppu: per_metre, unit: png::Unit::Meter }));
    for (key, value) in metadata {
        if value.chars().all(|c| u32::from(c) < 256) {
            encoder.add_text_chunk((*key).to_owned(), value.clone())?;
        } else {
            encoder.add_itxt_chunk((*key).to_owned(), value.clone())?;
        }
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(indices)?;
    writer.finish()?;
    Ok(out)
}

fn draw_item(
    root: &DrawingArea<BitMapBackend<'_>, Shift>,
    item: &Item,
    scale: f64,
) -> Result<(), DrawingAreaErrorKind<<BitMapBackend<'static> as DrawingBackend>::ErrorType>> {
    let grid = |v: f64| (v * scale).round() as i32;
    let at = |(x, y): (f64, f64)| (grid(x), grid(y));
    match item {
        Item::Line { points, stroke } => {
            let points: Vec<_> = points.iter().map(|&p| at(p)).collect();
            let width = grid(stroke.width).max(1) as u32;
            let style = ShapeStyle { color: stroke.color, filled: false, stroke_width: width };
            // plotters fills a wide polyline as one even-odd polygon, with holes at self-intersections, so each segment is drawn alone.
            for pair in points.windows(2) {
                root.draw(&PathElement::new(pair.to_vec(), style))?;
            }
            // On a transparent line, discs at the joints would be visible.
            if stroke.color.3 >= 1.0 {
                for &joint in points.get(1..points.len() - 1).unwrap_or_default() {
                    root.draw(&Circle::new(joint, width / 2, stroke.color.filled()))?;
                }
            }
            Ok(())
        }
        Item::Area { points, color } => {
            root.draw(&Polygon::new(points.iter().map(|&p| at(p)).collect::<Vec<_>>(), color.filled()))
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
            rasterize(text, em * scale, *align, *upward, |(dx, dy), coverage| {
                root.draw_pixel((x + dx, y + dy), &color.mix(coverage))
            })
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

/// The 256 most frequent colors of an RGB image, and the index of the nearest one for each pixel.
fn indexed(image: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let pixels = || image.chunks_exact(3).map(|p| [p[0], p[1], p[2]]);
    let mut counts: BTreeMap<[u8; 3], u32> = BTreeMap::new();
    for run in pixels().collect::<Vec<_>>().chunk_by(|a, b| a == b) {
        *counts.entry(run[0]).or_default() += run.len() as u32;
    }
    let mut by_count: Vec<_> = counts.iter().map(|(&color, &count)| (std::cmp::Reverse(count), color)).collect();
    by_count.sort_unstable();
    let palette: Vec<[u8; 3]> = by_count.iter().take(256).map(|&(_, color)| color).collect();
    let distance = |a: [u8; 3], b: [u8; 3]| (0..3).map(|k| u32::from(a[k].abs_diff(b[k])).pow(2)).sum::<u32>();
    let nearest = |color: [u8; 3]| (0..palette.len()).min_by_key(|&k| distance(palette[k], color)).unwrap_or(0) as u8;
    let index: BTreeMap<[u8; 3], u8> = counts.keys().map(|&color| (color, nearest(color))).collect();
    let (mut indices, mut last) = (Vec::with_capacity(image.len() / 3), ([0; 3], None));
    for color in pixels() {
        let at = last.1.filter(|_| last.0 == color).unwrap_or_else(|| index[&color]);
        last = (color, Some(at));
        indices.push(at);
    }
    (palette.concat(), indices)
}

#[cfg(test)]
mod tests {
    use super::indexed;

    #[test]
    fn the_palette_has_the_most_frequent_colors() {
        let frequent = (0..=255_u8).flat_map(|v| [v, 0, 0, v, 0, 0]);
        let image: Vec<u8> = frequent.chain([17, 3, 0]).collect();
        let (palette, indices) = indexed(&image);
        assert_eq!((palette.len(), indices.len()), (768, 513));
        let last = 3 * usize::from(indices[512]);
        assert_eq!(palette[last..last + 3], [17, 0, 0]);
    }
}
