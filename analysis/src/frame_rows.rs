//! The messages of one channel, column by column.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use lcm_idl::{Deviations, Leaf, Path, Segment, Type};
use polars::prelude::{Column, DataFrame, IntoColumn, NamedFrom, PolarsError, Series};

use crate::frames::LOG_TIME;

/// Values of an array in one message up to which each has a column of its own.
const MAX_COLUMNS: usize = 256;

/// The messages of one channel.
#[derive(Default)]
pub(crate) struct Rows {
    log_times: Vec<i64>,
    names: Vec<String>,
    columns: Vec<Values>,
    /// Names without indices of the arrays that are lists.
    lists: BTreeSet<String>,
}

enum Values {
    Integers(Vec<Option<i64>>),
    Floats(Vec<Option<f64>>),
    Flags(Vec<Option<bool>>),
    Texts(Vec<Option<String>>),
    /// One list per row: the end of each in the elements.
    Lists(Vec<usize>, Elements),
}

/// Elements of all lists of a column.
enum Elements {
    Bytes(Vec<u8>),
    Integers(Vec<i64>),
    Floats(Vec<f64>),
    Flags(Vec<bool>),
    Texts(Vec<String>),
}

impl Rows {
    /// Appends a message; `None` if it cannot be decoded, and nothing is appended then.
    pub fn push(&mut self, log_t_ns: i64, ty: Type<'_>, message: &[u8]) -> Option<Deviations> {
        // Decode once without effect, so that an incomplete message does not append a part of a row.
        let mut leaves = 0;
        let deviations = ty.walk_lenient(message, |_, _| leaves += 1).ok()?;
        if leaves > MAX_COLUMNS {
            self.find_lists(ty, message);
        }
        let row = self.log_times.len();
        let (mut cursor, mut name, mut plain) = (0, String::new(), String::new());
        let walked = ty.walk_lenient(message, |path, leaf| {
            name.clear();
            let _ = write!(name, "{path}");
            let mut is_list = false;
            if !self.lists.is_empty() && name.contains('[') {
                without_indices(path, &mut plain);
                is_list = self.lists.contains(&plain);
            }
            let at = self.column(cursor, if is_list { &plain } else { &name }, leaf, is_list);
            self.columns[at].set(row, leaf);
            cursor = at + usize::from(!is_list);
        });
        self.log_times.push(log_t_ns);
        walked.ok().map(|_| deviations)
    }

    /// Finds the arrays that are too long for a column per value, and changes those that had columns so far.
    fn find_lists(&mut self, ty: Type<'_>, message: &[u8]) {
        let mut counts: BTreeMap<String, usize> = BTreeMap::new();
        let (mut last, mut plain, mut run) = (String::new(), String::new(), 0);
        let mut add = |name: &str, run: usize| {
            if run > 0 {
                *counts.entry(name.to_owned()).or_default() += run;
            }
        };
        let _ = ty.walk_lenient(message, |path, _| {
            without_indices(path, &mut plain);
            if plain != last {
                add(&last, run);
                last.clone_from(&plain);
                run = 0;
            }
            run += 1;
        });
        add(&last, run);
        for (name, count) in counts {
            if count > MAX_COLUMNS && self.lists.insert(name.clone()) {
                self.make_list(&name);
            }
        }
    }

    /// Replaces the columns of an array by one of lists.
    fn make_list(&mut self, name: &str) {
        let rows = self.log_times.len();
        let is_part = |column: &str| {
            let fields: String =
                column.split('[').map(|part| part.split_once(']').map_or(part, |(_, after)| after)).collect();
            column.contains('[') && fields == name
        };
        let Some(first) = self.names.iter().position(|column| is_part(column)) else { return };
        let mut parts = Vec::new();
        for at in (0..self.names.len()).rev().filter(|&at| is_part(&self.names[at])).collect::<Vec<_>>() {
            self.names.remove(at);
            parts.push(self.columns.remove(at));
        }
        parts.reverse();
        let mut list = Values::Lists(Vec::new(), Elements::like_values(&parts[0]));
        for row in 0..rows {
            for part in &parts {
                match part {
                    Values::Integers(values) => list.append(row, values.get(row).copied().flatten().map(Leaf::Int64)),
                    Values::Floats(values) => list.append(row, values.get(row).copied().flatten().map(Leaf::Double)),
                    Values::Flags(values) => list.append(row, values.get(row).copied().flatten().map(Leaf::Boolean)),
                    Values::Texts(values) => {
                        list.append(row, values.get(row).and_then(Option::as_deref).map(Leaf::String));
                    }
                    Values::Lists(..) => {}
                }
            }
        }
        self.names.insert(first, name.to_owned());
        self.columns.insert(first, list);
    }

    /// Index of a column, added if missing. Fields have the same order in most messages, so the next column is tried first.
    fn column(&mut self, cursor: usize, name: &str, leaf: Leaf<'_>, is_list: bool) -> usize {
        if self.names.get(cursor).is_some_and(|next| next == name) {
            return cursor;
        }
        // After a list.
        if self.names.get(cursor + 1).is_some_and(|next| next == name) {
            return cursor + 1;
        }
        self.names.iter().position(|known| known == name).unwrap_or_else(|| {
            let follows_list = cursor < self.names.len() && self.lists.contains(&self.names[cursor]);
            let at = (cursor + usize::from(follows_list)).min(self.names.len());
            self.names.insert(at, name.to_owned());
            let list = || Values::Lists(vec![0; self.log_times.len()], Elements::like(leaf));
            self.columns.insert(at, if is_list { list() } else { Values::like(leaf) });
            at
        })
    }

