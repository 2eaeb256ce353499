//! The HTML page of golden logs whose replay differs from the record.

use super::{SCRIPT, head};
use crate::figures::{Figure, escape};
use crate::replay_comparison::{Log, Shown};
use std::fmt::Write as _;

/// The page: a table of all logs, then a section for each log whose replay differs.
pub(crate) fn page(logs: &[Log], shown: &[Shown]) -> String {
    let mut page = head(
        "Golden logs",
        "Before: as recorded. After: replay of the same inputs by the current controller. Written by hoof corpus check.",
    );
    page.push_str("<div class=\"wide\"><table><tr><th>log</th><th>purpose</th><th>verdict</th></tr>\n");
    for log in logs {
        let name = match log.sides {
            Some(_) => format!("<a href=\"#{0}\">{0}</a>", escape(&log.name)),
            None => escape(&log.name),
        };
        let class = if log.identical { "good" } else { "bad" };
        let verdict = log.verdict.lines().next().unwrap_or_default();
        let why = escape(&log.why);
        let _ = writeln!(page, "<tr><td>{name}</td><td>{why}</td><td class=\"{class}\">{}</td></tr>", escape(verdict));
    }
    page.push_str("</table></div>\n");
    shown.iter().for_each(|shown| section(&mut page, shown));
    let _ = write!(page, "<script>{SCRIPT}</script>\n</body></html>\n");
    page
}

fn section(page: &mut String, shown: &Shown) {
    let _ =
        writeln!(page, "<h2 id=\"{0}\">{0}</h2>\n<pre>{1}</pre>", escape(&shown.log.name), escape(&shown.log.verdict));
    let _ = writeln!(
        page,
        "<p class=\"soft\">Outputs kept in the log, every {:.0} ms, and the replayed outputs at the same ticks.</p>",
        1e3 * shown.period_s
    );
    page.push_str(
        "<table><tr><th>channel</th><th class=\"n\">differ</th><th class=\"n\">of</th><th class=\"n\">first kept tick</th>\
         <th>field</th><th>before</th><th>after</th><th class=\"n\">ulp</th></tr>\n",
    );
    for channel in &shown.channels {
        let Some(first) = &channel.first else { continue };
        let ulp = first.ulp.map_or_else(|| "–".to_owned(), |ulp| ulp.to_string());
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"n\">{ulp}</td></tr>",
            escape(&channel.name),
            channel.different + channel.left_only + channel.right_only,
            channel.left.max(channel.right),
            first.number,
            escape(&first.field),
            escape(&first.left),
            escape(&first.right),
        );
    }
    page.push_str("</table>\n");
    for figure in &shown.overlaid {
        let _ = writeln!(
            page,
            "<figure>{}<figcaption><b>{}.</b></figcaption></figure>",
            figure.svg(),
            escape(&figure.title)
        );
    }
    page.push_str("<div class=\"pair\">\n");
    for [before, after] in &shown.pairs {
        let _ = writeln!(page, "<h3>{}</h3>", escape(&before.title));
        side(page, "before", before);
        side(page, "after", after);
    }
    page.push_str("</div>\n");
}

fn side(page: &mut String, name: &str, figure: &Figure) {
    let _ = writeln!(page, "<figure>{}<figcaption>{name}</figcaption></figure>", figure.svg());
}
