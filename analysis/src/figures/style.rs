//! Colors, line widths and font sizes of all figures, and legends.
//!
//! Colors: Okabe and Ito, *Color Universal Design* (2008), distinguishable with every common color blindness. A quantity has the same color in all figures.

use super::canvas::{Align, Drawing, RGBAColor, Stroke};
use super::text::text_width;

const fn rgb(hex: u32) -> RGBAColor {
    RGBAColor((hex >> 16) as u8, (hex >> 8) as u8, hex as u8, 1.0)
}

/// The color with another opacity.
pub const fn pale(color: RGBAColor, opacity: f64) -> RGBAColor {
    RGBAColor(color.0, color.1, color.2, opacity)
}

/// Text.
pub const TEXT: RGBAColor = rgb(0x22_22_22);
/// Ground truth.
pub const BLUE: RGBAColor = rgb(0x00_72_B2);
/// Estimate.
pub const VERMILLION: RGBAColor = rgb(0xD5_5E_00);
/// Reference.
pub const BLACK: RGBAColor = rgb(0x00_00_00);
/// Legs LF RF LH RH.
pub const LEG_COLORS: [RGBAColor; 4] = [rgb(0x00_9E_73), rgb(0xE6_9F_00), rgb(0xCC_79_A7), rgb(0x56_B4_E9)];

/// Background of a swing.
pub const SWING: RGBAColor = pale(BLACK, 0.08);
/// Background of a push.
pub const PUSH: RGBAColor = pale(LEG_COLORS[2], 0.35);
/// Background of the modes other than `STANCE` and `WALK`.
pub const DAMPING: RGBAColor = pale(LEG_COLORS[1], 0.25);

/// Frame and ticks.
pub const FRAME: Stroke = Stroke { color: rgb(0x44_44_44), width: 0.7 };
/// Grid lines.
pub const GRID: Stroke = Stroke { color: rgb(0xE4_E4_E4), width: 0.6 };
/// Ground truth: wide enough to be visible below an equal estimate.
pub const TRUE_LINE: Stroke = Stroke { color: BLUE, width: 2.0 };
/// Estimate.
pub const ESTIMATED_LINE: Stroke = Stroke { color: VERMILLION, width: 0.9 };
/// Reference, dashed.
pub const REFERENCE_LINE: Stroke = Stroke { color: BLACK, width: 0.9 };

/// Font size of the numbers at axes.
pub const TICK_EM: f64 = 9.5;
/// Font size of labels and legends.
pub const LABEL_EM: f64 = 10.5;

/// Colors of logs in figures of several logs.
pub const RUN_COLORS: [RGBAColor; 7] =
    [BLUE, VERMILLION, LEG_COLORS[0], LEG_COLORS[1], LEG_COLORS[2], LEG_COLORS[3], rgb(0x77_77_77)];

/// Drawing units per millimeter.
pub const UNITS_PER_MM: f64 = 96.0 / 25.4;
/// Points (1/72 inch) per drawing unit.
pub const POINTS_PER_UNIT: f64 = 0.75;
/// Space for numbers and label of a vertical axis.
pub const LEFT_MARGIN: f64 = 56.0;
/// Space at the right edge.
pub const RIGHT_MARGIN: f64 = 10.0;
/// Space for the legend.
pub const TOP_MARGIN: f64 = 24.0;
/// Space for numbers and label of a horizontal axis.
pub const BOTTOM_MARGIN: f64 = 34.0;

/// Symbol of a legend entry.
#[derive(Clone, Copy, Debug)]
pub enum Mark {
    /// A line.
    Line(Stroke),
    /// A dashed line.
    Dashed(Stroke),
    /// A filled rectangle.
    Fill(RGBAColor),
    /// A disc.
    Dot(RGBAColor),
    /// Two bars, one above the other.
    Bars(RGBAColor, RGBAColor),
}

/// Height of a row of a legend.
pub const LEGEND_ROW: f64 = 14.0;

impl Mark {
    fn width(&self) -> f64 {
        match self {
            Self::Dot(_) => 7.0,
            Self::Fill(_) | Self::Bars(..) => 12.0,
            Self::Line(_) | Self::Dashed(_) => 18.0,
        }
    }
}

fn entry_width(text: &str, mark: &Mark) -> f64 {
    mark.width() + 4.0 + text_width(text, LABEL_EM) + 16.0
}

/// Distributes the entries to rows that fit into a width.
pub fn legend_rows<'a>(entries: &[(&'a str, Mark)], width: f64) -> Vec<Vec<(&'a str, Mark)>> {
    let mut rows: Vec<Vec<(&str, Mark)>> = Vec::new();
    let mut used = f64::INFINITY;
    for &(text, mark) in entries {
        let wide = entry_width(text, &mark);
        if used + wide - 16.0 > width {
            rows.push(Vec::new());
            used = 0.0;
        }
        used += wide;
        if let Some(row) = rows.last_mut() {
            row.push((text, mark));
        }
    }
    rows
}

/// Draws a row of legend entries from `left`, with the text at `baseline`.
pub fn legend(drawing: &mut Drawing, left: f64, baseline: f64, entries: &[(&str, Mark)]) {
    let mut x = left;
    let y = baseline - 0.35 * LABEL_EM;
    for (text, mark) in entries {
        let width = mark.width();
        match *mark {
            Mark::Line(stroke) => drawing.line(vec![(x, y), (x + width, y)], stroke),
            Mark::Dashed(stroke) => {
                for start in [0.0, 6.5, 13.0] {
                    drawing.line(vec![(x + start, y), (x + start + 4.0, y)], stroke);
                }
            }
            Mark::Fill(color) => drawing.rect((x, y - 4.0), (width, 8.0), color),
            Mark::Bars(upper, lower) => {
                drawing.rect((x, y - 3.5), (width, 3.0), upper);
                drawing.rect((x, y + 0.5), (width, 3.0), lower);
            }
            Mark::Dot(color) => drawing.dot((x + 3.5, y), 2.6, color),
        }
        drawing.text((x + width + 4.0, baseline), *text, LABEL_EM, Align::Left, TEXT);
        x += entry_width(text, mark);
    }
}