    pub fn into_frame(self) -> Result<DataFrame, PolarsError> {
        let rows = self.log_times.len();
        let mut columns = vec![Series::new(LOG_TIME.into(), self.log_times).into_column()];
        for (name, values) in self.names.into_iter().zip(self.columns) {
            columns.push(values.into_column(&name, rows));
        }
        DataFrame::new(rows, columns)
    }
}

/// Writes a path without its indices: `points.x` for `points[7].x`.
fn without_indices(path: &Path<'_>, out: &mut String) {
    out.clear();
    for segment in path.segments() {
        if let Segment::Field(name) = segment {
            if !out.is_empty() {
                out.push('.');
            }
            out.push_str(name);
        }
    }
}

impl Values {
    fn like(leaf: Leaf<'_>) -> Self {
        match leaf {
            Leaf::Float(_) | Leaf::Double(_) => Self::Floats(Vec::new()),
            Leaf::Boolean(_) => Self::Flags(Vec::new()),
            Leaf::String(_) | Leaf::Latin1(_) => Self::Texts(Vec::new()),
            _ => Self::Integers(Vec::new()),
        }
    }

    /// Sets the value of a row, or appends to its list. Rows since the last one set are null. A channel has one type, so the kinds of values are
    /// equal.
    fn set(&mut self, row: usize, leaf: Leaf<'_>) {
        match self {
            Self::Integers(values) => put(values, row, leaf.as_i64()),
            Self::Floats(values) => put(values, row, leaf.as_f64()),
            Self::Flags(values) => put(values, row, leaf.as_i64().map(|v| v != 0)),
            Self::Texts(values) => put(values, row, leaf.text().map(|text| text.into_owned())),
            Self::Lists(..) => self.append(row, Some(leaf)),
        }
    }

    /// Appends a value to the list of a row.
    fn append(&mut self, row: usize, leaf: Option<Leaf<'_>>) {
        let Self::Lists(ends, elements) = self else { return };
        while ends.len() <= row {
            ends.push(elements.len());
        }
        if let Some(leaf) = leaf {
            elements.push(leaf);
            ends[row] = elements.len();
        }
    }

    fn into_column(self, name: &str, rows: usize) -> Column {
        match self {
            Self::Integers(values) => Series::new(name.into(), filled(values, rows)).into_column(),
            Self::Floats(values) => Series::new(name.into(), filled(values, rows)).into_column(),
            Self::Flags(values) => Series::new(name.into(), filled(values, rows)).into_column(),
            Self::Texts(values) => Series::new(name.into(), filled(values, rows)).into_column(),
            Self::Lists(mut ends, elements) => {
                ends.resize(rows, elements.len());
                let begins = std::iter::once(0).chain(ends.iter().copied());
                let lists: Vec<Series> = begins.zip(&ends).map(|(begin, &end)| elements.series(begin, end)).collect();
                Series::new(name.into(), lists).into_column()
            }
        }
    }
}

impl Elements {
    fn like(leaf: Leaf<'_>) -> Self {
        match leaf {
            Leaf::Byte(_) => Self::Bytes(Vec::new()),
            Leaf::Float(_) | Leaf::Double(_) => Self::Floats(Vec::new()),
            Leaf::Boolean(_) => Self::Flags(Vec::new()),
            Leaf::String(_) | Leaf::Latin1(_) => Self::Texts(Vec::new()),
            _ => Self::Integers(Vec::new()),
        }
    }

    fn like_values(values: &Values) -> Self {
        match values {
            Values::Floats(_) => Self::Floats(Vec::new()),
            Values::Flags(_) => Self::Flags(Vec::new()),
            Values::Texts(_) => Self::Texts(Vec::new()),
            _ => Self::Integers(Vec::new()),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Bytes(values) => values.len(),
            Self::Integers(values) => values.len(),
            Self::Floats(values) => values.len(),
            Self::Flags(values) => values.len(),
            Self::Texts(values) => values.len(),
        }
    }

    fn push(&mut self, leaf: Leaf<'_>) {
        match self {
            Self::Bytes(values) => values.push(if let Leaf::Byte(byte) = leaf { byte } else { 0 }),
            Self::Integers(values) => values.push(leaf.as_i64().unwrap_or(0)),
            Self::Floats(values) => values.push(leaf.as_f64().unwrap_or(f64::NAN)),
            Self::Flags(values) => values.push(leaf.as_i64().is_some_and(|v| v != 0)),
            Self::Texts(values) => values.push(leaf.text().unwrap_or_default().into_owned()),
        }
    }

    fn series(&self, begin: usize, end: usize) -> Series {
        match self {
            Self::Bytes(values) => {
                let integers: Vec<i64> = values[begin..end].iter().map(|&byte| i64::from(byte)).collect();
                Series::new("".into(), integers)
            }
            Self::Integers(values) => Series::new("".into(), &values[begin..end]),
            Self::Floats(values) => Series::new("".into(), &values[begin..end]),
            Self::Flags(values) => Series::new("".into(), &values[begin..end]),
            Self::Texts(values) => Series::new("".into(), &values[begin..end]),
        }
    }
}

fn put<T>(values: &mut Vec<Option<T>>, row: usize, value: Option<T>) {
    values.resize_with(row, || None);
    values.push(value);
}

fn filled<T>(mut values: Vec<Option<T>>, rows: usize) -> Vec<Option<T>> {
    values.resize_with(rows, || None);
    values
}
