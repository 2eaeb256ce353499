//! The HTML page of a report, self-contained in one file. [`replay_comparison`] is the page of replayed golden logs.

pub(crate) mod replay_comparison;

use std::fmt::Write as _;

use crate::figures::{FONT, Figure, Format, NotDrawn, escape};
use crate::metrics::Metrics;
use crate::numeric_table::NumericTable;
use crate::tables;
use crate::timeline::TimelineEntry;

/// Timeline entries shown per log; a long log may have thousands.
const ENTRIES_SHOWN: usize = 300;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// A log on the page.
pub(crate) struct Part<'a> {
    /// Name of the log.
    pub name: String,
    /// Path of the log.
    pub path: String,
    /// Metrics of the log.
    pub metrics: &'a Metrics,
    /// Messages per channel.
    pub channels: &'a std::collections::BTreeMap<String, u64>,
    /// Timeline of the log.
    pub timeline: &'a [TimelineEntry],
}

/// Content of the page in addition to the logs.
pub(crate) struct Content<'a> {
    /// Figures in order.
    pub figures: &'a [Figure],
    /// File formats of each figure.
    pub formats: &'a [Format],
    /// Figures that could not be drawn.
    pub not_drawn: &'a [NotDrawn],
    /// Animation of the first log, as SVG.
    pub walk: Option<&'a str>,
    /// Other files of the report.
    pub files: &'a [String],
}

/// The page: remarks, timelines, tables, figures, channels.
pub(crate) fn page(parts: &[Part], content: &Content) -> String {
    let title = parts.iter().map(|part| part.name.as_str()).collect::<Vec<_>>().join(", ");
    let subtitle = if parts.len() == 1 {
        "Report of a run, computed from its log alone."
    } else {
        "Report of several runs, computed from their logs alone."
    };
    let mut page = head(&title, subtitle);
    for part in parts {
        remarks(&mut page, part, parts.len() > 1);
    }
    for missing in content.not_drawn {
        let _ = writeln!(
            page,
            "<p>Figure “{}” is not drawn: the log lacks {}.</p>",
            escape(&missing.title),
            escape(&missing.needs)
        );
    }
    if parts.len() > 1 {
        page.push_str("<h2>Side by side</h2>\n");
        let each: Vec<(String, &Metrics)> = parts.iter().map(|part| (part.name.clone(), part.metrics)).collect();
        numbers(&mut page, &tables::comparison(&each));
    }
    if let Some(walk) = content.walk {
        let _ = writeln!(
            page,
            "<figure>{walk}<figcaption>Side view, from joint positions and base pose in the log. <a href=\"walk.svg\">SVG</a></figcaption></figure>"
        );
    }
    for part in parts {
        let of_name = if parts.len() > 1 { format!(", {}", escape(&part.name)) } else { String::new() };
        let _ = writeln!(page, "<h2>Run{of_name}</h2>");
        run(&mut page, part);
        timeline(&mut page, part);
        if parts.len() == 1 {
            tracking(&mut page, part.metrics);
            contact(&mut page, part.metrics);
        }
        let times = tables::timing(part.metrics);
        if !times.rows.is_empty() {
            let _ = writeln!(page, "<h2>Timing{of_name}</h2>");
            numbers(&mut page, &times);
        }
    }
    page.push_str("<h2>Figures</h2>\n<p class=\"soft\">Zoom: Ctrl and mouse wheel, or double click. Move: drag. Reset: Escape.</p>\n");
    for figure in content.figures {
        let links = content.formats.iter().map(|format| {
            let extension = format.extension();
            format!("<a href=\"{}.{extension}\">{}</a>", figure.name, extension.to_uppercase())
        });
        let _ = writeln!(
            page,
            "<figure>{}<figcaption><b>{}.</b> {} {}</figcaption></figure>",
            figure.svg(),
            escape(&figure.title),
            escape(&figure.caption),
            links.collect::<Vec<_>>().join(", ")
        );
    }
    parts.iter().for_each(|part| channels(&mut page, part, parts.len() > 1));
    let links: Vec<String> = content.files.iter().map(|name| format!("<a href=\"{name}\">{name}</a>")).collect();
    let _ = write!(
        page,
        "<p class=\"soft\">Files in the same folder: {}.</p>\n<script>{SCRIPT}</script>\n</body></html>\n",
        links.join(", ")
    );
    page
}

