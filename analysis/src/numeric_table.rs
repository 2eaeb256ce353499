//! A table of numbers as text, CSV, LaTeX and JSON.

use std::fmt::Write as _;

use serde::Serialize;

use crate::table::{Column, Table};

/// Named rows of numbers under headings.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NumericTable {
    /// What the table shows, one sentence.
    pub caption: String,
    /// Headings of the columns. The first belongs to the names of the rows.
    pub head: Vec<String>,
    /// Rows.
    pub rows: Vec<Row>,
}

/// A row of a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Name of the row.
    pub name: String,
    /// Unit of the values; empty for dimensionless values.
    pub unit: String,
    /// Values; `null` if missing.
    pub values: Vec<Option<f64>>,
    /// Number of decimals of each value in text and LaTeX. CSV and JSON contain all digits.
    #[serde(skip)]
    pub decimals: Vec<usize>,
}

impl NumericTable {
    /// Aligned columns for a terminal, ending in a newline.
    pub fn text(&self) -> String {
        let column =
            |(k, heading): (usize, &String)| if k == 0 { Column::left(heading) } else { Column::right(heading) };
        let mut table = Table::new(self.head.iter().enumerate().map(column));
        for row in &self.rows {
            table.row(std::iter::once(row.label()).chain(row.printed("-")));
        }
        format!("{table}\n")
    }

    /// CSV with a header line. Numbers have all their digits; missing values are empty.
    pub fn csv(&self) -> String {
        let quoted = |text: &str| {
            if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
        };
        let head: Vec<String> = self.head.iter().skip(1).map(|heading| quoted(heading)).collect();
        let mut out = format!("quantity,unit,{}\n", head.join(","));
        for row in &self.rows {
            let values = row.values.iter().map(|value| value.map_or(String::new(), |v| format!("{v}")));
            let _ =
                writeln!(out, "{},{},{}", quoted(&row.name), quoted(&row.unit), values.collect::<Vec<_>>().join(","));
        }
        out
    }

    /// A LaTeX `tabular` with the rules of the package booktabs. The caption and `origin` precede it as comments.
    pub fn latex(&self, origin: &str) -> String {
        let columns = "r".repeat(self.head.len().saturating_sub(1));
        let comment = |text: &str| text.replace('\n', " ");
        let mut out = format!(
            "% {}\n% {}\n\\begin{{tabular}}{{l{columns}}}\n\\toprule\n",
            comment(&self.caption),
            comment(origin)
        );
        let head: Vec<String> = self.head.iter().map(|heading| latex_text(heading)).collect();
        let _ = writeln!(out, "{} \\\\\n\\midrule", head.join(" & "));
        for row in &self.rows {
            let cells: Vec<String> =
                row.printed("--").into_iter().map(|c| if c == "--" { c } else { format!("${c}$") }).collect();
            let _ = writeln!(out, "{} & {} \\\\", latex_text(&row.label()), cells.join(" & "));
        }
        out.push_str("\\bottomrule\n\\end{tabular}\n");
        out
    }

    /// Indented JSON, ending in a newline.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a structure of numbers, texts and lists is always JSON") + "\n"
    }
}

impl Row {
    /// A row whose values all have the same number of decimals.
    pub fn new(name: impl Into<String>, unit: &str, decimals: usize, values: Vec<Option<f64>>) -> Self {
        Self { name: name.into(), unit: unit.to_owned(), decimals: vec![decimals; values.len()], values }
    }

    /// Name and unit, as in `roll [rad]`.
    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} [{}]", self.name, self.unit) }
    }

    /// Values as text; `absent` for missing values.
    pub fn printed(&self, absent: &str) -> Vec<String> {
        let each = self.values.iter().zip(&self.decimals);
        each.map(|(value, &decimals)| value.map_or(absent.to_owned(), |v| fixed(v, decimals))).collect()
    }
}

/// A number with a fixed number of decimals; a value that rounds to zero has no sign.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let zero = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
    if zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Text for LaTeX: special characters escaped, characters outside ASCII as commands.
fn latex_text(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '%' | '&' | '#' | '_' | '$' | '{' | '}' => out.extend(['\\', c]),
            '\\' => out.push_str("\\textbackslash{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            '~' => out.push_str("\\textasciitilde{}"),
            '|' => out.push_str("$|$"),
            'µ' => out.push_str("\\textmu{}"),
            '²' => out.push_str("$^2$"),
            '±' => out.push_str("$\\pm$"),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> NumericTable {
        NumericTable {
            caption: "Two rows".to_owned(),
            head: ["", "mean |e|", "a_b, %"].map(str::to_owned).to_vec(),
            rows: vec![
                Row::new("roll", "rad", 4, vec![Some(-0.000_01), None]),
                Row::new("tick", "µs", 1, vec![Some(-1.25), Some(3.0)]),
            ],
        }
    }

    #[test]
    fn a_value_that_rounds_to_zero_has_no_sign() {
        assert_eq!([-0.00004, -0.00006, 0.1].map(|v| fixed(v, 4)), ["0.0000", "-0.0001", "0.1000"]);
    }

    #[test]
    fn the_four_renderings_agree() {
        let table = table();
        assert_eq!(
            table.text(),
            "            mean |e|  a_b, %\nroll [rad]    0.0000       -\ntick [µs]       -1.2     3.0\n"
        );
        assert_eq!(table.csv(), "quantity,unit,mean |e|,\"a_b, %\"\nroll,rad,-0.00001,\ntick,µs,-1.25,3\n");
        let latex = table.latex("log run.mcap");
        let rows = "roll [rad] & $0.0000$ & -- \\\\\ntick [\\textmu{}s] & $-1.2$ & $3.0$ \\\\\n";
        assert!(latex.contains(rows) && latex.contains(" & mean $|$e$|$ & a\\_b, \\% \\\\\n\\midrule"), "{latex}");
        assert!(latex.starts_with("% Two rows\n% log run.mcap\n\\begin{tabular}{lrr}\n\\toprule\n"));
        let json: serde_json::Value = serde_json::from_str(&table.json()).unwrap();
        assert_eq!(json["rows"][0]["values"], serde_json::json!([-0.000_01, null]));
    }
}
