//! Rows as text: columns, widths and number formats.

use analysis::table::{self, Table};
use replay::record::SenderCounts;
use replay::traffic::{Raised, Row};
use std::cmp::Ordering;

/// A column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    Name,
    Type,
    Count,
    Rate,
    Jitter,
    Gap,
    Bandwidth,
    Lost,
    Late,
    Age,
    Sender,
}

/// Columns by priority: on a narrow screen the last are left out first.
const BY_PRIORITY: [Column; 11] = [
    Column::Name,
    Column::Rate,
    Column::Jitter,
    Column::Lost,
    Column::Late,
    Column::Age,
    Column::Count,
    Column::Bandwidth,
    Column::Type,
    Column::Gap,
    Column::Sender,
];

/// Columns from left to right.
const LEFT_TO_RIGHT: [Column; 11] = [
    Column::Name,
    Column::Type,
    Column::Count,
    Column::Rate,
    Column::Jitter,
    Column::Gap,
    Column::Bandwidth,
    Column::Lost,
    Column::Late,
    Column::Age,
    Column::Sender,
];

impl Column {
    /// Heading with unit.
    pub fn title(self) -> &'static str {
        match self {
            Column::Name => "channel",
            Column::Type => "type",
            Column::Count => "count",
            Column::Rate => "rate Hz",
            Column::Jitter => "jitter",
            Column::Gap => "max gap",
            Column::Bandwidth => "B/s",
            Column::Lost => "lost",
            Column::Late => "late",
            Column::Age => "age",
            Column::Sender => "sender",
        }
    }

    /// Width in characters.
    pub fn width(self) -> usize {
        match self {
            Column::Name => 21,
            Column::Type => 28,
            Column::Count => 9,
            Column::Rate | Column::Jitter | Column::Gap | Column::Bandwidth => 8,
            Column::Lost | Column::Late => 6,
            Column::Age => 7,
            Column::Sender => 21,
        }
    }

    /// Text columns are aligned left, numbers right.
    pub fn is_text(self) -> bool {
        matches!(self, Column::Name | Column::Type | Column::Sender)
    }

    /// Text of a cell.
    pub fn cell(self, row: &Row) -> String {
        match self {
            Column::Name => row.name.clone(),
            Column::Type => type_text(row),
            Column::Count => row.count.to_string(),
            Column::Rate => number(row.rate_hz),
            Column::Jitter => row.jitter_us.map_or_else(none, time),
            Column::Gap => row.gap_us.map_or_else(none, time),
            Column::Bandwidth => scaled(row.bytes_per_s),
            Column::Lost => lost(row),
            Column::Late => row.late.to_string(),
            Column::Age => time(row.age_s * 1e6),
            Column::Sender => match &row.senders[..] {
                [] => none(),
                [one] => one.clone(),
                [first, more @ ..] => format!("{first} +{}", more.len()),
            },
        }
    }

    /// Order of two rows by this column, then by name.
    pub fn order(self, a: &Row, b: &Row) -> Ordering {
        let float = |of: fn(&Row) -> f64| of(b).total_cmp(&of(a));
        let lost = |row: &Row| row.lost.or(row.lost_at_most).unwrap_or(0);
        let by_value = match self {
            Column::Name => Ordering::Equal,
            Column::Type => a.type_name.cmp(&b.type_name),
            Column::Count => b.count.cmp(&a.count),
            Column::Rate => float(|row| row.rate_hz),
            Column::Jitter => float(|row| row.jitter_us.unwrap_or(-1.0)),
            Column::Gap => float(|row| row.gap_us.unwrap_or(-1.0)),
            Column::Bandwidth => float(|row| row.bytes_per_s),
            Column::Lost => lost(b).cmp(&lost(a)),
            Column::Late => b.late.cmp(&a.late),
            Column::Age => float(|row| row.age_s),
            Column::Sender => a.senders.cmp(&b.senders),
        };
        by_value.then_with(|| a.name.cmp(&b.name))
    }

    /// The next column to sort by.
    pub fn next(self) -> Self {
        let at = LEFT_TO_RIGHT.iter().position(|column| *column == self).map_or(0, |at| at + 1);
        LEFT_TO_RIGHT[at % LEFT_TO_RIGHT.len()]
    }
}

/// The columns that fit into a width, from left to right.
pub fn fitting(width: usize) -> Vec<Column> {
    let mut left = width + 1;
    let mut room = |column: &&Column| {
        let needed = column.width() + 1;
        let fits = needed <= left;
        left = if fits { left - needed } else { 0 };
        fits
    };
    let chosen: Vec<Column> = BY_PRIORITY.iter().take_while(&mut room).copied().collect();
    LEFT_TO_RIGHT.into_iter().filter(|column| chosen.contains(column)).collect()
}

/// A cell padded or truncated to its width.
pub fn padded(column: Column, text: &str) -> String {
    let width = column.width();
    let mut text = text.to_owned();
    if text.chars().count() > width {
        text = text.chars().take(width - 1).chain(['…']).collect();
    }
    if column.is_text() { format!("{text:<width$}") } else { format!("{text:>width$}") }
}