/// Head of a page, title and subtitle.
fn head(title: &str, subtitle: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>{0}</title>\n<style>{STYLE}\
         @font-face{{font-family:\"Hoofprint Sans\";src:url(data:font/ttf;base64,{1})}}</style></head><body>\n<h1>{0}</h1>\n<p class=\"soft\">{subtitle}</p>\n",
        escape(title),
        base64(FONT)
    )
}

/// Notes of the log and missing channels.
fn remarks(page: &mut String, part: &Part, several: bool) {
    let of = if several { format!("{}: ", escape(&part.name)) } else { String::new() };
    for note in &part.metrics.notes {
        let _ = writeln!(page, "<p class=\"bad\">{of}{}</p>", escape(note));
    }
    if !part.metrics.missing_channels.is_empty() {
        let _ = writeln!(page, "<p>{of}Not in the log: {}.</p>", part.metrics.missing_channels.join(", "));
    }
}

fn run(page: &mut String, part: &Part) {
    let metrics = part.metrics;
    page.push_str("<table>");
    for (key, value) in tables::summary_rows(metrics) {
        let class = if key == "fault" || (key == "fell" && metrics.safety.fell) { " class=\"bad\"" } else { "" };
        let _ = writeln!(page, "<tr><th>{key}</th><td{class}>{}</td></tr>", escape(&value));
    }
    for (key, value) in [
        ("toolchain", &metrics.run.toolchain),
        ("build", &metrics.run.build),
        ("host", &metrics.run.host),
        ("real time", &metrics.run.realtime),
        ("log, SHA-256", &metrics.run.log_sha256),
    ] {
        if !value.is_empty() {
            let _ = writeln!(page, "<tr><th>{key}</th><td>{}</td></tr>", escape(value));
        }
    }
    page.push_str("</table>\n");
}

fn timeline(page: &mut String, part: &Part) {
    page.push_str("<h2>Timeline</h2>\n");
    if part.timeline.is_empty() {
        page.push_str(
            "<p>No entries: no change of gait or mode, no fall, fault, loss, missed deadline or event.</p>\n",
        );
        return;
    }
    let path = escape(&part.path);
    let _ = writeln!(
        page,
        "<p class=\"soft\">Times are in seconds since the first tick. <code>hoof debug {path} --at T</code> shows the state at a time, \
         <code>hoof log trim {path} cut.mcap --around T</code> copies the part of the log around it.</p>"
    );
    page.push_str(
        "<div class=\"wide tall\"><table><tr><th class=\"n\">t [s]</th><th class=\"n\">tick</th><th>kind</th><th>description</th><th>replay</th></tr>\n",
    );
    for TimelineEntry { t_s, tick, what, text } in part.timeline.iter().take(ENTRIES_SHOWN) {
        let class = if what.is_problem() { " class=\"bad\"" } else { "" };
        let tick = tick.map_or(String::new(), |tick| tick.to_string());
        let _ = writeln!(
            page,
            "<tr><td class=\"n\">{t_s:.3}</td><td class=\"n\">{tick}</td><td{class}>{}</td><td{class}>{}</td><td><code>hoof replay {} --from {:.3} --to {:.3}</code></td></tr>",
            what.name(),
            escape(text),
            path,
            (t_s - 1.0).max(0.0),
            t_s + 1.0
        );
    }
    page.push_str("</table></div>\n");
    if part.timeline.len() > ENTRIES_SHOWN {
        let more = part.timeline.len() - ENTRIES_SHOWN;
        let _ = writeln!(page, "<p class=\"soft\">{more} more entries are in happenings.json.</p>");
    }
}

fn tracking(page: &mut String, metrics: &Metrics) {
    let table = tables::tracking(metrics);
    if table.rows.is_empty() {
        return;
    }
    let published = if metrics.run.quadruped {
        " Published: Raiola et al. 2020, Table 3, HyQ in simulation. Ratio: measured rms / published rms."
    } else {
        ""
    };
    let _ = writeln!(
        page,
        "<h2>Tracking</h2>\n<p class=\"soft\">{}, in the modes STANCE and WALK; feet during swing, relative to the base, in the horizontal \
         frame.{published}</p>",
        escape(tables::tracking_heading(metrics))
    );
    numbers(page, &table);
}

fn contact(page: &mut String, metrics: &Metrics) {
    let Some(contact) = &metrics.contact else { return };
    page.push_str(
        "<h2>Contact</h2>\n<div class=\"wide\"><table><tr><th></th><th class=\"n\">correct flags</th><th class=\"n\">missed ticks</th>\
         <th class=\"n\">false ticks</th><th class=\"n\">touchdowns</th><th class=\"n\">false</th><th class=\"n\">missed</th>\
         <th class=\"n\">delay p50 [ms]</th><th class=\"n\">p99 [ms]</th><th class=\"n\">force rms [N]</th></tr>\n",
    );
    for leg in &contact.legs {
        let dash = || "–".to_owned();
        let delay = leg.touchdowns.delay_ms;
        let cells = [
            leg.accuracy.map_or_else(dash, |a| format!("{:.2} %", 100.0 * a)),
            leg.true_missed.to_string(),
            leg.none_found.to_string(),
            leg.touchdowns.count.to_string(),
            leg.touchdowns.false_count.to_string(),
            leg.touchdowns.missed_count.to_string(),
            delay.map_or_else(dash, |d| format!("{:.1}", d.p50)),
            delay.map_or_else(dash, |d| format!("{:.1}", d.p99)),
            leg.force_error_contact_n.map_or_else(dash, |e| format!("{:.1}", e.rms)),
        ];
        let _ = write!(page, "<tr><td>{}</td>", leg.leg);
        for cell in cells {
            let _ = write!(page, "<td class=\"n\">{cell}</td>");
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table></div>\n");
}

/// A table of numbers. Values up to 1 in a column `ratio` are marked as good.
fn numbers(page: &mut String, table: &NumericTable) {
    page.push_str("<div class=\"wide\"><table><tr>");
    for (k, heading) in table.head.iter().enumerate() {
        let class = if k == 0 { "" } else { " class=\"n\"" };
        let _ = write!(page, "<th{class}>{}</th>", escape(heading));
    }
    page.push_str("</tr>\n");
    for row in &table.rows {
        let _ = write!(page, "<tr><td>{}</td>", escape(&row.label()));
        for ((heading, value), text) in table.head.iter().skip(1).zip(&row.values).zip(row.printed("")) {
            let class = match value {
                Some(ratio) if heading == "ratio" && *ratio <= 1.0 => " good",
                Some(_) if heading == "ratio" => " bad",
                _ => "",
            };
            let text = text.replace('-', "\u{2212}");
            let _ = write!(page, "<td class=\"n{class}\">{text}</td>");
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table></div>\n");
}

fn channels(page: &mut String, part: &Part, several: bool) {
    let of = if several { format!(", {}", escape(&part.name)) } else { String::new() };
    let _ = writeln!(
        page,
        "<h2>Channels{of}</h2>\n<div class=\"wide\"><table><tr><th>channel</th><th class=\"n\">messages</th></tr>"
    );
    for (channel, count) in part.channels {
        let _ = writeln!(page, "<tr><td>{}</td><td class=\"n\">{count}</td></tr>", escape(channel));
    }
    page.push_str("</table></div>\n");
}

/// RFC 4648 with padding.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let bits = (0..3).fold(0, |bits, k| bits << 8 | u32::from(group.get(k).copied().unwrap_or(0)));
        for k in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * k)) as usize & 63];
            text.push(if k <= group.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn base64_as_in_rfc_4648() {
        for (plain, coded) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(super::base64(plain.as_bytes()), coded);
        }
    }
}
