//! The table that every command prints: columns of text, aligned, without rules.
//!
//! ```
//! use analysis::table::{Column, Table};
//!
//! let mut table = Table::new([Column::left("joint"), Column::right("effort")]);
//! table.row(["LF_HAA", "120.0"]);
//! table.row(["LF_KFE", "9.5"]);
//! assert_eq!(table.to_string(), "joint   effort\nLF_HAA   120.0\nLF_KFE     9.5");
//! ```
//!
//! Layout and the width of Unicode text come from the crate `comfy-table`. Tables of numbers that are also written to files are
//! [`crate::numeric_table::NumericTable`], which prints itself through this type.

use std::fmt;

use comfy_table::{Cell, CellAlignment, presets};

/// Spaces between two columns.
const GAP: u16 = 2;

/// Rows of text under headings. [`Display`](fmt::Display) prints one line per row and no newline at the end, with control characters in
/// cells escaped.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Vec<String>>,
}

/// Heading and alignment of a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    heading: String,
    alignment: Alignment,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Alignment {
    Left,
    Right,
}

impl Column {
    /// A column of text.
    pub fn left(heading: impl Into<String>) -> Self {
        Self { heading: heading.into(), alignment: Alignment::Left }
    }

    /// A column of numbers.
    pub fn right(heading: impl Into<String>) -> Self {
        Self { heading: heading.into(), alignment: Alignment::Right }
    }
}

impl Table {
    /// A table without rows. The line of headings is omitted if all of them are empty.
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        Self { columns: columns.into_iter().collect(), rows: Vec::new() }
    }

    /// Appends a row. Missing cells are empty; cells beyond the last column are left-aligned.
    pub fn row<T: Into<String>>(&mut self, cells: impl IntoIterator<Item = T>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// True if no row was appended.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut layout = comfy_table::Table::new();
        layout.load_style(presets::NOTHING);
        let has_headings = self.columns.iter().any(|column| !column.heading.is_empty());
        let headings = self.columns.iter().map(|column| column.heading.clone()).collect();
        for row in has_headings.then_some(&headings).into_iter().chain(&self.rows) {
            layout.add_row(row.iter().enumerate().map(|(k, text)| {
                let cell = Cell::new(replay::printable(text));
                match self.columns.get(k).map_or(Alignment::Left, |column| column.alignment) {
                    Alignment::Left => cell.set_alignment(CellAlignment::Left),
                    Alignment::Right => cell.set_alignment(CellAlignment::Right),
                }
            }));
        }
        for column in layout.column_iter_mut() {
            column.set_padding((0, GAP));
        }
        f.write_str(&layout.trim_fmt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell_in_characters() {
        let mut table = Table::new([Column::left(""), Column::right("time [µs]"), Column::left("note")]);
        table.row(["tick", "-1.2", ""]);
        table.row(["wake-up", "12345678.9", "late"]);
        let lines = ["          time [µs]  note", "tick           -1.2", "wake-up  12345678.9  late"];
        assert_eq!(table.to_string(), lines.join("\n"));
    }

    #[test]
    fn headings_are_omitted_if_all_are_empty() {
        let mut table = Table::new([Column::left(""), Column::left("")]);
        assert!(table.is_empty());
        table.row(["robot", "hyq"]);
        assert_eq!(table.to_string(), "robot  hyq");
    }

    #[test]
    fn control_characters_are_escaped() {
        let mut table = Table::new([Column::left("channel")]);
        table.row(["A\u{1b}[2J\nB"]);
        assert_eq!(table.to_string(), "channel\nA\\u{1b}[2J\\nB");
    }

    #[test]
    fn rows_may_be_longer_or_shorter_than_the_headings() {
        let mut table = Table::new([Column::right("n")]);
        table.row(["10", "more"]);
        table.row::<String>([]);
        assert_eq!(table.to_string(), " n\n10  more\n");
    }
}