/// One line of cells.
pub fn line(columns: &[Column], cell: impl Fn(Column) -> String) -> String {
    columns.iter().map(|column| padded(*column, &cell(*column))).collect::<Vec<_>>().join(" ")
}

/// The whole table without truncation.
pub fn text(rows: &[Row]) -> String {
    let column =
        |column: Column| if column.is_text() { table::Column::left } else { table::Column::right }(column.title());
    let mut table = Table::new(LEFT_TO_RIGHT.map(column));
    for row in rows {
        table.row(LEFT_TO_RIGHT.map(|column| column.cell(row)));
    }
    table.to_string()
}

/// One line of statistics of a sender.
pub fn sender_text(account: &SenderCounts) -> String {
    let SenderCounts { sender, received, lost, duplicates, reordered, restarts, lost_runs: _ } = account;
    let restarts = if *restarts > 0 { format!(", restarts {restarts}") } else { String::new() };
    format!("{sender:<21} {received:>9} received, lost {lost}, duplicate {duplicates}, late {reordered}{restarts}")
}

/// An alarm as text.
pub fn alarm_text(raised: &Raised) -> String {
    let Raised { alarm, channel, value, times } = raised;
    let found = value.map_or("no messages".to_owned(), |value| format!("{channel} is {}", number(value)));
    let times = if *times == 1 { "once".to_owned() } else { format!("{times} times") };
    format!("{alarm}: {found}, raised {times}")
}

/// The type's name, or its fingerprint if it is unknown.
pub fn type_text(row: &Row) -> String {
    match (&row.type_name, &row.fingerprint) {
        (Some(name), _) => name.strip_prefix("hoofprint.").unwrap_or(name).to_owned(),
        (None, Some(fingerprint)) => format!("? {fingerprint}"),
        (None, None) => "? too short for a fingerprint".to_owned(),
    }
}

/// Messages lost: the number if it is known, else its upper bound.
fn lost(row: &Row) -> String {
    match (row.lost, row.lost_at_most) {
        (Some(lost), _) => lost.to_string(),
        (None, Some(at_most)) => format!("≤{at_most}"),
        (None, None) => none(),
    }
}

fn none() -> String {
    "-".to_owned()
}

/// A number with at least four significant digits, without unit.
pub fn number(x: f64) -> String {
    match x.abs() {
        size if size >= 99_999.5 => format!("{x:.3e}"),
        size if size >= 999.95 => format!("{x:.0}"),
        size if size >= 9.9995 || size == 0.0 => format!("{x:.1}"),
        _ => format!("{x:.3}"),
    }
}

/// A number with an SI prefix.
pub fn scaled(x: f64) -> String {
    match x {
        x if x < 999.5 => format!("{x:.0} "),
        x if x < 999.5e3 => format!("{:.1} k", x * 1e-3),
        x if x < 999.5e6 => format!("{:.2} M", x * 1e-6),
        x => format!("{:.2} G", x * 1e-9),
    }
}

/// A time in us, with a suitable unit.
pub fn time(us: f64) -> String {
    match us {
        us if us < 999.5 => format!("{us:.0} us"),
        us if us < 9.995e3 => format!("{:.2} ms", us * 1e-3),
        us if us < 999.5e3 => format!("{:.0} ms", us * 1e-3),
        us if us < 99.95e6 => format!("{:.1} s", us * 1e-6),
        us => format!("{:.0} s", us * 1e-6),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_significant_digits() {
        assert_eq!(
            [0.0, 0.25, 99.94, 999.96, 20_000.0, 1.5e6].map(number),
            ["0.0", "0.250", "99.9", "1000", "20000", "1.500e6"]
        );
        assert_eq!([12.0, 1e3, 5_310.0, 999_600.0, 2e6].map(time), ["12 us", "1.00 ms", "5.31 ms", "1.0 s", "2.0 s"]);
        assert_eq!([0.0, 999.0, 1500.0, 2.5e6, 3e9].map(scaled), ["0 ", "999 ", "1.5 k", "2.50 M", "3.00 G"]);
    }

    #[test]
    fn eighty_characters_hold_the_columns_of_highest_priority() {
        use Column::{Age, Bandwidth, Count, Jitter, Late, Lost, Name, Rate};
        assert_eq!(fitting(80), [Name, Count, Rate, Jitter, Bandwidth, Lost, Late, Age]);
        let line = line(&fitting(80), |column| column.title().to_owned());
        assert!(line.chars().count() <= 80, "{line}");
        assert_eq!(fitting(200).len(), 11);
        assert_eq!(fitting(10), []);
    }

    #[test]
    fn an_unknown_loss_is_shown_as_upper_bound() {
        let row = |lost, lost_at_most| Row { lost, lost_at_most, ..Row::default() };
        assert_eq!(Column::Lost.cell(&row(Some(3), Some(9))), "3");
        assert_eq!(Column::Lost.cell(&row(None, Some(9))), "≤9");
        assert_eq!(Column::Lost.cell(&row(None, None)), "-");
    }
}
