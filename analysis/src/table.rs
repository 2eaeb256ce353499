//! A table of numbers, and its renderings: text, CSV, LaTeX, JSON.

use std::fmt::Write as _;

use serde::Serialize;

/// Rows of numbers under headings.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Table {
    /// What the table shows, one sentence.
    pub caption: String,
    /// Headings of the columns, the first that of the rows' names.
    pub head: Vec<String>,
    /// Rows.
    pub rows: Vec<Row>,
}

/// A row of a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Name of the row.
    pub name: String,
    /// Unit of its values, empty if there is none.
    pub unit: String,
    /// Values, `null` where there is none.
    pub values: Vec<Option<f64>>,
    /// Decimals printed for people.
    #[serde(skip)]
    pub decimals: usize,
}

impl Table {
    /// For a terminal, columns aligned, ending in a newline.
    pub fn text(&self) -> String {
        let names: Vec<String> = self.rows.iter().map(Row::label).collect();
        let first = names.iter().chain(self.head.first()).map(|name| name.chars().count()).max().unwrap_or(0);
        let cells: Vec<Vec<String>> = self.rows.iter().map(|row| row.printed("-")).collect();
        let width = |k: usize| {
            let of_cells = cells.iter().filter_map(|row| row.get(k)).map(|cell| cell.chars().count()).max();
            of_cells.unwrap_or(0).max(self.head.get(k + 1).map_or(0, |h| h.chars().count()))
        };
        let mut out = format!("{:<first$}", self.head.first().map_or("", String::as_str));
        for (k, heading) in self.head.iter().skip(1).enumerate() {
            let _ = write!(out, "  {heading:>0$}", width(k));
        }
        out.push('\n');
        for (name, row) in names.iter().zip(&cells) {
            let _ = write!(out, "{name:<first$}");
            for (k, cell) in row.iter().enumerate() {
                let _ = write!(out, "  {cell:>0$}", width(k));
            }
            out.push('\n');
        }
        out
    }

    /// With a header; every digit of the numbers, absent ones empty.
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

    /// A `tabular` with the rules of the package booktabs; the caption and `origin` stand above it as comments.
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
    /// A row with its unit and the decimals that people are shown.
    pub fn new(name: impl Into<String>, unit: &str, decimals: usize, values: Vec<Option<f64>>) -> Self {
        Self { name: name.into(), unit: unit.to_owned(), values, decimals }
    }

    /// Name with unit.
    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} [{}]", self.name, self.unit) }
    }

    /// Values for people; `absent` where there is none.
    pub fn printed(&self, absent: &str) -> Vec<String> {
        self.values.iter().map(|value| value.map_or(absent.to_owned(), |v| fixed(v, self.decimals))).collect()
    }
}

/// A number with so many decimals; what rounds to zero has no sign.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let zero = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
    if zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Words for LaTeX: its special characters escaped, signs outside ASCII by their commands.
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

    fn table() -> Table {
        Table {
            caption: "Two rows".to_owned(),
            head: ["", "mean |e|", "a_b, %"].map(str::to_owned).to_vec(),
            rows: vec![
                Row::new("roll", "rad", 4, vec![Some(-0.000_01), None]),
                Row::new("tick", "µs", 1, vec![Some(-1.25), Some(3.0)]),
            ],
        }
    }

    #[test]
    fn zero_has_no_sign() {
        assert_eq!([-0.00004, -0.00006, 0.1].map(|v| fixed(v, 4)), ["0.0000", "-0.0001", "0.1000"]);
    }

    #[test]
    fn one_table_in_four_forms() {
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
