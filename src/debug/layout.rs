//! Text that is fitted to a width without showing part of a number: what does not fit is left out as a whole and marked with `…`.

use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};

/// Mark of an omission.
const MORE: &str = "…";

/// Column of a table: title and alignment of its cells. It is as wide as its widest cell.
pub struct Column {
    /// Title; empty if the table has no header.
    pub title: &'static str,
    /// Numbers are right-aligned.
    pub right: bool,
}

/// The cells of a row and its colour.
pub struct Row {
    /// One text per column.
    pub cells: Vec<String>,
    /// Colour of the row.
    pub color: Color,
}

/// Rows as lines of at most `width` columns, below a header unless all titles are empty. The last columns are left out if they do not fit.
pub fn table(columns: &[Column], rows: &[Row], width: usize) -> Vec<Line<'static>> {
    let cell_width = |k: usize| {
        let cells = rows.iter().filter_map(|row| row.cells.get(k)).map(|cell| text_width(cell));
        cells.max().unwrap_or(0).max(text_width(columns[k].title))
    };
    let widths: Vec<usize> = (0..columns.len()).map(cell_width).collect();
    let line = |cells: &mut dyn Iterator<Item = &str>, color: Color| {
        let padded: Vec<Span> = cells
            .zip(columns.iter().zip(&widths))
            .map(|(cell, (column, width))| {
                let fill = " ".repeat(width - text_width(cell));
                Span::raw(if column.right { format!("{fill}{cell}") } else { format!("{cell}{fill}") })
            })
            .collect();
        join(padded, "  ", width).style(Style::new().fg(color))
    };
    let mut lines = Vec::new();
    if columns.iter().any(|column| !column.title.is_empty()) {
        lines.push(line(&mut columns.iter().map(|column| column.title), Color::DarkGray));
    }
    lines.extend(rows.iter().map(|row| line(&mut row.cells.iter().map(String::as_str), row.color)));
    lines
}

/// Joins parts into a line of at most `width` columns. The last parts are left out if they do not fit.
pub fn join(parts: Vec<Span<'static>>, separator: &'static str, width: usize) -> Line<'static> {
    let gap = text_width(separator);
    let total = parts.iter().map(Span::width).sum::<usize>() + gap * parts.len().saturating_sub(1);
    let all = total <= width;
    // The mark of an omission needs room too.
    let room = if all { width } else { width.saturating_sub(1 + text_width(MORE)) };
    let (mut spans, mut used) = (Vec::new(), 0);
    for part in parts {
        let needed = part.width() + if spans.is_empty() { 0 } else { gap };
        if used + needed > room {
            break;
        }
        if !spans.is_empty() {
            spans.push(Span::raw(separator));
        }
        used += needed;
        spans.push(part);
    }
    if !all && width > 0 {
        spans.push(Span::raw(if spans.is_empty() { MORE.to_owned() } else { format!(" {MORE}") }));
    }
    Line::from(spans)
}

/// A text of at most `width` columns. The last words are left out if they do not fit.
pub fn cut(text: &str, width: usize) -> Line<'static> {
    if text_width(text) <= width {
        return Line::from(text.to_owned());
    }
    join(text.split_whitespace().map(|word| Span::raw(word.to_owned())).collect(), " ", width)
}

/// Columns that a text takes in the terminal.
pub fn text_width(text: &str) -> usize {
    Span::raw(text).width()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(line: &Line) -> String {
        line.spans.iter().map(|span| span.content.as_ref()).collect()
    }

    #[test]
    fn words_that_do_not_fit_are_left_out_as_a_whole() {
        let fitted = |width| text(&cut("row 123 of 4567", width));
        assert_eq!(fitted(15), "row 123 of 4567");
        assert_eq!(fitted(14), "row 123 of …");
        assert_eq!(fitted(8), "row …");
        assert_eq!(fitted(3), "…");
        assert_eq!(fitted(0), "");
    }

    #[test]
    fn columns_that_do_not_fit_are_left_out_as_a_whole() {
        let columns = [Column { title: "leg", right: false }, Column { title: "N", right: true }];
        let rows = [Row { cells: vec!["LF".to_owned(), "1234.5".to_owned()], color: Color::Reset }];
        let fitted = |width| table(&columns, &rows, width).iter().map(text).collect::<Vec<_>>();
        assert_eq!(fitted(11), ["leg       N", "LF   1234.5"]);
        assert_eq!(fitted(10), ["leg …", "LF  …"]);
    }
}
