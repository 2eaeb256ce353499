//! The page of a report: one file that needs no other.

use std::fmt::Write as _;

use lcmtypes::Event;

use crate::figures::{FONT, Figure, Lacking};
use crate::metrics::Metrics;
use crate::run::Run;
use crate::{Error, tables};

/// Events shown; a log of a long run may hold thousands.
const EVENTS_SHOWN: usize = 200;

const STYLE: &str = "\
:root{color-scheme:light dark;--ink:#222;--soft:#666;--line:#ddd;--paper:#fff;--card:#fff;--bad:#b3400a;--good:#00734f}
@media(prefers-color-scheme:dark){:root{--ink:#e4e4e4;--soft:#a0a0a0;--line:#3a3a3a;--paper:#181818;--bad:#f0915a;--good:#4ec9a0}}
body{margin:0 auto;max-width:64rem;padding:2rem 1rem 4rem;background:var(--paper);color:var(--ink);font:16px/1.5 system-ui,Arial,sans-serif}
h1{font-size:1.5rem;margin:0 0 .2rem}h2{font-size:1.1rem;margin:2.2rem 0 .6rem}
p,figcaption{margin:.4rem 0}.soft,figcaption{color:var(--soft);font-size:.88rem}
table{border-collapse:collapse;font-size:.88rem;font-variant-numeric:tabular-nums}
th,td{padding:.16rem .7rem .16rem 0;text-align:left;vertical-align:top;border-bottom:1px solid var(--line)}
th{font-weight:600;white-space:nowrap}.wide td{white-space:nowrap}td.n,th.n{text-align:right}td.gap,th.gap{padding-left:1.2rem}
.wide{overflow-x:auto}.bad{color:var(--bad)}.good{color:var(--good)}
figure{margin:1rem 0 1.6rem}figure svg{display:block;width:100%;height:auto;background:#fff;border-radius:4px}
a{color:inherit}";

/// The page: summary, figures inline, tables, events.
pub(crate) fn page(run: &Run, metrics: &Metrics, figures: &[Figure], lacking: &[Lacking]) -> Result<String, Error> {
    let name =
        run.path.file_name().map_or_else(|| run.path.display().to_string(), |n| n.to_string_lossy().into_owned());
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>{0}</title>\n<style>{STYLE}\n@font-face{{font-family:\"Hoofprint Sans\";src:url(data:font/ttf;base64,{1})}}</style></head><body>\n\
         <h1>{0}</h1>\n<p class=\"soft\">Report of a run, made from its log alone.</p>\n",
        escape(&name),
        base64(FONT)
    );
    remarks(&mut page, metrics, lacking);
    page.push_str("<h2>Run</h2>\n<table>");
    for (key, value) in tables::summary_rows(metrics) {
        let class = if key == "fault" || (key == "fell" && metrics.safety.fell) { " class=\"bad\"" } else { "" };
        let _ = writeln!(page, "<tr><th>{key}</th><td{class}>{}</td></tr>", escape(&value));
    }
    for (key, value) in [
        ("toolchain", &metrics.run.toolchain),
        ("build", &metrics.run.build),
        ("host", &metrics.run.host),
        ("real time", &metrics.run.realtime),
    ] {
        if !value.is_empty() {
            let _ = writeln!(page, "<tr><th>{key}</th><td>{}</td></tr>", escape(value));
        }
    }
    page.push_str("</table>\n");
    tracking(&mut page, metrics);
    contact(&mut page, metrics);
    timing(&mut page, metrics);
    page.push_str("<h2>Figures</h2>\n");
    for figure in figures {
        let _ = writeln!(
            page,
            "<figure>{}<figcaption><b>{}.</b> {} <a href=\"{name}.svg\">SVG</a>, <a href=\"{name}.png\">PNG</a></figcaption></figure>",
            figure.svg()?,
            figure.title,
            escape(&figure.caption),
            name = figure.name
        );
    }
    events(&mut page, run);
    channels(&mut page, run);
    page.push_str(
        "<p class=\"soft\">Files beside this page: <a href=\"metrics.json\">metrics.json</a>, <a href=\"tables.txt\">tables.txt</a>, \
         <a href=\"tracking.csv\">tracking.csv</a>.</p>\n</body></html>\n",
    );
    Ok(page)
}

/// What a reader must know before trusting a number.
fn remarks(page: &mut String, metrics: &Metrics, lacking: &[Lacking]) {
    for note in &metrics.notes {
        let _ = writeln!(page, "<p class=\"bad\">{}</p>", escape(note));
    }
    if !metrics.missing_channels.is_empty() {
        let _ = writeln!(page, "<p>Not in the log: {}.</p>", metrics.missing_channels.join(", "));
    }
    for lack in lacking {
        let _ = writeln!(page, "<p>No figure “{}”: it needs {}.</p>", lack.title, lack.needs);
    }
}

fn tracking(page: &mut String, metrics: &Metrics) {
    let _ = writeln!(
        page,
        "<h2>Tracking</h2>\n<p class=\"soft\">{}, while the controller stands or walks; feet during swing, relative to the base, in the \
         horizontal frame. Published: Raiola et al. 2020, Table 3, HyQ in simulation; ratio is measured over published rms.</p>",
        escape(tables::tracking_heading(metrics))
    );
    page.push_str(
        "<div class=\"wide\"><table><tr><th></th><th class=\"n\">mean</th><th class=\"n\">std</th><th class=\"n\">rms</th>\
         <th class=\"n\">mean |e|</th><th class=\"n\">max |e|</th><th class=\"n gap\">published mean</th><th class=\"n\">std</th>\
         <th class=\"n\">rms</th><th class=\"n\">ratio</th></tr>\n",
    );
    for row in tables::tracking_rows(metrics) {
        let number = |value: Option<f64>| value.map_or("–".to_owned(), |v| tables::fixed(v).replace('-', "\u{2212}"));
        let blank = |value: Option<f64>| value.map_or(String::new(), tables::fixed);
        let (m, p) = (row.measured, row.published);
        let _ = write!(page, "<tr><td>{} [{}]</td>", row.name, row.unit);
        for value in
            [m.map(|e| e.mean), m.map(|e| e.std), m.map(|e| e.rms), m.map(|e| e.mean_abs), m.map(|e| e.max_abs)]
        {
            let _ = write!(page, "<td class=\"n\">{}</td>", number(value));
        }
        let _ = write!(page, "<td class=\"n gap\">{}</td>", blank(p.map(|p| p.mean)));
        let _ = write!(
            page,
            "<td class=\"n\">{}</td><td class=\"n\">{}</td>",
            blank(p.map(|p| p.std)),
            blank(p.map(|p| p.rms()))
        );
        let (class, ratio) = match row.rms_ratio() {
            Some(ratio) => (if ratio <= 1.0 { " good" } else { " bad" }, format!("{ratio:.2}")),
            None => ("", String::new()),
        };
        let _ = writeln!(page, "<td class=\"n{class}\">{ratio}</td></tr>");
    }
    page.push_str("</table></div>\n");
}

fn contact(page: &mut String, metrics: &Metrics) {
    let Some(contact) = &metrics.contact else { return };
    page.push_str(
        "<h2>Contact</h2>\n<div class=\"wide\"><table><tr><th></th><th class=\"n\">flag right</th><th class=\"n\">missed ticks</th>\
         <th class=\"n\">false ticks</th><th class=\"n\">touchdowns</th><th class=\"n\">false</th><th class=\"n\">delay p50 [ms]</th>\
         <th class=\"n\">p99 [ms]</th><th class=\"n\">force rms [N]</th></tr>\n",
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

fn timing(page: &mut String, metrics: &Metrics) {
    let rows = tables::timing_rows(metrics);
    if rows.is_empty() {
        return;
    }
    page.push_str(
        "<h2>Timing</h2>\n<div class=\"wide\"><table><tr><th>[µs]</th><th class=\"n\">mean</th><th class=\"n\">std</th><th class=\"n\">p50</th>\
         <th class=\"n\">p99</th><th class=\"n\">p99.9</th><th class=\"n\">max</th></tr>\n",
    );
    for (name, d) in rows {
        let _ = write!(page, "<tr><td>{name}</td>");
        for value in [d.mean, d.std, d.p50, d.p99, d.p999, d.max] {
            let _ = write!(page, "<td class=\"n\">{value:.1}</td>");
        }
        page.push_str("</tr>\n");
    }
    page.push_str("</table></div>\n");
}

fn events(page: &mut String, run: &Run) {
    if run.events.is_empty() {
        return;
    }
    page.push_str(
        "<h2>Events</h2>\n<div class=\"wide\"><table><tr><th class=\"n\">t [s]</th><th>source</th><th>what</th></tr>\n",
    );
    let t0_ns = run.ticks.first().map_or(0, |tick| tick.t_ns);
    for event in run.events.iter().take(EVENTS_SHOWN) {
        let class = if event.level == Event::LEVEL_INFO { "" } else { " class=\"bad\"" };
        let t_s = (event.t_ns - t0_ns) as f64 / 1e9;
        let (source, text) = (escape(&event.source), escape(&event.text));
        let _ = writeln!(page, "<tr><td class=\"n\">{t_s:.3}</td><td>{source}</td><td{class}>{text}</td></tr>");
    }
    page.push_str("</table></div>\n");
    if run.events.len() > EVENTS_SHOWN {
        let _ = writeln!(page, "<p class=\"soft\">and {} more in the log.</p>", run.events.len() - EVENTS_SHOWN);
    }
}

fn channels(page: &mut String, run: &Run) {
    page.push_str(
        "<h2>Channels</h2>\n<div class=\"wide\"><table><tr><th>channel</th><th class=\"n\">messages</th></tr>\n",
    );
    for (channel, count) in &run.channels {
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

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
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
